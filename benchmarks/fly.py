"""Tours flown over MAVLink: problems and random worlds in currents, obstacles that appear under
way, failures at random moments, and packets that are none.

    python benchmarks/fly.py [--only tours|repairs|failures|packets] [--few] [--moments 10]
                             [--rows FILE] [--pace 3] [--packets 100000] [--keep]

The vehicle is the fake autopilot of the tests, on its own clock; where the environment variable
NETSP_ARDUSUB names the binary of ArduSub's simulator, the same is flown against that at a speed-up
of `--pace` (at most 3), in still water. Rows are written to FILE as they come, and a flight whose
row is there already is not flown again. `--few` flies some of each kind, for the gate.
"""

from __future__ import annotations

import argparse
import json
import random
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from table import ROOT, head, heading, row

from netsp import Circle, Problem, solve
from netsp.base.errors import InputError, NetspError
from netsp.base.geometry import polylines
from netsp.model.solution import Solution
from netsp.online.execute.events import Surprises
from netsp.online.execute.execution_log import Execution, ExecutionOptions, ExecutionRow
from netsp.online.execute.run_record import RunRecord
from netsp.online.fly.flight_rehearsal import rehearse
from netsp.online.fly.flight_time import predicted_flight
from netsp.online.fly.resume import from_record, read_run
from netsp.online.fly.standby import stand_by
from netsp.online.fly.stopped import RefusedError
from netsp.online.fly.tour_flight import fly
from netsp.online.link.address import Address
from netsp.online.link.dialect import dialect, parser
from netsp.online.link.geo_frame import Frame
from netsp.online.link.mavlink_messages import Listener
from netsp.online.link.modes import mode_name
from netsp.online.link.session import Session
from netsp.online.link.udp import UdpLink, messages_in
from netsp.plan.random_worlds import reachable_world
from netsp.plan.tour_plan import legs_of
from netsp.world.scene.scene import scene_of
from netsp.world.tether import GeodesicTether
from tests.ardusub import BINARY, HOME, ArduSub
from tests.autopilot import Earth
from tests.simulated_session import SimulatedSession

PROBLEMS = ("wharf", "pool", "oc4-jacket", "wec-array", "lillgrund-part")
KILOMETRES = ("wec-array", "lillgrund-part")
"""Problems whose tours are kilometres long; 0.5 m/s would take hours."""

SPEEDS = (0.5, 1.0, 1.5)
CURRENTS = (0.0, 0.4, 0.8)
"""Speeds of the vehicle and of the water, m/s; the current's direction is drawn for each flight."""

N_WORLDS = 10
BEYOND_S = 30.0
"""Seconds to look beyond the end of a flight."""

ALONE_S = 10.0
"""Seconds that a vehicle is alone between a flight that was killed and the one that goes on."""

REPAIRS = ("local", "replan", "home")

OTHER_KINDS = ((2, 3), (10, 3), (13, 3), (12, 12), (11, 3))
"""MAV_TYPE and MAV_AUTOPILOT of vehicles that must not be commanded: a quadcopter, a rover, a
hexacopter, a submarine with PX4, a boat."""


class KilledError(BaseException):
    """End of a process that nobody catches."""


class TrueSession(Session):
    """A session with ArduSub's simulator, which tells where the vehicle really is."""

    def __init__(self, vehicle: ArduSub, frame: Frame, pace: float) -> None:
        latitude, longitude, *_ = (float(v) for v in HOME.split(","))
        self.earth, self.places_told = Earth(latitude, longitude), []
        super().__init__(UdpLink(Address(True, "127.0.0.1", vehicle.port)), frame, 1, pace)

    def _receive(self, message: Any, peer: tuple[str, int]) -> None:
        super()._receive(message, peer)
        if message.get_type() == "SIMSTATE" and self.latest.position is not None:
            # it tells no depth; that of the filter comes from pressure and does not drift
            east, north = self.earth.local(message.lat, message.lng)
            self.places_told.append((self.latest.time, east, north, self.latest.position[2]))

    @property
    def truth(self) -> np.ndarray:
        """Time, east, north, up of where the vehicle really was, a row each."""
        return np.array(self.places_told, dtype=float).reshape(-1, 4)


