"""Viewpoints and their tour, chosen together: a covering tour of least time.

The problem is the generalised covering salesman with a partial cover: a closed tour from the start
through some viewpoints that see the needed area, so that the sum of legs and of the prices of
viewpoints is least (Gendreau, Laporte & Semet 1997; Golden et al. 2012). The search is a large
neighbourhood search (Shaw 1998): each round

1. removes viewpoints: a run of the tour, those nearest to one of them, or random ones;
2. adds viewpoints until the needed area is seen again, each time the one with the largest gain of
   area for its price, which is that of its insertion into the tour and its own;
3. drops viewpoints that are no longer needed, the one that saves most first;
4. shortens the tour (`netsp.plan.cover.tour_improvement`).

The rounds are kernels (`netsp.plan.cover.covering_rounds`).

A tour that is a little worse is accepted, too, ever less often (simulated annealing).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from netsp.base.arrays import Bools, ComparesArrays, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.compiled.rng import seeded
from netsp.plan.cover.choose import choose_greedily, prune
from netsp.plan.cover.cover_policy import TourSearchPolicy
from netsp.plan.cover.covering_rounds import (
    CoverArrays,
    RoundSettings,
    insertion_tour,
    search_rounds,
)
from netsp.plan.cover.tour_improvement import nearest_neighbour_tour, shorten, tour_length


@dataclass(frozen=True, eq=False)
class TourProblem(ComparesArrays):
    """Candidates for a covering tour. Place 0 is the start, which sees nothing.

    Parameters
    ----------
    sees : ndarray of bool, shape (n, m)
        Whether each place sees each patch.
    areas : ndarray, shape (m,)
        Areas of the patches.
    needed : float
        Area that must be seen.
    distances : ndarray, shape (n, n)
        Symmetric lengths of legs.
    prices : ndarray, shape (n,)
        Price of a visit at each place, in the unit of the lengths.
    """

    sees: Bools
    areas: Floats
    needed: float
    distances: Floats
    prices: Floats

    def arrays(self) -> CoverArrays:
        """Return the problem as arrays for kernels."""
        seen_by = np.ascontiguousarray(self.sees.T)
        return CoverArrays(
            np.r_[0, np.cumsum(self.sees.sum(axis=1))].astype(np.int64),
            np.nonzero(self.sees)[1].astype(np.int64),
            np.r_[0, np.cumsum(seen_by.sum(axis=1))].astype(np.int64),
            np.nonzero(seen_by)[1].astype(np.int64),
            np.asarray(self.areas, dtype=float),
            float(self.needed),
            np.ascontiguousarray(self.distances, dtype=float),
            np.asarray(self.prices, dtype=float),
        )

    def length(self, tour: Ints) -> float:
        """Return the length of a tour."""
        return tour_length(self.distances, tour)

    def cost(self, tour: Ints) -> float:
        """Return the length of a tour and the prices of its visits."""
        return self.length(tour) + float(self.prices[tour].sum())

    def seen_area(self, tour: Ints) -> float:
        """Return the area that is seen from a tour."""
        return float(self.areas[self.sees[tour].any(axis=0)].sum())


def cheapest_tour(
    problem: TourProblem,
    rng: np.random.Generator,
    clock: Clock,
    policy: TourSearchPolicy | None = None,
    on_progress: Callable[[str], None] | None = None,
    first: Ints | None = None,
) -> Ints:
    """Return a cheap closed tour from place 0 that sees the needed area.

    Parameters
    ----------
    clock : Clock
        When it is up, the best tour so far is returned.
    policy : TourSearchPolicy, optional
        Effort of the search.
    on_progress : callable, optional
        Called with a line of text now and then.
    first : ndarray of int, optional
        Tour with which the search begins; viewpoints are added to it until it sees enough. By
        default the cheapest of the tours of a greedy cover and of insertions from the start alone.

    Returns
    -------
    ndarray of int, shape (k,)
        Places in their order, the start first.
    """
    policy = policy or TourSearchPolicy()
    cover, state = problem.arrays(), seeded(rng)
    settings = RoundSettings(*(getattr(policy, name) for name in RoundSettings._fields))
    tours = [_first_tour(problem, policy, first)]
    if first is None:
        tours += [insertion_tour(cover, settings, state) for _ in range(policy.insertion_tours)]
    best = current = min((tour for tour in tours if len(tour)), key=problem.cost)
    max_rounds = max(policy.max_rounds, policy.rounds_per_visit * (len(best) - 1))
    policy = replace(policy, max_rounds=max_rounds)
    settings = settings._replace(max_rounds=max_rounds)
    idle_rounds = done = reported = 0
    while done < policy.max_rounds and not clock.is_up and len(best) > 1:
        if on_progress is not None and done >= reported:
            on_progress(f"tour of {problem.length(best):.1f} m with {len(best) - 1} viewpoints")
            reported = done + policy.rounds_per_report
        rounds = done, min(done + policy.rounds_per_check, policy.max_rounds)
        current, best, idle = search_rounds(cover, settings, current, best, rounds, state)
        count, done = rounds[1] - rounds[0], rounds[1]
        idle_rounds = idle_rounds + idle if idle == count else idle
        if idle_rounds > policy.idle_rounds_per_visit * len(best):
            break
    return best


def shortest_order(
    distances: Floats,
    places: Ints,
    rng: np.random.Generator,
    clock: Clock,
    policy: TourSearchPolicy | None = None,
) -> Ints:
    """Return a short closed tour from place 0 through all given places.

    The search is that of `cheapest_tour`, where each place sees a patch of its own.

    Parameters
    ----------
    distances : ndarray, shape (n, n)
        Symmetric distances.
    places : ndarray of int
        Places to visit, without 0.
    clock : Clock
        When it is up, the shortest tour so far is returned.
    """
    which = np.concatenate([[0], places])
    count = len(places)
    problem = TourProblem(
        np.vstack([np.zeros((1, count), dtype=bool), np.eye(count, dtype=bool)]),
        np.ones(count),
        float(count),
        np.ascontiguousarray(distances[np.ix_(which, which)]),
        np.zeros(count + 1),
    )
    return np.asarray(which[cheapest_tour(problem, rng, clock, policy)])


def _first_tour(problem: TourProblem, policy: TourSearchPolicy, first: Ints | None) -> Ints:
    """Return a short tour through given viewpoints, and through those of a greedy cover of the
    rest."""
    sees, begun = problem.sees, np.array([], dtype=np.int64) if first is None else first[1:]
    is_seen = sees[begun].any(axis=0)
    needed = problem.needed - float(problem.areas[is_seen].sum())
    added = choose_greedily(sees, np.where(is_seen, 0.0, problem.areas), max(needed, 0.0))
    chosen = prune(sees, problem.areas, np.r_[begun, added], problem.needed)
    tour = nearest_neighbour_tour(problem.distances, chosen)
    return shorten(problem.distances, tour, policy)
