"""Policies of the solvers of a generalised TSP: costs, searches, walks and the core."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_not_negative, check_positive, check_shares


@dataclass(frozen=True)
class CostPolicy:
    """Measuring and storage of the costs of legs.

    Attributes
    ----------
    max_measured_vertices
        Number of vertices up to which all legs are measured at once, which takes a second at most.
        Above, legs are bounded first, and those that matter are measured.
    max_double_vertices
        Number of vertices up to which costs are in double precision. Above, they are rounded down
        to single precision; they are measured again in double once half of this number is left.
    untimed_vertices
        Number of vertices up to which legs among them are measured even if time is up, such as
        those of a tour whose length is needed.
    max_s_per_leg
        CPU time of a leg, s, up to which all legs are measured at once instead of bounded first. A
        bound takes about as long.
    max_single_leg_s
        CPU time of a single leg, s, up to which legs are measured one by one as they are needed.
    s_per_single_leg, s_per_copied_leg
        Estimated CPU time of a leg, s: measured by itself, and copied from a matrix.
    tried_legs
        Number of legs measured at a time in a search, by bounds, for the nearest vertex.
    bytes_per_leg
        Memory of a proof for each entry of a matrix in double precision, bytes: the cost, what is
        known of the leg, and temporaries.
    bytes_per_rounded_leg
        Memory of a proof for each entry of a matrix in single precision, bytes.
    block_rows
        Rows of a matrix that are processed at a time; more rows take more memory.
    block_legs
        Legs that are measured at a time; more legs take more memory.
    task_rows
        Rows of sparse costs that a thread processes at a time.
    min_packed_share
        Share of the room of sparse costs in use at which they are packed again: packing copies all
        costs, room that is not in use wastes memory.
    """

    max_measured_vertices: int = 400
    max_double_vertices: int = 5000
    untimed_vertices: int = 50
    max_s_per_leg: float = 5e-7
    max_single_leg_s: float = 1e-4
    s_per_single_leg: float = 2e-6
    s_per_copied_leg: float = 1e-9
    tried_legs: int = 16
    bytes_per_leg: float = 24.0
    bytes_per_rounded_leg: float = 8.0
    block_rows: int = 512
    block_legs: int = 200_000
    task_rows: int = 256
    min_packed_share: float = 0.5

    def __post_init__(self) -> None:
        check_not_negative(self)
        check_shares(self, "min_packed_share")
        for name in ("tried_legs", "block_rows", "block_legs", "task_rows"):
            if getattr(self, name) < 1:
                raise InputError(f"{name}: expected 1 or more, got {getattr(self, name)}")

    def allows_all(self, seconds: float, k: int) -> bool:
        """Return whether all legs among k vertices are measured at once if that takes some time."""
        return seconds <= self.max_s_per_leg * k * (k - 1) / 2

    def allows_single(self, seconds: float) -> bool:
        """Return whether legs are measured one by one if each takes some time."""
        return seconds <= self.max_single_leg_s


@dataclass(frozen=True)
class LocalSearchPolicy:
    """Ruin and recreate over orders of clusters.

    Attributes
    ----------
    near_clusters
        Number of nearest clusters next to which a cluster may be inserted. More of them find a
        slightly better place in more time.
    ruined_neighbours
        Number of nearest clusters of a seed around which strings may be removed.
    first_temperature, last_temperature
        Temperatures of the acceptance, in mean legs of the tour. With a tenth of the default for
        the first, most starts end in the same poor tour, however many rounds they have.
    temperature_steps
        Number of temperatures from first to last if the number of rounds is limited.
    min_chunk_s
        CPU seconds below which the number of rounds between two checks of the clock is doubled.
    max_string_length
        Maximum number of clusters in one removed string (Christiaens & Vanden Berghe 2020).
    mean_removed
        Mean number of clusters removed in a round (same source).
    blink_rate
        Probability that a place of insertion is skipped (same source, section 3.3).
    """

    near_clusters: int = 12
    ruined_neighbours: int = 60
    first_temperature: float = 1.0
    last_temperature: float = 2e-2
    temperature_steps: int = 100
    min_chunk_s: float = 0.02
    max_string_length: int = 10
    mean_removed: int = 10
    blink_rate: float = 0.01

    def __post_init__(self) -> None:
        check_not_negative(self)
        check_shares(self, "blink_rate")
        for name in (
            "near_clusters",
            "ruined_neighbours",
            "temperature_steps",
            "max_string_length",
        ):
            if getattr(self, name) < 1:
                raise InputError(f"{name}: expected 1 or more, got {getattr(self, name)}")
        if not 0.0 < self.last_temperature <= self.first_temperature:
            raise InputError(
                "last_temperature: expected a positive number up to first_temperature, got "
                f"{self.last_temperature}"
            )


@dataclass(frozen=True)
class NeighbourhoodPolicy:
    """Vertices of each cluster that a search sees while there are too many for all.

    Attributes
    ----------
    searched_vertices
        Approximate number of vertices, shared among the clusters.
    min_per_cluster, max_per_cluster
        Minimum and maximum number of vertices of each cluster. Too few of each cost more length
        than a slower search.
    near_tour_ratio
        Number of vertices near the incumbent for each vertex that is near the base.
    """

    searched_vertices: int = 2400
    min_per_cluster: int = 3
    max_per_cluster: int = 12
    near_tour_ratio: int = 3

    def __post_init__(self) -> None:
        check_positive(self)

    def vertices_per_cluster(self, goals: int) -> int:
        """Return the number of vertices of each cluster that a search sees."""
        shared = self.searched_vertices // (goals + 1)
        return min(max(self.min_per_cluster, shared), self.max_per_cluster)


@dataclass(frozen=True)
class ProofSearchPolicy:
    """Local search in a solver that proves, and the core that is proven first.

    Attributes
    ----------
    first_tour_vertices
        Vertices of each cluster among which the first tour is searched for.
    max_whole_search
        Number of vertices, all measured, up to which a search sees all of them.
    max_searches
        Maximum number of searches near the incumbent in a row.
    max_vain_searches
        Searches without improvement after which they end.
    search_time_share
        Share of the time left that searches in a row may take.
    max_local_optima
        Maximum number of tours that searches ended in and that are kept, to be merged.
    core_vertices
        Approximate number of vertices of the core.
    min_core_per_cluster, max_core_per_cluster
        Minimum and maximum number of vertices of each cluster in the core.
    min_near_tour_per_cluster
        Number of vertices of each cluster in the core from which on it holds those near the
        incumbent. Smaller cores hold those near the base, whose cuts serve the proof over all
        vertices better.
    core_time_share
        Share of the time left that a proof over the core may take.
    min_core_ratio
        Number of vertices, as a multiple of the core's, above which the core is proven first. Below
        it the core costs more than it saves, and shows no bound meanwhile.
    min_core_ratio_many
        Value of `min_core_ratio` from `many_goals` goals on, where the core pays sooner.
    many_goals
        Number of goals from which on `min_core_ratio_many` holds.
    """

    first_tour_vertices: int = 3
    max_whole_search: int = 1200
    max_searches: int = 8
    max_vain_searches: int = 2
    search_time_share: float = 0.1
    max_local_optima: int = 8
    core_vertices: int = 800
    min_core_per_cluster: int = 3
    max_core_per_cluster: int = 12
    min_near_tour_per_cluster: int = 10
    core_time_share: float = 0.4
    min_core_ratio: float = 3.0
    min_core_ratio_many: float = 1.5
    many_goals: int = 100

    def __post_init__(self) -> None:
        check_not_negative(self)
        check_shares(self, "search_time_share", "core_time_share")

    def core_vertices_per_cluster(self, goals: int) -> int:
        """Return the number of vertices of each cluster in the core."""
        shared = self.core_vertices // (goals + 1)
        return min(max(self.min_core_per_cluster, shared), self.max_core_per_cluster)

    def core_ratio(self, goals: int) -> float:
        """Return the ratio of vertices to those of the core above which the core comes first."""
        return self.min_core_ratio_many if goals >= self.many_goals else self.min_core_ratio


@dataclass(frozen=True)
class WalkPolicy:
    """Bounds from ng-walks: prices, memory, and when they end.

    Attributes
    ----------
    first_step
        First step of the prices, as a share of the gap.
    step_decay
        Factor on the step after `patience` passes without a better bound.
    patience
        Passes without a better bound after which the step gets shorter.
    deflection
        Weight of the present walk in the direction of the step, from 0 to 1; the rest is that of
        the last direction.
    max_widened_labels
        Number of labels in a pass above which memories are not widened.
    remembered_goals
        Number of goals that each goal remembers at first, itself among them.
    stall_passes
        Passes that must together close the share `min_progress` of the gap, or eliminate that share
        of the states; otherwise the walks end.
    min_progress
        Share of the gap, or of the states, that counts as progress.
    max_kept_share
        Vertices without a state are removed when at most this share of all is left.
    max_table_cells
        Maximum number of (goal, goal, vertex) cells; 100 million take 0.8 GiB.
    threads
        Threads that the goals of a layer are shared among. Labels do not depend on it.
    block_rows
        Rows of the matrix that are processed at a time; more rows take more memory.
    """

    first_step: float = 0.5
    step_decay: float = 0.7
    patience: int = 5
    deflection: float = 0.5
    max_widened_labels: int = 2_000_000
    remembered_goals: int = 6
    stall_passes: int = 12
    min_progress: float = 0.03
    max_kept_share: float = 0.95
    max_table_cells: int = 100_000_000
    threads: int = 2
    block_rows: int = 512

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "step_decay", "deflection", "min_progress", "max_kept_share")


@dataclass(frozen=True)
class FilePolicy:
    """Size of the GTSPLIB files that are read.

    Attributes
    ----------
    max_vertices
        Maximum number of vertices; the costs of 20,000 take 3 GiB.
    bytes_per_leg
        Memory for each entry of the cost matrix while a file is read, bytes.
    """

    max_vertices: int = 20_000
    bytes_per_leg: float = 40.0

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class GtspPolicy:
    """Policy of the solvers of a generalised TSP.

    Attributes
    ----------
    costs
        How costs are measured and held.
    local_search
        Ruin and recreate.
    neighbourhood
        Vertices that a search sees.
    proof_search
        Searches of a solver that proves, and the core.
    walks
        Bounds from ng-walks.
    """

    costs: CostPolicy = CostPolicy()
    local_search: LocalSearchPolicy = LocalSearchPolicy()
    neighbourhood: NeighbourhoodPolicy = NeighbourhoodPolicy()
    proof_search: ProofSearchPolicy = ProofSearchPolicy()
    walks: WalkPolicy = WalkPolicy()
