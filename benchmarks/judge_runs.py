"""Judge of runs in space by other means than netsp's.

The judge takes from a run only where the robot was at which time, and when the surprises happened.
It lays strings of its own along the robot's path (`taut_string.py`) and measures distances to the
solids of the true scene in closed form. There are several strings, because one may catch at a
corner where a tether slips. For waypoints that were not visited, the judge searches the
shortest tether in the final scene through a graph of cells, and pulls it taut with the same string.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from flight_store import FlownStep
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from taut_string import StringBundle, is_free, packed, rooms

from netsp.world import Scene
from netsp.world.mission.mission import Mission
from netsp.world.simulator.surprises import SceneEvent


@dataclass(frozen=True)
class JudgeOptions:
    """Options of the judge.

    Attributes
    ----------
    rows
        Number of rows of the log between two relaxations of the whole string.
    cell
        Size of the cells of the graph for waypoints that were not visited, metres.
    free_m
        Excess of the string at home over the straight one up to which the tether is free, metres.
    late_s
        Time beyond the shortest possible one in which a tether must be within a lowered limit, s.
    margin
        Share of the limit that planners leave unused: their `limit_margin`.
    appear_depth
        Depth of the string in a solid that appears at which the side of the string is not known,
        metres.
    agreement
        Excess of a string over the tether of the log from which on other strings are tried, too, as
        a share of the limit. This saves time only: other strings count where they are shorter.
    detours
        Number of searches of a shortest tether with random weights of the cells, after the first.
    """

    rows: int = 10
    cell: float = 0.25
    free_m: float = 0.03
    late_s: float = 15.0
    margin: float = 0.004
    appear_depth: float = 0.2
    agreement: float = 0.002
    detours: int = 3


@dataclass
class Verdict:
    """Verdict on a run.

    Attributes
    ----------
    is_home, is_free
        Whether the robot ended at home, and its string as short as a straight one.
    over_s
        Time in which the string was longer than the limit, other than after a lowered limit, s.
    room
        Smallest distance of the robot from the solids, metres.
    visited, open, unreachable, lost
        Numbers of waypoints that the robot came within reach of, that could not be decided, that no
        tether reaches, and that it lost though a tether reaches them.
    difference
        Largest difference between the string and the tether of the log, as a share of the limit.
    faults
        One line for each fault.
    """

    is_home: bool = False
    is_free: bool = False
    over_s: float = 0.0
    room: float = math.inf
    visited: list[int] = field(default_factory=list)
    open: list[int] = field(default_factory=list)
    unreachable: list[int] = field(default_factory=list)
    lost: list[int] = field(default_factory=list)
    difference: float = 0.0
    faults: list[str] = field(default_factory=list)


def solids_after(solids: tuple, event: SceneEvent) -> tuple:
    """Return the solids after an event."""
    if event.appear is not None:
        return (*solids, event.appear)
    if event.vanish is not None:
        return tuple(s for s in solids if s.name != event.vanish)
    if event.move is not None:
        moved = []
        for solid in solids:
            if solid.name == event.move.solid:
                data = solid.model_dump(exclude_none=True)
                for shape in data.values():
                    if isinstance(shape, dict):
                        for key in ("a", "b", "center", "point"):
                            if key in shape:
                                shape[key] = [
                                    v + d for v, d in zip(shape[key], event.move.by, strict=False)
                                ]
                        if "polygon" in shape:
                            shape["polygon"] = [
                                (x + event.move.by[0], y + event.move.by[1])
                                for x, y in shape["polygon"]
                            ]
                solid = type(solid).model_validate(data)
            moved.append(solid)
        return tuple(moved)
    return solids


def anchor_at(mission: Mission, now: float) -> np.ndarray:
    """Return the position (3,) of the anchor at a time, s."""
    rows = np.array([(0.0, *mission.anchor), *mission.track])
    return np.array([np.interp(now, rows[:, 0], rows[:, k]) for k in (1, 2, 3)])


def anchor_line(mission: Mission, since: float, until: float) -> np.ndarray:
    """Return the corners (k, 3) of the anchor's way between two times, the last place included."""
    corners = [row[1:] for row in mission.track if since < row[0] < until]
    return np.array([*corners, anchor_at(mission, until)]).reshape(-1, 3)


