"""How time and memory grow with goals, classes and obstacles, with the exponents fitted.

    python benchmarks/scaling.py [--worlds 2] [--limit 60] [--plot FILE] [--keep]

Random worlds of the 2017 paper's recipe, one thing varied at a time: goals (tether 300, 20
obstacles), classes (20 goals, tether 200 to 550), obstacles (20 goals, tether 300, as many to the
area). Each measurement is a process of its own; memory is its peak beyond what it had, with all
code read, before. An exponent is the slope
of a line through the logarithms of all points, by least squares; proofs that did not come to an end
within the limit are left out of it, and counted.
"""

from __future__ import annotations

import argparse
import math
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

import numpy as np
from peak import highest
from table import head, heading, row

from netsp import Status, solve_graph
from netsp.model.problem import Problem
from netsp.plan.random_worlds import random_world
from netsp.roadmap.taut import TautRoadmap
from netsp.roadmap.travel_graph import TravelGraph
from netsp.view.pictures.style import SERIES, save

GOALS = (10, 20, 40, 80, 160, 320)
TETHERS = (200, 250, 300, 350, 400, 450, 500, 550)
OBSTACLES = (10, 20, 40, 80, 160)
ROUNDS = 2000
LEAST_S, LEAST_MIB = 0.002, 20.0
"""Less is rounding: of the clock, and of what the process has anyway."""

WHAT = {
    "roadmap": "taut: all classes",
    "legs": "taut: all legs",
    "lns": f"lns, {ROUNDS} rounds",
    "auto": "auto, to the proof",
}


@dataclass(frozen=True)
class Sample:
    """One world: what was varied, its number of classes, seconds of each part (nan where it was
    not measured, or not proven), and MiB."""

    varied: str
    value: float
    classes: int
    seconds: dict[str, float]
    proven: bool
    mib: float


def world(varied: str, value: float, seed: int) -> Problem:
    """A world where one thing has a value."""
    if varied == "goals":
        return random_world(seed, goals=int(value), tether_length=300.0)
    if varied == "classes":
        return random_world(seed, goals=20, tether_length=float(value))
    side = 500.0 * math.sqrt(value / 20.0)
    return random_world(seed, goals=20, obstacles=int(value), tether_length=300.0, side=side)


def measured(job: tuple[str, float, int, float]) -> Sample:
    """In a process of its own."""
    varied, value, seed, limit = job
    warm = TautRoadmap(random_world(0, goals=5, tether_length=300.0)).to_travel_graph()
    for solver in ("lns", "auto"):
        solve_graph(warm, solver, iteration_limit=5)
    problem = world(varied, value, seed)
    before = highest()
    seconds: dict[str, float] = {}

    def clocked(name: str, run: Any) -> Any:
        begin = time.perf_counter()
        out = run()
        seconds[name] = time.perf_counter() - begin
        return out

    roadmap = clocked("roadmap", lambda: TautRoadmap(problem))
    graph: TravelGraph = roadmap.to_travel_graph()
    found = clocked("auto", lambda: solve_graph(graph, "auto", time_limit=limit))
    mib = 1024 * (highest() - before)
    proven = found.status is Status.OPTIMAL
    if len(graph) <= 4000:
        again = TautRoadmap(problem).to_travel_graph()
        clocked("legs", lambda: again.costs)
        clocked("lns", lambda: solve_graph(again, "lns", iteration_limit=ROUNDS))
    return Sample(varied, value, len(graph), seconds, proven, mib)


def exponent(x: np.ndarray, y: np.ndarray, least: float) -> tuple[float, float]:
    """Slope of the line through the logarithms, and the share of the variance that it explains."""
    held = np.isfinite(y) & (y >= least)
    if held.sum() < 3 or np.ptp(x[held]) == 0.0:
        return math.nan, math.nan
    u, v = np.log(x[held]), np.log(y[held])
    slope, offset = np.polyfit(u, v, 1)
    left = float(((v - slope * u - offset) ** 2).sum())
    return float(slope), 1.0 - left / max(float(((v - v.mean()) ** 2).sum()), 1e-300)


