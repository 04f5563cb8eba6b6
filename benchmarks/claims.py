"""What README and docs claim, in a quick form: one entry a claim, measured by the benchmarks' code.

A claim has a name, a threshold as it is published, and a function that measures it and says whether
it held. Correctness has no allowance. A claim about time counts CPU seconds, with an allowance of
three, and is measured once more before it falls: the machine may be busy.
"""

from __future__ import annotations

import functools
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from table import ROOT

ALLOWANCE = 3.0
"""Of CPU seconds, for a busy machine and a slower one than that of the published figures."""

DATA = ROOT.parent / "shared" / "data"
"""Recorded flights, where they are present."""


@dataclass(frozen=True)
class Claim:
    """One entry. measure : returns what was measured, and whether it held. timed : measured once
    more before it falls."""

    name: str
    threshold: str
    measure: Callable[[], tuple[str, bool]]
    timed: bool = False


def proofs(cells: list[tuple[int, float]], worlds: int, limit: float) -> tuple[str, bool]:
    """Worlds proven optimal and verified, of all."""
    import frontier

    proven = verified = count = 0
    for goals, tether in cells:
        for seed in range(worlds):
            outcome = frontier.proof(frontier.world(seed, goals, tether, many=False), limit)
            count += 1
            proven += outcome.proven
            verified += outcome.verified
    return f"{proven} proven, {verified} verified of {count}", proven == verified == count


def table_one() -> tuple[str, bool]:
    return proofs([(n, t) for n in (5, 10, 15, 20) for t in (200, 250, 300, 350)], 5, 60.0)


def frontier_cells() -> tuple[str, bool]:
    return proofs([(20, 500), (40, 300), (60, 300)], 3, 120.0)


def bounds() -> tuple[str, bool]:
    """Runs stopped early, whose bound must not exceed the optimum."""
    from netsp import solve_graph, travel_graph
    from netsp.worlds import random_world

    worst, runs = -np.inf, 0
    for seed in range(10):
        graph = travel_graph(random_world(seed, goals=12, tether_length=320.0))
        best = solve_graph(graph, "mip").length or np.nan
        for solver, limit in (("mip", 2), ("mip", 10), ("dp", 2), ("dp", 6), ("auto", 4)):
            bound = solve_graph(graph, solver, iteration_limit=limit).lower_bound or 0.0
            worst = max(worst, bound / best - 1.0)
            runs += 1
    return f"{worst:.1e} at most in {runs} runs", worst <= 1e-9


def heuristic(name: str, most: float, **limits: float) -> Callable[[], tuple[str, bool]]:
    """Mean per cent of a heuristic above the proven optimum, 20 goals, tether 350."""

    def measure() -> tuple[str, bool]:
        from solvers import over_optimum

        over = over_optimum(name, range(6), **limits)
        return f"{np.mean(over):.2f} %", float(np.mean(over)) <= most

    return measure


def closed_forms() -> tuple[str, bool]:
    import tether

    errors, backs = [], []
    for _, solid, path, truth in tether.closed_cases():
        from netsp.online import GeodesicTether, Scene

        found, _, _, back = tether.driven(GeodesicTether(Scene(solids=[solid]).field(), 0.1), path)
        errors.append(abs(found.length / truth - 1.0))
        backs.append(back)
    return (
        f"{100 * max(errors):.4f} %, {max(backs):.4f} m left on the way back",
        max(errors) <= 1e-4 and max(backs) <= 1e-3,
    )


def prisms() -> tuple[str, bool]:
    import tether

    worst, wrong, count, back = 0.0, 0, 0, 0.0
    for family in ("icra2017", "harbour"):
        for seed in range(3):
            errors, bad, left, _ = tether.prism_world(family, seed)
            worst, wrong = max(worst, float(np.abs(errors).max())), wrong + bad
            count, back = count + len(errors), max(back, left)
    return f"{worst:.4f} %, {wrong} of {count} wrong, {back:.4f} left", worst <= 0.01 and not wrong


