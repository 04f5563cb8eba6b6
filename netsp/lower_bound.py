"""Lower bounds on tours, each with the tours that it holds for, and the words that say so.

A bound over the homotopy classes that a roadmap kept is no bound on all tours, one along a sampled
roadmap is none in the continuous world, and one between the states that were found is none for a
mission. So a bound is never a bare number where people see it: `LowerBound` carries its `Scope`,
and every page, table, message and file takes its words from here.

Scopes are ordered by inclusion. A bound of a scope also holds for each part of that scope
(`LowerBound.for_part`). The reverse needs a bound on all other tours (`LowerBound.or_elsewhere`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType

OPTIMALITY_TOLERANCE = 1e-6
"""Largest gap of a tour that is called optimal, as a share of its length. Bounds are computed in
floating point from dual values; their rounding is orders of magnitude smaller."""


class Scope(StrEnum):
    """Set of tours that a lower bound holds for.

    Attributes
    ----------
    ALL_TOURS
        All admissible tours of the continuous world, in every homotopy class.
    KEPT_CLASSES
        Tours over the homotopy classes that are in the travel graph, where others were left out.
    ROADMAP
        Tours along a sampled roadmap (PRM*), or that of another package.
    STATES
        Tours along the legs that were found between the states of the tether that were found.
    GIVEN_ORDER
        Tours that visit the goals in the order given.
    KEPT_IN_ORDER, ROADMAP_IN_ORDER, STATES_IN_ORDER
        Those of the classes kept, of the roadmap, of the states, in the order given.
    TRAVEL_GRAPH
        Tours of a travel graph that was given as such, a generalised TSP.
    PART
        Tours over some vertices of a travel graph; a step on the way to a bound on all of it.
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
        """Noun phrase for the shortest of them, as in "1 % above the shortest tour"."""
        return "the shortest tour" + _TOURS[self].removeprefix("all tours").removeprefix("tours")

    @property
    def column(self) -> str:
        """Short form for a column of a table."""
        return _COLUMN[self]

    @property
    def in_order(self) -> Scope:
        """Scope of those of its tours that visit the goals in the order given."""
        return _of_limits(_LIMITS[self] | {"order"})

    @property
    def keeps_order(self) -> bool:
        """Whether its tours visit the goals in the order given."""
        return "order" in _LIMITS[self]

    def includes(self, other: Scope) -> bool:
        """Say whether every tour of another scope of the same problem is one of this scope.

        Parameters
        ----------
        other : Scope
            The other one.

        Returns
        -------
        bool
            True if a bound of this scope holds for the other scope as well.
        """
        return _LIMITS[self] <= _LIMITS[other]


_LIMITS: Mapping[Scope, frozenset[str]] = MappingProxyType({
    Scope.ALL_TOURS: frozenset(),
    Scope.KEPT_CLASSES: frozenset({"kept"}),
    Scope.ROADMAP: frozenset({"roadmap"}),
    Scope.STATES: frozenset({"states"}),
    Scope.GIVEN_ORDER: frozenset({"order"}),
    Scope.KEPT_IN_ORDER: frozenset({"kept", "order"}),
    Scope.ROADMAP_IN_ORDER: frozenset({"roadmap", "order"}),
    Scope.STATES_IN_ORDER: frozenset({"states", "order"}),
    # a travel graph that was given has no world around it
    Scope.TRAVEL_GRAPH: frozenset({"graph"}),
    Scope.PART: frozenset({"part"}),
})  # fmt: skip
"""What limits each scope: fewer limits, more tours."""

_TOURS: Mapping[Scope, str] = MappingProxyType({
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
})  # fmt: skip

_COLUMN: Mapping[Scope, str] = MappingProxyType({
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
})  # fmt: skip


def _of_limits(limits: frozenset[str]) -> Scope:
    found = next((s for s, own in _LIMITS.items() if own == limits), None)
    if found is None:
        raise ValueError(f"scope: no tours limited by {', '.join(sorted(limits))}")
    return found


