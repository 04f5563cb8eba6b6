"""The figures of docs/theory, each drawn from what the code computes.

    python benchmarks/theory.py [--folder docs/pictures]

Words and lengths in them are those of the paths that are drawn; a string among slits is as long as
`netsp.roadmap.slits` says it is, or no figure is written.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle as PlotCircle

from netsp import Circle, Polygon, Problem, solve
from netsp.base.geometry import polylines
from netsp.hsignature import reduce
from netsp.hsignature.rays import crossings, signature
from netsp.roadmap.paths import TautPaths
from netsp.roadmap.taut import TautRoadmap
from netsp.view.pictures import style
from netsp.view.pictures.moments import moments_of_plan
from netsp.view.pictures.problem_picture import draw_obstacles

RISE = 0.35
"""Of a letter above its crossing."""


def panels(count: int, width: float, height: float) -> tuple[Any, Any]:
    """A figure of maps side by side."""
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, np.atleast_1d(figure.subplots(1, count))


def finish(ax: Any, title: str, box: Sequence[float]) -> None:
    """Names, units and what is seen."""
    ax.set(xlim=box[:2], ylim=box[2:], aspect="equal", xlabel="x (m)", ylabel="y (m)")
    ax.set_title(title, fontsize=9, loc="left")
    ax.tick_params(labelsize=7)


def draw_rays(ax: Any, problem: Problem, top: float) -> None:
    """From each representative point up."""
    for i, (x, y) in enumerate(problem.representative_points):
        ax.plot([x, x], [y, top], ":", color=style.EDGE, lw=1.0, zorder=2)
        ax.plot(x, y, ".", color=style.EDGE, ms=5, zorder=3)
        ax.annotate(str(i + 1), (x, y), xytext=(4, -9), textcoords="offset points", fontsize=8,
                    path_effects=style.halo())  # fmt: skip


def draw_letters(ax: Any, path: Any, points: Any) -> None:
    """The letter of each crossing, in its place."""
    for p, q in pairwise(np.asarray(path)[:, :2]):
        letters = crossings([p, q], points)
        for letter in letters:
            x = points[abs(letter) - 1][0]
            y = p[1] + (x - p[0]) / (q[0] - p[0]) * (q[1] - p[1])
            ax.plot(x, y, "o", ms=3.5, color=style.TETHER, zorder=6)
            ax.annotate(f"{letter:+d}".replace("-", "−"), (x, y), xytext=(4, 4), fontsize=8,
                        textcoords="offset points", color=style.TETHER, zorder=7,
                        path_effects=style.halo())  # fmt: skip


def told(word: Sequence[int]) -> str:
    """A word as it is written."""
    return "(" + ", ".join(str(a).replace("-", "−") for a in word) + ")" if word else "()"


def words() -> Any:
    """Three classes of one goal."""
    problem = Problem(
        base=(0, 0), goals=[(9, 1)], tether_length=13,
        obstacles=[Circle(center=(3, 0.6), radius=0.7), Circle(center=(6, 0.2), radius=0.9)],
    )  # fmt: skip
    roadmap = TautRoadmap(problem)
    order = np.argsort(roadmap.tethers[1:], kind="stable")[:4] + 1
    figure, axes = panels(len(order), 13.0, 2.5)
    for ax, v in zip(axes, order, strict=True):
        draw_obstacles(ax, problem)
        draw_rays(ax, problem, 3.4)
        tether = roadmap.paths.tether(0, roadmap.signatures[v])
        ax.plot(*tether.T[:2], color=style.TETHER, lw=1.6, zorder=5)
        draw_letters(ax, tether, problem.representative_points)
        ax.plot(*problem.base[:2], "*", color=style.BASE, ms=11, zorder=6)
        ax.plot(*problem.goals[0].position[:2], "o", color=style.GOAL, mec=style.PATH, zorder=6)
        word = signature(tether, problem.representative_points)
        assert word == tuple(roadmap.signatures[v])
        finish(ax, f"{told(word)}: {roadmap.tethers[v]:.4g} m", (-0.8, 9.8, -2.2, 3.4))
    return figure


def limit() -> Any:
    """How long the tether is along the legs of a tour."""
    problem = Problem.load(Path(__file__).parent.parent / "problems" / "wharf.json")
    tour = solve(problem)
    moments = moments_of_plan(problem, tour, 600)
    gone = np.linspace(0.0, float(tour.length or 0.0), len(moments))
    lengths = [polylines.length(m.nodes) for m in moments]
    counts = np.array([len(m.fates["visited"]) for m in moments])
    arrivals = [int(np.argmax(counts >= k + 1)) for k in range(len(tour.tour))]
    ends, step = [0, *arrivals, len(moments) - 1], float(gone[1])
    for a, b in pairwise(ends):
        assert max(lengths[a : b + 1]) <= max(lengths[a], lengths[b]) + step
    figure = Figure(figsize=(9.0, 3.2), layout="constrained")
    ax = figure.subplots()
    ax.plot(gone, lengths, color=style.TETHER, lw=1.6, label="taut tether")
    for a, b in pairwise(ends):
        most = max(lengths[a], lengths[b])
        ax.plot([gone[a], gone[b]], [most, most], color=style.PLAN, lw=1.2, ls="--",
                label="the longer of a leg's ends" if a == 0 else None)  # fmt: skip
    ax.plot(gone[arrivals], np.array(lengths)[arrivals], "o", ms=5, color=style.VISITED,
            label="goal visited")  # fmt: skip
    ax.axhline(problem.tether_length, color=style.LIMIT, ls="--", lw=1.0, label="limit")
    ax.set(xlabel="distance along the tour (m)", ylabel="length (m)", ylim=(0.0, 22.0))
    figure.legend(loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return figure


def pending() -> Any:
    """A letter that a path writes and takes back, one that it keeps, and one that it takes back
    around a hook that reaches across the ray from the path's own side."""
    over = Problem(
        base=(-3.5, 1.2), goals=[(-3.5, 5.2), (3.5, 2.0)], tether_length=14,
        obstacles=[Circle(center=(0, 0), radius=0.4), Circle(center=(-0.6, 3.2), radius=1.3)],
    )  # fmt: skip
    room = [(2, 2), (8, 2), (8, 8), (5, 8), (5, 7), (7, 7), (7, 3), (3, 3), (3, 7), (4, 7),
            (4, 8), (2, 8)]  # fmt: skip
    hooked = Problem(
        base=(6.6, 4.2), goals=[(9, 7)], tether_length=14,
        obstacles=[Circle(center=(6, 5.3), radius=0.5), Polygon(polygon=room)],
    )  # fmt: skip
    figure, axes = panels(3, 12.0, 4.6)
    wide, tall = (-4.2, 4.2, -1.2, 6.6), (1.4, 9.8, 1.4, 9.4)
    for ax, problem, goal, word, again, title, box in (
        (axes[0], over, 0, (-2,), True, "+1 is pending until −1 takes it back", wide),
        (axes[1], over, 1, (1,), False, "+1 is final", wide),
        (axes[2], hooked, 0, (), True, "−1 is pending around the hook of 2", tall),
    ):
        paths = TautPaths(problem)
        draw_obstacles(ax, problem)
        draw_rays(ax, problem, box[3])
        path = paths.tether(goal, word)
        letters = crossings(path, problem.representative_points)
        assert 1 in letters
        assert (-1 in letters) == again
        ax.plot(*path.T[:2], color=style.TETHER, lw=1.6, zorder=5)
        draw_letters(ax, path, problem.representative_points)
        ax.plot(*problem.base[:2], "*", color=style.BASE, ms=11, zorder=6)
        ax.plot(*problem.goals[goal].position[:2], "o", color=style.GOAL, mec=style.PATH, zorder=6)
        finish(ax, f"letters {told(letters)}, word {told(word)}:\n{title}", box)
    return figure