def mission(name: str, replan_s: float) -> Iterator[Claim]:
    """Claims about one shipped mission, flown once."""
    flown: list[dict[str, float]] = []

    def fly() -> dict[str, float]:
        import react

        from netsp.online.mission import Mission

        there = Mission.load(ROOT / "missions" / f"{name}.json")
        scene = there.load_scene()
        flown.append(react.fly(there, scene, scene.field(), "predictive", "kinematic"))
        return flown[-1]

    def safe() -> tuple[str, bool]:
        s = fly()
        shown = f"{s['exceedance_s']:.1f} s, {s['visited']} of {s['waypoints']}"
        return shown, s["exceedance_s"] == 0.0 and s["visited"] == s["waypoints"]

    def replan() -> tuple[str, bool]:
        s = flown.pop() if flown else fly()
        worst = s["replan_worst_s"]
        return f"{1e3 * worst:.0f} ms CPU", worst <= ALLOWANCE * replan_s

    yield Claim(f"{name}: tether too long; waypoints visited", "0.0 s; all", safe)
    yield Claim(
        f"{name}: worst replan",
        f"{1e3 * replan_s:.0f} ms CPU (x {ALLOWANCE:g})",
        replan,
        timed=True,
    )


def _surprised(task: tuple[int, str]) -> tuple[list[str], float] | None:
    import surprises

    flown = surprises.run(*task)
    if flown is None:
        return None
    done, faults = flown
    return faults, max((e.planning_s for e in done.entries), default=0.0)


@functools.cache
def _pool() -> ProcessPoolExecutor:
    """Two processes that keep the worlds they have solved."""
    return ProcessPoolExecutor(2)


