"""Notes and warnings on an exported file: points moved, things not written, assumptions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from netsp.base.errors import counted
from netsp.exchange.maps.goal_depths import height_warning
from netsp.exchange.missions.fence import Fence
from netsp.exchange.missions.mission_files import (
    FOR_VEHICLES,
    ExportSettings,
    fence_of_points,
    not_written,
    with_distinct_holds,
)
from netsp.exchange.missions.waypoints import Waypoint
from netsp.model.problem import Problem


@dataclass(frozen=True)
class ExportNotes:
    """Notes on an exported file, one line each.

    Attributes
    ----------
    warnings
        Possible problems in use.
    notes
        Changes, assumptions and omissions.
    """

    warnings: tuple[str, ...]
    notes: tuple[str, ...]


def export_notes(
    problem: Problem, points: list[Waypoint], kind: str, settings: ExportSettings
) -> ExportNotes:
    """Return the notes and warnings on an exported tour.

    Parameters
    ----------
    kind : str
        One of `netsp.exchange.missions.FORMATS`.
    """
    warnings, notes = [], []
    if kind != "csv" and (text := not_written(problem, kind)):
        notes.append(text)
    if kind in FOR_VEHICLES and (text := bend_note(points, settings)):
        notes.append(text)
    if kind in FOR_VEHICLES:
        min_depth = settings.policy.min_depth
        if kind == "plan":
            warnings += fence_warnings(problem, fence_of_points(problem, points, settings))
        remedy = f"heights are negative below it; moved to {min_depth} m of depth"
        if (text := height_warning(problem, remedy)) is not None:
            warnings.append(text)
        high = sum(p.goal is not None and p.goal >= 0 and p.position[2] > 0.0 for p in points)
        shallow = sum(p.position[2] > -min_depth for p in points) - high
        if shallow:
            notes.append(
                f"{counted(shallow, 'waypoint')} shallower than {min_depth} m moved to that depth"
            )
        notes.append("home is assumed to be at the surface above the base; do not set it by hand")
    return ExportNotes(tuple(warnings), tuple(notes))


def bend_note(points: list[Waypoint], settings: ExportSettings) -> str | None:
    """Return a note if the vehicle holds longer at bends than the settings state, else None."""
    seconds = with_distinct_holds(points, settings).bend_hold_s
    if seconds <= settings.bend_hold_s:
        return None
    return (
        f"the vehicle holds {seconds} s at bends instead of {settings.bend_hold_s} s, because it "
        f"holds {settings.bend_hold_s} s at a goal: netsp import tells goals from bends by these "
        "times"
    )


def fence_warnings(problem: Problem, fence: Fence) -> list[str]:
    """Return warnings about obstacles simplified or left out, and about zones on the tour."""
    lines = []
    if fence.simplified:
        max_growth = max(z.growth for z in fence.simplified)
        lines.append(
            f"{counted(len(fence.simplified), 'obstacle')} simplified in the fence, by up to "
            f"{max_growth:.2g} {problem.units}, to fit into the vehicle's storage; if your vehicle "
            "stores more, raise --fence-bytes"
        )
    if fence.left_out:
        lines.append(
            f"{counted(len(fence.left_out), 'obstacle')} left out of the fence "
            f"({_names(problem, fence.left_out)}), which takes the nearest to the tour first and "
            "is full; if your vehicle stores more, raise --fence-bytes"
        )
    if fence.touched:
        lines.append(
            f"the tour touches the fence at {counted(len(fence.touched), 'obstacle')} "
            f"({_names(problem, fence.touched)}), where the vehicle may report a breach; plan with "
            "a larger clearance"
        )
    return lines


def _names(problem: Problem, obstacles: Sequence[int], max_named: int = 3) -> str:
    """Return the names of the first few obstacles."""
    names = [problem.obstacle_name(k) for k in obstacles[:max_named]]
    return ", ".join(names) + (", …" if len(obstacles) > max_named else "")
