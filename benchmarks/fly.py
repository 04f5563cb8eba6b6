"""Tours flown over MAVLink by the fake autopilot of the tests: the shipped problems to their ends,
obstacles that appear under way, failures at random moments, and packets that are none.

    python benchmarks/fly.py [--only tours|repairs|failures|packets] [--pace 8] [--moments 10]
                             [--packets 100000] [--keep]

The autopilot is a process of its own at a pace of 8: eight of its seconds go by in one.
"""

from __future__ import annotations

import argparse
import random
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from table import ROOT, head, heading, row

from netsp import Circle, Problem, solve
from netsp.command.fly import way_home
from netsp.execute.events import Surprises
from netsp.execute.log import Execution, ExecutionOptions, ExecutionRow
from netsp.execute.plan import legs_of
from netsp.fly.flight import fly
from netsp.fly.rehearsal import rehearse
from netsp.geometry import polylines
from netsp.link.address import Address
from netsp.link.dialect import dialect, parser
from netsp.link.frame import Frame
from netsp.link.messages import Listener
from netsp.link.session import Session
from netsp.link.udp import UdpLink, messages_in
from netsp.online.scene.scene import scene_of
from netsp.online.tether import GeodesicTether
from netsp.solution import Solution
from tests.autopilot import Autopilot

SPEEDS = {"wharf": 0.5, "pool": 0.5, "oc4-jacket": 0.5, "wec-array": 1.5, "lillgrund-part": 1.5}
"""m/s: among wind turbines tours are kilometres long."""

FAILURES: dict[str, dict[str, Any] | None] = {
    "the pilot takes over": {"do": "mode", "mode": 19},
    "disarmed": {"do": "disarm"},
    "estimate lost": {"do": "lose_estimate"},
    "link lost": {"do": "silence", "seconds": 120},
    "carried off": {"do": "push", "by": [1.3, -1.1, 0]},
    "estimate jumps": {"do": "jump", "by": [-1.6, 1.2]},
    "Ctrl-C": None,
}

REPAIRS = ("local", "replan", "home")


@contextmanager
def vehicle(problem: Problem, pace: float, speed: float, seed: int) -> Iterator[Any]:
    """An autopilot that is armed at the base, and our session with it."""
    rehearse()
    with Autopilot(
        pace=pace, speed=speed, seed=seed, noise=0.02, drift=0.03, smooth=1.0,
        params={"FS_GCS_TIMEOUT": 30},
    ) as autopilot:  # fmt: skip
        frame = Frame(problem, "local")  # it begins at the base, wherever that is on earth
        session = Session(UdpLink(Address(True, "127.0.0.1", autopilot.port)), frame, 1, pace)
        try:
            autopilot.until(lambda: session.now.position is not None and session.now.estimate)
            session.command(400, 1)
            autopilot.until(lambda: session.now.armed is True)
            yield autopilot, session
        finally:
            session.close()


def truth(problem: Problem, autopilot: Autopilot, done: Execution) -> tuple[float, float]:
    """Least room to any obstacle (m), and the longest tether as a share of the limit, of where the
    vehicle really was until it was stopped."""
    begin = autopilot.now - (done.rows[-1].time if done.rows else 0.0)
    rows = autopilot.truth()
    told = rows[rows[:, 0] <= begin + (done.rows[-1].time if done.rows else 0.0) + 1.0, 1:]
    frame = Frame(problem, "local")
    places = np.array([frame.from_local(north, east, -up) for east, north, up in told])
    room = min(
        (float(o.signed_distance(p[:2])) for o in problem.obstacles for p in places[::5]),
        default=np.inf,
    )
    field = scene_of(problem).field()
    model = GeodesicTether(field, done.options.delta or 0.1)
    base = np.array(problem.base, dtype=float)
    _, lengths = model.drive(model.start(base, base), places[::10])
    return room, float(lengths.max(initial=0.0)) / problem.tether_length


