"""Random runs in space in which something happens under way, judged by other means.

    python benchmarks/under_way.py [--kinds anchor sensor surprises repair] [--runs 60] [--keep]

Four kinds: the anchor moves on a random track; a range sensor finds solids that are not on the map;
reported surprises of every kind; and a planned tour that is repaired after such surprises, half of
the time found by a range sensor. The runs of a kind go over twelve scenes in turn, with 8 to 10
waypoints each and a limit of 0.95 to 1.4 times the longest of the shortest tethers, so that some
waypoints are out of reach. `judge_runs.py` judges each run. With `--store FOLDER`, flights and
verdicts are kept there: no run is flown again, and it is judged again only if the judge changed.
"""

from __future__ import annotations

import argparse
import functools
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from flight_store import Flight, FlightStore, FlownStep, as_json
from judge_runs import JudgeOptions, Verdict, judge_run
from sites import box, capsule, mission_of, shipped
from space import random_frame
from table import head, heading, row, source

from netsp.base.errors import InputError, LimitReachedError
from netsp.base.geometry import polylines
from netsp.plan.space.space_plan import plan
from netsp.world import Scene
from netsp.world.mission.equipment import RangeSensor
from netsp.world.mission.mission import Mission
from netsp.world.paths.tree import ShortestTree, pull_taut
from netsp.world.planner import PlannerOptions
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene import Solid
from netsp.world.simulator.mission_run import mission_grid, simulate
from netsp.world.simulator.surprises import SceneSurprises

KINDS = {
    "anchor": "a moving anchor",
    "sensor": "a range sensor",
    "surprises": "reported surprises",
    "repair": "repair of a planned tour",
}

SCENES = (
    "jetty", "hull", "net pen", "ring", "linked rings", "comb", "slanted forest", "tunnel",
    "basin", "frame", "boulders", "posts",
)  # fmt: skip

SPEED = 0.5
"""Speed of the robot in all runs, m/s."""

OVERLAP = 0.08
"""Growth of boxes on each side, metres, so that boxes which touch overlap."""

CLEARANCE = 0.25
"""Clearance in all runs, metres."""

PLAN_S = 6.0
"""Time limit of the tour that is repaired, s."""

KEPT = ("visited", "waypoints", "contacts", "exceedance_s", "defects", "left_out", "home",
        "inspection_s", "stalls", "replan_worst_s")  # fmt: skip
"""Entries of a run's summary that are kept."""


def boulders() -> tuple[Mission, Scene]:
    """Twelve boulders on a sloping floor, and waypoints beside them."""
    rng = np.random.default_rng(5)
    solids: list[dict[str, Any]] = [{"half_space": {"point": [0, 0, -6], "normal": [0.1, 0, 1]}}]
    places = []
    for _ in range(12):
        x, y = rng.uniform(-7, 7, 2)
        radius = rng.uniform(0.6, 1.6)
        solids.append({"sphere": {"center": [x, y, -6 + 0.6 * radius], "radius": radius}})
        places += list(rng.normal(size=(3, 3)) * (radius + 0.9) / 1.7 + [x, y, -5.5 + radius])
    return free_mission("boulders", solids, (-9, -9, -7, 9, 9, 0), places, (-8, -8, -1))


def posts() -> tuple[Mission, Scene]:
    """Fourteen posts of three sizes, and waypoints beside them."""
    rng = np.random.default_rng(6)
    grid = np.array([(4.0 * i, 4.0 * j) for i in range(5) for j in range(4)])
    feet = (grid + rng.uniform(-1.2, 1.2, grid.shape))[rng.permutation(20)[:14]]
    solids = [{"post": {"center": f.tolist(), "radius": float(rng.choice([0.3, 0.5, 0.9]))}}
              for f in feet]  # fmt: skip
    places = [(*(f + 1.5 * rng.normal(size=2)), rng.uniform(-5, -1)) for f in feet for _ in "ab"]
    return free_mission("posts", solids, (-4, -4, -6, 20, 16, 0), places, (-3, -3, -1))


def free_mission(name, solids, bounds, places, anchor) -> tuple[Mission, Scene]:
    """Return a mission through those of the places that have room."""
    scene = Scene(name=name, solids=solids, bounds=bounds)
    places, low, high = np.array(places), np.add(bounds[:3], 0.4), np.subtract(bounds[3:], 0.4)
    good = (scene.field().distance(places) > 0.4) & ((places > low) & (places < high)).all(1)
    return Mission(scene="-", name=name, anchor=anchor, start=np.add(anchor, (0.3, 0.3, -0.2)),
                   waypoints=places[good].tolist(), tether_length=1e3), scene  # fmt: skip