def slits() -> Any:
    """A leg, the string among slits below it, and the same unfolded."""
    problem = Problem(
        base=(0, 0), goals=[(2.2, 3.6)], tether_length=30,
        obstacles=[
            Circle(center=(2.0, 0.9), radius=0.8), Circle(center=(4.6, 1.2), radius=1.0),
            Circle(center=(7.2, 1.6), radius=0.9),
        ],
    )  # fmt: skip
    word = (-3, -2)  # below all, and back above the third and the second
    paths = TautPaths(problem)
    leg = paths.tether(0, word)
    reach = np.array([[o.center[1] - o.radius, o.center[1] + o.radius] for o in problem.obstacles])
    x = np.array([o.center[0] for o in problem.obstacles])
    start, goal = np.zeros(2), np.array(problem.goals[0].position[:2])
    # to the right of the last chord below all, and back above those that lie right of the goal
    gates = [(x[k], -np.inf, reach[k, 0]) for k in range(3)]
    gates += [(x[k], reach[k, 1], np.inf) for k in (2, 1) if x[k] > goal[0]]
    string, unfolded = shortest_through(start, goal, gates)
    assert abs(polylines.length(string) - paths.slit_length(0, 1, word)) < 1e-6
    figure = Figure(figsize=(12.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.25])
    draw_obstacles(left, problem)
    for k in range(3):
        left.plot([x[k], x[k]], reach[k], color=style.EDGE, lw=2.6, zorder=4)
        left.plot([x[k], x[k]], [-9, 9], ":", color=style.EDGE, lw=0.7, zorder=1)
    left.plot(*leg.T[:2], color=style.PATH, lw=1.6, label=f"leg, {polylines.length(leg):.4g} m")
    left.plot(*string.T, color=style.PLAN, lw=1.6, ls="--",
              label=f"string among slits, {polylines.length(string):.4g} m")  # fmt: skip
    left.plot(*start, "*", color=style.BASE, ms=11, zorder=6)
    left.plot(*goal, "o", color=style.GOAL, mec=style.PATH, zorder=6)
    finish(left, f"word {told(word)}", (-0.8, 9.0, -1.4, 4.8))
    left.legend(loc="lower right", fontsize=7, frameon=False)
    along = unfolded[:, 0]
    for s, low, high in gates_unfolded(start, gates):
        right.plot([s, s], [max(low, -9), min(high, 9)], color=style.VISITED, lw=1.0, zorder=1)
        bar = [high, 9.0] if np.isfinite(high) else [-9.0, low]
        right.plot([s, s], bar, color=style.EDGE, lw=2.6, zorder=2)
    right.plot(*unfolded.T, color=style.PLAN, lw=1.6, ls="--")
    right.plot(*unfolded[0], "*", color=style.BASE, ms=11, zorder=6)
    right.plot(*unfolded[-1], "o", color=style.GOAL, mec=style.PATH, zorder=6)
    finish(right, "unfolded: a string through half-lines", (-0.8, along[-1] + 0.8, -1.4, 4.8))
    right.set(xlabel="distance travelled in x (m)")
    handles = [
        Line2D([], [], color=style.EDGE, lw=2.6, label="closed half of a line"),
        Line2D([], [], color=style.VISITED, lw=1.0, label="gate"),
    ]
    right.legend(handles=handles, loc="lower right", fontsize=7, frameon=False)
    return figure


