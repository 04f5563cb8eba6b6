"""Policy of planning in space: effort, time and limits of every stage of `solve_mission`."""

from __future__ import annotations

from dataclasses import dataclass, fields

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_not_negative, check_positive


def _check_shares(policy: object, *names: str) -> None:
    """Raise InputError if a field that is named, or ends in `_share`, is not from 0 to 1."""
    shares = [f.name for f in fields(policy) if f.name.endswith("_share")]  # type: ignore[arg-type]
    for name in (*shares, *names):
        value = getattr(policy, name)
        if not 0.0 <= value <= 1.0:
            raise InputError(f"{name}: expected a number from 0 to 1, got {value:g}")


def _check_minimum(policy: object, **minima: float) -> None:
    """Raise InputError if a field is less than its minimum."""
    for name, minimum in minima.items():
        value = getattr(policy, name)
        if not value >= minimum:
            raise InputError(f"{name}: {value}; expected {minimum:g} or more")


@dataclass(frozen=True)
class WordPolicy:
    """Size and accuracy of the cell complex that gives paths their words.

    Attributes
    ----------
    min_room_ratio
        Minimum distance of the centre of a free cell from solids, in cells. A smaller ratio keeps
        narrower passages open, and leaves more edges to check.
    max_cells
        Maximum number of cells; six million take about 0.4 GiB with their labels.
    max_halvings
        How often an edge or a square is divided to prove that it is free. Each halving finds
        tighter passages, and takes up to four times as long where they stay closed.
    max_generators
        Maximum number of generators before relations eliminate any; scenes with more are refused.
    max_hold_cells
        Maximum distance, in cells along an axis, of the cell that a point holds on to.
    far_hold_cells
        Distance, in cells along an axis, from which on a nearer cell is searched for.
    """

    min_room_ratio: float = 0.3
    max_cells: int = 6_000_000
    max_halvings: int = 4
    max_generators: int = 2_000
    max_hold_cells: int = 3
    far_hold_cells: float = 1.5

    def __post_init__(self) -> None:
        check_not_negative(self)
        _check_minimum(self, max_cells=1, max_hold_cells=1)