def tours(pace: float, names: list[str]) -> None:
    head("problem", "m/s", "goals", "tour m", "arrivals as planned", "home", "tether free",
         "longest tether, guard's / true, of the limit", "least room m, clearance", "simulated s",
         name="fly-tours")  # fmt: skip
    for name in names:
        problem = Problem.load(ROOT / "problems" / f"{name}.json")
        solution = solve(problem, time_limit=20.0)
        speed = SPEEDS[name]
        with vehicle(problem, pace, speed, 0) as (autopilot, session):
            done = fly(problem, solution, session, ExecutionOptions(speed=speed, reach=0.3))
            room, share = truth(problem, autopilot, done)
        s = done.summary
        row(name, speed, f"{s['visited']} of {len(problem.goals)}", f"{solution.length:.1f}",
            f"{s['arrivals_as_planned']} of {len(done.arrivals)}", "yes" if s["home"] else "no",
            "yes" if s["tether_free"] else "no",
            f"{s['longest_tether'] / problem.tether_length:.3f} / {share:.3f}",
            f"{room:.2f}, {problem.clearance:g}", f"{s['time_s']:.0f}")  # fmt: skip
    print()


def in_the_way(
    problem: Problem, solution: Solution, rng: np.random.Generator
) -> tuple[float, Circle]:
    """An obstacle that appears on the path, some seconds ahead, clear of goals and base."""
    path = np.vstack([leg.path for leg in legs_of(problem, solution)])
    length = polylines.length(path)
    while True:
        ahead = float(rng.uniform(0.15, 0.9)) * length
        _, at = polylines.points_along(path, ahead)[:2]
        boat = Circle(center=(float(at[0]), float(at[1])), radius=float(rng.uniform(0.2, 0.5)))
        room = [boat.signed_distance(np.array(g.position[:2])) for g in problem.goals]
        room.append(boat.signed_distance(np.array(problem.base[:2])))
        if min(map(float, room)) > problem.clearance + 0.2:
            return max(ahead / 0.5 - 6.0, 1.0), boat


def repairs(pace: float, moments: int) -> None:
    head("problem", "obstacles", "flights done", "home and free", "repair s, median / worst",
         "least room m", name="fly-repairs")  # fmt: skip
    for name in ("wharf", "pool", "oc4-jacket"):
        problem = Problem.load(ROOT / "problems" / f"{name}.json")
        solution = solve(problem, time_limit=20.0)
        rng, spent, ends, free, least = np.random.default_rng(0), [], 0, 0, np.inf
        for k in range(moments):
            when, boat = in_the_way(problem, solution, rng)
            event = {"time": when, "appear": {"center": boat.center, "radius": boat.radius}}
            told = Surprises.model_validate({"schema_version": 1, "events": [event]})
            with vehicle(problem, pace, 0.5, k) as (autopilot, session):
                done = fly(problem, solution, session, ExecutionOptions(speed=0.5, reach=0.3),
                           surprises=told)  # fmt: skip
                room, _ = truth(problem, autopilot, done)
            ends += done.summary["status"] == "done"
            free += bool(done.summary["home"] and done.summary["tether_free"])
            least = min(least, room)
            spent += [e.planning_s for e in done.entries if e.response in REPAIRS]
        row(name, moments, ends, free,
            f"{np.median(spent):.2f} / {max(spent):.2f} of {len(spent)}" if spent else "",
            f"{least:.2f}")  # fmt: skip
    print()


def failures(pace: float, moments: int) -> None:
    problem = Problem.load(ROOT / "problems" / "pool.json")
    solution = solve(problem, time_limit=20.0)
    options = ExecutionOptions(speed=0.5, reach=0.3)
    head("failure", "flights", "stopped, with a reason", "path home offered", "targets after it",
         "least room of targets m", "of the vehicle m", "longest tether of the limit",
         name="fly-failures")  # fmt: skip
    assert solution.length is not None
    for name, what in FAILURES.items():
        rng = np.random.default_rng(1)
        stopped = offered = later = 0
        aimed, least, most = np.inf, np.inf, 0.0
        for k in range(moments):
            when = float(rng.uniform(2.0, 0.9 * solution.length / options.speed))
            begun: list[float] = []
            with vehicle(problem, pace, options.speed, k) as (autopilot, session):
                step = at(when, begun, lambda a=autopilot, w=what: befall(a, w))
                done = fly(problem, solution, session, options, on_step=step)
                sent = len(targets(autopilot))
                autopilot.sleep(4.0)
                later += len(targets(autopilot)) - sent
                room, share = truth(problem, autopilot, done)
            stopped += bool(done.stopped or done.interrupted)
            offered += bool(way_home(done))
            aimed = min(aimed, room_of_targets(problem, autopilot))
            least, most = min(least, room), max(most, share)
        row(name, moments, stopped, offered, later, f"{aimed:.2f}", f"{least:.2f}",
            f"{most:.3f}")  # fmt: skip
    print()


