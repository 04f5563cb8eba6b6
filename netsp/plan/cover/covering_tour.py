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

A tour that is a little worse is accepted, too, ever less often (simulated annealing).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from netsp.base.arrays import Bools, ComparesArrays, Floats, Ints
from netsp.base.clock import Clock
from netsp.plan.cover.choose import choose_greedily, prune
from netsp.plan.cover.cover_policy import TourSearchPolicy
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
        default the tour of a greedy cover.

    Returns
    -------
    ndarray of int, shape (k,)
        Places in their order, the start first.
    """
    policy = policy or TourSearchPolicy()
    best = current = _first_tour(problem, policy, first)
    best_cost = current_cost = problem.cost(best)
    search = _Search(problem, rng, policy)
    idle_rounds = 0
    for number in range(policy.max_rounds):
        if clock.is_up or len(best) < 2 or idle_rounds > policy.idle_rounds_per_visit * len(best):
            break
        if on_progress is not None and number % policy.rounds_per_report == 0:
            on_progress(f"tour of {problem.length(best):.1f} m with {len(best) - 1} viewpoints")
        idle_rounds += 1
        tour = search.changed(current, current_cost)
        if tour is None:
            continue
        cost = problem.cost(tour)
        warmth = policy.warmth * (1.0 - number / policy.max_rounds) * current_cost / len(current)
        if cost - current_cost < -warmth * np.log(1.0 - rng.random()):
            current, current_cost = tour, cost
        if cost < best_cost * (1.0 - policy.min_gain):
            idle_rounds = 0
        if cost < best_cost:
            best, best_cost = tour, cost
    return best


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


class _Search:
    """Rounds of the search."""

    def __init__(
        self, problem: TourProblem, rng: np.random.Generator, policy: TourSearchPolicy
    ) -> None:
        self.problem, self.rng, self.policy = problem, rng, policy
        self.patch_rows = np.ascontiguousarray(problem.sees.T)
        self.patches_of = [np.flatnonzero(row) for row in problem.sees]
        self.area = float(problem.areas.sum())

    def changed(self, tour: Ints, cost: float) -> Ints | None:
        """Return a tour after one round; None if it got too expensive on the way."""
        problem = self.problem
        max_cost = cost * (1.0 + self.policy.max_detour / len(tour))
        places = self._removed_places(tour)
        left, removed = np.delete(tour, places), tour[places]
        views = np.bincount(self._patches_from(left)[0], minlength=len(problem.areas))
        covered = self._covered(left, views, removed, max_cost)
        if covered is None:
            return None
        pruned = self._pruned(covered, views)
        if problem.cost(pruned) > max_cost:
            return None
        beside = np.concatenate([tour[places - 1], tour[(places + 1) % len(tour)]])
        changed = np.union1d(beside, np.setdiff1d(pruned, left))
        return shorten(problem.distances, pruned, self.policy, changed)

    def _removed_places(self, tour: Ints) -> Ints:
        """Return the positions in the tour of the viewpoints that are removed, never 0."""
        rng, policy, count = self.rng, self.policy, len(tour) - 1
        size = int(rng.integers(1, max(1, min(policy.max_removed, count)) + 1))
        kind, middle = rng.random(), 1 + int(rng.integers(count))
        if kind < policy.run_share:
            first = max(1, min(middle, count - size + 1))
            return np.arange(first, first + size)
        if kind < 1.0 - policy.random_share:
            near = np.argsort(self.problem.distances[tour[middle], tour[1:]], kind="stable")
            return 1 + near[:size]
        return 1 + rng.choice(count, size, replace=False)

    def _covered(self, tour: Ints, views: Ints, removed: Ints, max_cost: float) -> Ints | None:
        """Return the tour with viewpoints added until the needed area is seen; `views`, the number
        of views of each patch, is updated."""
        problem, rng, policy = self.problem, self.rng, self.policy
        distances, prices = problem.distances, problem.prices
        unseen = np.flatnonzero(views == 0)
        missing = problem.needed - (self.area - float(problem.areas[unseen].sum()))
        max_missing = policy.rounding * problem.needed
        if missing <= max_missing:
            return tour
        rows = self.patch_rows[unseen]
        # single precision ranks viewpoints only; areas that decide are in double precision
        weights = problem.areas[unseen].astype(np.float32)
        candidates = np.flatnonzero(rows.any(axis=0))
        rows = rows[:, candidates].astype(np.float32)
        gains = weights @ rows
        bias = np.exp(policy.noise * rng.uniform(-1.0, 1.0, len(candidates)))
        bias[np.isin(candidates, removed)] *= policy.removed_bias if rng.random() < 0.5 else 1.0
        exponent = rng.uniform(policy.min_gain_exponent, policy.max_gain_exponent)
        insertion, after = _insertions(distances, candidates, tour)
        cost = problem.cost(tour)
        while missing > max_missing:
            useful = np.clip(gains, 0.0, missing)
            price = insertion + prices[candidates] + policy.min_price
            k = int((bias * useful**exponent / price).argmax())
            if useful[k] <= 0.0 or cost > max_cost:
                return None
            cost += float(insertion[k] + prices[candidates[k]])
            new, at = int(candidates[k]), int(after[k])
            fresh = (rows[:, k] > 0.0) & (weights > 0.0)
            missing -= float(problem.areas[unseen[fresh]].sum())
            gains -= weights[fresh] @ rows[fresh]
            weights[fresh] = 0.0
            gains[k] = 0.0
            views[self.patches_of[new]] += 1
            tour = np.insert(tour, at + 1, new)
            after = _update_insertions(distances, candidates, tour, at, insertion, after)
        return tour

    def _pruned(self, tour: Ints, views: Ints) -> Ints:
        """Return the tour without viewpoints that are not needed; `views` is updated."""
        problem = self.problem
        distances, areas = problem.distances, problem.areas
        spare = self.area - float(areas[views == 0].sum()) - problem.needed
        spare += self.policy.rounding * problem.needed
        sole = self._sole_areas(tour, views)
        while len(tour) > 1:
            before, after = np.roll(tour, 1), np.roll(tour, -1)
            saved = distances[before, tour] + distances[tour, after] - distances[before, after]
            saved = np.where(sole <= spare, saved + problem.prices[tour], -np.inf)
            saved[0] = -np.inf
            k = int(saved.argmax())
            if saved[k] < 0.0:
                return tour
            spare -= float(sole[k])
            views[self.patches_of[tour[k]]] -= 1
            tour = np.delete(tour, k)
            sole = self._sole_areas(tour, views)
        return tour

    def _sole_areas(self, tour: Ints, views: Ints) -> Floats:
        """Return the area that is seen from each visit of a tour and from no other."""
        patches, visits = self._patches_from(tour)
        areas = np.where(views[patches] == 1, self.problem.areas[patches], 0.0)
        return np.bincount(visits, areas, minlength=len(tour)).astype(float)

    def _patches_from(self, tour: Ints) -> tuple[Ints, Ints]:
        """Return the patches that are seen from the visits of a tour, and the visit of each."""
        patches_of = [self.patches_of[place] for place in tour]
        visits = np.repeat(np.arange(len(tour)), [len(patches) for patches in patches_of])
        return np.concatenate(patches_of), visits


def _insertions(distances: Floats, candidates: Ints, tour: Ints) -> tuple[Floats, Ints]:
    """Return the least length that inserting each candidate adds to a tour, and the position in
    the tour after which it adds so little."""
    legs = distances[tour, np.roll(tour, -1)]
    to_visits = distances[np.ix_(candidates, tour)]
    added = to_visits + np.roll(to_visits, -1, axis=1) - legs[None]
    after = added.argmin(axis=1)
    return added[np.arange(len(candidates)), after], after


def _update_insertions(
    distances: Floats, candidates: Ints, tour: Ints, at: int, insertion: Floats, after: Ints
) -> Ints:
    """Update in place the lengths that insertions add, after a visit was inserted behind position
    `at`; return the positions."""
    is_broken = after == at
    after = np.where(after > at, after + 1, after)
    if is_broken.any():
        insertion[is_broken], after[is_broken] = _insertions(distances, candidates[is_broken], tour)
    for position in (at, at + 1):
        a, b = tour[position], tour[(position + 1) % len(tour)]
        added = distances[candidates, a] + distances[candidates, b] - distances[a, b]
        is_less = added < insertion
        insertion[is_less], after[is_less] = added[is_less], position
    return after
