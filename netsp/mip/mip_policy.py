"""Policies of the mixed-integer program: the numbers that steer cuts, prices, LPs and covers."""

from __future__ import annotations

from dataclasses import dataclass, field

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_not_negative, check_positive, check_shares
from netsp.gtsp.dp.handover import Handover
from netsp.gtsp.gtsp_policy import GtspPolicy

CUT_FAMILIES = ("goals", "branches", "minimum cuts", "parity", "blossoms", "combs")
"""Format: names of the families of cuts that a policy can leave out. Subtour cuts of components are
never left out, because a point without them may be no tour."""


@dataclass(frozen=True)
class CutPolicy:
    """Policy of cuts: which violated inequalities come into the LP, and when they leave it.

    Attributes
    ----------
    families
        Names of the families of cuts that are separated, of `CUT_FAMILIES`.
    min_subtour_violation
        Minimum violation of a subtour cut; weaker cuts add a row and hardly move the LP.
    max_subtour_cuts
        Maximum number of cuts per point from branches of the cover and from minimum cuts among
        vertices. Cuts of components and of goals are not counted.
    min_comb_violation
        Minimum violation of a 2-matching inequality or comb.
    fractional_levels
        The flow between two clusters counts as fractional if it lies between a level and one less
        that level. Each level gives other handles.
    shrunk_sizes
        Maximum numbers of clusters in a set that is shrunk before combs are searched for; all are
        tried.
    max_combs
        Maximum number of combs per point.
    min_tooth_flow
        Minimum flow between two sets that are to be a tooth.
    min_parity_violation
        Minimum violation of a parity cut.
    max_parity_cuts
        Maximum number of parity cuts per point.
    max_cuts_before_pairs
        Pairs of barriers are searched only if single barriers gave fewer parity cuts than this.
    max_barrier_sets
        Maximum number of barriers, or of pairs, that are searched for parity cuts.
    max_parity_passes
        Maximum number of passes over all clusters when sides of a parity cut are improved.
    incumbent_weight
        Weight of the incumbent in the point that is separated first, from 0 to 1. Cuts that are
        violated nearer to the incumbent go deeper (in-out separation, Ben-Ameur & Neto 2007).
    max_idle_rounds
        Rounds without a price after which a cut leaves the LP; separation finds it again if needed.
    slack_rounds
        Number of idle rounds for which a round with slack counts. A cut that is tight without a
        price may only lie where the LP has no legs.
    max_kept_share
        Idle cuts are removed only if at most this share of all cuts remains.
    """

    families: tuple[str, ...] = CUT_FAMILIES
    min_subtour_violation: float = 1e-4
    max_subtour_cuts: int = 60
    min_comb_violation: float = 0.02
    fractional_levels: tuple[float, ...] = (1e-6, 0.05, 0.15, 0.3)
    shrunk_sizes: tuple[int, ...] = (2, 3, 4, 6, 9, 14, 25)
    max_combs: int = 40
    min_tooth_flow: float = 0.3
    min_parity_violation: float = 0.02
    max_parity_cuts: int = 40
    max_cuts_before_pairs: int = 4
    max_barrier_sets: int = 500
    max_parity_passes: int = 4
    incumbent_weight: float = 0.6
    max_idle_rounds: int = 8
    slack_rounds: int = 2
    max_kept_share: float = 0.9

    def __post_init__(self) -> None:
        check_not_negative(self)
        check_shares(self, "incumbent_weight", "max_kept_share")
        # lists, as study files have them, or one name, as the command line has it
        families = (self.families,) if isinstance(self.families, str) else tuple(self.families)
        object.__setattr__(self, "families", families)
        for family in self.families:
            if family not in CUT_FAMILIES:
                known = ", ".join(CUT_FAMILIES)
                raise InputError(f"families: unknown {family!r}; expected some of {known}")
        object.__setattr__(self, "fractional_levels", tuple(self.fractional_levels))
        object.__setattr__(self, "shrunk_sizes", tuple(self.shrunk_sizes))


