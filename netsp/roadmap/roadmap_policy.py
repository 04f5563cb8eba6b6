"""Policies of the roadmaps: limits of searches, sizes of blocks, shares of time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from netsp.base.errors import InputError
from netsp.base.number_ranges import check_not_negative, check_positive
from netsp.gtsp.gtsp_policy import CostPolicy


def _check_growth(policy: object, *names: str) -> None:
    """Raise InputError unless the named factors are more than 1."""
    for name in names:
        if not getattr(policy, name) > 1.0:
            raise InputError(f"{name}: expected more than 1, got {getattr(policy, name)!r}")


@dataclass(frozen=True)
class SightPolicy:
    """Policy that rules out pairs of arcs that cannot see each other.

    No number changes a tangent; they trade time against memory.

    Parameters
    ----------
    sectors : int
        Number of sectors of each pencil; at least 8. More sectors rule out more pairs, but take
        time and memory: 8 bytes for each arc and sector.
    min_pairs : int
        Minimum number of pairs for which horizons are computed; at least 0. Fewer are all tested.
    block : int
        Number of arcs that a thread joins at one time, and whose pairs are then in memory; at
        least 1.
    min_distance_ratio : float
        Smallest distance of the centres of two disks, as a multiple of the sum of their radii, at
        which horizons may rule out their pair; at least 1. Nearer disks are always tested.
    min_clearance_ratio : float
        Smallest distance of a blocker from the centre of a disk, as a multiple of the sum of their
        radii, at which it gives the disk a horizon; more than 1. Directions to nearer blockers are
        ill-conditioned.
    max_shift_share : float
        Largest shift of a direction by the radius of a disk that is bounded instead of computed, as
        a share of a sector; at least 0. A larger share saves arcsines and lowers fewer horizons.
    """

    sectors: int = 32
    min_pairs: int = 100_000
    block: int = 1024
    min_distance_ratio: float = 4.0
    min_clearance_ratio: float = 1.1
    max_shift_share: float = 0.05

    def __post_init__(self) -> None:
        minima = {
            "sectors": 8,
            "min_pairs": 0,
            "block": 1,
            "min_distance_ratio": 1.0,
            "min_clearance_ratio": math.nextafter(1.0, 2.0),
            "max_shift_share": 0.0,
        }
        for name, value in minima.items():
            if not getattr(self, name) >= value:
                raise InputError(f"{name}: expected at least {value}, got {getattr(self, name)}")


@dataclass(frozen=True)
class PathPolicy:
    """Policy of the search for the taut path of a word, and of its drawing. All numbers are
    positive.

    Attributes
    ----------
    first_ratio
        First limit of a search, as a multiple of the straight distance; more than 1. Most paths are
        hardly longer, and a search with a small limit is far cheaper.
    max_growth
        Largest factor from one limit to the next; more than 1.
    min_second_share
        Smallest second limit, as a share of the longest path possible.
    max_states
        Maximum number of departures expanded for one path in the last resort, a search among the
        paths of all words. A million take about half a second.
    max_known
        Maximum number of paths in the cache, which is then emptied.
    max_bends
        Maximum number of nodes of a path that is pulled taut. A search finds longer paths.
    max_backward_turn
        Largest angle, radians, by which a string among slits may seem to go back on an arc at which
        it bends twice in a row. A larger angle counts as a full turn.
    max_chord_turn
        Largest turn of a chord of a drawn arc, radians. Chords of 3 degrees are 0.023 % longer than
        their arc.
    """

    first_ratio: float = 1.02
    max_growth: float = 1.3
    min_second_share: float = 1 / 32
    max_states: int = 1_000_000
    max_known: int = 5000
    max_bends: int = 256
    max_backward_turn: float = 0.5
    max_chord_turn: float = math.radians(3.0)

    def __post_init__(self) -> None:
        check_positive(self)
        _check_growth(self, "first_ratio", "max_growth")


@dataclass(frozen=True)
class ContactPolicy:
    """Policy of the search for shortest paths in any class.

    Attributes
    ----------
    limit_ratios
        Length limits of successive searches, as multiples of the straight distance; a last search
        has no limit.
    sources_per_check
        Number of sources of shortest paths between two checks of the clock.
    arcs_per_check
        Number of arcs whose contacts are joined between two checks of the clock.
    """

    limit_ratios: tuple[float, ...] = (1.5, 3.0)
    sources_per_check: int = 16
    arcs_per_check: int = 1024

    def __post_init__(self) -> None:
        check_positive(self)
        if not all(ratio > 0.0 for ratio in self.limit_ratios):
            raise InputError(f"limit_ratios: expected positive numbers, got {self.limit_ratios}")


@dataclass(frozen=True)
class ClassPolicy:
    """Policy of the choice of classes that a roadmap holds. All numbers are positive.

    Attributes
    ----------
    max_classes
        Approximate maximum number of classes; if there are more, the shortest of each goal are
        kept. All legs between 22 000 classes take 1.8 GiB in single precision.
    states_per_class
        Maximum number of states of a search, as a multiple of the number of classes wanted.
    first_excess
        First excess length in a search for the classes of one goal, beyond the length of its
        shortest tether, as a share of the rest of the tether.
    growth
        Factor by which the excess length grows while there are too few classes; more than 1.
    shrink
        Divisor of the step by which the excess length shrinks while there are too many classes;
        more than 1.
    max_searches
        Maximum number of searches for the classes of one goal.
    max_time_share
        Maximum share of the remaining time for each of the two searches: for all classes, and then
        goal by goal.
    """

    max_classes: int = 22_000
    states_per_class: int = 200
    first_excess: float = 1 / 64
    growth: float = 4.0
    shrink: float = 16.0
    max_searches: int = 16
    max_time_share: float = 0.3

    def __post_init__(self) -> None:
        check_positive(self)
        _check_growth(self, "growth", "shrink")


@dataclass(frozen=True)
class LegPolicy:
    """Policy of the measurement of legs between classes; it changes no length.

    Attributes
    ----------
    block_rows
        Number of matrix rows computed at a time, so that intermediate arrays stay small.
    bound_rows
        Number of matrix rows of lower bounds that a thread computes at one time.
    max_block_legs
        Maximum number of legs in memory if not all are held. The default is a quarter of a GiB in
        single precision. With fewer, more blocks pull the same legs again.
    max_single_legs
        Maximum number of legs that are pulled one by one, which takes some hundredths of a second.
        A thread also pulls this number at a time.
    untimed_vertices
        Number of vertices up to which legs among them are measured even if time is up; at least
        `CostPolicy.untimed_vertices`, which solvers rely on.
    max_parted_classes
        Maximum number of classes whose tree of tethers is quickly built. Among more classes, a few
        legs are pulled one by one.
    s_per_leg
        Estimated CPU time of a leg, s, if all are measured together.
    min_joint_searches
        Number of tethers that cannot be pulled above which one search finds all of them.
    """

    block_rows: int = 256
    bound_rows: int = 64
    max_block_legs: int = 64_000_000
    max_single_legs: int = 20_000
    untimed_vertices: int = CostPolicy.untimed_vertices
    max_parted_classes: int = 1500
    s_per_leg: float = 8e-8
    min_joint_searches: int = 20

    def __post_init__(self) -> None:
        check_not_negative(self)
        for name in ("block_rows", "bound_rows", "max_single_legs"):
            if getattr(self, name) < 1:
                raise InputError(f"{name}: expected 1 or more, got {getattr(self, name)}")


@dataclass(frozen=True)
class ParityPathPolicy:
    """Policy of the search for paths by the parity of their crossings.

    All numbers are positive.

    Attributes
    ----------
    first_ratio
        First length limit, as a multiple of the largest distance from a goal to its nearest goal.
    growth
        Factor from one limit to the next; more than 1.
    min_tether_share
        Smallest first limit, as a share of the tether.
    max_paths
        Number of paths at which the length limit stops growing.
    max_states
        Maximum number of departures expanded from one goal.
    """

    first_ratio: float = 1.5
    growth: float = 1.25
    min_tether_share: float = 1e-3
    max_paths: int = 1_000_000
    max_states: int = 20_000_000

    def __post_init__(self) -> None:
        check_positive(self)
        _check_growth(self, "growth")


@dataclass(frozen=True)
class DetourPolicy:
    """Policy of the sub-goals that change the class of a path. Both numbers are positive.

    Attributes
    ----------
    sub_goals_per_obstacle
        Number of places around each obstacle; those in free space are sub-goals.
    sub_goal_offset
        Distance of a sub-goal from the boundary, as a share of the obstacle's size.
    """

    sub_goals_per_obstacle: int = 8
    sub_goal_offset: float = 0.05

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class ReachPolicy:
    """Policy of the search for the tether length that each goal needs.

    Attributes
    ----------
    max_whole_obstacles
        Maximum number of obstacles up to which all are considered. With more, only obstacles that a
        path may touch are considered.
    first_ratio
        First guess of the longest path to a goal, as a multiple of the distance of the farthest
        goal.
    max_explained
        Maximum number of enclosed goals for which messages name the enclosing obstacles, because
        finding these is slow.
    """

    max_whole_obstacles: int = 100
    first_ratio: float = 1.2
    max_explained: int = 5

    def __post_init__(self) -> None:
        check_not_negative(self)


@dataclass(frozen=True)
class TetherPolicy:
    """Policy of the search for taut tethers to a place. All numbers are positive.

    Attributes
    ----------
    first_ratio
        First limit of the search for the shortest tether, as a multiple of the distance.
    growth
        Factor from one limit to the next; more than 1.
    max_states
        Maximum number of departures expanded for one place.
    """

    first_ratio: float = 1.05
    growth: float = 1.25
    max_states: int = 5_000_000

    def __post_init__(self) -> None:
        check_positive(self)
        _check_growth(self, "growth")


@dataclass(frozen=True)
class PrmPolicy:
    """Policy of the sampled roadmap. All numbers are positive.

    Attributes
    ----------
    samples
        Number of milestones; the default is that of the 2017 paper.
    max_time_share
        Maximum share of the remaining time for sampling.
    max_augmented
        Maximum number of vertices (milestone, word) of the augmented graph.
    s_per_search, s_per_searched_state
        Estimated CPU time of a search for shortest paths, s: a constant, and an amount for each
        vertex of the augmented graph.
    """

    samples: int = 1000
    max_time_share: float = 0.4
    max_augmented: int = 2_000_000
    s_per_search: float = 1e-3
    s_per_searched_state: float = 2e-6

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class RoadmapPolicy:
    """Policy of the roadmaps over a problem.

    Attributes
    ----------
    sight, paths, contacts, classes, legs, parity, detours, reach, tethers, prm
        Policies of the parts.
    max_state_ratio
        Largest tether length of a state, as a multiple of the tether length, or of the size of the
        world if larger. The limit may have been lowered after the robot went out.
    """

    sight: SightPolicy = SightPolicy()
    paths: PathPolicy = PathPolicy()
    contacts: ContactPolicy = ContactPolicy()
    classes: ClassPolicy = ClassPolicy()
    legs: LegPolicy = LegPolicy()
    parity: ParityPathPolicy = ParityPathPolicy()
    detours: DetourPolicy = DetourPolicy()
    reach: ReachPolicy = ReachPolicy()
    tethers: TetherPolicy = TetherPolicy()
    prm: PrmPolicy = PrmPolicy()
    max_state_ratio: float = 50.0

    def __post_init__(self) -> None:
        check_positive(self)
