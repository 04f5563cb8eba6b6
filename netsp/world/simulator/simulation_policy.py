"""Policy of the mission simulator."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive, check_shares
from netsp.world.simulator.environment_policy import CoveragePolicy, GustPolicy, RangingPolicy


@dataclass(frozen=True)
class MissionLimits:
    """Limits of a mission; a number beyond is likely a mistake of units. All are positive.

    Attributes
    ----------
    max_distance_ratio
        Maximum distance of a waypoint from the anchor, in tether lengths.
    max_steps
        Maximum number of steps of a run.
    max_tether_nodes
        Maximum number of nodes of a tether, its length over `delta`.
    max_water_speed
        Maximum speed of the water, m/s; no sea is as fast.
    max_drag_ratio
        Maximum ratio of the drag on the whole tether to its tension.
    """

    max_distance_ratio: float = 1000.0
    max_steps: int = 5_000_000
    max_tether_nodes: int = 200_000
    max_water_speed: float = 20.0
    max_drag_ratio: float = 20.0

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class MappingPolicy:
    """Policy of the map that a range sensor corrects. All numbers are positive.

    Attributes
    ----------
    look_steps
        Number of steps between two looks of the sensor.
    min_hits
        Number of rays that must hit a solid before it is put on the map.
    removal_depth
        Depth inside a solid of the map at which a ray shows that it is not there, metres.
    min_passes
        Number of such rays in one look that remove the solid.
    trail_spacing
        Distance between points of the robot's trail, metres.
    retrace_share
        Distance to the last point but one, as a share of the spacing, below which the robot has
        gone back and the last point is dropped.
    recall_steps
        Number of steps between two remembered shapes of the tether.
    max_recalled
        Maximum number of remembered shapes; beyond it, every other one is dropped.
    payout_tolerance
        Difference between measured payout and that of a remembered shape up to which the shape
        explains the payout, metres.
    """

    look_steps: int = 3
    min_hits: int = 3
    removal_depth: float = 0.1
    min_passes: int = 5
    trail_spacing: float = 0.1
    retrace_share: float = 0.9
    recall_steps: int = 50
    max_recalled: int = 40
    payout_tolerance: float = 0.03

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class SimulationPolicy:
    """Policy of the mission simulator. All numbers are positive.

    Attributes
    ----------
    step_s
        Time between two decisions of the planner, s.
    tether_steps
        Number of steps between two tethers kept for pictures, if the scene changes.
    camera_steps
        Number of steps between two pictures of the camera.
    min_course_speed
        Speed through the water below which a vehicle keeps its heading, m/s.
    heading_tolerance_deg
        Largest error of the heading at which a turn to a waypoint's heading is complete, degrees.
    max_waypoint_s
        Time at one waypoint after which it is left out, s.
    stall_s, stall_progress
        Time, s, in which the rest of the path must get shorter, and by how much, metres. Otherwise
        the robot has stalled, for example in a strong current.
    position_gain
        Share of the error of a measured position by which the estimate is corrected, at most 1. A
        smaller gain removes more noise, and follows a turn later.
    gusts, ranging, coverage
        Policies of the environment.
    mapping
        Policy of the map that a range sensor corrects.
    limits
        Limits of a mission's numbers.
    """

    step_s: float = 0.1
    tether_steps: int = 10
    camera_steps: int = 2
    min_course_speed: float = 0.05
    heading_tolerance_deg: float = 5.0
    max_waypoint_s: float = 600.0
    stall_s: float = 30.0
    stall_progress: float = 0.05
    position_gain: float = 0.25
    gusts: GustPolicy = GustPolicy()
    ranging: RangingPolicy = RangingPolicy()
    coverage: CoveragePolicy = CoveragePolicy()
    mapping: MappingPolicy = MappingPolicy()
    limits: MissionLimits = MissionLimits()

    def __post_init__(self) -> None:
        check_positive(self)
        check_shares(self, "position_gain")
