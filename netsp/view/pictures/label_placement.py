"""Placement of labels beside markers, without overlaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from netsp.base.arrays import Floats
from netsp.view.pictures.picture_layout import LabelLayout

Alignment = Literal["left", "center", "right"]
"""Horizontal alignment of a text."""

ALIGNMENTS: dict[int, Alignment] = {1: "left", 0: "center", -1: "right"}
"""End of the label that faces the marker, by direction."""


@dataclass(frozen=True)
class LabelPlace:
    """Place of a label beside a marker.

    Attributes
    ----------
    offset
        Offset from the middle of the marker to the end or middle of the label, points.
    align
        Part of the label that lies at the offset.
    """

    offset: tuple[float, float]
    align: Alignment


def place_labels(
    places: Floats,
    texts: Sequence[str],
    *,
    marker_radius: float,
    taken: Floats | None = None,
    layout: LabelLayout = LabelLayout(),
) -> list[LabelPlace | None]:
    """Return the place of each label; None if it would cover a marker or another label.

    Labels are placed one after the other beside their markers, on the first side that is free.

    Parameters
    ----------
    places : ndarray, shape (n, 2)
        Middles of the markers, in points on the paper.
    texts : sequence of str
        One line for each marker; an empty one needs no place.
    marker_radius : float
        Radius of the markers, points.
    taken : ndarray, shape (k, 2), optional
        Middles of other markers of this radius.
    layout : LabelLayout
        Font size, and distances from the markers.

    Returns
    -------
    list of LabelPlace or None
        One for each marker.

    Examples
    --------
    >>> place_labels(np.array([[0.0, 0.0]]), ["A"], marker_radius=5.0)
    [LabelPlace(offset=(8.0, -7.8), align='left')]
    >>> place_labels(np.zeros((1, 2)), [""], marker_radius=5.0)
    [None]
    """
    others = np.empty((0, 2)) if taken is None else taken
    markers = np.vstack([places, others])
    boxes = [  # lowest x, lowest y, highest x, highest y
        np.hstack([markers - marker_radius, markers + marker_radius])
    ]
    out: list[LabelPlace | None] = []
    for place, text in zip(places, texts, strict=True):
        size = np.array([layout.letter_width * len(text), layout.line_height])
        half = 0.5 * layout.font_size * size
        chosen = None
        for side in layout.sides if text else ():
            above = layout.rise if side[0] else marker_radius + half[1]
            offset = (layout.gap * side[0], float(above * side[1]))
            middle = place + offset + (half[0] * side[0], 0.0)
            box = np.concatenate([middle - half, middle + half])
            filled = np.vstack(boxes)
            covers = (filled[:, :2] < box[2:]).all(axis=1) & (filled[:, 2:] > box[:2]).all(axis=1)
            if not covers.any():
                boxes.append(box[None, :])
                chosen = LabelPlace(offset, ALIGNMENTS[side[0]])
                break
        out.append(chosen)
    return out