def judge_run(
    mission: Mission,
    scene: Scene,
    log: Sequence[FlownStep],
    happened: Sequence[tuple[float, SceneEvent]],
    reserve: float,
    options: JudgeOptions = JudgeOptions(),
) -> Verdict:
    """Judge a run.

    Parameters
    ----------
    mission : Mission
        Mission as it was given.
    scene : Scene
        True scene at 0 s, without the events.
    log : sequence of FlownStep
        Only times and positions are used, and the lengths for `difference`.
    happened : sequence of (float, SceneEvent)
        Times, s, and events, in their order.
    reserve : float
        Length that the planner promises to keep in reserve at the end of the run, metres.
    """
    verdict, solids, due = Verdict(), tuple(scene.all_solids()), list(happened)
    rows, corners = packed(solids)
    places = [np.array(w.position) for w in mission.waypoints]
    cancelled: set[int] = set()
    start = np.array([log[0].x, log[0].y, log[0].z])
    string = StringBundle(rows, corners, np.array([mission.anchor, start]))
    limit, lowered_until, now, before = mission.tether_length, -math.inf, 0.0, start
    seen: set[int] = set()
    for n, row in enumerate(log):
        place = np.array([row.x, row.y, row.z])
        between = before + np.linspace(0.0, 1.0, 3)[:, None] * (place - before)
        verdict.room = min(verdict.room, float(rooms(rows, corners, between).min()))
        if mission.track:
            string.move_anchor(anchor_line(mission, now, row.time))
        string.move_end(place)
        now_due = [event for time, event in due if time <= row.time + 1e-6]
        due = due[len(now_due) :]
        for event in now_due:
            if event.add_waypoint is not None:
                places.append(np.array(event.add_waypoint.position))
            elif event.cancel_waypoint is not None:
                if event.cancel_waypoint not in seen:
                    cancelled.add(event.cancel_waypoint)
            elif event.tether_length is not None:
                string.relax()
                excess = string.length - event.tether_length
                limit = event.tether_length
                if excess > 0.0:
                    lowered_until = row.time + excess / mission.speed + options.late_s
            elif event.push is None:
                solids = solids_after(solids, event)
                rows, corners = packed(solids)
                depth = string.change_scene(rows, corners)
                if depth > options.appear_depth:
                    verdict.faults.append(f"a solid came upon the string at {row.time:g} s")
        seen |= {k for k, p in enumerate(places) if np.linalg.norm(p - place) <= mission.reach}
        if n % options.rows == 0 or n == len(log) - 1 or string.length > limit:
            enough = min(limit, row.tether + options.agreement * limit)
            string.relax(string.length <= limit, enough)
            gap = abs(string.length - row.tether) / limit
            verdict.difference = max(verdict.difference, gap)
        if string.length <= limit:
            lowered_until = -math.inf
        elif row.time > lowered_until:
            if verdict.over_s == 0.0:
                verdict.faults.append(
                    f"at {row.time:g} s the string is {string.length:.3f} m of {limit:g} long, "
                    f"the tether of the log {row.tether:.3f}"
                )
            verdict.over_s += row.time - now
        now, before = row.time, place
    _judge_end(verdict, mission, string, now, options.free_m)
    if verdict.room < 0.0:
        verdict.faults.append(f"the robot was {-verdict.room:.3f} m deep in a solid")
    verdict.visited = sorted(seen - cancelled)
    missing = [k for k in range(len(places)) if k not in seen and k not in cancelled]
    if missing:
        _judge_missing(verdict, mission, scene, (rows, corners), places, missing, now,
                       limit * (1.0 - options.margin) - reserve, options)  # fmt: skip
    return verdict


def _judge_end(
    verdict: Verdict, mission: Mission, string: StringBundle, now: float, free_m: float
) -> None:
    """Judge whether the robot is home, with a free tether."""
    anchor, robot = anchor_at(mission, now), string.end
    home = anchor + np.array(mission.start) - np.array(mission.anchor)
    distance = float(np.linalg.norm(robot - home))
    if mission.track:
        distance = min(distance, float(np.linalg.norm(robot - anchor)))
    verdict.is_home = distance <= mission.reach + 1e-9
    if not verdict.is_home:
        verdict.faults.append(f"the robot ended {distance:.2f} m from home")
    excess = string.length - float(np.linalg.norm(robot - anchor))
    verdict.is_free = verdict.is_home and excess <= free_m
    if verdict.is_home and not verdict.is_free:
        verdict.faults.append(f"{excess:.2f} m of the string hang on a solid at home")


def _judge_missing(
    verdict: Verdict,
    mission: Mission,
    scene: Scene,
    solids: tuple[np.ndarray, np.ndarray],
    places: Sequence[np.ndarray],
    missing: Sequence[int],
    now: float,
    usable: float,
    options: JudgeOptions,
) -> None:
    """Sort the waypoints that were not visited: lost, unreachable, or not decided."""
    anchor = anchor_at(mission, now)
    home = anchor + np.array(mission.start) - np.array(mission.anchor)
    box = np.array(scene.bounds).reshape(2, 3)
    graph = CellGraph(*solids, box, options)
    robot_side = graph.connected(home, mission.clearance)
    for k in missing:
        room = float(rooms(*solids, places[k][None])[0])
        if room < mission.clearance or not graph.holds(robot_side, places[k]):
            verdict.open.append(k)
            continue
        length = graph.tether_length(anchor, places[k], stop=usable)
        if length <= usable:
            verdict.lost.append(k)
            verdict.faults.append(
                f"waypoint #{k} was lost: {length:.2f} m of tether reach it, of {usable:.2f}"
            )
        else:
            verdict.unreachable.append(k)


