"""Words for whoever looks at a ground station, in MAVLink's STATUSTEXT.

Chunks of 50 bytes, numbered from 0, under an id that they share; one that is shorter is the last. A
text of one chunk has the id 0 and is shown at once (MAVLink 2, common message 253).
"""

from __future__ import annotations

import unicodedata
from typing import Any

from netsp.online.link.dialect import dialect

CHUNK = 50
"""Bytes of a chunk."""

MOST = 250
"""Bytes of a text: longer ones are cut."""


def status_texts(severity: int, text: str, number: int) -> list[Any]:
    """A text as messages.

    Parameters
    ----------
    severity : int
        MAV_SEVERITY.
    text : str
        What to say.
    number : int
        Of the text among those sent: what two in a row share is not put together.

    Returns
    -------
    list of messages
        One or more, in their order.
    """
    data = ascii_of(text)[:MOST]
    parts = [data[k : k + CHUNK] for k in range(0, max(len(data), 1), CHUNK)]
    if len(parts) > 1 and len(parts[-1]) == CHUNK:
        parts.append(b"")  # or else the end is not known
    together = 1 + number % 0xFFFF if len(parts) > 1 else 0
    message = dialect().MAVLink_statustext_message
    return [message(severity, part, id=together, chunk_seq=k) for k, part in enumerate(parts)]


def ascii_of(text: str) -> bytes:
    """A text in the characters that ground stations show: letters without their accents.

    Parameters
    ----------
    text : str
        Any.

    Returns
    -------
    bytes
        ASCII; a question mark for what has no such letter.
    """
    plain = unicodedata.normalize("NFKD", text.replace("−", "-"))
    letters = "".join(c for c in plain if not unicodedata.combining(c))
    return letters.encode("ascii", "replace")