def gates_unfolded(start: Any, gates: Any) -> list[tuple[float, float, float]]:
    """The gates over the way in x."""
    out, s, at = [], 0.0, float(start[0])
    for x, low, high in gates:
        s += abs(x - at)
        at = x
        out.append((s, low, high))
    return out


def shortest_through(start: Any, goal: Any, gates: Any) -> tuple[Any, Any]:
    """The shortest string through half-lines in their order: by a search over their ends."""
    over = gates_unfolded(start, gates)
    end = over[-1][0] + abs(float(goal[0]) - gates[-1][0])
    corners = [(0.0, float(start[1])), *((s, low if np.isfinite(low) else high)
               for s, low, high in over), (end, float(goal[1]))]  # fmt: skip

    def free(a: int, b: int) -> bool:
        (s, y), (t, z) = corners[a], corners[b]
        for k in range(a + 1, b):
            at, low, high = over[k - 1]
            height = y + (at - s) / (t - s) * (z - y) if t > s else y
            if not low - 1e-12 <= height <= high + 1e-12:
                return False
        return True

    best = {0: (0.0, [0])}
    for b in range(1, len(corners)):
        best[b] = min(
            (best[a][0] + float(np.hypot(*np.subtract(corners[b], corners[a]))), [*best[a][1], b])
            for a in range(b)
            if free(a, b)
        )
    chosen = best[len(corners) - 1][1]
    places = [start, *((g[0], 0.0) for g in gates), goal]
    unfolded = np.array([corners[k] for k in chosen])
    string = np.array([[places[k][0], corners[k][1]] for k in chosen])
    turn = int(np.argmax([g[0] for g in gates])) + 1
    if turn not in chosen:  # where it turns back it meets the line of the gate
        s = over[turn - 1][0]
        y = float(np.interp(s, unfolded[:, 0], unfolded[:, 1]))
        place = int(np.searchsorted(unfolded[:, 0], s))
        string = np.insert(string, place, [gates[turn - 1][0], y], axis=0)
    return string, unfolded


