"""Measures of entanglement of any path in any scene: its word, and its winding numbers.

Winding numbers are the word's class in the abelianisation of the scene's group. For rings and
closed bars they are linking numbers: how often a loop goes through each of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from netsp.base.errors import InputError
from netsp.base.geometry import polylines
from netsp.base.number_ranges import check_positive
from netsp.hsignature import Word
from netsp.plan.space.mission_policy import WordPolicy
from netsp.plan.space.space_signature import SpaceSignature
from netsp.world.scene.scene import Scene
from netsp.world.scene.surfaces import extent


@dataclass(frozen=True)
class MeasurePolicy:
    """Grid on which paths are measured.

    Attributes
    ----------
    cell
        Size of a cell, metres, unless there would be too many cells. Gaps narrower than a cell may
        count as closed.
    margin_cells
        Cells around the scene and the path, so that paths can be closed around everything.
    words
        Size and accuracy of the cell complex.
    """

    cell: float = 0.2
    margin_cells: float = 5.0
    words: WordPolicy = field(default_factory=WordPolicy)

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class SpaceMeasures:
    """Measures of a path in a scene.

    Attributes
    ----------
    length
        Length, metres.
    closed
        Whether the path was measured as a loop; if not, each end counts as joined to the beginning
        of the path by the shortest path.
    signature
        Word; empty if the path can be pulled straight without passing through anything.
    windings
        How often the path winds around each hole, with signs.
    exact
        Whether words that differ are always of different classes.
    cell
        Size of a cell, metres; narrower gaps may count as closed.
    """

    length: float
    closed: bool
    signature: Word
    windings: tuple[int, ...]
    exact: bool
    cell: float


def measure_path(
    scene: Scene,
    path: npt.ArrayLike,
    *,
    closed: bool | None = None,
    cell: float | None = None,
    policy: MeasurePolicy | None = None,
) -> SpaceMeasures:
    """Measure a path (k, 3), metres, in a scene.

    Parameters
    ----------
    closed : bool, optional
        Whether the end is joined to the beginning; by default if they are one point.
    cell : float, optional
        Size of a cell, metres; by default that of the policy, or more in a large scene.
    policy : MeasurePolicy, optional
        Grid on which the path is measured.

    Raises
    ------
    InputError
        Fewer than two points; a path that runs through a solid or a gap narrower than a cell, says
        where; too many cells.

    Examples
    --------
    >>> ring = {"center": [0, 0, 0], "axis": [0, 0, 1], "major_radius": 2, "minor_radius": 0.1}
    >>> loop = [[0, 0, 2], [0, 0, -2], [4, 0, -2], [4, 0, 2], [0, 0, 2]]
    >>> abs(measure_path(Scene(solids=[{"torus": ring}]), loop).windings[0])
    1
    """
    policy = policy or MeasurePolicy()
    line = np.asarray(path, dtype=float).reshape(-1, 3)
    if len(line) < 2:
        raise InputError(f"path: expected two points or more, got {len(line)}")
    if closed is None:
        closed = bool(np.linalg.norm(line[0] - line[-1]) < 1e-9)
    low, high = extent(scene, line)
    if cell is None:
        volume = np.prod(high - low + 2.0 * policy.margin_cells * policy.cell)
        cell = max(policy.cell, 1.05 * float(volume / policy.words.max_cells) ** (1.0 / 3.0))
    low, high = low - policy.margin_cells * cell, high + policy.margin_cells * cell
    words = SpaceSignature.in_box(scene.field(), low, high, cell, line[0], policy=policy.words)
    word = words.word(line, closed=closed)
    length = float(polylines.length(line))
    if closed:
        length += float(np.linalg.norm(line[0] - line[-1]))
    return SpaceMeasures(length, closed, word, words.windings(word), words.exact, cell)
