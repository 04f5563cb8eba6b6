"""Selection of the features of a map to inspect: by layer, name or box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from netsp.base.errors import InputError
from netsp.base.validated import shown

if TYPE_CHECKING:
    import shapely

Box = tuple[float, float, float, float]

WORDS = ("layer", "name", "box", "earth")
"""Words of a rule: ``box`` is in the problem's plane, ``earth`` in degrees."""


@dataclass(frozen=True)
class Selection:
    """Selection of obstacles; a feature that fits one rule of each kind is selected.

    Attributes
    ----------
    layers
        Names of layers, in lower case, with the wildcards ``*`` and ``?``.
    names
        Names of features, likewise.
    boxes
        ``(xmin, ymin, xmax, ymax)`` in the problem's plane; a feature within or across fits.
    earth_boxes
        ``(south, west, north, east)`` in degrees.

    Examples
    --------
    >>> chosen = Selection.parse([("layer", "SLCONS"), ("name", "Pier *")])
    >>> chosen.matches("slcons", "Pier 3"), chosen.matches("slcons", None)
    (True, False)
    """

    layers: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    boxes: tuple[Box, ...] = ()
    earth_boxes: tuple[Box, ...] = field(default=())

    @classmethod
    def parse(cls, rules: Sequence[tuple[str, str]]) -> Selection:
        """Return the selection of rules such as ``("layer", "SLCONS")``, ``("box", "0,0,50,20")``.

        Raises
        ------
        InputError
            A word is unknown, or a box is wrong.
        """
        for word, _ in rules:
            if word not in WORDS:
                raise InputError(
                    f"--of: expected one of {', '.join(WORDS)} before the =, got {shown(word)}"
                )

        def values(word: str) -> list[str]:
            return [value for rule, value in rules if rule == word]

        return cls(
            tuple(v.lower() for v in values("layer")),
            tuple(v.lower() for v in values("name")),
            tuple(_box("box", v, "XMIN,YMIN,XMAX,YMAX") for v in values("box")),
            tuple(_box("earth", v, "SOUTH,WEST,NORTH,EAST") for v in values("earth")),
        )

    def matches(self, layer: str, name: str | None) -> bool:
        """Return whether layer and name of a feature fit."""
        return (not self.layers or _fits(layer, self.layers)) and (
            not self.names or (name is not None and _fits(name, self.names))
        )

    def is_in_boxes(self, shape: shapely.Geometry, areas: Sequence[shapely.Geometry]) -> bool:
        """Return whether a shape lies in or across one of the boxes; True without boxes.

        Parameters
        ----------
        areas : sequence of shapely.Geometry
            All boxes, in the plane of the shape.
        """
        return not areas or any(shape.intersects(area) for area in areas)


def _fits(text: str, patterns: Sequence[str]) -> bool:
    name = text.lower()
    return any(name == pattern or fnmatchcase(name, pattern) for pattern in patterns)


def _box(word: str, text: str, expected: str) -> Box:
    try:
        low_x, low_y, high_x, high_y = (float(v) for v in text.split(","))
    except ValueError:
        raise InputError(f"--of {word}: expected {expected}, got {shown(text)}") from None
    if not (low_x < high_x and low_y < high_y):
        raise InputError(
            f"--of {word}: expected {expected} with the smaller values first, got {shown(text)}"
        )
    return low_x, low_y, high_x, high_y