def carried_out(kind: str, runs: int = 20) -> Claim:
    """Tours carried out with a surprise of a kind, over worlds of all kinds."""

    def measure() -> tuple[str, bool]:
        tasks = [(k, kind) for k in range(5 * runs // 4)]
        flown = [f for f in _pool().map(_surprised, tasks) if f is not None]
        found = flown[:runs]
        good = sum(not faults for faults, _ in found)
        first = next((f[0] for f, _ in found if f), "")
        return f"{good} of {len(found)} {first}".strip(), good == len(found) >= min(runs, 10)

    return Claim(f"execute, surprise: {kind}", "all good", measure)


def overrun() -> tuple[str, bool]:
    """Seconds beyond a limit of one, over solvers, on two large problems."""
    import limits

    worst, where, silent = limits.worst(1.0)
    return f"{worst:.2f} s ({where}); {silent} without a tour", worst <= 1.0


def killed() -> tuple[str, bool]:
    """A comparison killed without a word, and continued: every trial once."""
    with tempfile.TemporaryDirectory() as folder:
        rows = Path(folder) / "r.jsonl"
        command = [sys.executable, "-m", "netsp", "compare", "-o", str(rows), "--goals", "6", "8",
                   "--tethers", "250", "--solvers", "auto", "greedy", "--worlds", "10",
                   "--quiet"]  # fmt: skip
        first = subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL)
        for _ in range(600):
            time.sleep(0.05)
            if rows.exists() and rows.read_bytes().count(b"\n") >= 5:
                break
        os.killpg(first.pid, signal.SIGKILL)
        first.wait()
        kept = rows.read_bytes()
        kept = kept[: kept.rfind(b"\n") + 1]
        again = subprocess.run(command, capture_output=True)
        ids = [json.loads(line)["trial"] for line in rows.read_text().splitlines()]
        whole = rows.read_bytes().startswith(kept)
    held = again.returncode == 0 and len(ids) == len(set(ids)) == 40 and whole
    before = kept.count(b"\n")
    return f"{len(set(ids))} of 40 trials, {before} before the kill", held


def cold_start() -> tuple[str, bool]:
    """CPU seconds of the first solve on a machine, its cache of compiled code empty."""
    with tempfile.TemporaryDirectory() as folder:
        env = dict(os.environ) | {"NUMBA_CACHE_DIR": folder}
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "netsp", "solve", str(ROOT / "problems" / "wharf.json"),
                   "-o", f"{folder}/s.json"]  # fmt: skip
        done = subprocess.run(command, env=env, capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    told = "compiling" in done.stderr
    shown = f"{spent:.1f} s CPU" + ("" if told else ", and did not say that it compiles")
    return shown, done.returncode == 0 and told and spent <= ALLOWANCE * 15.0


def help_start() -> tuple[str, bool]:
    """Seconds of CPU until the help is printed, over those of Python's own start."""

    def spent(command: list[str]) -> float:
        runs = []
        for _ in range(5):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(command, capture_output=True, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            runs.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        return float(np.median(runs))

    ratio = spent([sys.executable, "-m", "netsp", "--help"]) / spent([sys.executable, "-c", ""])
    return f"{ratio:.1f} times", ratio <= 8.0


def repeatable() -> tuple[str, bool]:
    """Pairs of runs in new processes, with other hash seeds and numbers of threads, to the byte."""
    import repeat

    same, pairs = repeat.pairs(20)
    return f"{same} of {pairs}", same == pairs


def judged() -> tuple[str, bool]:
    """False tours accepted, and right ones refused, over hostile worlds."""
    import judge

    right, false, refused, accepted = judge.count(100)
    held = not refused and not accepted
    return f"{len(accepted)} of {false} accepted, {len(refused)} of {right} refused", held


def flights() -> tuple[str, bool]:
    """Predicted over flown times of recorded flights of exported missions."""
    import flown

    if not (DATA / "ardusub").is_dir():
        return "not measured: the recorded flights are not here", True
    ratios = flown.ratios(DATA / "ardusub")
    return f"{min(ratios):.2f} to {max(ratios):.2f}", 0.9 <= min(ratios) <= max(ratios) <= 1.1


def page(name: str) -> Claim:
    """Every command and snippet of a page."""

    def measure() -> tuple[str, bool]:
        import pages

        with tempfile.TemporaryDirectory() as folder:
            try:
                ran = pages.run_page(name, Path(folder))
            except AssertionError as error:
                return str(error).strip().splitlines()[0], False
        return f"{len(ran)} run", True

    return Claim(f"{name}: commands and snippets", "run as written", measure)


def claims() -> Iterator[Claim]:
    """All of them, quick ones first."""
    import pages
    import surprises

    yield Claim("cold start: first solve of the wharf", "15 s CPU (x 3)", cold_start, timed=True)
    yield Claim("`netsp --help` over the start of Python", "8 times", help_start, timed=True)
    yield Claim("Table I: proven and verified", "80 of 80 worlds", table_one)
    yield Claim("frontier: 20/500, 40/300, 60/300", "9 of 9 worlds", frontier_cells)
    yield Claim("bounds above the optimum", "none", bounds)
    yield Claim("lns over the optimum, 1 s", "0.01 %", heuristic("lns", 0.01, time_limit=1.0))
    yield Claim(
        "anneal over the optimum, 20 M proposals", "3 %",
        heuristic("anneal", 3.0, iteration_limit=20_000_000),
    )  # fmt: skip
    yield Claim("reduced-mip over the optimum", "4 %", heuristic("reduced-mip", 4.0))
    yield Claim("false tours accepted, right ones refused", "none", judged)
    yield Claim("same seed, same bytes", "all pairs", repeatable)
    yield Claim("tether: closed forms; way back", "0.01 %; 1 mm", closed_forms)
    yield Claim("tether: prisms; classes", "0.01 %; none wrong", prisms)
    yield Claim("beyond a time limit of 1 s, every solver", "1 s", overrun, timed=True)
    yield Claim("comparison killed and continued", "every trial once", killed)
    yield Claim("predicted times of recorded flights", "within 10 %", flights)
    for name, worst in (("basin", 0.15), ("pipes", 0.3), ("jacket", 1.4)):
        yield from mission(name, worst)
    for kind in surprises.KINDS:
        yield carried_out(kind)
    for name in pages.PAGES:
        if any(True for _ in pages.blocks(name)):
            yield page(name)
