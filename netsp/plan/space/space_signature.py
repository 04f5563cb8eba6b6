"""Words of paths in any scene: the second kind of `netsp.hsignature.signature_protocol.Signature`.

The labels of a complex (`netsp.plan.space.triangle_labels`) after relations have eliminated what
generators they can. How often a path's word is right: always where the path keeps off the solids by
its tolerance, and the word then says the same of it as of any path that it can be deformed into.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Floats, Ints
from netsp.base.clock import abandoned, end_if_abandoned
from netsp.base.deprecated import deprecated_method
from netsp.base.errors import InputError
from netsp.hsignature.groups import Group, eliminated
from netsp.hsignature.words import Word, invert
from netsp.hsignature.wordtable import (
    Rules,
    Table,
    empty_table,
    number_of,
    packed,
    times,
    word_of,
)
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

    Parameters
    ----------
    cells : Cells
        The complex of its free water.
    root : Ints
        (3,) the cell from which the labels were found.
    group : Group
        Of the loops at the root.
    labels : Labels
        (3 n,) number of the word of every edge in the table.
    far : ndarray of int32
        (n,) hundredths of a cell from the root, FAR for what is cut off.
    generators : int
        How many there were before relations eliminated any.
    tolerance : float
        Metres that paths may dip into a surface.
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
        """The words of a box in a scene.

        Parameters
        ----------
        scene : DistanceField
            The scene.
        low : array_like, shape (3,)
            Corner of the box, metres.
        high : array_like, shape (3,)
            The other corner, metres.
        cell : float
            Size of a cell, metres. Gaps narrower than it may count as closed.
        root : array_like, shape (3,)
            A point of the water that is meant: the anchor.
        tolerance : float
            Metres that paths may dip into a surface, as taut tethers do between their nodes (by
            delta / 8); also the size of what is not looked at more closely. Bars thinner than four
            times that might be passed through by a path that touches them.

        Returns
        -------
        SpaceSignature
            Its words.

        Raises
        ------
        InputError
            A box without size, too many cells for the memory, a root that is not in the water, or
            a scene with thousands of holes.

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
        """The words of a complex.

        Parameters
        ----------
        cells : Cells
            The complex.
        root : array_like, shape (3,)
            A point of the water that is meant, metres.
        tolerance : float
            As of `of`, metres.

        Returns
        -------
        SpaceSignature
            Its words.

        Raises
        ------
        InputError
            As of `of`.
        """
        policy = policy or WordPolicy()
        point = np.asarray(root, dtype=float)
        no_labels = np.empty(0, dtype=np.int32)
        everywhere = np.ones(cells.flags.shape, dtype=np.uint8)
        at = find_visible_cell(_labelled(cells, no_labels, everywhere, tolerance, policy), point)
        if at < 0:
            raise InputError(
                f"anchor: no free cell of {cells.cell:g} m is in sight of {shown(point)}; "
                "expected a point in the water, or a smaller cell"
            )
        begin = np.array(np.unravel_index(at, cells.flags.shape), dtype=np.int64)
        stop = abandoned()
        far, order = cell_distances(cells.flags, begin, stop)
        none = packed([])
        labels, table, generators = label_edges(
            cells.flags, far, order, empty_table(), none, policy.max_generators, stop
        )
        end_if_abandoned()
        if generators > policy.max_generators:
            raise InputError(
                f"cell: {cells.cell:g} m finds more than {policy.max_generators} holes in the "
                "scene; expected a larger cell"
            )
        words, table = square_relations(cells.flags, labels, order, table, none, stop)
        end_if_abandoned()
        meaning, rank, relators = eliminated(
            generators, [word_of(table, int(number)) for number in words]
        )
        group = Group.of(rank, relators)
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
        """Whether words that differ are of different classes of the complex."""
        return self.group.exact

    @cached_property
    def rules(self) -> Rules:
        """The group's rules for kernels."""
        return packed(self.group.rules)

    @cached_property
    def _complex(self) -> LabelledComplex:
        """Return the labelled complex for kernels."""
        return _labelled(self.cells, self.labels, self.reached_cells, self.tolerance, self.policy)

    @property
    def table(self) -> Table:
        """The words met so far."""
        return self._tables[0]

    def keep_table(self, table: Table) -> None:
        """Take over a table that has grown.

        Parameters
        ----------
        table : Table
            It has all words of the one before, under the same numbers.
        """
        self._tables[0] = table

    @cached_property
    def reached_cells(self) -> npt.NDArray[np.uint8]:
        """(nx, ny, nz) which cells a path from the root leads to."""
        return np.asarray((self.far < FAR).reshape(self.cells.flags.shape), dtype=np.uint8)

    def visible_cell(self, point: npt.ArrayLike) -> int | None:
        """The number of the cell that a point holds on to.

        Parameters
        ----------
        point : array_like, shape (3,)
            Metres.

        Returns
        -------
        int or None
            None where no cell is in sight.
        """
        at = find_visible_cell(self._complex, np.asarray(point, dtype=float))
        return None if at < 0 else int(at)

    def word(self, path: npt.ArrayLike, *, closed: bool = False) -> Word:
        """The word of a path. Each end counts as joined to the root by the shortest way from the
        cell that it holds on to.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            Polyline, metres.
        closed : bool
            Whether the last point is joined to the first.

        Returns
        -------
        Word
            Empty for a contractible loop; in a group that is not `exact`, others may be, too.

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
        """The same without an error.

        Parameters
        ----------
        path : array_like, shape (k, 3)
            Polyline, metres.
        closed : bool
            Whether the last point is joined to the first.

        Returns
        -------
        word : Word
            Empty where it could not be told.
        broken : ndarray of shape (3,) or None
            Where it could not be told any further.
        """
        line = np.asarray(path, dtype=float).reshape(-1, 3)
        if closed:
            line = np.vstack([line, line[:1]])
        number, where = self.word_number(line)
        if number is None:
            return (), where
        return word_of(self.table, number), None

    def word_number(self, line: Floats) -> tuple[int | None, Floats]:
        """The number of a path's word in the table.

        Parameters
        ----------
        line : ndarray, shape (k, 3)
            Polyline, metres.

        Returns
        -------
        number : int or None
            None where it cannot be told.
        where : ndarray, shape (3,)
            The last point that was reached.
        """
        number, table, where = path_word(
            self._complex, self.table, self.rules, np.ascontiguousarray(line)
        )
        self.keep_table(table)
        return (None if number < 0 else int(number)), where

    def product(self, *words: Word) -> Word:
        """The word of paths one after the other.

        Parameters
        ----------
        *words : Word
            Their words.

        Returns
        -------
        Word
            In its normal form.
        """
        return self.group.normal(x for word in words for x in word)

    def letters(self, number: int) -> Word:
        """The word of a number.

        Parameters
        ----------
        number : int
            In the table.

        Returns
        -------
        Word
            Its letters.
        """
        return word_of(self.table, number)

    def multiply(self, a: int, b: int) -> int:
        """`product` of words by their numbers in the table.

        Parameters
        ----------
        a : int
            Number of the first.
        b : int
            Number of the second.

        Returns
        -------
        int
            Of both.
        """
        number, table = times(self.table, self.rules, a, b)
        self.keep_table(table)
        return int(number)

    def inverse(self, word: Word) -> Word:
        """The word of a path backwards.

        Parameters
        ----------
        word : Word
            Of the path.

        Returns
        -------
        Word
            In its normal form.
        """
        return self.group.normal(invert(word))

    def windings(self, word: Word) -> tuple[int, ...]:
        """How often a loop winds around what there is, counted with signs.

        Parameters
        ----------
        word : Word
            Of the loop.

        Returns
        -------
        tuple of int
            Its class in the abelianisation; all zero for what is contractible.
        """
        return self.group.windings(word)


def _labelled(
    cells: Cells,
    labels: Labels,
    known: npt.NDArray[np.uint8],
    tolerance: float,
    policy: WordPolicy,
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
    """Labels in the generators that are left."""
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
    """A point as messages name it.

    Parameters
    ----------
    point : ndarray, shape (3,)
        Metres.

    Returns
    -------
    str
        To the centimetre.
    """
    return "(" + ", ".join(f"{x:.2f}" for x in point) + ")"
