"""What a notebook shows of our objects: the short text, and the picture below it.

The pictures live in the top layer (`netsp.pictures`) and are imported when one is asked for, so the
models that carry this stay free of Matplotlib.
"""

from __future__ import annotations

import html
import io
from typing import Any


class Drawn:
    """Something with a picture."""

    def plot(self, ax: Any = None) -> Any:
        """Draw on axes (Matplotlib's) of the caller, or on new ones; returns the axes."""
        raise NotImplementedError

    def _repr_html_(self) -> str:
        from netsp.pictures.style import literal

        out = io.StringIO()
        figure = literal(self.plot().figure)
        figure.savefig(out, format="svg", metadata={"Date": None}, bbox_inches="tight")
        text = out.getvalue()
        return f"<p><code>{html.escape(repr(self))}</code></p>{text[text.index('<svg') :]}"
