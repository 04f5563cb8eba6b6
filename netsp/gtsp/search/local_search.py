"""Local search, then ruin and recreate, over orders of clusters."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Ints
from netsp.base.clock import Clock
from netsp.base.compiled.rng import seeded
from netsp.base.time_flags import NEVER
from netsp.gtsp.search.descent import descend, two_opt
from netsp.gtsp.search.layers import LayeredInstance, best_classes
from netsp.gtsp.search.links import Tables, link, no_links
from netsp.gtsp.search.ruin import StringPolicy, ruin_and_recreate


def local_search(
    instance: LayeredInstance,
    rng: np.random.Generator,
    *,
    rounds: int,
    clock: Clock,
    start_order: npt.ArrayLike | None = None,
) -> tuple[float, tuple[int, ...]]:
    """Return the best tour after rounds of ruin and recreate, or when the clock runs out.

    Until the clock runs out, the result depends on `rng` alone.

    Parameters
    ----------
    instance : LayeredInstance
        Instance that is searched.
    rng : numpy.random.Generator
        Random generator.
    rounds : int
        Rounds of ruin and recreate.
    clock : Clock
        Clock that ends the search.
    start_order : array_like of int, optional
        Clusters in the order to start from; by default by farthest insertion.

    Returns
    -------
    length : float
        Length of the tour.
    tour : tuple of int
        Vertices of the travel graph.
    """
    search = Search(instance, rng, start_order, clock)
    search.settle()
    search.run(rounds, clock)
    return search.best()


class Search:
    """A search in progress: the present order and the best.

    Parameters
    ----------
    instance, rng, start_order
        As in `local_search`.
    clock : Clock, optional
        Clock that ends the descent.
    """

    def __init__(
        self,
        instance: LayeredInstance,
        rng: np.random.Generator,
        start_order: npt.ArrayLike | None = None,
        clock: Clock | None = None,
    ) -> None:
        self.instance = instance
        self._stop = NEVER if clock is None else clock.flag
        if start_order is None:
            start_order = _farthest_insertion(instance.cluster_costs, instance.before)
        self.order: Ints = np.array(start_order, dtype=np.int64)
        self._links = no_links(len(self.order), instance.largest)
        self._row = np.empty(instance.largest)
        self.chance = seeded(rng)
        self.length = np.inf
        self.best_order, self.best_length = self.order.copy(), np.inf

    @property
    def _tables(self) -> Tables:
        i = self.instance
        return Tables(
            i.start,
            i.costs,
            i.cluster_costs,
            i.near,
            *i.neighbours,
            i.rank,
            i.before,
            i.min_gain,
            i.rounding,
        )

    def _link(self) -> None:
        """Fill the links of the present order, and measure it."""
        i = self.instance
        self.length = link(self.order, self._links, i.start, i.costs, self._row)

    def settle(self) -> None:
        """Descend to an order that no move of one cluster and no reversal shortens."""
        n = len(self.order)
        before = np.inf
        while True:
            self._link()
            self.length = descend(self.order, self._tables, self._links, self.chance, self._stop)
            if n > 3:
                self.length = two_opt(self.order, self._tables, self._stop)
            if not self.length < before * (1.0 - self.instance.min_gain):
                break
            before = self.length
        self._keep()

    def run(
        self,
        rounds: float,
        clock: Clock,
        progress: Callable[[], float] | None = None,
        on_chunk: Callable[[int], None] | None = None,
    ) -> None:
        """Ruin and recreate, cooling from the first temperature to the last.

        Parameters
        ----------
        rounds : float
            Rounds of ruin and recreate; inf for as long as the clock allows.
        clock : Clock
            Clock that ends the search.
        progress : callable, optional
            Returns how far the cooling is, from 0 to 1; by default that of the rounds.
        on_chunk : callable, optional
            Called after every chunk with the number of its rounds.
        """
        for count in self.chunks(rounds, clock, progress):
            if on_chunk:
                on_chunk(count)

    def chunks(
        self, rounds: float, clock: Clock, progress: Callable[[], float] | None = None
    ) -> Iterator[int]:
        """Do what `run` does, chunk by chunk.

        Parameters
        ----------
        rounds, clock, progress
            As in `run`.

        Yields
        ------
        int
            Number of rounds of the chunk.
        """
        policy = self.instance.policy
        n = len(self.order)
        self._link()
        done, chunk = 0, 1
        mean_leg = self.length / n
        # a temperature lasts a number of rounds, whatever time they take, so that runs repeat
        step = 1 if progress else max(1, int(rounds) // policy.temperature_steps)
        hot, cold = policy.first_temperature, policy.last_temperature
        strings = StringPolicy(policy.max_string_length, policy.mean_removed, policy.blink_rate)
        while done < rounds and n > 3 and not clock.is_up:
            share = progress() if progress else (done - done % step) / rounds
            theta = mean_leg * hot * (cold / hot) ** min(share, 1.0)
            count = int(min(chunk, rounds - done if progress else step - done % step))
            begin = clock.elapsed
            self.length, self.best_length = ruin_and_recreate(
                self.order,
                self.best_order,
                self.length,
                self.best_length,
                count,
                theta,
                self._tables,
                self._links,
                strings,
                self.chance,
            )
            done += count
            was_short = clock.elapsed - begin < policy.min_chunk_s
            if was_short and chunk < max(1, rounds / policy.temperature_steps):
                chunk *= 2
            yield count

    def best(self) -> tuple[float, tuple[int, ...]]:
        """Return the best tour so far.

        Returns
        -------
        length : float
            Length; inf if the tour needs a missing leg.
        tour : tuple of int
            Vertices of the travel graph.
        """
        i = self.instance
        length, tour = best_classes(self.best_order[1:], i.start, i.costs)
        return float(length) if length < i.penalty else float("inf"), i.original(tour)

    def _keep(self) -> None:
        if self.length < self.best_length:
            self.best_length = self.length
            self.best_order[:] = self.order


def _farthest_insertion(d: npt.NDArray[np.float64], before: Bools) -> Ints:
    """Return an order of clusters, base first, by farthest insertion.

    `d` is the minimum cost of a leg between clusters.
    """
    left = list(range(1, len(d)))
    tour = [0]
    while left:
        inside = d[np.ix_(left, tour)].min(axis=1)
        k = left[int(np.argmax(inside))]
        t = np.array(tour)
        after = np.roll(t, -1)
        between = d[t, after] if len(t) > 1 else np.zeros(1)
        increase = d[t, k] + d[k, after] - between
        if len(before):
            increase[: int(np.flatnonzero(before[t, k]).max(initial=0))] = np.inf
            increase[int(np.flatnonzero(before[k, t]).min(initial=len(t))) :] = np.inf
        tour.insert(int(np.argmin(increase)) + 1, k)
        left.remove(k)
    return np.array(tour, dtype=np.int64)