@dataclass
class Vehicle:
    """A vehicle that is armed at the base, and our session with it."""

    session: Any
    befall: Callable[..., None]
    """Has something happen to the vehicle, as of `tests.autopilot`."""

    @property
    def now(self) -> float:
        """Seconds of the vehicle's clock, also while it is not heard."""
        if isinstance(self.session, SimulatedSession):
            return float(self.session.simulation.now)
        return float(self.session.latest.time)

    @property
    def truth(self) -> np.ndarray:
        return np.array(self.session.truth)

    @property
    def state(self) -> tuple[bool | None, str | None]:
        """Return whether it is armed, and its mode: what is true, not what was heard."""
        if isinstance(self.session, SimulatedSession):
            true = self.session.simulation.vehicle
            return true.armed, mode_name(true.mode)
        return self.session.latest.armed, self.session.latest.mode


@contextmanager
def vehicle(
    problem: Problem, pace: float, speed: float, seed: int,
    current: tuple[float, float] = (0.0, 0.0), kind: tuple[int, int] = (12, 3),
) -> Iterator[Vehicle]:  # fmt: skip
    """Start a vehicle at the base, and arm it."""
    if not BINARY:
        session: Any = SimulatedSession(
            problem, speed=speed, seed=seed, current=current, noise=0.02, drift=0.03, smooth=1.0,
            kind=kind[0], autopilot=kind[1],
        )  # fmt: skip
        yield Vehicle(session.arm(), session.simulation.do)
        session.close()
        return
    with ArduSub(pace, {"WPNAV_SPEED": 100.0 * speed}) as ardusub:
        session = TrueSession(ardusub, Frame(problem, "local"), pace)
        try:
            ardusub.until(lambda: session.latest.position is not None and session.latest.estimate)
            session.command(400, 1, 21196)
            ardusub.until(lambda: session.latest.armed is True)
            yield Vehicle(session, lambda **what: befall_ardusub(session, **what))
        finally:
            session.close()


def befall_ardusub(session: Session, **what: Any) -> None:
    """Have something happen to ArduSub's simulator; raise NotImplementedError if it cannot."""
    m = dialect()
    if what["do"] == "mode":
        session.command(m.MAV_CMD_DO_SET_MODE, 1, what["mode"])
    elif what["do"] == "disarm":
        session.command(m.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196)
    elif what["do"] == "lose_estimate":
        set_parameter(session, "SIM_GPS1_ENABLE", 0.0)
    elif what["do"] == "gps_jump":
        set_parameter(session, "SIM_GPS1_GLTCH_X", what["by"][1] * 1e-7 / Earth.METRES)
    else:
        raise NotImplementedError(what["do"])


def set_parameter(session: Session, name: str, value: float) -> None:
    m = dialect()
    session.link.send(m.MAVLink_param_set_message(1, 1, name.encode(), value, 9))


# rows


class Rows:
    """Rows of flights by what was flown, kept in a file as they come."""

    def __init__(self, file: str | None) -> None:
        self.file = None if file is None else Path(file)
        self.found: dict[str, dict[str, Any]] = {}
        if self.file is not None and self.file.exists():
            for line in self.file.read_text(encoding="utf-8").splitlines():
                kept = json.loads(line)
                self.found[json.dumps(kept["flown"], sort_keys=True)] = kept["row"]

    def of(self, fly_it: Callable[[], dict[str, Any]], **flown: Any) -> dict[str, Any]:
        """Return the row of a flight, which is flown if it has none yet."""
        flown["vehicle"] = "ArduSub" if BINARY else "fake"
        key = json.dumps(flown, sort_keys=True)
        if key not in self.found:
            self.found[key] = fly_it()
            if self.file is not None:
                with self.file.open("a", encoding="utf-8") as out:
                    out.write(json.dumps({"flown": flown, "row": self.found[key]}) + "\n")
        return self.found[key]