@functools.cache
def site(name: str) -> tuple[Mission, Scene, DistanceField, np.ndarray]:
    """Return a mission through all places of a scene, with names of its solids, and the length of
    the shortest tether to each, metres; infinite where none was found."""
    if name == "basin":
        mission, scene = shipped(name)
        mission = mission.model_copy(update={"waypoints": mission.waypoints[::4]})
    elif name in ("frame", "boulders", "posts"):
        made = {"boulders": boulders, "posts": posts, "frame": lambda: random_frame(1)}
        mission, scene = made[name]()
    else:
        mission, scene = mission_of(name)
    solids = tuple(
        grown_box(s).model_copy(update={"name": f"solid {k}"})
        for k, s in enumerate(scene.all_solids())
    )
    bounds = scene.bounds
    if bounds is None:
        places = mission.every_place
        bounds = (*(places.min(0) - 2.0).tolist(), *(places.max(0) + 2.0).tolist())
    scene = scene.model_copy(update={"solids": solids, "bounds": bounds, "problem": None})
    mission = mission.model_copy(
        update={"speed": SPEED, "clearance": CLEARANCE, "camera": None, "cell": None,
                "inspect": None, "delta": 0.1, "reach": 0.1}
    )  # fmt: skip
    field = scene.field()
    tree = ShortestTree(mission_grid(mission, scene, field), mission.anchor, mission.places)
    paths = [tree.path(k) for k in range(len(mission.places))]
    lengths = [
        np.inf if p is None else polylines.length(pull_taut(field, p, 0.0, mission.delta))
        for p in paths
    ]
    return mission, scene, field, np.array(lengths)


def grown_box(solid: Solid) -> Solid:
    """Return a solid, a box with its faces farther out by `OVERLAP`: where boxes only touch, the
    seam between them is free water by distances."""
    if solid.box is None:
        return solid
    size = tuple(side + 2.0 * OVERLAP for side in solid.box.size)
    return solid.model_copy(update={"box": solid.box.model_copy(update={"size": size})})


def random_solid(rng: np.random.Generator, centre: np.ndarray) -> dict[str, Any]:
    """Return a random solid about a place."""
    kind, turn = int(rng.integers(5)), rng.normal(size=3)
    turn = turn / np.linalg.norm(turn)
    if kind == 0:
        return {"sphere": {"center": centre.tolist(), "radius": float(rng.uniform(0.2, 0.8))}}
    if kind == 1:
        size = rng.uniform(0.3, 1.5, 3).tolist()
        return box(centre.tolist(), size, float(rng.uniform(0, 90)))
    if kind == 2:
        ring = {"major_radius": float(rng.uniform(0.6, 1.2)),
                "minor_radius": float(rng.uniform(0.1, 0.2))}  # fmt: skip
        return {"torus": {"center": centre.tolist(), "axis": turn.tolist(), **ring}}
    if kind == 3:
        return {"post": {"center": centre[:2].tolist(), "radius": float(rng.uniform(0.1, 0.5))}}
    half = rng.uniform(0.5, 2.5) * turn
    return capsule(centre - half, centre + half, float(rng.uniform(0.1, 0.4)))


def random_place(rng, mission: Mission, scene: Scene, field, room: float) -> np.ndarray:
    """Return a random place in the box of the mission's waypoints with some room."""
    low = np.maximum(mission.every_place.min(0) - 0.5, np.array(scene.bounds[:3]) + room)
    high = np.minimum(mission.every_place.max(0) + 0.5, np.array(scene.bounds[3:]) - room)
    for _ in range(1000):
        place = rng.uniform(low, high)
        if field.distance(place) >= room:
            return place
    raise InputError(f"{scene.name}: no free place was found")


def random_track(rng, mission: Mission, scene: Scene, field) -> list[tuple[float, ...]]:
    """Return one to three legs of a moving anchor in open water."""
    grown, here, now, out = field.grown(0.5), np.array(mission.anchor), 0.0, []
    for _ in range(int(rng.integers(1, 4))):
        speed = SPEED * rng.uniform(0.05, 0.7)
        for _ in range(200):
            there = random_place(rng, mission, scene, field, 0.8)
            far = float(np.linalg.norm(there - here))
            if far > 1.0 and grown.line_of_sight(here, there):
                now += float(rng.uniform(0, 20))
                if now > 0.0:
                    out.append((now, *here.tolist()))
                now += far / speed
                out.append((now, *there.tolist()))
                here = there
                break
    return out