@dataclass(frozen=True)
class GapPolicy:
    """Effort of the search for gaps that a grid does not show, and of the choice of its cell size.

    Attributes
    ----------
    max_points
        Maximum number of fine points; the more cells may hold a gap, the fewer points each gets.
    finest
        Maximum number of fine points along a side of a cell.
    around
        Cells around a gap in which its two sides may be connected; a gap with a connection that
        close is ignored, because it saves no distance.
    max_gaps
        Maximum number of gaps returned; the widest are kept.
    max_pairs
        Maximum number of pairs of free cells whose connection is checked.
    max_cells
        Maximum number of cells of a finer grid; the time to plan grows in proportion.
    smallest
        Smallest finer cell size, as a share of the cell size before.
    step
        Ratio of successive cell sizes that are tried.
    time_share
        Share of the remaining time for the search, more than 0 and at most 1.
    """

    max_points: int = 4_000_000
    finest: int = 8
    around: int = 3
    max_gaps: int = 5
    max_pairs: int = 2_000
    max_cells: int = 1_000_000
    smallest: float = 0.25
    step: float = 0.985
    time_share: float = 0.5

    def __post_init__(self) -> None:
        _check_minimum(self, max_points=1, finest=1, around=1, max_gaps=1, max_pairs=1, max_cells=1)
        for name in ("smallest", "step"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise InputError(f"{name}: {getattr(self, name)}; expected between 0 and 1")
        if not 0.0 < self.time_share <= 1.0:
            raise InputError(f"time_share: {self.time_share}; expected more than 0 and at most 1")


@dataclass(frozen=True)
class OrderPolicy:
    """Effort for tours in the order of the file and in short orders.

    Attributes
    ----------
    blocked_ratio
        Estimated length of a leg whose ends do not see one another, as a multiple of the straight
        distance; at least 1.
    max_rounds
        Maximum number of orders; at least 1.
    max_sighted
        Maximum number of places whose lines of sight are tested; at least 0. With more places,
        straight distances are the estimates.
    max_solve_s
        Seconds for the solver in each round; more than 0.
    time_share
        Share of the remaining time for all rounds, from 0 to 1.
    max_paths_per_waypoint
        Maximum number of paths of the planner per waypoint; a planner that needs more makes no
        progress.
    """

    blocked_ratio: float = 1.5
    max_rounds: int = 4
    max_sighted: int = 300
    max_solve_s: float = 2.0
    time_share: float = 0.2
    max_paths_per_waypoint: int = 8

    def __post_init__(self) -> None:
        _check_minimum(
            self, blocked_ratio=1.0, max_rounds=1, max_sighted=0, max_paths_per_waypoint=1
        )
        if not self.max_solve_s > 0.0:
            raise InputError(f"max_solve_s: {self.max_solve_s}; expected more than 0")
        _check_shares(self)


@dataclass(frozen=True)
class PlanePolicy:
    """Budget of the tours of the plane among upright prisms.

    Attributes
    ----------
    max_classes
        Maximum number of augmented goals, at least 1; if there are more, the solvers search for a
        tour without a list of them.
    max_s
        Seconds for each tour, more than 0; the limit also holds for runs without a time limit.
    time_share
        Share of the remaining time for all tours of the plane, from 0 to 1.
    corner_segments
        Segments of a quarter circle around the corners of a prism that grows by more than the
        others. More segments follow the circle more closely, and make more corners.
    tether_margin
        Share of the tether that tours of the plane leave over, because a tether in space is
        measured as a polyline; from 0 to 1.
    """

    max_classes: int = 2000
    max_s: float = 15.0
    time_share: float = 0.6
    corner_segments: int = 4
    tether_margin: float = 1e-5

    def __post_init__(self) -> None:
        if self.max_classes < 1:
            raise InputError(f"max_classes: expected 1 or more, got {self.max_classes}")
        if not self.max_s > 0.0:
            raise InputError(f"max_s: expected more than 0, got {self.max_s:g}")
        _check_minimum(self, corner_segments=1)
        _check_shares(self, "tether_margin")


@dataclass(frozen=True)
class PotentialPolicy:
    """Effort of the lower bound on the length of one leg.

    Attributes
    ----------
    min_cells
        Number of cells of the first grid of a leg; more cells make a stronger bound, and take about
        5 µs of CPU each.
    max_cells
        Number of cells of the finest grid of a leg; a cell takes 40 bytes.
    growth
        Ratio of the numbers of cells of two successive grids; 8 halves the size of a cell.
    halvings
        How often a cell is divided if its middle does not decide whether it is blocked.
    rounds
        How often cells with too steep a slope are slowed before the remaining excess is lowered.
    bucket_cells
        Width of a bucket in the queue of fast marching, in cells; narrower buckets order corners
        better, and take more memory.
    """

    min_cells: int = 15_000
    max_cells: int = 2_000_000
    growth: int = 8
    halvings: int = 3
    rounds: int = 5
    bucket_cells: float = 0.25

    def __post_init__(self) -> None:
        check_not_negative(self)
        _check_minimum(self, min_cells=64, max_cells=self.min_cells, growth=2, halvings=0, rounds=1)
        if not self.bucket_cells > 0.0:
            raise InputError(f"bucket_cells: {self.bucket_cells}; expected more than 0")


@dataclass(frozen=True)
class EdgePolicy:
    """Effort of the lower bound on the length of one leg around edges of polytopes.

    Attributes
    ----------
    sides
        Number of sides of the polygons that stand for circles, a multiple of 4. More sides make a
        stronger bound, and take more time: with n sides, a path around a circle loses a share of
        1.6 / n² of its length there.
    max_edges
        Maximum number of edges; polytopes that are farther from a leg are left out.
    max_pieces
        Maximum number of pieces of edges; about the square of it in pairs are looked at, of eight
        bytes each.
    max_rounds
        Maximum number of searches for a shortest path over pieces; after each, the pieces on the
        path are halved.
    min_piece
        Length of a piece that is not halved any more, metres.
    tolerance
        Relative gap between the bound and the path on its pieces at which the bound is final.
    """

    sides: int = 12
    max_edges: int = 800
    max_pieces: int = 2000
    max_rounds: int = 200
    min_piece: float = 2e-3
    tolerance: float = 5e-4

    def __post_init__(self) -> None:
        check_not_negative(self)
        _check_minimum(self, sides=4, max_edges=1, max_pieces=2, max_rounds=1)
        if self.sides % 4:
            raise InputError(f"sides: {self.sides}; expected a multiple of 4")
        for name in ("min_piece", "tolerance"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name}: {getattr(self, name)}; expected more than 0")


@dataclass(frozen=True)
class BoundPolicy:
    """Time and accuracy of a bound on all tours.

    Attributes
    ----------
    upright_share
        Share of the remaining time for the bound among upright solids, from 0 to 1.
    max_classes
        Maximum number of augmented goals, at least 1, for which the robot's clearance is in the
        bound among upright solids; the costs of their legs take eight bytes for each pair.
    thick_share
        Share of that time for all obstacles or, if they have too many classes, the thickest, from 0
        to 1.
    few_share
        Share of the rest of that time for few obstacles around which the shortest tours are wound,
        from 0 to 1; what is then left is for the robot's clearance from these.
    max_obstacles_added
        Maximum number of obstacles added to few at a time, at least 1.
    max_detour_ratio
        Longest path considered where no path is known, as a multiple of the straight distance;
        more than 1.
    max_leg_gap
        Relative gap between the bound of a leg and its known length at which the bound is final,
        from 0 to 1.
    min_solve_s
        Seconds for the solver if the time is up; more than 0, so that there is always a bound.
    cell_s
        Expected CPU seconds per cell of a potential; a grid that would exceed the remaining time is
        skipped. At least 0.
    """

    upright_share: float = 0.4
    max_classes: int = 4000
    thick_share: float = 0.2
    few_share: float = 0.85
    max_obstacles_added: int = 2
    max_detour_ratio: float = 2.2
    max_leg_gap: float = 2e-3
    min_solve_s: float = 0.3
    cell_s: float = 8e-6

    def __post_init__(self) -> None:
        _check_shares(self, "max_leg_gap")
        if not self.max_detour_ratio > 1.0:
            raise InputError(f"max_detour_ratio: {self.max_detour_ratio}; expected more than 1")
        if not self.min_solve_s > 0.0:
            raise InputError(f"min_solve_s: {self.min_solve_s}; expected more than 0")
        _check_minimum(self, cell_s=0.0, max_classes=1, max_obstacles_added=1)


@dataclass(frozen=True)
class ClassPolicy:
    """Sizes and accuracy of a bound on all tours over classes.

    Attributes
    ----------
    share
        Share of the remaining time for this bound, from 0 to 1.
    max_raise_ratio
        Largest raise of a bound, as a share of it; more than 0.
    max_halvings
        How often the raise is halved for the first attempt. Each later attempt doubles it.
    max_loops
        Maximum number of loops that are counted; a few more may be added in the last round.
    max_new_loops
        Maximum number of loops that are added because a tour winds around them at its end.
    max_states
        Maximum number of states of a travel graph. More states allow a higher bound and take more
        time.
    max_leg_windings, max_tether_windings
        Maximum number of windings of a leg, and of a tether. Each nearby bar triples the number of
        windings to look at.
    tolerance
        Amount by which the bound on a detour may be less than it could be, metres; more than 0.
    max_pieces
        Number of pieces of a bar after which the bound on a detour proven so far is taken.
    sagitta_share
        Largest distance between a chord of a ring and its arc, as a share of the radius about the
        arc; more than 0. Shorter chords weaken the bound less and take more time.
    min_loop_depths
        A joint of two bars is left out if it closes a loop no longer than this multiple of its
        depth, which encloses no passage. The bound holds without any joint.
    max_segments
        Number of segments of bars and rings from which on no loops are searched for, because the
        search would take too long.
    hub_samples
        Number of points of a bar at which its depth in a box or half-space is measured.
    max_tips
        Number of cones tried for each loop. Crossings with a cone may be uncertain by rounding; a
        loop without a certain cone is left out.
    seed
        Seed of the tips of cones, and of the moves of cores by which symmetric scenes become
        generic.
    """

    share: float = 0.5
    max_raise_ratio: float = 0.3
    max_halvings: int = 6
    max_loops: int = 8
    max_new_loops: int = 2
    max_states: int = 2000
    max_leg_windings: int = 243
    max_tether_windings: int = 2187
    tolerance: float = 2e-3
    max_pieces: int = 20_000
    sagitta_share: float = 0.02
    min_loop_depths: float = 8.0
    max_segments: int = 1500
    hub_samples: int = 33
    max_tips: int = 20
    seed: int = 0

    def __post_init__(self) -> None:
        _check_shares(self, "share")
        _check_minimum(
            self,
            max_halvings=0,
            max_states=1,
            max_leg_windings=1,
            max_tether_windings=1,
            max_pieces=1,
            min_loop_depths=0.0,
            max_segments=1,
            hub_samples=2,
            max_tips=1,
            seed=0,
        )
        if not self.max_raise_ratio > 0.0:
            raise InputError(f"max_raise_ratio: {self.max_raise_ratio}; expected more than 0")
        for name in ("tolerance", "sagitta_share"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name}: {getattr(self, name)}; expected more than 0")


@dataclass(frozen=True)
class StateEffort:
    """Numbers of states, paths and detours per waypoint or leg.

    Attributes
    ----------
    words
        Shortest words of a waypoint that become its first states.
    states
        Maximum number of states of a waypoint in each successive stage of growth; later stages
        start only if there is time.
    paths
        Maximum number of classes of paths between two waypoints.
    max_path_ratio
        Longest path between two waypoints, as a multiple of their distance; for paths on other
        sides of bodies with free ends, of their shortest path.
    detours
        Excess lengths of detours, as shares of the leg.
    detour_directions
        Number of directions of detours, evenly spaced around a leg.
    detour_tethers
        Maximum number of tethers kept after each leg of an order that is driven with detours.
    """

    words: int
    states: tuple[int, ...]
    paths: int
    max_path_ratio: float
    detours: tuple[float, ...]
    detour_directions: int
    detour_tethers: int

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class StatePolicy:
    """Effort of the search for states of the tether, and for legs between them.

    Attributes
    ----------
    few_waypoints, many_waypoints
        Numbers of waypoints up to which the effort per waypoint is `thorough` or
        `balanced`; with more, it is `quick`. A search then takes about a minute on two cores.
    thorough, balanced, quick
        Effort per waypoint. Around a row of piles, a path is twice as long as the distance, so few
        waypoints allow longer paths.
    n_neighbours
        Number of nearest waypoints to which legs of a waypoint are searched for.
    max_robot_ratio
        Longest path of the robot from the start to a waypoint, as a multiple of the longest tether.
    max_pull_rounds
        Maximum number of iterations that pull a tether taut.
    tree_trade_offs
        Weights of the distance from the start in the trees of legs, one tree for each: 0 grows the
        tree of the shortest legs (Prim), larger weights approach the tree of the shortest paths
        from the start (Dijkstra).
    max_surrounding
        Number of new states around a tour from which on the graph is solved before more are added.
        Each takes about 0.5 ms.
    max_with_surrounding
        Number of states of all places from which on none are added around tours; the solver needs
        eight bytes for each pair.
    """

    few_waypoints: int = 24
    many_waypoints: int = 100
    thorough: StateEffort = StateEffort(
        words=5,
        states=(7, 14, 28),
        paths=6,
        max_path_ratio=2.2,
        detours=(0.02, 0.06, 0.15, 0.35),
        detour_directions=8,
        detour_tethers=8,
    )
    balanced: StateEffort = StateEffort(
        words=4,
        states=(5, 10, 16, 32),
        paths=4,
        max_path_ratio=1.5,
        detours=(0.02, 0.1),
        detour_directions=6,
        detour_tethers=12,
    )
    quick: StateEffort = StateEffort(
        words=3,
        states=(5, 10),
        paths=4,
        max_path_ratio=1.5,
        detours=(0.02, 0.1),
        detour_directions=6,
        detour_tethers=4,
    )
    n_neighbours: int = 10
    max_robot_ratio: float = 2.0
    max_pull_rounds: int = 300
    tree_trade_offs: tuple[float, ...] = (0.0, 0.05, 0.15, 0.4)
    max_surrounding: int = 1500
    max_with_surrounding: int = 5000

    def __post_init__(self) -> None:
        check_positive(self)

    def effort(self, n_waypoints: int) -> StateEffort:
        """Return the effort for a number of waypoints."""
        if n_waypoints <= self.few_waypoints:
            return self.thorough
        return self.balanced if n_waypoints <= self.many_waypoints else self.quick


@dataclass(frozen=True)
class StageTimePolicy:
    """Division of the time of a search for states and legs. Each share is one of the time left.

    Attributes
    ----------
    first_states_share
        Share for the first states, and again for states where the robot has more room.
    path_search_share
        Share for the search for paths between waypoints in all classes.
    tether_path_share
        Share for paths along two tethers, after the search for paths has used its share.
    tree_share
        Share for driving the tether along trees of legs, and again for the legs between the
        states found there.
    home_path_share
        Share for the paths from the start to new states.
    taut_share
        Share for tours along taut paths; the rest is for tours with detours.
    growth_share
        Share for each stage of growth of states and legs.
    solve_share
        Share for the solver in the last stage of growth.
    early_solve_share
        Share for the solver in earlier stages; its tour is the warm start of the next one.
    surround_share
        Share for the solver of a graph with states around a tour.
    min_growth_s, min_solve_s
        Seconds for legs and for the solver if the time is up. Without them there would be no tour,
        or only one through the start.
    max_solves
        Maximum number of times that the graph is solved, each time without the legs at fault in
        the tour before. Applies only if the time is up.
    """

    first_states_share: float = 0.3
    path_search_share: float = 0.3
    tether_path_share: float = 0.3
    tree_share: float = 0.3
    home_path_share: float = 0.3
    taut_share: float = 0.6
    growth_share: float = 0.5
    solve_share: float = 0.5
    early_solve_share: float = 0.1
    surround_share: float = 0.06
    min_growth_s: float = 1.0
    min_solve_s: float = 0.5
    max_solves: int = 20

    def __post_init__(self) -> None:
        check_not_negative(self)
        _check_shares(self)


@dataclass(frozen=True)
class DetourPolicy:
    """Effort for paths around bodies with free ends, and for tours with detours.

    Attributes
    ----------
    n_bend_directions
        Number of directions in which a path is bent to pass bodies on their other sides.
    bend_shares
        Offsets of bent paths, as shares of the largest that the length allows.
    max_bent_paths
        Maximum number of paths kept that bending finds between two waypoints, the shortest.
    n_sight_lines
        Number of places along a path from which a bent path is looked at. A bent path that all of
        them see is the same path once it is pulled taut.
    n_start_paths
        Maximum number of paths from the start to a place, along tethers of its states.
    piece_lengths
        Numbers of visits in a piece that is moved elsewhere in the order.
    max_orders
        Maximum number of orders that are driven.
    order_share
        Share of the remaining time for the order without a tether, and again for the lines of
        sight between places far apart.
    position_error
        Error of the robot's position at the bends of a path, metres. A tether must come to hang
        alike with the bends moved by this distance to either side.
    drive_steps
        Steps of the robot in which a tether that slips off something must come to hang alike,
        metres. In fine steps a tether may stay on what it slips off in coarse ones.
    long_leg
        Length of a leg from which on the steps grow in proportion, metres.
    """

    n_bend_directions: int = 12
    bend_shares: tuple[float, ...] = (0.35, 0.8)
    max_bent_paths: int = 4
    n_sight_lines: int = 6
    n_start_paths: int = 4
    piece_lengths: tuple[int, ...] = (1, 2, 3, 4, 6, 8)
    max_orders: int = 400
    order_share: float = 0.2
    position_error: float = 0.15
    drive_steps: tuple[float, ...] = (0.03, 0.02, 0.01)
    long_leg: float = 2.0

    def __post_init__(self) -> None:
        check_not_negative(self)
        _check_shares(self)
        if not self.drive_steps or not min(self.drive_steps) > 0.0:
            raise InputError(f"drive_steps: {self.drive_steps}; expected positive numbers")


@dataclass(frozen=True)
class GoingOnPolicy:
    """Effort of the search for an order by going straight on.

    Attributes
    ----------
    n_neighbours
        Number of nearest waypoints to which legs of a waypoint are searched for.
    max_classes
        Maximum number of classes of the tether kept for each waypoint.
    max_pull_rounds
        Maximum number of iterations that pull the shortest tether to a waypoint taut.
    max_iterations
        Maximum number of iterations of the search for an order.
    """

    n_neighbours: int = 12
    max_classes: int = 3
    max_pull_rounds: int = 300
    max_iterations: int = 400

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class MissionPolicy:
    """Effort, time and limits of planning a mission.

    Attributes
    ----------
    round_s
        Seconds that the first round of the search plans with; more than 0. Rounds do not depend on
        the time limit, so that a longer limit begins with the rounds of a shorter one.
    round_growth
        Ratio of the times that two successive rounds plan with; more than 1. With a larger ratio,
        less work is done again, and more of it is lost in the last round, which the limit ends.
    planning_share
        Share of a round for tours along states and legs.
    bound_share
        Share of the remaining time of a round for the bound on all tours.
    going_on_share
        Share of the remaining time of the first round for the order by going straight on.
    min_saving
        Share of the time until home that a flight by going straight on must save to replace a tour
        with a bound. Stopping within reach of the start saves less than the default.
    first_tour_s
        CPU seconds, at least 0, up to which netsp works on the first tour, even if the time limit
        is shorter: the tour in the order of the file or, if that cannot be driven, another. A
        smaller number leaves more missions without any tour when the limit is short; with a larger
        one, very large missions end later.
    given_order_s
        CPU seconds, at least 0, up to which `predictive` drives the order of the file, even if the
        time limit is shorter. Before that, netsp drives the same order along spokes.
    tether_share
        Share of the tether that states and legs may need. The rest is for how the robot is steered,
        and for the tether's length between two steps along a leg.
    bound_worth
        Share of its length, or of the time until home, by which a tour with a bound may exceed one
        without, and still be preferred.
    max_cell_path_ratio
        Length of a path along cells, as a multiple of the same path pulled taut, up to which
        searches look. The 26 directions of steps make 1.09, and round bodies more.
    max_lifts
        Maximum number of times that the corners of a taut path are led around the outside of what
        they cut off.
    words, gaps, orders, plane, states, times, detours, going_on, bound, potential, classes
        Policies of the parts of planning.
    """

    round_s: float = 8.0
    round_growth: float = 8.0
    planning_share: float = 0.7
    bound_share: float = 0.3
    going_on_share: float = 0.3
    min_saving: float = 0.005
    first_tour_s: float = 15.0
    given_order_s: float = 2.0
    tether_share: float = 0.99
    bound_worth: float = 1e-3
    max_cell_path_ratio: float = 1.35
    max_lifts: int = 12
    words: WordPolicy = WordPolicy()
    gaps: GapPolicy = GapPolicy()
    orders: OrderPolicy = OrderPolicy()
    plane: PlanePolicy = PlanePolicy()
    states: StatePolicy = StatePolicy()
    times: StageTimePolicy = StageTimePolicy()
    detours: DetourPolicy = DetourPolicy()
    going_on: GoingOnPolicy = GoingOnPolicy()
    bound: BoundPolicy = BoundPolicy()
    potential: PotentialPolicy = PotentialPolicy()
    classes: ClassPolicy = ClassPolicy()

    def __post_init__(self) -> None:
        check_not_negative(self)
        _check_shares(self, "min_saving", "bound_worth")
        _check_minimum(self, max_cell_path_ratio=1.0)
        if not self.round_s > 0.0:
            raise InputError(f"round_s: expected more than 0, got {self.round_s:g}")
        if not self.round_growth > 1.0:
            raise InputError(f"round_growth: expected more than 1, got {self.round_growth:g}")