# tours


def places(problem: Problem, rows: np.ndarray) -> np.ndarray:
    """Return true places in the frame of the problem."""
    frame = Frame(problem, "local")
    found = [frame.from_local(north, east, -up) for east, north, up in rows[:, 1:]]
    return np.array(found, dtype=float).reshape(-1, 3)


def least_room(problem: Problem, rows: np.ndarray) -> float:
    """Return the least distance of true places to any obstacle, m."""
    return min(
        (float(o.signed_distance(p[:2])) for o in problem.obstacles for p in places(problem, rows)),
        default=np.inf,
    )


def longest_tether(problem: Problem, rows: np.ndarray, delta: float | None) -> float:
    """Return the length of the longest tether along true places, as a share of the limit."""
    model = GeodesicTether(scene_of(problem).field(), delta or 0.1)
    base = np.array(problem.base, dtype=float)
    _, lengths = model.drive(model.start(base, base), places(problem, rows)[::5])
    return float(lengths.max(initial=0.0)) / problem.tether_length


def worlds(count: int) -> list[Problem]:
    """Return random worlds of the size of a harbour, whose goals a tour can all visit."""
    found: list[Problem] = []
    seed = 0
    while len(found) < count:
        seed += 1
        try:
            drawn, _ = reachable_world(
                seed, goals=6, obstacles=8, side=40.0, tether_length=45.0, radii=(0.8, 2.4)
            )
            problem = Problem.model_validate({
                **drawn.model_dump(mode="json"), "name": f"world-{seed}", "units": "m",
                "clearance": 0.4,
                "goals": [[x, y, -1.5] for x, y, *_ in (g.position for g in drawn.goals)],
            })  # fmt: skip
        except (InputError, ValueError):
            continue
        if len(solve(problem, time_limit=10.0).tour) == len(problem.goals):
            found.append(problem)
    return found


def flow(problem: Problem, current: float) -> tuple[float, float]:
    """Return a current of a speed, in a direction that is drawn for the problem."""
    angle = random.Random(problem.name).uniform(0.0, 2.0 * np.pi)
    return current * float(np.cos(angle)), current * float(np.sin(angle))


def fly_tour(problem: Problem, pace: float, speed: float, current: float) -> dict[str, Any]:
    """Fly a tour to its end; return what came of it."""
    solution = solve(problem, time_limit=20.0)
    assert solution.length is not None
    with vehicle(problem, pace, speed, 0, flow(problem, current)) as v:
        begin = v.now
        done = fly(problem, solution, v.session, ExecutionOptions(speed=speed, reach=0.3))
        rows = v.truth
        rows = rows[(rows[:, 0] >= begin) & (rows[:, 0] <= begin + flown_s(done))]
    s = done.summary
    return {
        "goals": f"{s['visited']} of {len(problem.goals)}",
        "words": f"{s['arrivals_as_planned']} of {len(solution.tour) + 1}",
        "home": "yes" if s["home"] and s["tether_free"] else done.stopped or s["status"],
        "tether": longest_tether(problem, rows, done.options.delta),
        "room": least_room(problem, rows),
        "seconds": flown_s(done),
        "predicted": predicted_flight(problem, solution, speed, reach=0.3).total_s,
    }  # fmt: skip


def flown_s(done: Execution) -> float:
    return done.rows[-1].time if done.rows else 0.0