def spiral() -> Any:
    """Draw the shortest tours of the double spiral, over all classes and over the non-looping ones.

    The tether is drawn at the visit where its word is longest.
    """
    file = Path(__file__).parent.parent / "problems" / "known" / "double-spiral.json"
    problem = Problem.load(file)
    figure, axes = panels(2, 9.0, 5.2)
    paths = TautPaths(problem)
    lengths = []
    for ax, classes, title in (
        (axes[0], "all", "all classes"), (axes[1], "non-looping", "non-looping classes")
    ):  # fmt: skip
        tour = solve(problem, roadmap_options={"classes": classes})
        lengths.append(float(tour.length or 0.0))
        visit = max(tour.tour, key=lambda v: (len(v.signature), v.tether_length))
        draw_obstacles(ax, problem)
        draw_rays(ax, problem, 4.6)
        ax.plot(*np.array(tour.path).T[:2], color=style.PATH, lw=1.4, zorder=4)
        xy = np.array([g.position[:2] for g in problem.goals])
        ax.plot(*xy.T, "o", ms=3.5, color=style.GOAL, mec=style.PATH, zorder=5)
        tether = paths.tether(visit.goal, visit.signature)
        ax.plot(*tether.T[:2], color=style.TETHER, lw=1.4, ls="--", zorder=6)
        ax.plot(*problem.base[:2], "*", color=style.BASE, ms=11, zorder=7)
        name = f"{title}: {lengths[-1]:.2f} m, longest word {told(visit.signature)}"
        finish(ax, name, (-4.2, 4.2, -3.6, 4.6))
        assert (len(visit.signature) == 2) == (classes == "all")
    assert lengths[0] < 0.98 * lengths[1]
    handles = [
        Line2D([], [], color=style.PATH, lw=1.4, label="tour"),
        Line2D([], [], color=style.TETHER, lw=1.4, ls="--", label="tether of the longest word"),
        Line2D([], [], color=style.EDGE, lw=1.0, ls=":", label="ray of the pile"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return figure


def branches() -> Any:
    """Draw one crossing that all legs between two branches of tethers share."""
    far = [(8.0, 3.2), (8.6, 2.2), (7.6, 1.4), (8.0, -3.4), (8.6, -2.2), (7.4, -1.2)]
    problem = Problem(
        base=(0, 0), goals=far, tether_length=14,
        obstacles=[Circle(center=(4.0, 2.4), radius=1.0), Circle(center=(4.6, -2.2), radius=1.0)],
    )  # fmt: skip
    paths = TautPaths(problem)
    upper, lower = (1, 2), ()
    words = [upper] * 3 + [lower] * 3
    products = []
    figure, axes = panels(2, 11.0, 4.2)
    for ax in axes:
        draw_obstacles(ax, problem)
        ax.plot(*problem.base[:2], "*", color=style.BASE, ms=11, zorder=7)
    for k, word in enumerate(words):
        tether = paths.tether(k, word)
        axes[0].plot(*tether.T[:2], color=style.TETHER, lw=1.3, zorder=4)
    for u in range(3):
        for v in range(3, 6):
            between = reduce([*(-a for a in reversed(words[u])), *words[v]])
            leg = paths.path(u + 1, v + 1, between)
            axes[1].plot(*leg.T[:2], color=style.PATH, lw=1.3, zorder=4)
            tethers = paths.length(0, u + 1, words[u]) + paths.length(0, v + 1, words[v])
            products.append(0.5 * (tethers - paths.length(u + 1, v + 1, between)))
    assert np.ptp(products) < 1e-9
    for ax in axes:
        for names, rows in (("u", far[:3]), ("v", far[3:])):
            for k, (x, y) in enumerate(rows):
                ax.plot(x, y, "o", ms=5, color=style.GOAL, mec=style.PATH, zorder=6)
                ax.annotate(f"{names}{'₁₂₃'[k]}", (x, y), xytext=(6, -3),
                            textcoords="offset points", fontsize=8)  # fmt: skip
        ax.annotate("p", (4.0, 2.4), ha="center", va="center", fontsize=9)
        ax.annotate("q", (4.6, -2.2), ha="center", va="center", fontsize=9)
    box = (-0.8, 9.6, -4.2, 4.2)
    finish(axes[0], "tethers: two branches of a tree", box)
    finish(axes[1], f"nine legs, one crossing: Gromov product {products[0]:.4g} m", box)
    return figure


def shape() -> Any:
    """Draw a taut path around grown polygons: where it bends, and where it does not."""
    hook = [(2.0, 0.0), (7.0, 0.0), (7.0, 3.0), (5.6, 3.0), (5.6, 1.2), (3.4, 1.2), (3.4, 2.2),
            (2.0, 2.2)]  # fmt: skip
    problem = Problem(
        base=(0.0, 0.4), goals=[(9.6, 1.2)], tether_length=16, clearance=0.5,
        obstacles=[Polygon(polygon=hook), Circle(center=(8.6, 3.4), radius=0.6)],
    )  # fmt: skip
    paths = TautPaths(problem)
    word = (1,)
    tether = paths.tether(0, word)
    corners = np.array(hook)
    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    ax = figure.subplots()
    draw_obstacles(ax, problem)
    for k, corner in enumerate(corners):
        before, after = corner - corners[k - 1], corners[(k + 1) % len(corners)] - corner
        if before[0] * after[1] - before[1] * after[0] > 0:
            ax.add_artist(PlotCircle(corner, 0.5, fill=False, color=style.EDGE, lw=0.8, ls=":"))
        else:
            ax.plot(*corner, "x", ms=7, color=style.EDGE, zorder=6)
    ax.plot(*tether.T[:2], color=style.TETHER, lw=1.8, zorder=5, label="taut path")
    turns = distances_to_corners(tether, corners)
    assert min(turns) > 0.5 - 1e-6
    assert np.count_nonzero(np.array(turns) < 0.5 + 1e-3) == 3
    ax.plot(*problem.base[:2], "*", color=style.BASE, ms=11, zorder=7)
    ax.plot(*problem.goals[0].position[:2], "o", color=style.GOAL, mec=style.PATH, zorder=6)
    finish(ax, "", (-0.8, 10.4, -1.0, 4.9))
    handles = [
        Line2D([], [], color=style.TETHER, lw=1.8, label="taut path"),
        Line2D([], [], color=style.EDGE, lw=0.8, ls=":", label="arcs of convex vertices"),
        Line2D([], [], color=style.EDGE, lw=0, marker="x", label="reflex vertex: no bend"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return figure


def distances_to_corners(path: Any, corners: Any) -> list[float]:
    """Return the distance of each corner from a path."""
    line = shapely.LineString(np.asarray(path)[:, :2])
    return [float(line.distance(shapely.Point(corner))) for corner in corners]


def ring() -> Any:
    """Draw the shortest tour over the goals of a ring, which goes around, and the shortest tour."""
    angles = 2.0 * np.pi * np.arange(7) / 7
    places = 16.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    problem = Problem(
        base=tuple(places[0]), goals=[tuple(p) for p in places[1:]], tether_length=200.0,
        obstacles=[Circle(center=(0.0, 0.0), radius=10.0)],
    )  # fmt: skip
    best = solve(problem)
    around = np.vstack([places, places[:1]])
    words = (signature(around, problem.representative_points), ())
    assert len(words[0]) == 1
    figure, axes = panels(2, 8.6, 4.6)
    lengths = (polylines.length(around), float(best.length or 0.0))
    for ax, path, length, word, name in zip(
        axes, (around, np.array(best.path)), lengths, words, ("one sheet", "two sheets"),
        strict=True,
    ):  # fmt: skip
        draw_obstacles(ax, problem)
        draw_rays(ax, problem, 21.0)
        ax.plot(*path.T[:2], color=style.PATH, lw=1.5, zorder=4)
        draw_letters(ax, path, problem.representative_points)
        ax.plot(*places[1:].T, "o", ms=5, color=style.GOAL, mec=style.PATH, zorder=5)
        ax.plot(*places[0], "*", color=style.BASE, ms=11, zorder=7)
        finish(ax, f"{name}: {length:.1f} m, word {told(word)}", (-21, 21, -21, 21))
    return figure


FIGURES: dict[str, Callable[[], Any]] = {
    "words": words, "limit": limit, "pending": pending, "slits": slits, "spiral": spiral,
    "branches": branches, "shape": shape, "ring": ring,
}  # fmt: skip


def main() -> None:
    """Write them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument(
        "--folder", type=Path, default=Path(__file__).parent.parent / "docs/pictures"
    )
    args = parser.parse_args()
    for name, draw in FIGURES.items():
        file = args.folder / f"theory-{name}.png"
        style.save(draw(), file, dpi=90)
        print(file)


if __name__ == "__main__":
    main()