class CellGraph:
    """Graph of the cells of a box, for shortest tethers and paths of the robot.

    Parameters
    ----------
    box : ndarray, shape (2, 3)
        Corners, metres.
    """

    def __init__(
        self, rows: np.ndarray, corners: np.ndarray, box: np.ndarray, options: JudgeOptions
    ) -> None:
        self.rows, self.corners, self.options, self.low = rows, corners, options, box[0]
        self.shape = tuple(
            np.maximum(2, np.floor((box[1] - box[0]) / options.cell) + 1).astype(int)
        )
        axes = [box[0][k] + options.cell * np.arange(self.shape[k]) for k in range(3)]
        self.points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
        self.rooms = rooms(rows, corners, self.points)

    def _nearby(self, place: np.ndarray) -> np.ndarray:
        """Return the numbers of the eight cells about a place."""
        at = np.floor((place - self.low) / self.options.cell).astype(int)
        around = at + np.array(list(itertools.product((0, 1), repeat=3)))
        around = np.clip(around, 0, np.array(self.shape) - 1)
        return np.unique(np.ravel_multi_index(around.T, self.shape))

    def connected(self, place: np.ndarray, room: float) -> np.ndarray:
        """Return a mask (n,) of the cells with some room that are connected with a place's."""
        labels, _ = ndimage.label((self.rooms >= room).reshape(self.shape))
        flat = labels.ravel()
        near = {int(v) for v in flat[self._nearby(place)] if v}
        return np.isin(flat, list(near))

    def holds(self, mask: np.ndarray, place: np.ndarray) -> bool:
        """Return whether a mask (n,) has a cell about a place."""
        return bool(mask[self._nearby(place)].any())

    def _graph(self, rng: np.random.Generator | None) -> coo_array:
        """Return the graph of free cells; with a generator, its weights are random."""
        number = np.arange(len(self.points)).reshape(self.shape)
        weights = np.ones(len(self.points))
        if rng is not None:  # smooth random weights lead through other classes
            coarse = rng.uniform(1.0, 3.0, np.maximum(2, np.array(self.shape) // 8))
            zoom = np.array(self.shape) / np.array(coarse.shape)
            weights = ndimage.zoom(coarse, zoom, order=1)[tuple(map(slice, self.shape))].ravel()
        starts, ends, costs = [], [], []
        for step in itertools.product((-1, 0, 1), repeat=3):
            if step <= (0, 0, 0):
                continue
            here = tuple(
                slice(max(0, -d), n - max(0, d)) for d, n in zip(step, self.shape, strict=True)
            )
            there = tuple(
                slice(max(0, d), n - max(0, -d)) for d, n in zip(step, self.shape, strict=True)
            )
            i, j = number[here].ravel(), number[there].ravel()
            far = self.options.cell * math.sqrt(sum(d * d for d in step))
            free = (self.rooms[i] > 0.0) & (self.rooms[j] > 0.0)
            free &= self.rooms[i] + self.rooms[j] >= far  # the balls of both ends cover the edge
            i, j = i[free], j[free]
            starts.append(i)
            ends.append(j)
            costs.append(far * 0.5 * (weights[i] + weights[j]))
        size = (len(self.points),) * 2
        return coo_array((np.concatenate(costs), (np.concatenate(starts), np.concatenate(ends))),
                         shape=size).tocsr()  # fmt: skip

    def tether_length(self, anchor: np.ndarray, place: np.ndarray, stop: float) -> float:
        """Return the length of the shortest tether that was found to a place, metres; the search
        ends at one that is not longer than `stop`."""
        best = math.inf
        for attempt in range(1 + self.options.detours):
            rng = np.random.default_rng(attempt) if attempt else None
            graph = self._graphs(rng, attempt)
            begin = self._visible(anchor)
            end = self._visible(place)
            if begin is None or end is None:
                return math.inf
            _, previous = dijkstra(graph, directed=False, indices=begin, return_predecessors=True)
            line = [place, self.points[end]]
            while end != begin:
                end = int(previous[end])
                if end < 0:
                    break
                line.append(self.points[end])
            if end != begin:
                return math.inf
            points = np.array([*line, anchor])[::-1]
            string = StringBundle(self.rows, self.corners, points)
            string.relax()
            best = min(best, string.length)
            if best <= stop:
                break
        return best

    def _graphs(self, rng: np.random.Generator | None, attempt: int) -> coo_array:
        cache = self.__dict__.setdefault("_kept", {})
        if attempt not in cache:
            cache[attempt] = self._graph(rng)
        return cache[attempt]

    def _visible(self, place: np.ndarray) -> int | None:
        """Return the nearest free cell in sight of a place."""
        near = self._nearby(place)
        near = near[self.rooms[near] > 0.0]
        for n in near[np.argsort(np.linalg.norm(self.points[near] - place, axis=1))]:
            q = self.points[n]
            if is_free(self.rows, self.corners, place, q, 0.5 * (place + q), 0.0):
                return int(n)
        return None