def tours(rows: Rows, pace: float, names: list[str], few: bool) -> None:
    groups = {name: [Problem.load(ROOT / "problems" / f"{name}.json")] for name in names}
    n_worlds = 1 if few else N_WORLDS
    groups[f"{n_worlds} random worlds"] = worlds(n_worlds)
    currents = (0.0,) if BINARY else (0.0, 0.8) if few else CURRENTS
    head("vehicle", "problem", "m/s", "flights", "home, tether free", "goals", "words as planned",
         "longest true tether of the limit", "least room m, clearance",
         "seconds over predicted, median / worst", name="fly-tours")  # fmt: skip
    for name, problems in groups.items():
        speeds = SPEEDS[:1] if few else SPEEDS[1:] if name in KILOMETRES else SPEEDS
        for speed in speeds:
            found = [
                rows.of(
                    lambda p=problem, v=speed, c=current: fly_tour(p, pace, v, c),  # type: ignore[misc]
                    tour=problem.name, speed=speed, current=current,
                )
                for problem in problems for current in currents
            ]  # fmt: skip
            share = [r["seconds"] / r["predicted"] for r in found if r["home"] == "yes"]
            worst = max(share, key=lambda r: abs(r - 1.0), default=1.0)
            row("ArduSub" if BINARY else "fake", name, speed, len(found), len(share),
                of_all(r["goals"] for r in found), of_all(r["words"] for r in found),
                f"{max(r['tether'] for r in found):.3f}",
                f"{min(r['room'] for r in found):.2f}, {problems[0].clearance:g}",
                f"{np.median(share):.2f} / {worst:.2f}" if share else "")  # fmt: skip
    print()


def of_all(counts: Iterable[str]) -> str:
    """Return the sum of counts such as "5 of 6"."""
    pairs = [tuple(map(int, text.split(" of "))) for text in counts]
    return f"{sum(p[0] for p in pairs)} of {sum(p[1] for p in pairs)}"


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


def repairs(rows: Rows, pace: float, moments: int) -> None:
    head("vehicle", "problem", "obstacles", "flights done", "home and free",
         "repair s, median / worst", "least room m", name="fly-repairs")  # fmt: skip
    for name in ("wharf", "pool", "oc4-jacket"):
        problem = Problem.load(ROOT / "problems" / f"{name}.json")
        solution = solve(problem, time_limit=20.0)
        rng = np.random.default_rng(0)
        found = []
        for k in range(moments):
            when, boat = in_the_way(problem, solution, rng)
            found.append(rows.of(
                lambda p=problem, s=solution, w=when, b=boat, k=k: fly_round(p, s, pace, w, b, k),  # type: ignore[misc]
                repair=name, moment=k,
            ))  # fmt: skip
        spent = [s for r in found for s in r["planning_s"]]
        row("ArduSub" if BINARY else "fake", name, moments, sum(r["done"] for r in found),
            sum(r["home"] for r in found),
            f"{np.median(spent):.2f} / {max(spent):.2f} of {len(spent)}" if spent else "",
            f"{min(r['room'] for r in found):.2f}")  # fmt: skip
    print()


def fly_round(
    problem: Problem, solution: Solution, pace: float, when: float, boat: Circle, seed: int
) -> dict[str, Any]:
    """Fly a tour on whose way an obstacle appears; return what came of it."""
    event = {"time": when, "appear": {"center": boat.center, "radius": boat.radius}}
    told = Surprises.model_validate({"schema_version": 1, "events": [event]})
    with vehicle(problem, pace, 0.5, seed) as v:
        begin = v.now
        done = fly(problem, solution, v.session, ExecutionOptions(speed=0.5, reach=0.3),
                   surprises=told)  # fmt: skip
        rows = v.truth
    rows = rows[(rows[:, 0] >= begin) & (rows[:, 0] <= begin + flown_s(done))]
    return {
        "done": done.summary["status"] == "done",
        "home": bool(done.summary["home"] and done.summary["tether_free"]),
        "room": least_room(problem, rows),
        "planning_s": [e.planning_s for e in done.entries if e.response in REPAIRS],
    }


# failures


