"""How far runs go over their time limit, whatever the size of the problem.

    python benchmarks/limits.py [--limit 1]
    python benchmarks/limits.py --corners
    python benchmarks/limits.py --sites [MISSION …]

Problems that are too large for what is asked: 200 goals at tether 500 (some 20,000 classes are kept
of many more), 67 turbines with 13 km of tether (millions of classes); for the solvers that bound,
200 goals at tether 400 for three times as long; and for `auto` two of the library with some 20,000
classes of few goals, for twice as long: one where many tethers are only found by a search, and one
whose legs are a matrix that takes longer than there is time.

`--corners` prints the same for islands of a thousand to 66,672 corners. `--sites` looks for loops
that do not hear the clock: it has the time be up at each call site where the clock is asked, at the
first and at the last time, and prints how long the run goes on from there.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from library_worlds import FOLDER
from table import head, heading, row

from netsp import Circle, Problem, solve
from netsp.base.errors import InputError, NetspError
from netsp.plan.random_worlds import random_world
from netsp.plan.solver_table import SOLVERS


def turbines() -> Problem:
    """A wind farm of 67 turbines with far too long a tether."""
    rng = np.random.default_rng(0)
    places = [
        (900.0 * (k % 9) + rng.uniform(-100, 100), 900.0 * (k // 9) + rng.uniform(-100, 100))
        for k in range(67)
    ]
    return Problem(
        name="turbines", base=(-500, -500), goals=[(x + 20, y + 20) for x, y in places],
        obstacles=[Circle(center=p, radius=5) for p in places], tether_length=13_000,
    )  # fmt: skip


LIBRARY = ("maze-30-0", "windfarm-9-5")
"""Problems of few goals and some 20,000 classes."""

UNBOUNDED = ", no bound"

BOUNDING = ("auto", "mip", "dp")
"""They have more steps before the first bound than the others have in all."""

WORTH_REPEATING = 0.5
"""Seconds over the limit from which a run is made once more: the machine may have been busy."""


def cpu() -> float:
    """CPU seconds of this process and of those it has waited for."""
    return sum(os.times()[:4])


def over(problem: Problem, solver: str, limit: float) -> tuple[float, str]:
    """Seconds over the limit and the status. On a busy machine a run may have waited for a
    processor, so what counts is the lesser of elapsed time and CPU time."""
    begin, spent = time.monotonic(), cpu()
    try:
        found = solve(problem, solver, time_limit=limit)
        status = found.status.value
        if solver == "auto" and not found.lower_bound:
            status += UNBOUNDED
    except NetspError as error:
        status = str(error)
    return min(time.monotonic() - begin, cpu() - spent) - limit, status


def runs(limit: float) -> Iterator[tuple[str, str, float, str]]:
    """(solver, problem, seconds over the limit, status) for every solver and its problems."""
    warm = random_world(0, goals=6, tether_length=500.0)
    many = random_world(0, goals=200, tether_length=500.0)
    problems = [("200 goals", many, limit), ("67 turbines", turbines(), limit)]
    # classes enough for legs to be bounded at all, and time enough to begin with that
    fewer = (
        "200 goals, shorter tether",
        random_world(0, goals=200, tether_length=400.0),
        3 * limit,
    )
    small = ("20 goals", random_world(0, goals=20, tether_length=300.0), limit)
    kept = [(name, Problem.load(FOLDER / f"{name}.json"), 2 * limit) for name in LIBRARY]
    for solver in SOLVERS:
        for problem in (warm, random_world(0, goals=20, tether_length=500.0)):
            with contextlib.suppress(InputError):  # mip-2017 refuses programs of many legs
                solve(problem, solver, time_limit=0.5)  # compiled before it counts
        for name, problem, allowed in [
            *problems,
            *([fewer] if solver in BOUNDING else []),
            *(kept if solver == "auto" else []),
            *([small] if solver == "mip-2017" else []),
        ]:
            found = over(problem, solver, allowed)
            if found[0] > WORTH_REPEATING:
                again = over(problem, solver, allowed)
                # what was missing the first time is missing
                found = min(found[0], again[0]), max(found[1], again[1], key=_missing)
            yield solver, name, *found


def _missing(status: str) -> bool:
    return UNBOUNDED in status or ("feasible" not in status and "optimal" not in status)


def worst(limit: float) -> tuple[float, str, int, int]:
    """The most seconds over the limit, where, how many runs of solvers that are not blind had no
    tour to show, and how many of `auto` no bound."""
    found = list(runs(limit))
    solver, name, over, _ = max(found, key=lambda r: r[2])
    blind = {s.name for s in SOLVERS.values() if s.geometric}
    silent = sum(s not in blind and "feasible" not in r and "optimal" not in r
                 for s, _, _, r in found)  # fmt: skip
    return over, f"{solver}, {name}", silent, sum(UNBOUNDED in r for *_, r in found)


def islands(corners: int, count: int = 20) -> Problem:
    """Return a problem with islands of many corners and ten goals between them."""
    rng, side = np.random.default_rng(0), int(np.ceil(np.sqrt(count)))
    obstacles = []
    for k in range(count):
        angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners // count))
        radius = 35.0 * (1.0 + 0.2 * rng.uniform(-1.0, 1.0, len(angle)))
        x, y = 100.0 * (k % side) + 50.0, 100.0 * (k // side) + 50.0
        outline = np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])
        obstacles.append({"polygon": outline.tolist()})
    goals = [(100.0 * (k % side), 100.0 * (k // side + 1)) for k in range(10)]
    return Problem(base=(0, 0), goals=goals, obstacles=obstacles, tether_length=120.0 * side)


CORNERS = (1000, 5000, 20_000, 66_672)


def corners(limit: float) -> Iterator[tuple[int, float, float, str]]:
    """Yield corners, seconds until the file is read and checked, seconds over the limit, and
    status."""
    solve(islands(200), time_limit=2.0)  # compiled before it counts
    for count in CORNERS:
        text = islands(count).to_json()
        begin = time.process_time()
        problem = Problem.from_json(text)
        read = time.process_time() - begin
        yield count, read, *over(problem, "auto", limit)


def sites(missions: list[str]) -> Iterator[tuple[str, int, float, str, str]]:
    """(run, call sites, most CPU seconds that it went on after its time was up, where, the worst
    answer) for every solver on a small problem, and for missions."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from netsp import verify
    from netsp.plan.space.mission_solver import solve_mission
    from netsp.world.mission.mission import Mission
    from tests.clock_sites import watched

    problem = random_world(3, goals=10, tether_length=300.0)

    def planned(name: str) -> Callable[[], bool]:
        return lambda: bool(verify(problem, solve(problem, name, time_limit=20.0)))

    runs = {name: planned(name) for name, s in SOLVERS.items() if not s.geometric}
    for name in missions:
        mission = Mission.load(name)
        scene = mission.load_scene()
        field = scene.field()

        def flown(mission: Mission = mission, scene: object = scene, field: object = field) -> bool:
            found = solve_mission(mission, scene=scene, field=field, time_limit=60.0)  # type: ignore[arg-type]
            return not found.left_out

        runs[name] = flown
    for name, run in runs.items():
        run()
        with watched() as recorded:
            run()
        worst, where, answer = 0.0, "", "as it should be"
        for site, count in recorded.asked.items():
            for times in {1, count}:
                with watched(site, times) as fired:
                    try:
                        if not run():
                            answer = f"not good after {site}"
                    except NetspError as error:
                        answer = str(error)
                if fired.fired is not None and fired.overtime > worst:
                    worst, where = fired.overtime, f"{site[0]}:{site[1]}"
        yield name, len(recorded.asked), worst, where, answer


def main() -> None:
    """Print one row a run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--limit", type=float, default=1.0)
    parser.add_argument("--corners", action="store_true")
    parser.add_argument("--sites", nargs="*", metavar="MISSION")
    args = parser.parse_args()
    if args.corners:
        heading(f"Many corners ({args.limit:g} s)")
        head("corners", "read s", "over s", "status", name="limits corners")
        for count, read, beyond, status in corners(args.limit):
            row(count, f"{read:.2f}", f"{beyond:.2f}", status)
        return
    if args.sites is not None:
        heading("A clock that fires wherever it is asked")
        head("run", "call sites", "over CPU s", "where", "answer", name="limits sites")
        for name, number, beyond, where, answer in sites(args.sites):
            row(name, number, f"{beyond:.2f}", where, answer)
        return
    heading(f"Time limits ({args.limit:g} s)")
    head("solver", "problem", "over s", "status", name="limits")
    for solver, name, over, status in runs(args.limit):
        row(solver, name, f"{over:.2f}", status)


if __name__ == "__main__":
    main()
