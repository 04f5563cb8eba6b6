"""Lower bounds on tours, the scope of each bound, and how both are put into words.

A bound over the homotopy classes that a roadmap kept is no bound on all tours. A bound along a
sampled roadmap does not hold in the continuous world, and a bound between the states that were
found does not hold for the mission. So each `LowerBound` has a `Scope`: the set of tours for which
it holds. Pages, tables, messages and files take their wording from this module.

Scopes are ordered by inclusion. A bound of a scope also holds for each part of that scope
(`LowerBound.for_part`). The reverse needs a bound on all other tours (`LowerBound.or_elsewhere`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType

OPTIMALITY_TOLERANCE = 1e-6
"""Tolerance for the relative gap of a tour that is called optimal.

It is orders of magnitude above the rounding errors of the dual values that bounds come from.
"""


class Scope(StrEnum):
    """Set of tours that a lower bound holds for.

    Attributes
    ----------
    ALL_TOURS
        All admissible tours of the continuous world, in every homotopy class.
    KEPT_CLASSES
        Tours over the homotopy classes in the travel graph, if other classes were left out.
    ROADMAP
        Tours along a sampled roadmap (PRM*), or along a roadmap of another package.
    STATES
        Tours along the legs that were found between the known states of the tether.
    GIVEN_ORDER
        Tours that visit the goals in the order given.
    KEPT_IN_ORDER, ROADMAP_IN_ORDER, STATES_IN_ORDER
        Tours of `KEPT_CLASSES`, `ROADMAP` and `STATES` that keep the order given.
    TRAVEL_GRAPH
        Tours of a travel graph without a world, a generalised TSP.
    PART
        Tours over some vertices of a travel graph, before their bound is extended to all vertices.
    """

    ALL_TOURS = "all_tours"
    KEPT_CLASSES = "kept_classes"
    ROADMAP = "roadmap"
    STATES = "states"
    GIVEN_ORDER = "given_order"
    KEPT_IN_ORDER = "kept_in_order"
    ROADMAP_IN_ORDER = "roadmap_in_order"
    STATES_IN_ORDER = "states_in_order"
    TRAVEL_GRAPH = "travel_graph"
    PART = "part"

    @property
    def tours(self) -> str:
        """Noun phrase for the tours of the scope, as in "bound 40 m on all tours"."""
        return _TOURS[self]

    @property
    def shortest(self) -> str:
        """Noun phrase for the shortest tour of the scope, as in "1 % above the shortest tour"."""
        return "the shortest tour" + _TOURS[self].removeprefix("all tours").removeprefix("tours")

    @property
    def column(self) -> str:
        """Short name for a column of a table."""
        return _COLUMN[self]

    @property
    def in_order(self) -> Scope:
        """Scope of the tours of this scope that visit the goals in the order given."""
        return _of_limits(_LIMITS[self] | {"order"})

    @property
    def keeps_order(self) -> bool:
        """True if all tours of the scope visit the goals in the order given."""
        return "order" in _LIMITS[self]

    def includes(self, other: Scope) -> bool:
        """Return whether every tour of another scope of the same problem is in this scope."""
        return _LIMITS[self] <= _LIMITS[other]


_LIMITS: Mapping[Scope, frozenset[str]] = MappingProxyType(
    {
        Scope.ALL_TOURS: frozenset(),
        Scope.KEPT_CLASSES: frozenset({"kept"}),
        Scope.ROADMAP: frozenset({"roadmap"}),
        Scope.STATES: frozenset({"states"}),
        Scope.GIVEN_ORDER: frozenset({"order"}),
        Scope.KEPT_IN_ORDER: frozenset({"kept", "order"}),
        Scope.ROADMAP_IN_ORDER: frozenset({"roadmap", "order"}),
        Scope.STATES_IN_ORDER: frozenset({"states", "order"}),
        # a travel graph without a world is no part of all tours of a world
        Scope.TRAVEL_GRAPH: frozenset({"graph"}),
        Scope.PART: frozenset({"part"}),
    }
)
"""Restrictions of each scope. A scope with a subset of the restrictions of another includes it."""

_TOURS: Mapping[Scope, str] = MappingProxyType(
    {
        Scope.ALL_TOURS: "all tours",
        Scope.KEPT_CLASSES: "tours over the classes kept",
        Scope.ROADMAP: "tours of this roadmap",
        Scope.STATES: "tours between the states found",
        Scope.GIVEN_ORDER: "tours in the given order",
        Scope.KEPT_IN_ORDER: "tours over the classes kept in the given order",
        Scope.ROADMAP_IN_ORDER: "tours of this roadmap in the given order",
        Scope.STATES_IN_ORDER: "tours between the states found in the given order",
        Scope.TRAVEL_GRAPH: "tours of the travel graph",
        Scope.PART: "tours over a part of the travel graph",
    }
)

_COLUMN: Mapping[Scope, str] = MappingProxyType(
    {
        Scope.ALL_TOURS: "all tours",
        Scope.KEPT_CLASSES: "kept",
        Scope.ROADMAP: "roadmap",
        Scope.STATES: "states",
        Scope.GIVEN_ORDER: "order",
        Scope.KEPT_IN_ORDER: "kept+order",
        Scope.ROADMAP_IN_ORDER: "road+order",
        Scope.STATES_IN_ORDER: "state+order",
        Scope.TRAVEL_GRAPH: "graph",
        Scope.PART: "part",
    }
)


def _of_limits(limits: frozenset[str]) -> Scope:
    found = next((s for s, limits_of_scope in _LIMITS.items() if limits_of_scope == limits), None)
    if found is None:
        raise ValueError(f"scope: no tours limited by {', '.join(sorted(limits))}")
    return found


@dataclass(frozen=True)
class LowerBound:
    """Proven lower bound on the length of tours, with the scope that it holds for.

    Parameters
    ----------
    length : float
        Bound, in the problem's units.
    scope : Scope
        Tours that the bound holds for.
    because : str
        Reason why the bound holds for the scope, if it was derived for another; not compared.

    Raises
    ------
    ValueError
        A negative length or NaN.

    Examples
    --------
    >>> bound = LowerBound(90.0, Scope.KEPT_CLASSES)
    >>> bound.above(100.0)
    'at most 11.1 % above the shortest tour over the classes kept'
    >>> because = "classes left out have tethers of at least 40"
    >>> bound.or_elsewhere(80.0, Scope.ALL_TOURS, because).above(100.0)
    'at most 25 % above the shortest tour'
    """

    length: float
    scope: Scope
    because: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if not self.length >= 0.0:
            raise ValueError(f"lower bound: expected a length of at least 0, got {self.length!r}")

    def gap(self, length: float) -> float:
        """Return the gap of a tour, (length - bound) / length, at least 0."""
        return max(0.0, (length - self.length) / length) if length > 0.0 else 0.0

    def proves(self, length: float) -> bool:
        """Return whether the gap of a tour is at most `OPTIMALITY_TOLERANCE`."""
        return length - self.length <= OPTIMALITY_TOLERANCE * max(length, 1e-300)

    def capped_at(self, length: float) -> LowerBound:
        """Return the bound, lowered to the length of a tour of the scope if rounding put it
        above."""
        return LowerBound(min(self.length, length), self.scope, self.because)

    def for_part(self, scope: Scope, because: str) -> LowerBound:
        """Return the same bound for a smaller scope.

        Parameters
        ----------
        scope : Scope
            Scope whose tours are all in the scope of this bound.
        because : str
            Reason why these tours are in the scope of this bound.

        Raises
        ------
        ValueError
            The scope has tours that this bound does not hold for, or the reason is empty.
        """
        _check_reason(because)
        if not self.scope.includes(scope):
            raise ValueError(
                f"lower bound: holds for {self.scope.tours}, which are not all of {scope.tours}"
            )
        return LowerBound(self.length, scope, because)

    def or_elsewhere(self, other_bound: float, scope: Scope, because: str) -> LowerBound:
        """Return a bound for a larger scope: this bound, or the one on the other tours if lower.

        Parameters
        ----------
        other_bound : float
            Lower bound on the tours of the larger scope that are not in the scope of this bound.
        scope : Scope
            Larger scope.
        because : str
            Reason why no other tour is shorter than `other_bound`.

        Raises
        ------
        ValueError
            The reason is empty.
        """
        _check_reason(because)
        return LowerBound(min(self.length, max(other_bound, 0.0)), scope, because)

    def above(self, length: float) -> str:
        """Return in words how much longer a tour may be than the shortest: "at most 3.8 % above the
        shortest tour"."""
        gap = self.gap(length)
        if gap >= 1.0:
            return "no bound"
        return f"at most {100.0 * gap / (1.0 - gap):.3g} % above {self.scope.shortest}"

    def says(self, length: float | None = None, units: str = "", digits: int = 6) -> str:
        """Return the bound and the gap of a tour in words: "bound 40 m on all tours, gap 1.20 %".

        Parameters
        ----------
        length : float, optional
            Length of a tour; without it, there is no gap.
        units : str
            Unit of lengths, such as "m".
        digits : int
            Significant digits of the bound.
        """
        bound = f"bound {self.length:.{digits}g} {units}".rstrip() + f" on {self.scope.tours}"
        return bound if length is None else f"{bound}, gap {self.percent(length)}"

    def percent(self, length: float, decimals: int = 2) -> str:
        """Return the gap of a tour as text, such as "1.20 %"."""
        return f"{100.0 * self.gap(length):.{decimals}f} %"