@dataclass(frozen=True)
class LowerBound:
    """Proven lower bound, with the tours that it holds for.

    Parameters
    ----------
    length : float
        No tour of the scope is shorter; in the problem's units.
    scope : Scope
        Tours that it holds for.
    because : str
        Reason why it holds there, if it was derived for another scope; no part of equality.

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
        """Return the gap of a tour, (length - bound) / length, at least 0.

        Parameters
        ----------
        length : float
            Length of a tour.

        Returns
        -------
        float
            Share of the tour's own length.
        """
        return max(0.0, (length - self.length) / length) if length > 0.0 else 0.0

    def proves(self, length: float) -> bool:
        """Say whether the bound proves a tour the shortest of its scope.

        Parameters
        ----------
        length : float
            Length of a tour.

        Returns
        -------
        bool
            True if bound and length differ by no more than rounding.
        """
        return length - self.length <= OPTIMALITY_TOLERANCE * max(length, 1e-300)

    def at_most(self, length: float) -> LowerBound:
        """Return the bound, cut down to the length of a tour: rounding may lift it above.

        Parameters
        ----------
        length : float
            Length of a tour of the scope.

        Returns
        -------
        LowerBound
            Of the same scope.
        """
        return LowerBound(min(self.length, length), self.scope, self.because)

    def for_part(self, scope: Scope, because: str) -> LowerBound:
        """Return the bound as one on a part of its tours.

        Parameters
        ----------
        scope : Scope
            The part.
        because : str
            Reason why those tours are among the tours of this bound.

        Returns
        -------
        LowerBound
            Of the same length.

        Raises
        ------
        ValueError
            A scope with tours that this bound does not hold for; no reason.
        """
        _check_reason(because)
        if not self.scope.includes(scope):
            raise ValueError(
                f"lower bound: holds for {self.scope.tours}, which are not all of {scope.tours}"
            )
        return LowerBound(self.length, scope, because)

    def or_elsewhere(self, least: float, scope: Scope, because: str) -> LowerBound:
        """Return a bound on a larger set of tours: those of this scope, and all others of it.

        Parameters
        ----------
        least : float
            No tour of the larger scope that is not one of this bound's is shorter.
        scope : Scope
            The larger scope.
        because : str
            Reason why no other tour is shorter than `least`.

        Returns
        -------
        LowerBound
            The lesser of the two.

        Raises
        ------
        ValueError
            No reason.
        """
        _check_reason(because)
        return LowerBound(min(self.length, max(least, 0.0)), scope, because)

    def above(self, length: float) -> str:
        """Say how far above the shortest tour of the scope a tour may be.

        Parameters
        ----------
        length : float
            Length of a tour.

        Returns
        -------
        str
            As in "at most 3.8 % above the shortest tour".
        """
        gap = self.gap(length)
        if gap >= 1.0:
            return "no bound"
        return f"at most {100.0 * gap / (1.0 - gap):.3g} % above {self.scope.shortest}"

    def says(self, length: float | None = None, units: str = "", digits: int = 6) -> str:
        """Say the bound, and the gap of a tour.

        Parameters
        ----------
        length : float, optional
            Length of a tour.
        units : str
            Of lengths.
        digits : int
            Significant digits of the bound.

        Returns
        -------
        str
            As in "bound 40 m on all tours, gap 1.20 %".
        """
        bound = f"bound {self.length:.{digits}g} {units}".rstrip() + f" on {self.scope.tours}"
        return bound if length is None else f"{bound}, gap {self.percent(length)}"

    def percent(self, length: float, decimals: int = 2) -> str:
        """Return the gap of a tour in per cent, as text.

        Parameters
        ----------
        length : float
            Length of a tour.
        decimals : int
            Decimals.

        Returns
        -------
        str
            As in "1.20 %".
        """
        return f"{100.0 * self.gap(length):.{decimals}f} %"


def gap_of(length: float | None, bound: LowerBound | None) -> float | None:
    """Return the gap of a tour, where length and bound may be missing.

    Parameters
    ----------
    length : float, optional
        Length of a tour.
    bound : LowerBound, optional
        Lower bound on tours of a scope that is named beside the gap.

    Returns
    -------
    float or None
        (length - bound) / length, at least 0; None if either is missing.
    """
    return None if length is None or bound is None else bound.gap(length)


def strongest(*bounds: LowerBound | None) -> LowerBound | None:
    """Return the largest of several bounds of one scope.

    Parameters
    ----------
    *bounds : LowerBound or None
        Those of another scope are brought into the same one first (`LowerBound.for_part`).

    Returns
    -------
    LowerBound or None
        None if there is none.

    Raises
    ------
    ValueError
        Bounds of different scopes.
    """
    known = [b for b in bounds if b is not None]
    scopes = {b.scope for b in known}
    if len(scopes) > 1:
        names = " and ".join(sorted(s.tours for s in scopes))
        raise ValueError(f"lower bounds: one on {names}; say first why each holds for the same")
    return max(known, key=lambda b: b.length, default=None)


def above_shortest(length: float | None, bound: LowerBound | None) -> str:
    """Say how far above the shortest tour of the bound's scope a tour may be.

    Parameters
    ----------
    length : float or None
        Length of a tour.
    bound : LowerBound or None
        None where nothing is known.

    Returns
    -------
    str
        "no bound" where either is missing, or the bound is 0.
    """
    if length is None or bound is None or bound.length == 0.0 < length:
        return "no bound"
    return bound.above(length)


def _check_reason(because: str) -> None:
    if not because.strip():
        raise ValueError("lower bound: a bound changes its scope for a reason; expected one")