def random_events(rng, mission: Mission, scene: Scene, field, lengths, kinds) -> list[dict]:
    """Return events of the given kinds, at random times."""
    names = [s.name for s in scene.solids if s.shape.box() is not None]
    duration = polylines.length(mission.places) / SPEED
    out: list[dict[str, Any]] = []
    for kind in kinds:
        event: dict[str, Any] = {"time": float(rng.choice([0.0, rng.uniform(0, 0.9) * duration]))}
        if kind == "appear":
            place = random_place(rng, mission, scene, field, 0.0)
            event["appear"] = {"name": f"new {len(out)}", **random_solid(rng, place)}
        elif kind in ("vanish", "move"):
            if not names:
                continue
            name = names.pop(int(rng.integers(len(names))))
            by = rng.normal(size=3).round(2).tolist()
            event[kind] = name if kind == "vanish" else {"solid": name, "by": by}
        elif kind == "add_waypoint":
            event[kind] = random_place(rng, mission, scene, field, 0.4).tolist()
        elif kind == "cancel_waypoint":
            event[kind] = int(rng.integers(len(mission.waypoints)))
        elif kind == "push":
            event[kind] = (rng.normal(size=3) * [1, 1, 0.3]).round(2).tolist()
        else:
            event[kind] = float(mission.tether_length * rng.uniform(0.6, 1.2))
        if kind not in ("appear", "vanish", "move"):
            event["time"] = float(rng.uniform(0.1, 0.9) * duration)
        out.append(event)
    return out


def scenario(kind: str, index: int) -> tuple[Mission, Scene, DistanceField, SceneSurprises | None]:
    """Return the mission, the scene and the surprises of a run."""
    rng = np.random.default_rng([list(KINDS).index(kind), index])
    mission, scene, field, lengths = site(SCENES[index % len(SCENES)])
    known = np.flatnonzero(np.isfinite(lengths))
    count = min(len(known), int(rng.integers(8, 11)))
    chosen = np.sort(rng.choice(known, count, replace=False))
    shortest = float(np.linalg.norm(np.subtract(mission.start, mission.anchor)))
    limit = max(rng.uniform(0.95, 1.4) * lengths[chosen].max(), 2.0 * shortest)
    update: dict[str, Any] = {
        "waypoints": tuple(mission.waypoints[int(k)] for k in chosen),
        "tether_length": round(float(limit), 2),
    }
    mission = mission.model_copy(update=update)
    if kind == "repair":  # cells in which a tour is planned within seconds
        mission = mission.model_copy(update={"cell": 0.3})
    if kind == "anchor":
        track = tuple(random_track(rng, mission, scene, field))
        return mission.model_copy(update={"track": track}), scene, field, None
    every = ["appear", "vanish", "move", "add_waypoint", "cancel_waypoint", "push", "tether_length"]
    with_sensor = kind == "sensor" or (kind == "repair" and bool(rng.integers(2)))
    kinds = rng.choice(every, int(rng.integers(2, 6))).tolist()
    if kind == "sensor":
        kinds = ["appear"] * int(rng.integers(2, 6)) + ["vanish"] * int(rng.integers(2))
    if with_sensor:
        sensor = RangeSensor(noise=float(rng.choice([0.0, 0.03])))
        mission = mission.model_copy(update={"range_sensor": sensor})
    events = random_events(rng, mission, scene, field, lengths, kinds)
    surprises = SceneSurprises.model_validate({"schema_version": 1, "events": events})
    surprises.check(scene, "", len(mission.waypoints))
    return mission, scene, field, surprises