def gap_of(length: float | None, bound: LowerBound | None) -> float | None:
    """Return the gap of a tour, or None if length or bound is missing.

    Callers that show the gap must name the scope of the bound.
    """
    return None if length is None or bound is None else bound.gap(length)


def strongest(*bounds: LowerBound | None) -> LowerBound | None:
    """Return the largest of some bounds of one scope, or None if all are None.

    Raises
    ------
    ValueError
        Bounds of different scopes; derive them for the same scope first (`LowerBound.for_part`).
    """
    known = [b for b in bounds if b is not None]
    scopes = {b.scope for b in known}
    if len(scopes) > 1:
        names = " and ".join(sorted(s.tours for s in scopes))
        raise ValueError(
            f"lower bounds: one on {names}; say first why each holds for the same (for_part)"
        )
    return max(known, key=lambda b: b.length, default=None)


def above_shortest(length: float | None, bound: LowerBound | None) -> str:
    """Return in words how much longer a tour may be than the shortest of the bound's scope.

    Return "no bound" if length or bound is missing, or the bound is 0.
    """
    if length is None or bound is None or bound.length == 0.0 < length:
        return "no bound"
    return bound.above(length)


def _check_reason(because: str) -> None:
    if not because.strip():
        raise ValueError("because: expected the reason why the bound holds for the scope, got none")
