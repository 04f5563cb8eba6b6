"""Texts for ground stations, in MAVLink's STATUSTEXT.

Chunks of 50 bytes are numbered from 0 under an id that they share; a shorter one is the last. A
text
of one chunk has the id 0 and is shown at once (MAVLink 2, common message 253).
"""

from __future__ import annotations

import unicodedata
from typing import Any

from netsp.online.link.dialect import dialect
from netsp.online.link.link_policy import LinkPolicy

CHUNK_BYTES = 50
"""Format of STATUSTEXT: length of a chunk, bytes."""


def status_texts(
    severity: int, text: str, number: int, max_bytes: int = LinkPolicy.max_text_bytes
) -> list[Any]:
    """Return a text as messages, in order.

    Parameters
    ----------
    severity : int
        MAV_SEVERITY.
    text : str
        The text.
    number : int
        Number of the text among those sent: stations join the chunks of texts with the same id.
    max_bytes : int
        Longest text, bytes; longer ones are cut.
    """
    data = to_ascii(text)[:max_bytes]
    parts = [data[k : k + CHUNK_BYTES] for k in range(0, max(len(data), 1), CHUNK_BYTES)]
    if len(parts) > 1 and len(parts[-1]) == CHUNK_BYTES:
        parts.append(b"")  # marks the end
    shared_id = 1 + number % 0xFFFF if len(parts) > 1 else 0
    message = dialect().MAVLink_statustext_message
    return [message(severity, part, id=shared_id, chunk_seq=k) for k, part in enumerate(parts)]


def to_ascii(text: str) -> bytes:
    """Return a text in ASCII, which ground stations show: letters without accents.

    Other characters become question marks.
    """
    plain = unicodedata.normalize("NFKD", text.replace("−", "-"))
    letters = "".join(c for c in plain if not unicodedata.combining(c))
    return letters.encode("ascii", "replace")