def against(samples: list[Sample], varied: str, what: str) -> tuple[np.ndarray, np.ndarray]:
    """x and y of a curve; y is nan where it was not measured or not proven."""
    some = [s for s in samples if s.varied == varied]
    x = np.array([s.classes if varied == "classes" else s.value for s in some], dtype=float)
    if what == "memory":
        return x, np.array([s.mib for s in some])
    return x, np.array([
        math.nan if what == "auto" and not s.proven else s.seconds.get(what, math.nan)
        for s in some
    ])  # fmt: skip


def drawn(samples: list[Sample], path: str) -> None:
    """Curves of times and of memory."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 6), layout="constrained")
    panels = figure.subplots(2, 3, sharex="col", sharey="row")
    for k, varied in enumerate(("goals", "classes", "obstacles")):
        curves = [(panels[0][k], what, LEAST_S, name) for what, name in WHAT.items()]
        for n, (panel, what, least, name) in enumerate(
            [*curves, (panels[1][k], "memory", LEAST_MIB, "peak memory")]
        ):
            x, y = against(samples, varied, what)
            held = np.isfinite(y) & (y >= least)
            look = {"color": SERIES[n] if what != "memory" else "#000000"}
            panel.plot(x[held], y[held], "os^Dv"[n], markersize=4, label=name, **look)
            slope, _ = exponent(x, y, least)
            if math.isfinite(slope):
                fit = np.polyfit(np.log(x[held]), np.log(y[held]), 1)
                ends = np.array([x[held].min(), x[held].max()])
                panel.plot(ends, np.exp(np.polyval(fit, np.log(ends))), lw=1, **look)
            panel.set(xscale="log", yscale="log")
            panel.grid(alpha=0.3)
        panels[1][k].set(xlabel=varied)
    panels[0][0].set(ylabel="seconds")
    panels[1][0].set(ylabel="peak memory, MiB more")
    names, labels = panels[0][1].get_legend_handles_labels()
    figure.legend(names, labels, fontsize=8, loc="outside upper center", ncols=len(labels))
    save(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=2)
    parser.add_argument("--limit", type=float, default=60.0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--plot")
    args = parser.parse_args()
    heading("How it grows")
    values = {"goals": GOALS, "classes": TETHERS, "obstacles": OBSTACLES}
    jobs = [
        (varied, float(value), seed, args.limit)
        for varied, those in values.items() for value in those for seed in range(args.worlds)
    ]  # fmt: skip
    with ProcessPoolExecutor(
        args.jobs, mp_context=get_context("spawn"), max_tasks_per_child=1
    ) as pool:
        samples = list(pool.map(measured, jobs))
    head("varied", "from", "to", "classes", "what", "exponent", "R²", "at the largest",
         "not proven", name="scaling")  # fmt: skip
    for varied in values:
        some = [s for s in samples if s.varied == varied]
        x, _ = against(samples, varied, "memory")
        classes = [s.classes for s in some]
        for what in (*WHAT, "memory"):
            x, y = against(samples, varied, what)
            slope, share = exponent(x, y, LEAST_MIB if what == "memory" else LEAST_S)
            last = y[int(np.argmax(np.where(np.isfinite(y), x, -1.0)))]
            unit = "MiB" if what == "memory" else "s"
            open_ = sum(not s.proven for s in some) if what == "auto" else ""
            fitted = ["", ""] if math.isnan(slope) else [f"{slope:.2f}", f"{share:.2f}"]
            row(varied, f"{x.min():g}", f"{x.max():g}", f"{min(classes)} to {max(classes)}",
                WHAT.get(what, "peak memory"), *fitted,
                f"{last:.3g} {unit}", open_)  # fmt: skip
    print()
    if args.plot:
        drawn(samples, args.plot)


if __name__ == "__main__":
    main()
