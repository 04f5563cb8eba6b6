"""Pictures of problems and solutions, as PNG, SVG or PDF."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from netsp.base import progress
from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.gtsp.travel.result import Progress
from netsp.model.problem import Circle, Problem
from netsp.model.solution import Solution, Status
from netsp.roadmap.paths import TautPaths
from netsp.view.pictures import style
from netsp.view.pictures.label_placement import LabelPlace, place_labels
from netsp.view.pictures.picture_layout import LabelLayout, MapLayout

if TYPE_CHECKING:
    import shapely
    from matplotlib.axes import Axes


def save(problem: Problem, solution: Solution | None, path: str | Path) -> None:
    """Draw a problem, with a solution if given, to a file; InputError if it cannot be written."""
    style.save(draw(problem, solution), path)


def save_import(problem: Problem, left_out: Sequence[shapely.Geometry], path: str | Path) -> None:
    """Draw an imported problem to a file, with the features that were left out dashed.

    Parameters
    ----------
    problem : Problem
        The problem.
    left_out : sequence of shapely.Geometry
        Shapes of omitted features, in the plane of the problem.
    path : str or Path
        File to write: PNG, SVG or PDF.
    """
    import shapely

    figure, ax = _single(problem)
    draw_map(problem, ax=ax)
    limits = (ax.get_xlim(), ax.get_ylim())
    frame = shapely.box(limits[0][0], limits[1][0], limits[0][1], limits[1][1])
    parts = [part for shape in left_out for part in shapely.get_parts(shapely.get_parts(shape))]
    outlines = [part.boundary if part.geom_type == "Polygon" else part for part in parts]
    seen = shapely.intersection([o for o in outlines if not o.is_empty], frame)
    # edges that areas share are drawn once, because dashes over dashes look like a solid line
    edges = _edges(shapely.union_all([s for s in seen if s.length > 0.0]))
    rims = shapely.STRtree([o.shape().boundary for o in problem.obstacles])
    width = MapLayout.hidden_rim * (limits[0][1] - limits[0][0])
    hidden = [
        set(map(tuple, rims.query(shapely.points(at), "dwithin", width).T.tolist()))
        for at in (edges[:, 0], edges.mean(axis=1), edges[:, 1])
    ]
    along = [edge for edge, _ in set.intersection(*hidden)]  # all of it along one obstacle
    lines = shapely.line_merge(shapely.MultiLineString(np.delete(edges, along, axis=0).tolist()))
    for line in shapely.get_parts(lines):
        x, y = shapely.get_coordinates(line).T
        ax.plot(x, y, color=style.LEFT_OUT, lw=0.8, ls="--", zorder=2.5)
    spots = shapely.get_coordinates([s for s in seen if s.geom_type in ("Point", "MultiPoint")])
    ax.plot(*spots.T, color=style.LEFT_OUT, marker="x", ms=4, ls="none", zorder=2.5)
    ax.set(xlim=limits[0], ylim=limits[1])
    if left_out:
        ax.plot([], [], color=style.LEFT_OUT, lw=0.8, ls="--", label="left out")
        ax.legend(loc="best", fontsize=8, frameon=False)
    style.save(figure, path)


def _edges(lines: shapely.Geometry) -> Floats:
    """Return the (n, 2, 2) ends of the edges of lines."""
    import shapely

    places, line = shapely.get_coordinates(shapely.get_parts(lines), return_index=True)
    is_edge = line[1:] == line[:-1]
    return np.asarray(np.stack([places[:-1], places[1:]], axis=1)[is_edge])


def draw(problem: Problem, solution: Solution | None = None) -> Any:
    """Return a matplotlib Figure with a map of the tour, and a map of the tether at each visit."""
    from matplotlib.figure import Figure

    visits = solution.tour if solution is not None else ()
    panels = len(visits)
    xmin, ymin, xmax, ymax = view(problem, solution)
    aspect = (ymax - ymin) / (xmax - xmin)
    if panels == 0:
        figure, ax = _single(problem)
        draw_map(problem, solution, ax=ax)
        return figure
    small = panels if panels <= 20 else 0
    columns = int(np.clip(round(np.sqrt(max(small, 1) * aspect * 0.9)), 1, 5)) if small else 0
    rows = -(-small // columns) if columns else 0
    height = float(np.clip(8.0 * aspect + 1.2, 4.2, 10.5))
    wide = height / max(rows, 1) / max(aspect, 0.35) * columns if columns else 0.0
    wide = float(np.clip(wide, 0.0, 7.0))
    figure = Figure(figsize=(8.0 + wide, height), layout="constrained")
    if not columns:
        draw_map(problem, solution, ax=figure.subplots(), tethers=True)
        return figure
    sides: Any = figure.subfigures(1, 2, width_ratios=[8.0, wide])
    left, right = sides
    draw_map(problem, solution, ax=left.subplots())
    axes = np.atleast_1d(right.subplots(rows, columns)).ravel()
    right.suptitle("the taut tether at each visit", fontsize=9, color=style.EDGE)
    longest = max(problem.tether_length, *(visit.tether_length for visit in visits))
    paths = TautPaths(problem, 2.0 * longest)
    for k, ax in enumerate(axes):
        ax.set_axis_off()
        if k >= len(visits):
            continue
        visit = visits[k]
        draw_obstacles(ax, problem)
        tether = paths.tether_if_found(visit.goal, visit.signature)
        if tether is not None:
            ax.plot(tether[:, 0], tether[:, 1], color=style.TETHER, lw=1.3)
        ax.plot(*problem.base[:2], marker="*", ms=8, color=style.BASE, mec="none")
        ax.plot(*problem.points[visit.goal + 1, :2], "o", ms=4, color=style.PATH)
        # y=1.0 keeps Matplotlib from measuring ticks to place the title: there are none
        ax.set_title(
            f"{k + 1}: {visit.tether_length:.4g} {problem.units}", fontsize=7, pad=2, y=1.0
        )
        _frame(ax, problem, solution)
    return figure


def save_roadmap(problem: Problem, roadmap: str, options: dict[str, Any], path: str | Path) -> None:
    """Draw a roadmap by name: tangents and arcs of ``taut``, milestones and edges of ``prm``."""
    from matplotlib.collections import LineCollection

    from netsp.plan.solve_problem import build_roadmap

    if roadmap not in ("taut", "prm"):
        raise InputError(f"roadmap: no picture of {roadmap!r}; expected taut or prm")
    built = build_roadmap(problem, roadmap, **options)
    figure, ax = _single(problem)
    draw_map(problem, ax=ax)
    if roadmap == "prm":
        m = built.milestones
        lines = m[built.edges][:, :, :2]
        ax.plot(m[:, 0], m[:, 1], ".", ms=2, color=style.EDGE, zorder=2)
        counted = f"{len(m)} milestones, {len(built.edges)} edges, {len(built.augmented)} augmented"
    else:
        t = built.paths.tangents
        lines = t.ends.reshape(-1, 2, 2)
        lines = lines + built.outline.origin
        for cx, cy, r, a, b in t.arcs + np.append(built.outline.origin, np.zeros(3)):
            theta = np.linspace(a, b, 60)
            ax.plot(
                cx + r * np.cos(theta), cy + r * np.sin(theta), color=style.PATH, lw=0.8, zorder=3
            )
        counted = (
            f"{len(t.arcs)} arcs, {len(lines) // 2} tangents, {len(built.cluster) - 1} classes"
        )
    # thousands of edges must not hide obstacles, goals and milestones
    alpha = float(np.clip(MapLayout.full_strength_edges / max(len(lines), 1), 0.04, 0.35))
    ax.add_collection(
        LineCollection(list(lines), colors=style.PATH, lw=0.35, alpha=alpha, zorder=2)
    )
    ax.set_title(f"{problem.name}: {roadmap} roadmap, {counted}", fontsize=10, loc="left")
    style.save(figure, path)


def save_trace(rows: Sequence[Progress], title: str, units: str, path: str | Path) -> None:
    """Draw the progress of a solver: lengths and bound by iteration.

    For solvers that pass through entangled states, a panel below has the number of entangled
    obstacles (Fig. 3 of McCammon & Hollinger 2016).
    """
    from matplotlib.figure import Figure

    tangled = any(r.entangled for r in rows)
    figure = Figure(figsize=(8.0, 6.0 if tangled else 4.2), layout="constrained")
    axes = figure.subplots(2 if tangled else 1, 1, sharex=True, squeeze=False)[:, 0]
    top = axes[0]
    for field, label, look in (
        ("current", "current path", {"color": style.OBSTACLE, "lw": 0.7}),
        ("incumbent", "best tour", {"color": style.PATH, "lw": 1.6, "drawstyle": "steps-post"}),
    ):
        seen = [(r.iteration, getattr(r, field)) for r in rows if getattr(r, field) is not None]
        if seen:
            top.plot(*zip(*seen, strict=True), label=label, marker=_mark(seen), **look)
    look = {"color": style.TETHER, "lw": 1.2, "drawstyle": "steps-post"}
    bounds = [(r.iteration, r.bound) for r in rows if r.bound is not None]
    for scope in dict.fromkeys(b.scope for _, b in bounds):
        line = [(at, b.length) for at, b in bounds if b.scope is scope]
        label = f"lower bound on {scope.tours}"
        top.plot(*zip(*line, strict=True), label=label, marker=_mark(line), **look)
    top.set_ylabel(f"length ({units})")
    top.legend(frameon=False, fontsize=8)
    top.set_title(title, fontsize=10, loc="left")
    if tangled:
        seen = [(r.iteration, r.entangled) for r in rows if r.entangled is not None]
        axes[1].plot(*zip(*seen, strict=True), color=style.BASE, lw=0.9, marker=_mark(seen))
        axes[1].set_ylabel("entangled obstacles")
        axes[1].set_ylim(bottom=0.0)
    axes[-1].set_xlabel("iteration")
    style.save(figure, path)


def _mark(points: Sequence[object]) -> str | None:
    """Return a marker if all points coincide, so that they are visible, else None."""
    return "o" if len(points) == 1 else None


def save_classes(problem: Problem, goal: int, path: str | Path) -> None:
    """Draw all taut tethers to one goal (0-based), shortest first, each with its word."""
    from netsp.roadmap.taut import TautRoadmap

    roadmap = TautRoadmap(problem)
    rows = np.flatnonzero(roadmap.cluster == goal + 1)
    shown = rows[:30]
    xmin, ymin, xmax, ymax = view(problem, None)
    aspect = (ymax - ymin) / (xmax - xmin)
    columns = int(np.clip(round(np.sqrt(len(shown) * aspect * 1.4)), 1, 6))
    lines = -(-len(shown) // columns)
    from matplotlib.figure import Figure

    width = 2.6 if columns > 2 else 4.0
    figure = Figure(
        figsize=(width * columns, max(width * aspect, 0.8) * lines + 0.35 * lines + 0.6),
        layout="constrained",
    )
    axes = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for k, ax in enumerate(axes):
        ax.set_axis_off()
        if k >= len(shown):
            continue
        v = int(shown[k])
        draw_obstacles(ax, problem, label=_letter if len(problem.obstacles) <= 20 else None)
        tether = roadmap.paths.tether_if_found(goal, roadmap.signatures[v])
        if tether is not None:
            ax.plot(tether[:, 0], tether[:, 1], color=style.TETHER, lw=1.4, zorder=3)
        ax.plot(*problem.base[:2], marker="*", ms=9, color=style.BASE, mec="none", zorder=4)
        ax.plot(*problem.points[goal + 1, :2], "o", ms=5, color=style.PATH, zorder=4)
        word = list(roadmap.signatures[v])
        ax.set_title(f"{roadmap.tethers[v]:.5g} {problem.units}: {word}", fontsize=7, pad=2, y=1.0)
        _frame(ax, problem, None)
    more = f", the {len(shown)} shortest shown" if len(shown) < len(rows) else ""
    figure.suptitle(
        f"{problem.name}: {len(rows)} classes reach {problem.goal_label(goal)} within "
        f"{problem.tether_length:g} {problem.units}{more}\n"
        "(obstacle numbers are the letters of the words)",
        fontsize=10,
    )
    style.save(figure, path)


def _letter(i: int) -> str:
    """Return the letter of obstacle i in words, i + 1."""
    return str(i + 1)


def _single(problem: Problem) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    xmin, ymin, xmax, ymax = view(problem, None)
    aspect = (ymax - ymin) / (xmax - xmin)
    height = float(np.clip(8.0 * aspect + 0.8, 3.5, 11.0))
    figure = Figure(figsize=(8.0, height), layout="constrained")
    return figure, figure.subplots()


def draw_map(
    problem: Problem,
    solution: Solution | None = None,
    *,
    ax: Axes | None = None,
    tethers: bool = False,
) -> Axes:
    """Draw a problem, and the path of a solution, on given or new axes; return the axes.

    Parameters
    ----------
    tethers
        Whether to draw the taut tether at each visit.
    """
    if ax is None:
        _, ax = _single(problem)
    wrapped = solution.entangled if solution else ()
    label = problem.obstacle_name if len(problem.obstacles) <= 40 else None
    draw_obstacles(ax, problem, label=label, wrapped=wrapped)
    if problem.bounds is not None:
        xmin, ymin, xmax, ymax = problem.bounds
        ax.plot(
            [xmin, xmax, xmax, xmin, xmin], [ymin, ymin, ymax, ymax, ymin], color=style.EDGE, lw=1
        )
    order = {v.goal: k + 1 for k, v in enumerate(solution.tour)} if solution else {}
    if solution is not None and solution.path:
        if tethers:
            longest = max(v.tether_length for v in solution.tour)
            paths = TautPaths(problem, 2.0 * max(problem.tether_length, longest))
            for v in solution.tour:
                line = paths.tether_if_found(v.goal, v.signature)
                if line is not None:
                    ax.plot(line[:, 0], line[:, 1], color=style.TETHER, lw=0.7, alpha=0.6, zorder=2)
        path = np.array(solution.path)
        ax.plot(path[:, 0], path[:, 1], color=style.PATH, lw=1.8, zorder=3, solid_joinstyle="round")
        _arrows(ax, path, len(solution.tour) + 1)
    for k, goal in enumerate(problem.goals):
        x, y = goal.position[:2]
        ax.plot(
            x,
            y,
            "o",
            ms=13 if order else 9,
            mec=style.PATH,
            mew=1.4,
            zorder=5,
            color="white" if order and k not in order else style.GOAL,
        )
        visit = str(order.get(k, ""))
        ax.annotate(visit, (x, y), ha="center", va="center", fontsize=7, zorder=6)
    ax.plot(
        *problem.base[:2],
        marker="*",
        ms=17,
        color=style.BASE,
        mec="white",
        zorder=7,
        ls="none",
        label="base",
    )
    ax.set_xlabel(f"x ({problem.units})")
    ax.set_ylabel(f"y ({problem.units})")
    ax.tick_params(labelsize=8)
    _frame(ax, problem, solution)
    more = ""
    if len(problem.goals) <= MapLayout.max_named:
        more = _label_goals(ax, problem, 6.5 if order else 4.5, is_numbered=bool(order))
    ax.set_title(_title(problem, solution) + more, fontsize=10, loc="left")
    return ax


def _label_goals(ax: Axes, problem: Problem, radius: float, *, is_numbered: bool) -> str:
    """Write the names and heights of goals beside their markers; return an addition to the title.

    If the labels lack room, a height that all goals share moves to the title. Names that would
    still cover another goal or name are left out.

    Parameters
    ----------
    ax : Axes
        The map, with its limits set.
    problem : Problem
        Problem with these goals.
    radius : float
        Radius of the markers, points.
    is_numbered : bool
        Whether the markers have numbers, so that goals without names need no label.
    """
    low, high = (np.array(limits) for limits in zip(ax.get_xlim(), ax.get_ylim(), strict=True))
    figure = ax.get_figure(root=True)
    assert figure is not None
    paper = 72.0 * np.array(figure.get_size_inches()) * ax.get_position(original=True).size
    scale = float((paper / (high - low)).min())  # points per unit of the map
    flat = np.array([goal.position[:2] for goal in problem.goals]) * scale
    base = np.array([problem.base[:2]]) * scale
    heights = {goal.position[2] for goal in problem.goals}
    names = [
        goal.name or "" if is_numbered else problem.goal_name(k)
        for k, goal in enumerate(problem.goals)
    ]
    notes = [f"z {goal.position[2]:g}" if goal.position[2] else "" for goal in problem.goals]
    texts = [" ".join(filter(None, both)) for both in zip(names, notes, strict=True)]
    more = ""

    def places() -> list[LabelPlace | None]:
        return place_labels(flat, texts, marker_radius=radius, taken=base)

    found = places()
    has_room = all(place or not text for place, text in zip(found, texts, strict=True))
    if not has_room and len(heights) == 1 and notes[0]:
        texts, more = names, f"; goals at {notes[0]}"
        found = places()
    for goal, text, place in zip(problem.goals, texts, found, strict=True):
        if place is not None:
            ax.annotate(
                text,
                goal.position[:2],
                xytext=place.offset,
                textcoords="offset points",
                ha=place.align,
                va="center",
                fontsize=LabelLayout.font_size,
                color=style.EDGE,
                zorder=6,
                path_effects=style.halo(),
            )
    return more


def draw_path(solution: Solution, *, ax: Any = None) -> Any:
    """Draw the path of a solution without its problem on given or new axes; return the axes."""
    from matplotlib.figure import Figure

    if ax is None:
        ax = Figure(figsize=(6, 6), layout="constrained").subplots()
    if solution.path:
        path = np.array(solution.path)
        ax.plot(path[:, 0], path[:, 1], color=style.PATH, lw=1.8)
        _arrows(ax, path, len(solution.tour) + 1)
        ax.plot(*path[0, :2], "*", color=style.BASE, mec="white", ms=17)
    ax.set(aspect="equal", xlabel="x", ylabel="y")
    return ax


def draw_solution(
    solution: Solution, *, ax: Axes | None = None, problem: Problem | None = None
) -> Axes:
    """Draw the path of a solution, over its problem if given, on given or new axes; return them."""
    if problem is not None:
        return draw_map(problem, solution, ax=ax)
    path: Axes = draw_path(solution, ax=ax)
    return path


def _title(problem: Problem, solution: Solution | None) -> str:
    if solution is None or solution.length is None:
        return f"{problem.name}: {problem.summary}"
    proof = solution.proof
    longest = max((v.tether_length for v in solution.tour), default=0.0)
    kind = "non-entangling tour"
    if solution.status is Status.INVALID:
        kind, proof = "tour", f"entangles {len(solution.entangled)} obstacles (pink)"
    over = ", over the limit" if longest > problem.tether_length * (1.0 + 1e-9) else ""
    return (
        f"{problem.name}: {kind} of {solution.length:.6g} {problem.units}, {proof}\n"
        f"longest tether {longest:.4g} of {problem.tether_length:g} {problem.units}{over}; "
        f"numbers give the order of visits"
    )


def draw_obstacles(
    ax: Axes,
    problem: Problem,
    *,
    label: Callable[[int], str] | None = None,
    wrapped: tuple[int, ...] = (),
) -> None:
    """Draw obstacles, and dotted lines at the clearance around them, on axes of the caller.

    Parameters
    ----------
    label
        Function that returns the text on obstacle i, or beside it if it is small.
    wrapped
        Obstacles that a path is wrapped around.
    """
    from matplotlib.patches import Circle as Disk
    from matplotlib.patches import Polygon as Patch

    xmin, ymin, xmax, ymax = view(problem, None)
    small = MapLayout.min_circle * max(xmax - xmin, ymax - ymin)
    corners: list[tuple[float, float]] = []
    for i, o in enumerate(progress.track(problem.obstacles)):
        look: dict[str, Any] = {"fc": style.OBSTACLE, "ec": style.EDGE, "lw": 0.6, "zorder": 1}
        if i in wrapped:
            look["fc"] = style.WRAPPED
        if isinstance(o, Circle):
            if problem.clearance:
                grown = Disk(o.center, o.radius + problem.clearance)
                grown.set(fc="none", ec=style.EDGE, lw=0.5, ls=":", zorder=1)
                ax.add_artist(grown)
            ax.add_artist(Disk(o.center, o.radius, **look))
            (x, y), reach = o.center, o.radius + problem.clearance
            corners += [(x - reach, y - reach), (x + reach, y + reach)]
        else:
            if problem.clearance:
                import shapely

                ring = shapely.Polygon(o.polygon).buffer(problem.clearance).exterior
                ax.plot(*ring.xy, color=style.EDGE, lw=0.5, ls=":", zorder=1)
            ax.add_artist(Patch(o.polygon, closed=True, **look))
            corners += o.polygon
        if label is not None:
            inside = not isinstance(o, Circle) or o.radius >= small
            place: dict[str, Any] = (
                {"ha": "center", "va": "center"}
                if inside
                else {
                    "ha": "right",
                    "va": "bottom",
                    "xytext": (-5, 4),
                    "textcoords": "offset points",
                }
            )
            ax.annotate(
                label(i),
                o.representative_point,
                fontsize=6,
                color=style.BASE,
                zorder=6,
                clip_on=True,
                path_effects=style.halo(),
                **place,
            )
    # faster than `add_patch`, which computes the extent of each curve
    ax.update_datalim(corners)


def _arrows(ax: Axes, path: Any, count: int) -> None:
    """Draw arrowheads along the path, at least one on each leg."""
    step = np.hypot(*np.diff(path[:, :2], axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(step)])
    if along[-1] == 0.0:
        return
    places = (np.arange(2 * count) + 0.5) / (2 * count) * along[-1]
    for s in places:
        k = int(np.clip(np.searchsorted(along, s) - 1, 0, len(step) - 1))
        if step[k] == 0.0:
            continue
        a = path[k, :2] + (s - along[k]) / step[k] * (path[k + 1, :2] - path[k, :2])
        d = (path[k + 1, :2] - path[k, :2]) / step[k]
        tip = a + d * 1e-3 * along[-1]
        ax.annotate(
            "",
            xy=tip,
            xytext=a,
            zorder=4,
            arrowprops={"arrowstyle": "-|>", "color": style.PATH, "lw": 0, "mutation_scale": 13},
        )


def view(problem: Problem, solution: Solution | None = None) -> tuple[float, float, float, float]:
    """Return the box of a map, which contains all goals, paths and nearby obstacles, with a margin.

    Parameters
    ----------
    problem : Problem
        Problem to draw.
    solution : Solution, optional
        Solution whose path must be in the box, too.

    Returns
    -------
    xmin, ymin, xmax, ymax : float
        Bounds in the problem's units.
    """
    xy = [problem.points[:, :2]]
    if solution is not None and solution.path:
        xy.append(np.array(solution.path)[:, :2])
    if problem.bounds is not None:
        xy.append(np.array(problem.bounds).reshape(2, 2))
    for o in problem.obstacles:
        if isinstance(o, Circle):
            c, r = np.array(o.center), o.radius
            xy.append(np.array([c - r, c + r]))
        else:
            xy.append(np.array(o.polygon))
    points = np.vstack(xy)
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(float((high - low).max()), 1e-9)
    low, high = low - 0.05 * size, high + 0.05 * size
    longest = max(len(g.name or "") for g in problem.goals)
    if (
        longest and len(problem.goals) <= MapLayout.max_named
    ):  # their labels stand to the right of the goals
        high[0] += min(0.03 + 0.008 * longest, 0.2) * size
    for axis in range(2):
        lack = 0.25 * size - float((high - low)[axis])
        if lack > 0:
            low[axis] -= lack / 2
            high[axis] += lack / 2
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _frame(ax: Axes, problem: Problem, solution: Solution | None) -> None:
    xmin, ymin, xmax, ymax = view(problem, solution)
    ax.set_xlim(xmin, xmax)
    ax.set_ylim(ymin, ymax)
    ax.set_aspect("equal")
