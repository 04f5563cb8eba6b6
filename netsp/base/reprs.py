"""Representations of netsp's objects in notebooks: a line of text, and a picture below it.

The pictures live in an upper room (`netsp.view.pictures`). A class names the function that draws
it, which is imported at the first call: models and graphs do not import Matplotlib.
"""

from __future__ import annotations

import html
from typing import Any, ClassVar

from netsp.base.registry import load


class Drawn:
    """Base of classes with a picture; `picture` is the ``module:function`` that draws it on
    axes."""

    picture: ClassVar[str]

    def plot(self, ax: Any = None, **more: Any) -> Any:
        """Draw the object with Matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; by default, axes of a new figure.
        **more : Any
            Options of the picture. A solution takes its `problem`, to draw the map under the tour.

        Returns
        -------
        matplotlib.axes.Axes
            The axes; their `figure` can be saved.

        Examples
        --------
        >>> from netsp import Problem, solve
        >>> problem = Problem(base=(0, 0), goals=[(3, 4)], tether_length=6)
        >>> solve(problem).plot(problem=problem).figure.savefig("tour.png")  # doctest: +SKIP
        """
        return load(self.picture)(self, ax=ax, **more)

    def _repr_html_(self) -> str:
        picture = load("netsp.view.pictures.style:svg")(self.plot().figure, bbox_inches="tight")
        return f"<p><code>{html.escape(repr(self))}</code></p>{picture}"
