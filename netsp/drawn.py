"""What a notebook shows of our objects: the short text, and the picture below it.

The pictures live in an upper layer (`netsp.pictures`); what has one names it, and it is loaded when
it is asked for, so models and graphs stay free of Matplotlib.
"""

from __future__ import annotations

import html
import io
from typing import Any, ClassVar

from netsp.registry import load


class Drawn:
    """Something with a picture: `picture` names the function that draws it on an axes."""

    picture: ClassVar[str]

    def plot(self, ax: Any = None, **more: Any) -> Any:
        """Draw on axes (Matplotlib's) of the caller, or on new ones; returns the axes.

        Parameters
        ----------
        more
            Further options of the picture; for a solution its `problem`, drawn underneath.
        """
        return load(self.picture)(self, ax=ax, **more)

    def _repr_html_(self) -> str:
        out = io.StringIO()
        figure = load("netsp.pictures.style:literal")(self.plot().figure)
        figure.savefig(out, format="svg", metadata={"Date": None}, bbox_inches="tight")
        text = out.getvalue()
        return f"<p><code>{html.escape(repr(self))}</code></p>{text[text.index('<svg') :]}"
