"""Times both roadmaps and draws the convergence of PRM* towards the exact optimum.

python benchmarks/roadmaps.py                 the tables
python benchmarks/roadmaps.py --convergence   docs/pictures/prm-convergence.png and its table
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np
from peak import highest
from table import ROOT, head, heading, row


def times_row(name: str, values: list[float], note: str = "") -> None:
    """One line of the table."""
    low, high = min(values), max(values)
    row(name, f"{statistics.median(values):.3f}", f"{low:.3f}", f"{high:.3f}", len(values), note)


def taut(tether: float, worlds: int = 10) -> None:
    """Classes and the full matrix, 20 circles and 20 goals."""
    from netsp.roadmap.taut import TautRoadmap
    from tests.worlds import random_world

    TautRoadmap(random_world(0, goals=3, tether=200.0)).to_travel_graph().costs  # noqa: B018
    times, sizes = [], []
    for seed in range(worlds):
        problem = random_world(seed, goals=20, tether=tether)
        begin = time.perf_counter()
        graph = TautRoadmap(problem).to_travel_graph()
        graph.costs  # noqa: B018
        times.append(time.perf_counter() - begin)
        sizes.append(len(graph))
    peak = highest()
    times_row(
        f"taut, classes and matrix, 20 goals, tether {tether:g}",
        times,
        f"{min(sizes)} to {max(sizes)} vertices, peak {peak:.2f} GiB",
    )


def many(worlds: int = 5) -> None:
    """Classes alone among 100 obstacles; the world grows with their number."""
    from netsp.roadmap.taut import TautRoadmap
    from tests.worlds import random_world

    times, sizes = [], []
    for seed in range(worlds):
        problem = random_world(seed, circles=100, goals=100, tether=300.0, side=1100.0)
        begin = time.perf_counter()
        sizes.append(len(TautRoadmap(problem).cluster))
        times.append(time.perf_counter() - begin)
    times_row(
        "taut, classes, 100 circles, 100 goals, tether 300", times, f"{min(sizes)} to {max(sizes)}"
    )


def prm(worlds: int = 5) -> None:
    """Build and matrix of PRM*, 1000 samples, tether 300."""
    from netsp.roadmap.prm import PrmRoadmap
    from tests.worlds import random_world

    PrmRoadmap(random_world(0, goals=3, tether=200.0), samples=50)
    builds, matrices, sizes = [], [], []
    for seed in range(worlds):
        problem = random_world(seed, goals=20, tether=300.0)
        begin = time.perf_counter()
        graph = PrmRoadmap(problem, seed=seed).to_travel_graph()
        built = time.perf_counter()
        graph.costs  # noqa: B018
        builds.append(built - begin)
        matrices.append(time.perf_counter() - built)
        sizes.append(len(graph))
    times_row("prm, build, 1000 samples, 20 circles, tether 300", builds)
    times_row("prm, matrix, 20 goals", matrices, f"{min(sizes)} to {max(sizes)} vertices")


def first_run() -> None:
    """The whole of a first run in a process with nothing compiled: 20 goals, tether 350."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from tests.worlds import random_world\n"
        "from netsp import travel_graph\n"
        "travel_graph(random_world(0, goals=20, tether=350.0)).costs\n"
    )
    with tempfile.TemporaryDirectory() as cache:
        begin = time.perf_counter()
        subprocess.run(
            [sys.executable, "-c", code, str(ROOT)],
            check=True,
            env={**os.environ, "NUMBA_CACHE_DIR": cache},
        )
        times_row("taut, first run ever, compilation included", [time.perf_counter() - begin])


Ratios = dict[int, list[float]]


def ratios(counts: list[int], worlds: int, seeds: int) -> tuple[Ratios, Ratios, dict[int, int]]:
    """PRM* optimum over the exact one by the number of samples: along the roadmap, with the legs
    pulled taut, and how often there was no tour."""
    from netsp import solve
    from netsp.base.errors import LimitReachedError
    from tests.worlds import random_world

    along: Ratios = {n: [] for n in counts}
    shortcut: Ratios = {n: [] for n in counts}
    lost = dict.fromkeys(counts, 0)
    for w in range(worlds):
        problem = random_world(w, goals=10, tether=300.0)
        exact = solve(problem).length or 0.0
        for n in counts:
            for seed in range(seeds):
                for pulled, into in ((False, along), (True, shortcut)):
                    options = {"samples": n, "shortcut": pulled}
                    try:
                        found = solve(problem, roadmap="prm", roadmap_options=options, seed=seed)
                    except LimitReachedError:
                        lost[n] += 1
                        continue
                    into[n].append((found.length or 0.0) / exact)
    return along, shortcut, lost


def convergence(worlds: int = 3, seeds: int = 3) -> None:
    """As a table and a picture."""
    from matplotlib.figure import Figure

    from netsp.view.pictures.style import EDGE, PATH, TETHER

    counts = [250, 500, 1000, 2000, 4000, 8000, 16000]
    along, shortcut, lost = ratios(counts, worlds, seeds)
    print()
    head("samples", "median ratio", "min", "max", "pulled taut: median",
         "pulled taut: max", "no tour", name="prm-convergence")  # fmt: skip
    for n in counts:
        r, s = along[n], shortcut[n]
        row(
            n, f"{np.median(r):.5f}", f"{min(r):.5f}", f"{max(r):.5f}", f"{np.median(s):.6f}",
            f"{max(s):.5f}", lost[n],
        )  # fmt: skip
    figure = Figure(figsize=(6.5, 4.0), layout="constrained")
    ax = figure.subplots()
    for n in counts:
        ax.plot([n] * len(along[n]), 100 * (np.array(along[n]) - 1), ".", color=PATH, ms=5)
    medians = [100 * (np.median(along[n]) - 1) for n in counts]
    pulled_medians = [100 * (np.median(shortcut[n]) - 1) for n in counts]
    ax.plot(counts, medians, color=PATH, label="along the roadmap (median)")
    ax.plot(counts, pulled_medians, "--", color=TETHER, label="legs pulled taut (median)")
    ax.axhline(0.0, color=EDGE, lw=0.8)
    ax.set_xscale("log")
    ax.set_xticks(counts, [str(n) for n in counts])
    ax.minorticks_off()
    ax.set_xlabel("samples")
    ax.set_ylabel("per cent above the exact optimum")
    ax.set_title(f"{worlds} worlds, {seeds} seeds, 20 circles, 10 goals, tether 300", fontsize=10)
    ax.legend()
    figure.savefig(ROOT / "docs" / "pictures" / "prm-convergence.png", dpi=130)


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--convergence", action="store_true")
    args = parser.parse_args()
    heading("Roadmaps")
    if args.convergence:
        convergence()
        return
    head("what", "median s", "min", "max", "samples", "note", name="roadmap-speed")
    taut(350.0)
    taut(500.0, worlds=3)
    many()
    prm()
    first_run()


if __name__ == "__main__":
    main()
