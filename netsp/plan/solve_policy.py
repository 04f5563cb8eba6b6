"""Policy of `solve`: the solvers that `auto` chooses by size, and the policies of its parts."""

from __future__ import annotations

from dataclasses import dataclass, field

from netsp.base.number_ranges import check_not_negative, check_positive, check_shares
from netsp.gtsp.gtsp_policy import GtspPolicy
from netsp.gtsp.scheduler import SchedulerPolicy
from netsp.mip.mip_policy import MipPolicy
from netsp.plan.search_effort import SearchEffort


@dataclass(frozen=True)
class RoutePolicy:
    """Choice of the solver by size in `auto`, and division of its time.

    Attributes
    ----------
    max_proven_vertices
        Number of vertices up to which `mip` bounds a tour; the taut roadmap keeps as many unless it
        is asked for more.
    max_walk_goals
        Number of goals up to which walks come before cuts. With more goals, walks that remember
        them take longer than cuts.
    kept_vertices
        Approximate number of vertices, those of shortest tether, that are proven over if there are
        more than `max_proven_vertices` and few goals.
    first_tour_classes
        Number of classes per goal of a first tour if the roadmap left classes out. With all of
        them, whose words are long, a search would have little time.
    first_tour_time_share
        Share of the time for that tour.
    goal_bound_time_share
        Share of the time for a first bound from the goals.
    search_time_share
        Minimum share of the time for the search if goals have an order, where the bound is weak.
    cover_time_share
        Share of the time left for the bound of covers if no proof over all classes is tried.
    """

    max_proven_vertices: int = 22_000
    max_walk_goals: int = 24
    kept_vertices: int = 3000
    first_tour_classes: int = 3
    first_tour_time_share: float = 0.4
    goal_bound_time_share: float = 0.2
    search_time_share: float = 0.6
    cover_time_share: float = 0.8

    def __post_init__(self) -> None:
        check_not_negative(self)
        check_shares(
            self,
            "first_tour_time_share",
            "goal_bound_time_share",
            "search_time_share",
            "cover_time_share",
        )


@dataclass(frozen=True)
class SubsetPolicy:
    """Size of problems that are solved by dynamic programming over sets of goals.

    Attributes
    ----------
    max_sums
        Maximum number of sums; the default takes about a quarter of a second. With 0, no
        problem is solved this way.
    sums_per_call
        Sums that take as long as one call of NumPy; each set is extended by each goal in one call.
    max_vertices
        Maximum number of vertices, among which all legs are measured.
    s_per_sum
        Estimated time of a sum, s, for the scheduler.
    """

    s_per_sum: float = 5e-9
    max_sums: float = 5e7
    sums_per_call: int = 1500
    max_vertices: int = 1000

    def __post_init__(self) -> None:
        check_not_negative(self)


@dataclass(frozen=True)
class CarryPolicy:
    """Search for classes along good tours, where the roadmap left classes out.

    Attributes
    ----------
    time_share
        Share of the time for this search.
    near_goals
        Number of nearest goals to which the tether is carried from each class.
    rounds_per_goal
        Rounds of ruin and recreate for each goal in one search.
    max_rounds
        Maximum number of rounds in one search.
    first_classes
        Classes of shortest tether per goal that the search starts from.
    max_classes, max_classes_per_goal
        Number of classes, in all and for each goal, above which the search starts again from the
        first classes and those of the best tour.
    max_vain_searches
        Searches without improvement after which it ends, because the set of classes is infinite.
    """

    time_share: float = 0.5
    near_goals: int = 8
    rounds_per_goal: int = 60
    max_rounds: int = 4000
    first_classes: int = 2
    max_classes: int = 2000
    max_classes_per_goal: int = 40
    max_vain_searches: int = 4

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "time_share")


@dataclass(frozen=True)
class WarmStartPolicy:
    """Adaptation of the tour of an older version of a problem.

    Attributes
    ----------
    max_goal_move
        Distance up to which a goal without a name counts as the same goal, as a share of the
        problem's size.
    classes_per_goal
        Classes of shortest tether per goal that are tried where a class of the old tour is missing.
    """

    max_goal_move: float = 0.02
    classes_per_goal: int = 3

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class BaselessPolicy:
    """Search before the proofs from each vertex of the smallest cluster, if there is no base.

    Attributes
    ----------
    rounds_per_cluster
        Rounds of ruin and recreate for each cluster, shared among the vertices. A short tour found
        ahead of a proof saves most of its work.
    time_share
        Share of the time for these searches.
    """

    rounds_per_cluster: int = 2000
    time_share: float = 0.2

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "time_share")


@dataclass(frozen=True)
class TaskTimePolicy:
    """Estimated times of the tasks of the scheduler: an order of magnitude is enough.

    Attributes
    ----------
    s_per_round
        Time of a round of ruin and recreate, s.
    s_per_goal_pair
        Time of the bound over goals for each pair of goals, s.
    s_per_covered_pair
        Time of covers for each pair of goals, s.
    s_per_covered_class
        Additional time of covers for each vertex, s.
    further_searches
        Number of searches after the first in which a shorter tour is expected.
    s_per_label
        Time of walks for each vertex, divided by the fifth power of the number of goals, s: labels
        remember sets of goals, so their number grows faster than that of pairs.
    s_per_priced_leg
        Time of cutting planes for each pair of vertices, s.
    s_per_cut_pair
        Additional time of cutting planes for each pair of goals, s.
    min_core_ratio
        Ratio of all vertices to those of a core above which the core is a task.
    """

    s_per_round: float = 1e-3
    s_per_goal_pair: float = 1e-4
    s_per_covered_pair: float = 5e-3
    s_per_covered_class: float = 3e-4
    further_searches: float = 50.0
    s_per_label: float = 2.5e-10
    s_per_priced_leg: float = 5e-6
    s_per_cut_pair: float = 1.5e-4
    min_core_ratio: float = 2.0

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class SolvePolicy:
    """Policy of `solve` and of its solver `auto`.

    Attributes
    ----------
    routes
        Solver by size, and time of its parts.
    scheduler, task_times
        Slices of time for tasks that share it (`netsp.plan.scheduled`), and the estimated times of
        the tasks.
    subsets
        Dynamic programming over sets of goals.
    search_effort
        Rounds of ruin and recreate before a proof.
    mip
        Cutting planes, with the policies of costs, searches and walks (`gtsp`).
    carry
        Classes along good tours, where the roadmap left classes out.
    warm_start
        Warm starts from older versions of a problem.
    baseless
        Graphs without a base.
    drawing_time_share
        Share of the time kept for drawing the tour, if a roadmap was cut short.
    max_drawing_s
        Maximum time kept for drawing the tour, s.
    """

    routes: RoutePolicy = RoutePolicy()
    scheduler: SchedulerPolicy = SchedulerPolicy()
    task_times: TaskTimePolicy = TaskTimePolicy()
    subsets: SubsetPolicy = SubsetPolicy()
    search_effort: SearchEffort = field(default_factory=SearchEffort)
    mip: MipPolicy = field(default_factory=MipPolicy)
    carry: CarryPolicy = CarryPolicy()
    warm_start: WarmStartPolicy = WarmStartPolicy()
    baseless: BaselessPolicy = BaselessPolicy()
    drawing_time_share: float = 0.4
    max_drawing_s: float = 1.0

    def __post_init__(self) -> None:
        check_not_negative(self)
        check_shares(self, "drawing_time_share")

    @property
    def gtsp(self) -> GtspPolicy:
        """Policies of costs, searches and walks."""
        return self.mip.gtsp