@dataclass(frozen=True)
class PricingPolicy:
    """Policy of pricing: which legs come into the LP, and which are measured.

    Attributes
    ----------
    nearest_legs
        Nearest legs of each vertex in the first LP.
    max_new_legs_per_vertex
        Maximum number of legs that one pricing pass adds at a vertex.
    max_new_legs
        Maximum number of legs that one pricing pass adds in all.
    candidates_per_vertex
        Legs of most negative reduced cost that a pricing pass keeps for each vertex.
    max_gap_ratio
        Reduced-cost fixing is skipped when the gap of this pass's bound exceeds the best gap by
        this factor: it would hardly fix a leg.
    max_measured_legs
        All remaining legs are measured once there are at most this many, which takes a second or
        two. A bound over estimated legs misses what the estimates miss.
    min_measured_use
        Minimum value of a leg in the LP's point for which it is measured.
    rows_per_task
        Rows of the cost matrix that a thread prices at a time.
    mask_rows
        Rows of a mask of legs that are unpacked at a time; more rows take more memory.
    vertices_per_check
        Vertices that the search for paths from the base settles between two checks of the limits.
    """

    nearest_legs: int = 4
    max_new_legs_per_vertex: int = 3
    max_new_legs: int = 3000
    candidates_per_vertex: int = 8
    max_gap_ratio: float = 1.5
    max_measured_legs: int = 1_000_000
    min_measured_use: float = 0.05
    rows_per_task: int = 256
    mask_rows: int = 512
    vertices_per_check: int = 500

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class SchedulePolicy:
    """Schedule of the root: when it prices all legs, and when it ends.

    Attributes
    ----------
    min_interval
        Rounds of cuts between two pricing passes, unless no cut is found.
    max_interval
        Maximum interval. It doubles after each pass that adds few legs and hardly raises the bound.
    min_gap_closed
        Share of the gap that a pass must close to count as progress.
    patience
        Pricing passes without progress after which the root ends.
    estimated_patience
        Value of `patience` while legs are only estimated: measuring and a second root come next, so
        the root ends early.
    min_new_leg_share
        Share of the LP's legs that a pass must add not to be idle.
    min_bound_rise
        Relative rise of the bound, or of the LP's optimum, from which on idle cuts are removed.
    settle_share
        While the LP's optimum is above the bound by more than this share of the gap, the root
        prices and adds no cuts. It holds in large LPs only (`LpPolicy.many_vertices`).
    settled_share
        Share of the gap below which the root then searches for cuts again.
    """

    min_interval: int = 2
    max_interval: int = 32
    min_gap_closed: float = 0.02
    patience: int = 60
    estimated_patience: int = 15
    min_new_leg_share: float = 0.002
    min_bound_rise: float = 1e-6
    settle_share: float = 0.3
    settled_share: float = 0.1

    def __post_init__(self) -> None:
        check_not_negative(self)


@dataclass(frozen=True)
class LpPolicy:
    """Size of the LP, and how it is solved.

    Attributes
    ----------
    max_dead_share
        Legs that are fixed out, or far from being used, leave the LP when they are more than this
        share of it.
    max_vertex_share
        Vertices are removed when at most this share of them is left.
    many_vertices
        Number of vertices above which the LP is large: `drop_interval` and
        `SchedulePolicy.settle_share` apply. There the first prices bring in far more legs than
        remain useful, and LPs take all the time.
    drop_interval
        Pricing passes between two removals of legs of large reduced cost.
    max_reduced_cost
        Largest reduced cost of a leg that stays, as a share of the incumbent's length.
    max_block_entries
        Largest number of coefficients that are held at once while rows or columns are added.
    simplex_steps_per_row
        Maximum number of simplex steps from a basis, per row and column. Then the LP is solved from
        scratch.
    fresh_step_factor
        Maximum number of simplex steps from scratch, as a multiple of the steps from a basis. Then
        the LP is solved with looser tolerances, on which no bound rests.
    cbc_grace_s
        Time past its own limit after which the process of CBC is ended, s.
    cbc_check_interval_s
        Time between two checks of the process of CBC, s.
    """

    max_dead_share: float = 0.3
    max_vertex_share: float = 0.85
    many_vertices: int = 2000
    drop_interval: int = 4
    max_reduced_cost: float = 0.01
    max_block_entries: int = 4_000_000
    simplex_steps_per_row: int = 2
    fresh_step_factor: int = 4
    cbc_grace_s: float = 1.0
    cbc_check_interval_s: float = 0.02

    def __post_init__(self) -> None:
        check_not_negative(self)
        check_shares(self, "max_dead_share", "max_vertex_share")