def interrupt(v: Vehicle) -> None:
    raise KeyboardInterrupt


def kill(v: Vehicle) -> None:
    raise KilledError


def other_station(v: Vehicle) -> None:
    need_fake()
    v.session.stations = {(255, 190): v.now}


def late_heartbeats(v: Vehicle) -> None:
    """Have the next heartbeat come 4 s late, where the vehicle waits for 5."""
    need_fake()
    v.session._beat_due = v.now + 4.0


def need_fake() -> None:
    if BINARY:
        raise NotImplementedError


def done_to(**what: Any) -> Callable[[Vehicle], None]:
    return lambda v: v.befall(**what)


FAILURES: dict[str, Callable[[Vehicle], None]] = {
    "mode": done_to(do="mode", mode=19),
    "disarm": done_to(do="disarm"),
    "link": done_to(do="silence", seconds=120),
    "freeze": done_to(do="freeze"),
    "GPS off": done_to(do="lose_estimate"),
    "GPS jump": done_to(do="gps_jump", by=[0.0, 5.6]),
    "kill -9 and resume": kill,
    "Ctrl-C": interrupt,
    "current": done_to(do="current", by=[0.6, 0.5]),
    "wrong vehicle": interrupt,
    "other ground station": other_station,
    "heartbeats late": late_heartbeats,
}


def failures(rows: Rows, pace: float, moments: int, names: list[str]) -> None:
    problem = Problem.load(ROOT / "problems" / "pool.json")
    solution = solve(problem, time_limit=20.0)
    head("vehicle", "failure", "flights", "stopped, s until then: median / worst",
         "flown to the end, home and free", "armed and mode 30 s later",
         "m moved in these 30 s, median / worst", "least room m in flight, in these 30 s",
         name="fly-failures")  # fmt: skip
    for name in names:
        rng = np.random.default_rng(1)
        found = []
        for k in range(moments):
            when = float(rng.uniform(2.0, 0.9 * (solution.length or 0.0) / 0.5))
            found.append(rows.of(
                lambda n=name, w=when, k=k: fly_failure(problem, solution, pace, n, w, k),  # type: ignore[misc]
                failure=name, moment=k,
            ))  # fmt: skip
        flown = [r for r in found if "skipped" not in r]
        if not flown:
            row("ArduSub" if BINARY else "fake", name, f"0: {found[0]['skipped']}", *[""] * 5)
            continue
        noticed = [r["noticed"] for r in flown if r["noticed"] is not None]
        moved = [r["moved"] for r in flown if r["moved"] is not None]
        ends = sorted({r["after"] for r in flown})
        row("ArduSub" if BINARY else "fake", name, len(flown),
            f"{len(noticed)}, {median(noticed)}", sum(r["home"] for r in flown),
            ", ".join(f"{sum(r['after'] == e for r in flown)} {e}" for e in ends), median(moved),
            f"{least(r['room'] for r in flown)}, {least(r['room_after'] for r in flown)}",
            )  # fmt: skip
    print()


def median(values: list[float]) -> str:
    return f"{np.median(values):.1f} / {max(values):.1f}" if values else ""


def least(values: Iterable[float | None]) -> str:
    found = [v for v in values if v is not None]
    return f"{min(found):.2f}" if found else ""


