"""Missions solved within short limits: when the first tour is there, and what more time brings.

    python benchmarks/short_limits.py [--scenes jetty …] [--only first|anytime|runs] [--keep]
                                      [--cpu-limits] [--longest 60] [--limits 2]

First: CPU seconds of each stage up to the first tour, without a run, and whether the judge passes
it, with `--words` by the words of the scene, too. Anytime: the incumbent's length at 2, 5, 10, 30
and 60 s of one run each. Runs: runs with a limit of their own, verified from what they would write.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable
from pathlib import Path

from plane_in_space import random_prisms
from sites import SITES, mission_of, shipped
from space import prism_world, random_frame
from table import ROOT, head, heading, row

from netsp.base.clock import Clock
from netsp.plan.space.incumbents import Incumbents
from netsp.plan.space.judge import verify_mission
from netsp.plan.space.mission_solver import SolvedMission, solve_mission
from netsp.plan.space.space_plan import StagedSearch, prepare_without_words
from netsp.world import Scene
from netsp.world.mission.mission import Mission

SAMPLES_S = (2.0, 5.0, 10.0, 30.0, 60.0)
"""Seconds at which the incumbent of one run is looked at."""

OTHERS = ROOT.parent / "shared" / "data" / "scenes"
"""Folder of scenes made by others; it may be absent."""


def _other(name: str) -> tuple[Mission, Scene]:
    mission = Mission.load(OTHERS / f"{name}.json")
    return mission, mission.load_scene()


def scenes() -> dict[str, Callable[[], tuple[Mission, Scene]]]:
    """Return 24 scenes: our sites, shipped missions, scenes made by others, frames and prisms."""
    made: dict[str, Callable[[], tuple[Mission, Scene]]] = {}
    for name in SITES:
        made[name] = lambda name=name: mission_of(name)
    for name in ("basin", "jacket", "pipes"):
        made[name] = lambda name=name: shipped(name)
    for name in ("comb-tight", "wreck-tight", "cloud-tight"):
        if Path(OTHERS / f"{name}.json").exists():
            made[f"{name}, by other hands"] = lambda name=name: _other(name)
    for seed in (0, 1, 3, 7):
        made[f"frame {seed}"] = lambda seed=seed: random_frame(seed)
    for seed in (0, 4):
        made[f"prisms {seed}"] = lambda seed=seed: random_prisms(seed)[1:]
    for kind, seed in (("many", 0), ("close pairs", 1), ("depths", 0)):
        made[f"{kind} {seed}"] = lambda kind=kind, seed=seed: prism_world(kind, seed)[1:]
    return made


def first_tour(name: str, make: Callable[[], tuple[Mission, Scene]], with_words: bool) -> list[str]:
    """Return a row: the stages up to the first tour, in CPU seconds, and what the judge says."""
    mission, scene = make()
    times = [time.process_time()]

    def lap() -> float:
        times.append(time.process_time())
        return times[-1] - times[-2]

    field = scene.field()
    distances = lap()
    context = prepare_without_words(mission, Clock(), scene=scene, field=field)
    stages = StagedSearch(context, scene, lambda _: None, {"solver": "auto", "seed": 0})
    cells = lap()
    plan = stages.spokes_as_given()
    driven = lap()
    assert plan is not None
    judged = verify_mission(plan.to_mission(), scene=scene, context=context)
    judging, total = lap(), times[-1] - times[0]
    verdict = judged
    if with_words:
        verdict = verify_mission(plan.to_mission(), scene=scene, field=field)
    failed = [check.name for check in verdict.checks if not check.passed]
    return [
        name, str(len(mission.waypoints)), str(len(plan.visits)), f"{plan.length:.1f}",
        f"{distances:.2f}", f"{cells:.2f}", f"{driven:.2f}", f"{judging:.2f}", f"{total:.2f}",
        "yes" if judged and verdict else failed[0] if failed else "no",
    ]  # fmt: skip


def trajectory(
    mission: Mission, scene: Scene, limit: float
) -> tuple[SolvedMission, list[tuple[float, int, float]], float]:
    """Return the result of a run, its incumbents with the seconds after which each came, and the
    seconds of the whole run."""
    rows: list[tuple[float, int, float]] = []
    begin = time.monotonic()

    class Watched(Incumbents):
        """Incumbents that are recorded."""

        def __setattr__(self, name: str, value: object) -> None:
            object.__setattr__(self, name, value)
            if name == "best" and isinstance(value, SolvedMission):
                seconds = time.monotonic() - begin
                rows.append((seconds, len(value.tour.stops), value.length_to_waypoints))

    import netsp.plan.space.mission_solver as solver

    solver.Incumbents, kept = Watched, solver.Incumbents  # type: ignore[misc]
    try:
        found = solve_mission(mission, scene=scene, time_limit=limit)
    finally:
        solver.Incumbents = kept  # type: ignore[misc]
    return found, rows, time.monotonic() - begin


def at(rows: list[tuple[float, int, float]], seconds: float) -> tuple[int, float] | None:
    """Return visits and length of the incumbent at a time."""
    known = [row for row in rows if row[0] <= seconds]
    return known[-1][1:] if known else None


def main() -> None:
    """Print the tables that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="*")
    parser.add_argument("--only", choices=("first", "anytime", "runs"))
    parser.add_argument("--words", action="store_true", help="find words to verify first tours")
    parser.add_argument("--longest", type=float, default=60.0, help="limit of the one run, seconds")
    parser.add_argument("--limits", type=float, nargs="*", default=[2.0])
    args = parser.parse_args()
    made = scenes()
    names = args.scenes or list(made)
    heading("Short limits")
    if args.only in (None, "first"):
        head("scene", "waypoints", "visited", "order given along spokes m", "distances s",
             "cells s", "spokes and driving s", "judging s", "in all s",
             "verified with words" if args.words else "verified",
             name="space-first")  # fmt: skip
        for name in names:
            row(*first_tour(name, made[name], args.words))
        print()
    if args.only in (None, "anytime"):
        samples = [s for s in SAMPLES_S if s <= args.longest]
        head("scene", *(f"at {s:g} s, m" for s in samples), "first tour after s", "in all s",
             "found by", "status", "ever longer", name="space-anytime")  # fmt: skip
        for name in names:
            found, rows, took = trajectory(*made[name](), args.longest)
            longer = any(b[1] <= a[1] and b[2] > a[2] * (1.0 + 1e-9)
                         for a, b in itertools.pairwise(rows))  # fmt: skip
            lengths = [at(rows, s) for s in samples]
            row(name, *("–" if x is None else f"{x[1]:.1f}" for x in lengths), f"{rows[0][0]:.1f}",
                f"{took:.0f}", found.tour.solver, found.tour.status.value,
                "yes" if longer else "no")  # fmt: skip
        print()
    if args.only in (None, "runs"):
        columns = [c for s in args.limits for c in (f"{s:g} s: m", "s", "verified")]
        head("scene", *columns, name="space-short-runs")
        for name in names:
            cells: list[str] = []
            for limit in args.limits:
                mission, scene = made[name]()
                found, _, took = trajectory(mission, scene, limit)
                verdict = verify_mission(found.mission, scene=scene)
                cells += [f"{found.tour.length:.1f}", f"{took:.1f}", "yes" if verdict else "no"]
            row(name, *cells)
        print()


if __name__ == "__main__":
    main()