def at(when: float, begun: list[float], do: Callable[[], None]) -> Callable[[ExecutionRow], None]:
    def on_step(r: ExecutionRow) -> None:
        if r.time >= when and not begun:
            begun.append(r.time)
            do()

    return on_step


def befall(autopilot: Autopilot, what: dict[str, Any] | None) -> None:
    if what is None:
        raise KeyboardInterrupt
    autopilot.tell(**what)


def targets(autopilot: Autopilot) -> list[dict[str, Any]]:
    return [e for e in autopilot.events if e.get("event") == "target"]


def room_of_targets(problem: Problem, autopilot: Autopilot) -> float:
    """How near to an obstacle the vehicle was ever sent."""
    frame = Frame(problem, "local")
    sent = [frame.from_local(y, x, -z) for x, y, z in (e["at"] for e in targets(autopilot))]
    return min((float(o.signed_distance(np.array(p[:2]))) for o in problem.obstacles for p in sent),
               default=np.inf)  # fmt: skip


def packets(count: int) -> None:
    """Whole messages with bytes changed, cut or added, and from strangers: what got through, and
    how long it took."""
    head("packets", "messages in them", "of the vehicle's system id, understood", "raised",
         "s", name="fly-packets")  # fmt: skip
    rng, m = random.Random(0), dialect()
    packs = [parser(1, 1), parser(2, 1), parser(1, 42)]
    problem = Problem.load(ROOT / "problems" / "pool.json")
    listener = Listener(Frame(problem), 1)
    read = understood = raised = 0
    begin = time.perf_counter()
    for _ in range(count):
        whole = rng.choice([
            m.MAVLink_heartbeat_message(12, 3, 128, 4, 4, 3),
            m.MAVLink_local_position_ned_message(1, 1.0, 2.0, 3.0, 0, 0, 0),
            m.MAVLink_statustext_message(4, b"\xff\xfe"),
            m.MAVLink_attitude_message(1, 0.0, 0.0, float("nan"), 0, 0, 0),
            m.MAVLink_ekf_status_report_message(831, 0.1, 0.1, 0.05, 0.1, 0.0),
        ])  # fmt: skip
        data = bytearray(whole.pack(rng.choice(packs)))
        for _ in range(rng.randint(1, 6)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        data = data[: rng.randint(0, len(data))] + rng.randbytes(rng.randint(0, 20))
        try:
            for message in messages_in(bytes(data)):
                read += 1
                understood += listener.understand(message) is not None
        except Exception as error:  # counted: that is what this is for
            print(repr(error))
            raised += 1
    row(count, read, understood, raised, f"{time.perf_counter() - begin:.0f}")
    print()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=("tours", "repairs", "failures", "packets"))
    parser.add_argument("--problems", nargs="*", default=list(SPEEDS), help="to be flown")
    parser.add_argument("--pace", type=float, default=8.0)
    parser.add_argument("--moments", type=int, default=10)
    parser.add_argument("--packets", type=int, default=100_000)
    args = parser.parse_args()
    heading("Tours flown over MAVLink")
    for name, measure in (
        ("tours", lambda: tours(args.pace, args.problems)),
        ("repairs", lambda: repairs(args.pace, args.moments)),
        ("failures", lambda: failures(args.pace, args.moments)),
        ("packets", lambda: packets(args.packets)),
    ):  # fmt: skip
        if args.only in (None, name):
            measure()


if __name__ == "__main__":
    main()