def fly(kind: str, index: int, vehicle: str = "kinematic") -> Flight:
    """Fly a run."""
    begin, name = time.process_time(), SCENES[index % len(SCENES)]
    commit = source()["commit"]
    try:
        mission, scene, field, surprises = scenario(kind, index)
        planner, options, given = "predictive", PlannerOptions(seed=index), mission
        if kind == "repair":
            planner = "repair"
            options = PlannerOptions(seed=index, planning_limit=2.0)
            given = plan(mission, scene=scene, field=field, time_limit=PLAN_S).to_mission()
        run = simulate(given, planner, vehicle=vehicle, scene=scene, field=field, seed=index,
                       surprises=surprises, options=options)  # fmt: skip
    except (InputError, LimitReachedError) as error:
        spent = time.process_time() - begin
        return Flight(kind, index, name, vehicle, commit, spent, refused=str(error))
    s, happened = run.summary, []
    if surprises is not None:
        happened = [(e["time"], as_json(surprises.events[e["number"]]))
                    for e in s["surprises"]["events"]]  # fmt: skip
    return Flight(
        kind, index, name, vehicle, commit, time.process_time() - begin,
        mission=as_json(given),
        scene=as_json(scene),
        happened=happened,
        log=[FlownStep(r.time, r.x, r.y, r.z, r.tether, r.mode) for r in run.log],
        summary={k: s[k] for k in KEPT},
        responses=[r["response"] for r in s.get("repairs", ())],
    )  # fmt: skip


def judged(flight: Flight) -> Verdict:
    """Judge a run by its log."""
    mission = flight.parsed_mission()
    reserve = 0.0 if mission.range_sensor is None else 0.2
    return judge_run(mission, flight.parsed_scene(), flight.log, flight.parsed_events(), reserve,
                     JudgeOptions())  # fmt: skip


def runs_of(args: argparse.Namespace) -> Iterator[tuple[Flight, dict[str, Any]]]:
    """Yield flights and verdicts, those of the store and new ones, until `--cpu-s` are spent."""
    store, numbers = FlightStore(args.store), args.only or range(args.runs)
    for index in numbers:
        if args.scenes is not None and SCENES[index % len(SCENES)] not in args.scenes:
            continue
        for kind in args.kinds:
            is_up = args.finished or time.process_time() > args.cpu_s
            flight = store.flight(kind, index)
            if flight is None:
                if is_up:
                    continue
                flight = fly(kind, index, args.vehicle)
                store.keep_flight(flight)
            verdict = store.verdict(flight) if flight.refused is None else {}
            if verdict is None:
                if is_up:
                    continue
                begin = time.process_time()
                verdict = vars(judged(flight))
                verdict["judge_s"] = time.process_time() - begin
                store.keep_verdict(flight, verdict)
            yield flight, verdict


def main() -> None:
    """Fly, judge, and name what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=list(KINDS))
    parser.add_argument("--scenes", nargs="*", choices=SCENES, help="only runs in these")
    parser.add_argument("--runs", type=int, default=60, help="of each kind")
    parser.add_argument("--only", type=int, nargs="*", help="numbers of runs")
    parser.add_argument("--vehicle", default="kinematic")
    parser.add_argument("--store", type=Path, help="folder of flights and verdicts, to go on from")
    parser.add_argument("--finished", action="store_true", help="fly none, show those of --store")
    parser.add_argument("--cpu-s", type=float, default=math.inf, help="CPU time for new runs, s")
    args = parser.parse_args()
    runs = list(runs_of(args))
    origin = {"commit": " and ".join(sorted({f.commit for f, _ in runs}))} if runs else {}
    heading("Under way")
    head("what happens", "runs", "scenes", "home", "free", "over the limit", "in a solid",
         "visited", "out of reach", "no room", "lost", "tether and string differ by at most",
         "CPU s a run", name="under-way", **origin)  # fmt: skip
    for kind in args.kinds:
        flights = [f for f, _ in runs if f.kind == kind and f.refused is None]
        v = [v for f, v in runs if f.kind == kind and f.refused is None]
        row(
            KINDS[kind], len(flights), len({f.scene_name for f in flights}),
            sum(x["is_home"] for x in v), sum(x["is_free"] for x in v),
            sum(x["over_s"] > 0.0 for x in v), sum(x["room"] < 0.0 for x in v),
            sum(len(x["visited"]) for x in v), sum(len(x["unreachable"]) for x in v),
            sum(len(x["open"]) for x in v), sum(len(x["lost"]) for x in v),
            f"{100 * max((x['difference'] for x in v), default=0.0):.1f} %",
            f"{np.mean([f.cpu_s for f in flights]):.1f}" if flights else "-",
        )  # fmt: skip
    print()
    for flight, verdict in runs:
        run = f"{flight.kind} {flight.index}, {flight.scene_name}"
        if flight.refused is not None:
            print(f"- {run}: refused: {flight.refused}")
            continue
        for fault in verdict["faults"]:
            print(f"- {run}: {fault}")


if __name__ == "__main__":
    main()