@dataclass(frozen=True)
class BranchingPolicy:
    """Policy of branch and cut: how nodes are chosen and processed.

    Attributes
    ----------
    min_fractionality
        Minimum distance from a whole number of a value that is branched on.
    pair_candidates
        Pairs of clusters that are probed at a node.
    vertex_candidates
        Vertices that are probed at a node.
    probe_steps
        Simplex steps of a probe (strong branching).
    max_cut_rounds
        Maximum number of rounds of cuts at a node, unless its point is integer.
    min_gap_closed
        Share of the gap that a round of cuts must close for another to follow.
    rounding_interval
        Nodes between two points that are rounded to a tour.
    """

    min_fractionality: float = 0.02
    pair_candidates: int = 8
    vertex_candidates: int = 6
    probe_steps: int = 60
    max_cut_rounds: int = 12
    min_gap_closed: float = 0.03
    rounding_interval: int = 25

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class CoverPolicy:
    """Covers between the goals and all classes: how many, how large, over which barriers.

    Attributes
    ----------
    min_classes
        Number of classes above which covers are worth their time.
    max_growth
        Maximum ratio of the cells of a cover to those of the one below, unless one barrier alone
        adds more.
    coarse_covers
        Covers over shortest paths before those over the classes that are left.
    max_cells
        Maximum number of cells.
    max_barriers
        Maximum number of barriers by whose sides cells differ; the parities of 62 or fewer fit
        into the bits of an integer.
    patience
        Pricing passes without progress after which the next cover is tried.
    promise_decay
        Factor on the promise that a barrier had at the cover below: the LP's point goes around it
        differently in every cover.
    size_exponent
        Promises are divided by the number of new cells to this power: an LP over twice the cells
        takes far more than twice as long.
    min_promise
        Minimum promise of a barrier, as a share of the gap.
    max_side_passes
        Maximum number of passes over all cells when their sides are improved.
    path_time_share
        Share of the time left that finding the shortest paths between goals may take.
    classes_per_cell
        Classes of shortest tether in each visited cell that a search for a better tour adds.
    """

    min_classes: int = 3000
    max_growth: float = 1.3
    coarse_covers: int = 3
    max_cells: int = 6000
    max_barriers: int = 60
    patience: int = 4
    promise_decay: float = 0.5
    size_exponent: float = 2.5
    min_promise: float = 1e-4
    max_side_passes: int = 20
    path_time_share: float = 0.3
    classes_per_cell: int = 2

    def __post_init__(self) -> None:
        check_not_negative(self)
        check_shares(self, "promise_decay", "path_time_share")
        if self.max_barriers > 62:
            raise InputError(f"max_barriers: expected at most 62, got {self.max_barriers}")


@dataclass(frozen=True)
class GoalBoundPolicy:
    """Bound from the goals alone: 1-trees, then a proof over goals.

    Attributes
    ----------
    max_trees
        Maximum number of 1-trees.
    first_step
        First step of the ascent, as a multiple of Polyak's.
    step_decay
        Factor on the step after `patience` trees without a better bound.
    patience
        Trees without a better bound after which the step gets shorter.
    tour_factor
        Estimate of the tour's length for Polyak's step, as a multiple of the best bound.
    untimed_legs
        Legs between goals that 1-trees examine when no time is left, besides those of the first
        tree; some hundredths of a second.
    max_programs
        Maximum number of programs of the proof over goals. With hundreds of goals it would
        otherwise take as long as the proof over classes.
    max_programs_before_proof
        Value of `max_programs` if the proof over all classes follows, which soon makes up for a
        weaker bound.
    max_proven_goals
        Number of goals below which the proof over goals is always made, since it takes a second.
    """

    max_trees: int = 60
    first_step: float = 1.0
    step_decay: float = 0.7
    patience: int = 4
    tour_factor: float = 1.1
    untimed_legs: int = 500_000
    max_programs: int = 300
    max_programs_before_proof: int = 60
    max_proven_goals: int = 60

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "step_decay")


