"""Words of paths in any scene: the second kind of `netsp.hsignature.signature_protocol.Signature`.

The words are the labels of a complex (`netsp.plan.space.triangle_labels`), after relations have
eliminated as many generators as possible. The word of a path that keeps off solids by the tolerance
is exact: it is the word of every path that the path can be deformed into.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.bounded_work import abandoned, end_if_abandoned
from netsp.base.deprecated import deprecated_method
from netsp.base.errors import InputError
from netsp.hsignature.groups import Group, eliminated
from netsp.hsignature.words import Word, invert
from netsp.hsignature.wordtable import Rules, Table, empty_table, number_of, packed, times, word_of
from netsp.plan.space.cells import Cells
from netsp.plan.space.mission_policy import WordPolicy
from netsp.plan.space.triangle_labels import (
    FAR,
    UNKNOWN,
    Labels,
    cell_distances,
    label_edges,
    square_relations,
)
from netsp.plan.space.walk import LabelledComplex, path_word
from netsp.plan.space.walk import visible_cell as find_visible_cell
from netsp.world.scene.field import DistanceField


@dataclass(frozen=True)
class SpaceSignature:
    """Words of paths in a scene, up to homotopy.

    Attributes
    ----------
    cells
        Complex of the free water.
    root
        (3,) cell where the labels begin.
    group
        Group of the loops at the root.
    labels
        (3 n,) number of the word of every edge in the table.
    far
        (n,) distance of each cell from the root, hundredths of a cell; `FAR` for cells cut off.
    generators
        Number of generators before relations eliminated any.
    tolerance
        Depth to which paths may enter solids, metres.
    policy
        Size and accuracy of the complex.
    """

    cells: Cells
    root: Ints
    group: Group
    labels: Labels = field(repr=False)
    far: npt.NDArray[np.int32] = field(repr=False)
    generators: int
    tolerance: float
    policy: WordPolicy
    _tables: list[Table] = field(repr=False)

    @classmethod
    def in_box(
        cls,
        scene: DistanceField,
        low: npt.ArrayLike,
        high: npt.ArrayLike,
        cell: float,
        root: npt.ArrayLike,
        *,
        tolerance: float = 0.015,
        policy: WordPolicy | None = None,
    ) -> SpaceSignature:
        """Return the words of a box in a scene.

        Parameters
        ----------
        low, high : array_like, shape (3,)
            Corners of the box, metres.
        cell : float
            Size of a cell, metres. Gaps narrower than a cell may count as closed.
        root : array_like, shape (3,)
            Point in the water, such as the anchor; water that it is not connected to has no words.
        tolerance : float
            Depth to which paths may enter solids, metres, as taut tethers do between their nodes
            (by delta / 8, so the default suits a delta of 0.1); also the size of the smallest parts
            that are checked. A path that touches a bar thinner than four times that may pass
            through it.

        Raises
        ------
        InputError
            A box without size, too many cells, a root that is not in the water, or a scene with
            thousands of holes.

        Examples
        --------
        >>> from netsp.world import Scene
        >>> ring = {"center": [0, 0, 0], "axis": [0, 0, 1], "major_radius": 2, "minor_radius": 0.1}
        >>> field = Scene(solids=[{"torus": ring}]).field()
        >>> water = SpaceSignature.in_box(field, [-4] * 3, [4] * 3, 0.25, [3, 0, 3])
        >>> through = water.word([[0, 0, 3], [0, 0, -3]])
        >>> beside = water.word([[0, 0, -3], [3.5, 0, -3], [3.5, 0, 3], [0, 0, 3]])
        >>> water.group.rank, len(water.product(through, beside))
        (1, 1)
        """
        cells = Cells.in_box(scene, low, high, cell, policy)
        return cls.from_cells(cells, root, tolerance=tolerance, policy=policy)

    @classmethod
    def from_cells(
        cls,
        cells: Cells,
        root: npt.ArrayLike,
        *,
        tolerance: float = 0.015,
        policy: WordPolicy | None = None,
    ) -> SpaceSignature:
        """Return the words of a complex; `root` and `tolerance` as for `in_box`.

        Raises
        ------
        InputError
            A root that is not in the water, or a scene with thousands of holes.
        """
        policy = policy or WordPolicy()
        point = np.asarray(root, dtype=float)
        no_labels = np.empty(0, dtype=np.int32)
        everywhere = np.ones(cells.flags.shape, dtype=np.uint8)
        root_cell = find_visible_cell(
            _labelled_complex(cells, no_labels, everywhere, tolerance, policy), point
        )
        if root_cell < 0:
            raise InputError(
                f"anchor: no free cell of {cells.cell:g} m is in sight of {shown(point)}; "
                "expected a point in the water, or a smaller cell"
            )
        begin = np.array(np.unravel_index(root_cell, cells.flags.shape), dtype=np.int64)
        stop = abandoned()
        far, order = cell_distances(cells.flags, begin, stop)
        no_rules = packed([])
        labels, table, generators = label_edges(
            cells.flags, far, order, empty_table(), no_rules, policy.max_generators, stop
        )
        end_if_abandoned()
        if generators > policy.max_generators:
            raise InputError(
                f"cell: {cells.cell:g} m finds more than {policy.max_generators} holes in the "
                "scene; expected a larger cell"
            )
        words, table = square_relations(cells.flags, labels, order, table, no_rules, stop)
        end_if_abandoned()
        meaning, rank, relators = eliminated(
            generators, [word_of(table, int(number)) for number in words]
        )
        group = Group.presented(rank, relators)
        labels, table = _renumbered(labels, table, meaning, packed(group.rules))
        return cls(cells, begin, group, labels, far, generators, tolerance, policy, [table])

    of = deprecated_method("of", "in_box")
    of_cells = deprecated_method("of_cells", "from_cells")
    held = deprecated_method("held", "visible_cell")
    word_until = deprecated_method("word_until", "try_word")
    number = deprecated_method("number", "word_number")
    times = deprecated_method("times", "multiply")
    keep = deprecated_method("keep", "keep_table")
    known = deprecated_method("known", "reached_cells")

    @property
    def exact(self) -> bool:
        """Return whether words that differ are always of different classes of the complex."""
        return self.group.exact

    @cached_property
    def rules(self) -> Rules:
        """Return the rules of the group, for kernels."""
        return packed(self.group.rules)

    @cached_property
    def _complex(self) -> LabelledComplex:
        """Return the labelled complex for kernels."""
        return _labelled_complex(
            self.cells, self.labels, self.reached_cells, self.tolerance, self.policy
        )

    @property
    def table(self) -> Table:
        """Return the table of the words met so far."""
        return self._tables[0]

    def keep_table(self, table: Table) -> None:
        """Replace the table by one that has grown: it has all words under the same numbers, and
        more."""
        self._tables[0] = table

    @cached_property
    def reached_cells(self) -> npt.NDArray[np.uint8]:
        """Return the mask (nx, ny, nz) of the cells that paths from the root reach."""
        return np.asarray((self.far < FAR).reshape(self.cells.flags.shape), dtype=np.uint8)

    def visible_cell(self, point: npt.ArrayLike) -> int | None:
        """Return the number of the cell that a point holds on to; None if it sees no cell."""
        at = find_visible_cell(self._complex, np.asarray(point, dtype=float))
        return None if at < 0 else int(at)

    def word(self, path: npt.ArrayLike, *, closed: bool = False) -> Word:
        """Return the word of a path. Each end counts as joined to the root by the shortest path
        from the cell that it holds on to.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            Polyline, metres.
        closed : bool
            Whether the last point is joined to the first.

        Returns
        -------
        Word
            Empty for a contractible loop; in a group that is not `exact`, some contractible loops
            have other words.

        Raises
        ------
        InputError
            The path runs through a solid, out of the box, or through a gap that the cells do not
            show; says where.
        """
        word, broken = self.try_word(path, closed=closed)
        if broken is not None:
            raise InputError(
                f"path: no word at {shown(broken)}: a solid, the bounds, or a gap narrower than "
                f"the cell of {self.cells.cell:g} m"
            )
        return word

    def try_word(self, path: npt.ArrayLike, *, closed: bool = False) -> tuple[Word, Floats | None]:
        """Return the word of a path as `word` does, but no error if it has none.

        Returns
        -------
        word : Word
            Empty if the path has no word.
        broken : ndarray of shape (3,) or None
            The point up to which the word is known, if it has none.
        """
        line = np.asarray(path, dtype=float).reshape(-1, 3)
        if closed:
            line = np.vstack([line, line[:1]])
        number, where = self.word_number(line)
        if number is None:
            return (), where
        return word_of(self.table, number), None

    def word_number(self, line: Floats) -> tuple[int | None, Floats]:
        """Return the number of the word of a polyline (k, 3) in the table, None if it has none, and
        the last point (3,) that was reached."""
        number, table, where = path_word(
            self._complex, self.table, self.rules, np.ascontiguousarray(line)
        )
        self.keep_table(table)
        return (None if number < 0 else int(number)), where

    def product(self, *words: Word) -> Word:
        """Return the word of paths one after the other, in its normal form."""
        return self.group.normal(x for word in words for x in word)

    def letters(self, number: int) -> Word:
        """Return the word of a number in the table."""
        return word_of(self.table, number)

    def multiply(self, a: int, b: int) -> int:
        """Return the number of the product of two words, given by their numbers in the table."""
        number, table = times(self.table, self.rules, a, b)
        self.keep_table(table)
        return int(number)

    def inverse(self, word: Word) -> Word:
        """Return the word of a reversed path, in its normal form."""
        return self.group.normal(invert(word))

    def windings(self, word: Word) -> tuple[int, ...]:
        """Return how often a loop winds around each hole, with signs: its class in the
        abelianisation.

        All are zero for a contractible loop.
        """
        return self.group.windings(word)


def _labelled_complex(
    cells: Cells, labels: Labels, known: npt.NDArray[np.uint8], tolerance: float, policy: WordPolicy
) -> LabelledComplex:
    """Return a labelled complex for kernels."""
    return LabelledComplex(
        cells.field.arrays,
        cells.low,
        float(cells.cell),
        cells.flags,
        labels,
        known,
        float(tolerance),
        policy.max_hold_cells,
        policy.far_hold_cells,
    )


def _renumbered(
    labels: Labels, table: Table, meaning: list[Word], rules: Rules
) -> tuple[Labels, Table]:
    """Return labels and table in the generators that are left."""
    used = np.unique(labels)
    used = used[used != UNKNOWN]
    new, numbers = empty_table(), np.full(int(used.max(initial=0)) + 2, UNKNOWN, dtype=np.int32)
    for old in used:
        letters = [
            y
            for x in word_of(table, int(old))
            for y in (meaning[x - 1] if x > 0 else invert(meaning[-x - 1]))
        ]
        numbers[old], new = number_of(new, rules, letters)
    return numbers[labels], new


def shown(point: Floats) -> str:
    """Return a point (3,) as messages name it, to the centimetre."""
    return "(" + ", ".join(f"{x:.2f}" for x in point) + ")"
