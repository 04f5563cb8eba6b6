"""Tethers shortened under way: is the new limit kept, and how soon.

    python benchmarks/shortened.py [--moments 4] [--problems pool …] [--flown pool …] [--keep]

Every problem's tour is carried out, and at random moments the limit is lowered to a random share of
the longest tether; in the simulation of `netsp execute`, and flown by the fake autopilot of the
tests, whose true places tell the true tether. Vehicles at sea are 1.5 m/s fast, others 0.5 m/s.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from fly import KILOMETRES, PROBLEMS, places, vehicle
from table import ROOT, head, heading, row

from netsp import Problem, Solution, solve
from netsp.online.execute import ExecutionOptions, Surprises, execute
from netsp.online.execute.execution_log import Execution
from netsp.online.fly.flight_rehearsal import rehearse
from netsp.online.fly.tour_flight import fly
from netsp.world.scene.scene import scene_of
from netsp.world.tether import GeodesicTether

RESOLUTION = 1e-4
"""Share of the tether to which its model is right."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of one run whose tether was shortened.

    Attributes
    ----------
    again_s
        Seconds over the new limit after the tether was within it once.
    excess
        Longest tether then, less the limit, m.
    until_s, least_s
        Seconds from the event until the tether was within the limit, and what its excess takes at
        the speed of the vehicle.
    is_told
        Whether the summary says so when the limit was not kept.
    """

    again_s: float
    excess: float
    until_s: float
    least_s: float
    is_told: bool
    home: bool
    visited: int
    left_out: int


def outcome(
    done: Execution, t: np.ndarray, tether: np.ndarray, when: float, limit: float, speed: float
) -> Outcome:
    """Return what came of a run, given its tether over time."""
    after = t >= when
    t, tether = t[after], tether[after]
    over = tether > limit * (1.0 + RESOLUTION)
    met = int(np.argmin(over)) if not over.all() else len(over)
    steps = np.diff(t, append=t[-1:])
    s = done.summary
    again = float(steps[met:][over[met:]].sum())
    return Outcome(
        again, float(np.max(tether[met:] - limit, initial=0.0)) if again else 0.0,
        float(t[min(met, len(t) - 1)] - when) if over[0] else 0.0,
        max(float(tether[0]) - limit, 0.0) / speed, not again or s["exceedance_s"] > 0.0,
        bool(s["home"] and s["tether_free"]), s["visited"], len(s["left_out"]),
    )  # fmt: skip


def drawn(
    problem: Problem, solution: Solution, speed: float, rng: np.random.Generator
) -> tuple[float, float, Surprises]:
    """Return a moment, a limit, and the event."""
    assert solution.length is not None
    when = float(rng.uniform(0.05, 0.9)) * solution.length / speed
    longest = max(v.tether_length for v in solution.tour)
    limit = float(rng.uniform(0.4, 1.0)) * longest
    event = {"time": when, "tether_length": limit}
    return when, limit, Surprises.model_validate({"schema_version": 1, "events": [event]})


def simulated(problem: Problem, solution: Solution, speed: float, seed: int) -> Outcome:
    when, limit, events = drawn(problem, solution, speed, np.random.default_rng(seed))
    done = execute(problem, solution, ExecutionOptions(speed=speed), surprises=events)
    t, tether = (np.array([getattr(r, k) for r in done.rows]) for k in ("time", "tether"))
    begin = next((r.time for r in done.rows if r.limit == limit), when)
    return outcome(done, t, tether, begin, limit, speed)


def flown(problem: Problem, solution: Solution, speed: float, seed: int) -> Outcome:
    when, limit, events = drawn(problem, solution, speed, np.random.default_rng(seed))
    with vehicle(problem, 1.0, speed, seed) as v:
        begin = v.now
        options = ExecutionOptions(speed=speed, reach=0.3)
        done = fly(problem, solution, v.session, options, surprises=events)
        rows = v.truth
    rows = rows[(rows[:, 0] >= begin) & (rows[:, 0] <= begin + done.rows[-1].time)][::3]
    model = GeodesicTether(scene_of(problem).field(), done.options.delta or 0.1)
    base = np.array(problem.base, dtype=float)
    lengths = model.drive(model.start(base, base), places(problem, rows))[1]
    return outcome(done, rows[:, 0] - begin, lengths, when, limit, speed)


def main() -> None:
    """Carry the tours out, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moments", type=int, default=4)
    parser.add_argument("--problems", nargs="*", default=list(PROBLEMS), help="simulated")
    parser.add_argument("--flown", nargs="*", default=["pool", "wharf", "oc4-jacket"])
    args = parser.parse_args()
    rehearse()
    heading("Tethers shortened under way")
    head("vehicle", "problem", "runs", "over the limit again", "worst excess m, seconds",
         "not told by the summary", "over at the event", "s until within it less the least, worst",
         "home and free", "goals visited, left out", name="shortened")  # fmt: skip
    for name, run, names in (
        ("simulated", simulated, args.problems), ("fake autopilot", flown, args.flown),
    ):  # fmt: skip
        for problem_name in names:
            problem = Problem.load(ROOT / "problems" / f"{problem_name}.json")
            solution = solve(problem, time_limit=20.0)
            speed = 1.5 if problem_name in KILOMETRES else 0.5
            found = [run(problem, solution, speed, seed) for seed in range(args.moments)]
            late = [o.until_s - o.least_s for o in found if o.until_s]
            row(name, problem_name, len(found), sum(o.again_s > 0.0 for o in found),
                f"{max(o.excess for o in found):.3f}, {max(o.again_s for o in found):.1f}",
                sum(not o.is_told for o in found), len(late), f"{max(late, default=0.0):.1f}",
                sum(o.home for o in found),
                f"{sum(o.visited for o in found)}, {sum(o.left_out for o in found)}")  # fmt: skip
    print()


if __name__ == "__main__":
    main()