def fly_failure(
    problem: Problem, solution: Solution, pace: float, name: str, when: float, seed: int
) -> dict[str, Any]:
    """Fly a tour in which something fails; return what came of it, also 30 s later."""
    kind = OTHER_KINDS[seed % len(OTHER_KINDS)] if name == "wrong vehicle" else (12, 3)
    if BINARY and name in ("wrong vehicle", "kill -9 and resume"):
        return {"skipped": "not with ArduSub"}
    begun: list[float] = []
    options = ExecutionOptions(speed=0.5, reach=0.3)
    with vehicle(problem, pace, 0.5, seed, kind=kind) as v, tempfile.TemporaryDirectory() as run:
        begin = v.now

        def on_step(r: ExecutionRow) -> None:
            if r.time >= when and not begun:
                begun.append(v.now)
                FAILURES[name](v)

        done: Execution | None = None
        why: str | None = None
        try:
            done = fly(problem, solution, v.session, options, on_step=on_step,
                       record=RunRecord(run, solution))  # fmt: skip
            why = done.stopped or ("Ctrl-C" if done.interrupted else None)
        except NotImplementedError:
            return {"skipped": "not with ArduSub"}
        except RefusedError as error:
            begun.append(begin)
            why = f"refused: {error}"
        except KilledError:
            v.session.close()
            v.session.begin_at(v.now + ALONE_S)
            done, why = resume(v, run, options)
        end = v.now
        stand_by_for(v, BEYOND_S)
        rows, (armed, mode) = v.truth, v.state
    late = rows[rows[:, 0] > end]
    early = rows[(rows[:, 0] >= begin) & (rows[:, 0] <= end)]
    home = done is not None and done.summary["home"] and done.summary["tether_free"]
    return {
        "why": why, "noticed": end - begun[0] if why and begun else None, "home": bool(home),
        "after": f"{'armed' if armed else 'disarmed'}, {mode}",
        "moved": float(np.linalg.norm(late[-1, 1:] - late[0, 1:])) if len(late) else None,
        "room": least_room(problem, early) if len(early) else None,
        "room_after": least_room(problem, late) if len(late) else None,
    }  # fmt: skip


def resume(v: Vehicle, run: str, options: ExecutionOptions) -> tuple[Execution | None, str | None]:
    """Go on with a flight that was killed; return what came of it, and what stopped it."""
    problem, solution, state = read_run(run)
    v.session = SimulatedSession(problem, v.session.simulation).arm()
    try:
        done = fly(problem, solution, v.session, options, begins=from_record(problem, state))
    except NetspError as error:
        return None, str(error)
    return done, done.stopped


def stand_by_for(v: Vehicle, seconds: float) -> None:
    """Let time go by after a flight, as the command does."""
    end = v.now + seconds
    stand_by(v.session, should_stop=lambda: v.now >= end)
    if not BINARY and v.now < end:
        v.session.close()
        v.session.begin_at(end)
    while v.now < end and BINARY:
        time.sleep(0.1)


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
                understood += listener.read(message) is not None
        except Exception as error:  # counted: that is what this is for
            print(repr(error))
            raised += 1
    row(count, read, understood, raised, f"{time.perf_counter() - begin:.0f}")
    print()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=("tours", "repairs", "failures", "packets"))
    parser.add_argument("--few", action="store_true", help="some flights of each kind")
    parser.add_argument("--problems", nargs="*", default=list(PROBLEMS), help="to be flown")
    parser.add_argument("--failures", nargs="*", default=list(FAILURES), help="to be flown")
    parser.add_argument("--rows", metavar="FILE", help="rows of flights, added to as they come")
    parser.add_argument("--pace", type=float, default=3.0, help="speed-up of ArduSub, at most 3")
    parser.add_argument("--moments", type=int, default=10)
    parser.add_argument("--packets", type=int, default=100_000)
    args = parser.parse_args()
    if args.few:
        args.problems, args.moments, args.packets = ["pool"], 1, 5_000
    rows, pace = Rows(args.rows), min(args.pace, 3.0)
    rehearse()
    heading("Tours flown over MAVLink")
    for name, measure in (
        ("tours", lambda: tours(rows, pace, args.problems, args.few)),
        ("repairs", lambda: repairs(rows, pace, args.moments)),
        ("failures", lambda: failures(rows, pace, args.moments, args.failures)),
        ("packets", lambda: packets(args.packets)),
    ):  # fmt: skip
        if args.only in (None, name) and not (args.few and name == "repairs"):
            measure()


if __name__ == "__main__":
    main()