@dataclass(frozen=True)
class MergingPolicy:
    """Policy of tour merging.

    Attributes
    ----------
    min_goals
        Minimum number of goals. Searches over fewer goals end in the shortest tour through their
        classes, so that merging finds nothing.
    searches
        Searches from scratch whose tours are merged; more of them find the same tour.
    search_time_share
        Share of the time left that these searches may take.
    """

    min_goals: int = 50
    searches: int = 8
    search_time_share: float = 0.75

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "search_time_share")


@dataclass(frozen=True)
class TimePolicy:
    """Time of the bounds that come before the proof over all classes.

    Attributes
    ----------
    goal_share
        Share of the time left for the bound from the goals alone, and at least for covers.
    cover_share
        Maximum share of the time left for covers.
    cover_classes
        Number of classes from which on covers get `cover_share`; with fewer classes their share
        falls with the square of the number, as the sizes of the matrices do.
    min_sparse_share
        Minimum share for covers where costs are sparse and goals are few (`max_sparse_goals`).
    sparse_classes
        Number of classes from which on covers get `cover_share` there; with fewer it falls with the
        cube, because programs over sparse costs are quick while few legs are left.
    max_sparse_goals
        Number of goals above which `goal_share` and `cover_classes` hold for sparse costs, too:
        there the program over all classes closes little of the gap.
    min_sparse_s
        Minimum time for covers where costs are sparse, s, but at most half of the time left.
        Nothing is known there before the first cover is proven.
    """

    goal_share: float = 0.1
    cover_share: float = 0.8
    cover_classes: int = 17_000
    min_sparse_share: float = 0.05
    sparse_classes: int = 20_000
    max_sparse_goals: int = 150
    min_sparse_s: float = 5.0

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "goal_share", "cover_share", "min_sparse_share")


@dataclass(frozen=True)
class MipPolicy:
    """Policy of the solver `mip`: what it does by size, and the policies of its parts.

    Attributes
    ----------
    many_goals
        Number of goals from which on the relaxation over goals is solved first; its cuts seed the
        root LP. With fewer goals the relaxation over classes is quicker.
    large_goal_count
        Number of goals above which covers get all the time they may, and a large gap after them
        ends the proof (`max_gap_after_covers`).
    max_gap_after_covers
        Relative gap after covers above which the time left goes to searches, with more goals than
        `large_goal_count`: the program over all classes would close almost nothing.
    core_classes
        Number of classes above which a first bound, and a proof over a core of the classes, come
        before the proof over all classes, even if walks are wanted.
    handover
        Sizes of the rest of a proof at which cuts take over from walks.
    search_gap_ratio
        Share of the last gap at which the classes that the LP visits are searched again.
    max_branching_legs
        Number of legs left above which neither branching nor an integer program would end.
    max_searches
        Maximum number of searches for a tour that fixes legs out, while more are left.
    min_integer_s_per_leg
        Time left per leg below which the integer program is not begun, s: its presolve would take
        that long, and cannot be stopped.
    time
        Time of the bounds before the proof.
    cuts, pricing, schedule, lp, branching, covers, goals, merging
        Policies of the parts.
    gtsp
        Policy of costs, searches and walks (`SearchingRun.gtsp_policy`).
    """

    many_goals: int = 100
    large_goal_count: int = 300
    max_gap_after_covers: float = 0.02
    core_classes: int = 3000
    handover: Handover = field(
        default_factory=lambda: Handover(
            max_legs=600, max_legs_of_slow_walks=10_000, max_labels=25_000
        )
    )
    search_gap_ratio: float = 0.5
    max_branching_legs: int = 30_000
    max_searches: int = 6
    min_integer_s_per_leg: float = 3e-4
    time: TimePolicy = TimePolicy()
    cuts: CutPolicy = CutPolicy()
    pricing: PricingPolicy = PricingPolicy()
    schedule: SchedulePolicy = SchedulePolicy()
    lp: LpPolicy = LpPolicy()
    branching: BranchingPolicy = BranchingPolicy()
    covers: CoverPolicy = CoverPolicy()
    goals: GoalBoundPolicy = GoalBoundPolicy()
    merging: MergingPolicy = MergingPolicy()
    gtsp: GtspPolicy = field(default_factory=GtspPolicy)

    def __post_init__(self) -> None:
        check_not_negative(self)
