"""Tours carried out online: as planned, and with an obstacle that is not on the map.

python benchmarks/execute.py [--worlds 100] [--goals 20] [--tether 300]
"""

from __future__ import annotations

import argparse

import numpy as np
from table import head, heading, row

from netsp import Problem, Solution, solve
from netsp.online.execute import ExecutionOptions, Surprises, execute
from netsp.online.execute.execution_log import Execution
from netsp.plan.random_worlds import random_world

SPEED = 1.0


def surprise(problem: Problem, solution: Solution, seed: int) -> Surprises:
    """One circle on what is left of the path, some time on the way, clear of the base."""
    rng = np.random.default_rng(seed)
    path = np.array(solution.path)
    s = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    when = rng.uniform(0.05, 0.7) * s[-1]
    for _ in range(1000):
        there = rng.uniform(when + 0.02 * s[-1], s[-1])
        centre = [float(np.interp(there, s, path[:, k]) + rng.uniform(-5, 5)) for k in (0, 1)]
        radius = float(rng.uniform(10.0, 30.0))
        if np.hypot(centre[0] - problem.base[0], centre[1] - problem.base[1]) > radius + 1.0:
            event = {"time": float(when / SPEED), "appear": {"center": centre, "radius": radius}}
            return Surprises.model_validate({"schema_version": 1, "events": [event]})
    raise RuntimeError("no place for a surprise")


def good(done: Execution) -> bool:
    """Never over the limit, every visit in the planned class, home and free, nothing forgotten."""
    s = done.summary
    return (
        s["exceedance_s"] == 0.0
        and s["arrivals_as_planned"] == len(done.arrivals)
        and s["home"]
        and s["tether_free"]
        and s["visited"] + len(s["left_out"]) == len(done.problem.goals)
    )


def table(name: str, runs: list[Execution]) -> None:
    over = [100 * (d.summary["path"] / d.summary["planned_path"] - 1) for d in runs]
    planning = [e.planning_s for d in runs for e in d.entries if e.response != "kept"]
    kinds = [e.response for d in runs for e in d.entries]
    row(
        name, f"{sum(map(good, runs))} of {len(runs)}",
        f"{sum(d.summary['exceedance_s'] == 0.0 for d in runs)}",
        f"{sum(d.summary['as_planned'] == len(d.arrivals) for d in runs)}",
        f"{sum(d.summary['tether_free'] and d.summary['home'] for d in runs)}",
        f"{np.median(over):.3f}; {max(over):.3f}",
        f"{sum(len(d.left_out) for d in runs)}",
        ", ".join(f"{kinds.count(k)} {k}" for k in sorted(set(kinds))),
        f"{np.median(planning):.2f}; {max(planning):.2f}" if planning else "",
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=100)
    parser.add_argument("--goals", type=int, default=20)
    parser.add_argument("--tether", type=float, default=300.0)
    args = parser.parse_args()
    heading("Tours carried out")
    plain, surprised = [], []
    for seed in range(args.worlds):
        problem = random_world(goals=args.goals, tether_length=args.tether, seed=seed)
        solution = solve(problem)
        plain.append(execute(problem, solution, ExecutionOptions(speed=SPEED)))
        events = surprise(problem, solution, seed)
        surprised.append(
            execute(problem, solution, ExecutionOptions(speed=SPEED), surprises=events)
        )
    head(
        "worlds", "all good", "never over the limit", "words as planned", "home and free",
        "path over plan % (median; worst)", "goals left out", "done about it",
        "planning s (median; worst)", name="execute",
    )  # fmt: skip
    table("no surprise", plain)
    table("one obstacle", surprised)
    print()
    for done in [*plain, *surprised]:
        if not good(done):
            print(f"- {done.problem.name}: {done.summary}")
    reasons = [why.split(" (")[0] for d in surprised for why in d.left_out.values()]
    for why in sorted(set(reasons)):
        print(f"- left out {reasons.count(why)} times: {why}")


if __name__ == "__main__":
    main()
