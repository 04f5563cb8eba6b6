"""Nothing is compiled, nor loaded, while a vehicle is flown or watched."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from netsp import Circle, Problem, solve
from netsp.base.compiled.compile_policy import compiles
from netsp.online.execute import execute, repair_warm_up
from netsp.online.fly import flight_rehearsal
from netsp.online.fly.flight_rehearsal import rehearse
from netsp.online.guard.guard_rehearsal import rehearse as watched
from tests.autopilot import Autopilot

pytestmark = pytest.mark.skipif(not compiles(), reason="NUMBA_DISABLE_JIT is set")

PACE = 4.0
ROOT = Path(__file__).parent.parent

SITE = Problem(
    base=(0, 0), goals=[(3, 1, -1), (3.2, -1, -1)], tether_length=12,
    obstacles=[Circle(center=(2, 0), radius=0.4, name="pile")], clearance=0.3,
)  # fmt: skip

LOADED = """
import gc, json, sys
from numba.core.dispatcher import Dispatcher

def loaded():
    "Kernels and the types that they are there for."
    return {
        f"{d.py_func.__module__}.{d.py_func.__name__} {s}"
        for d in gc.get_objects() if isinstance(d, Dispatcher) for s in d.signatures
    }
"""

FLOWN = """
from netsp.command.main import main
from netsp.online.link import session

opened, begin = [], session.Session.__init__

def open_link(self, *args):
    opened.append(loaded())
    begin(self, *args)

session.Session.__init__ = open_link
code = main(sys.argv[1:])
print(json.dumps([code, len(opened[0]), sorted(loaded() - opened[0])]))
"""

WATCHED = """
import numpy as np
from netsp.online.guard import live
from netsp.online.guard.telemetry import Fix
from netsp.online.guard.tether_guard import Guard
from netsp.online.link.geo_frame import Frame
from netsp.world.mission.mission import Mission
from netsp.model.problem import Problem

opened = []

class Link:
    def __init__(self, *_):
        opened.append(loaded())
        raise KeyboardInterrupt

live.UdpLink = Link
site = (Mission if "mission" in sys.argv[1] else Problem).load(sys.argv[1])
guard = Guard(site)
try:
    live.watch(guard, Frame(site), "udpin:14550", print)
except KeyboardInterrupt:
    rng, time, words = np.random.default_rng(3), 0.0, set()
    corners = np.array(json.loads(sys.argv[2]), dtype=float)
    track = np.concatenate([np.linspace(a, b, 25) for a, b in zip(corners[:-1], corners[1:])])
    for k, place in enumerate(track):
        time += 15.0 if k == 100 else 0.2
        noise = 0.2 * rng.normal(size=3)
        report = guard.update(Fix(time, tuple(map(float, place + noise)), estimate=k % 40 != 39))
        words |= {c.word for c in report.classes}
    print(json.dumps([len(words), len(opened[0]), sorted(loaded() - opened[0])]))
"""


def run(script, *args):
    """What a process of its own prints last."""
    done = subprocess.run(
        [sys.executable, "-c", LOADED + script, *map(str, args)], cwd=ROOT, text=True,
        capture_output=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert not done.returncode, done.stderr
    return *json.loads(done.stdout.splitlines()[-1]), done.stderr


def test_before_a_tour_is_flown_all_is_loaded_that_it_and_its_repairs_need(tmp_path):
    problem, solution = tmp_path / "p.json", tmp_path / "s.json"
    problem.write_text(SITE.to_json())
    solution.write_text(solve(SITE).to_json())
    surprise = tmp_path / "surprise.json"
    events = [
        {"time": 1, "appear": {"center": [1.6, 0.9], "radius": 0.2}},
        {"time": 3, "add_goal": [3.6, 0, -1]},
    ]
    surprise.write_text(json.dumps({"schema_version": 1, "events": events}))
    rehearse()  # on a fresh machine that takes a minute, in which an armed vehicle drifts off
    watched(in_space=False)
    with Autopilot(pace=PACE, params={"FS_GCS_ENABLE": 0}) as autopilot:
        autopilot.tell(do="arm")
        autopilot.event("armed")
        code, before, more, said = run(
            FLOWN, "fly", problem, solution, "--link", f"udpin:{autopilot.port}", "--pace", PACE,
            "--planning-limit", "1", "--surprise", surprise, "--page", "0", "-o", tmp_path / "run",
            "--quiet",
        )  # fmt: skip
    assert code == 0, said
    entries = (tmp_path / "run" / "events.csv").read_text()
    assert "local" in entries or "replan" in entries
    assert before > 30
    assert more == []


@pytest.mark.parametrize(
    ("module", "stage", "told"),
    [(flight_rehearsal, "solve", "on_progress"), (flight_rehearsal, "execute", "on_step"),
     (repair_warm_up, "solve_graph", "on_progress")],
)  # fmt: skip
def test_ctrl_c_before_the_flight_ends_it(module, stage, told, monkeypatch):
    """Planning and flying take Ctrl-C for the wish to have what there is."""
    real = getattr(module, stage)
    press = {told: lambda _: signal.raise_signal(signal.SIGINT)}
    monkeypatch.setattr(module, stage, lambda *args, **more: real(*args, **{**more, **press}))
    monkeypatch.setattr(
        "netsp.online.execute.tour_execution.warm_up_repair",
        repair_warm_up.warm_up_repair.__wrapped__,
    )
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            rehearse.__wrapped__()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_rehearsal_meets_no_defect(monkeypatch):
    """It would hide there: a flight goes home with it."""
    flown = []
    monkeypatch.setattr(
        flight_rehearsal, "execute", lambda *args, **more: flown.append(execute(*args, **more))
    )
    rehearse.__wrapped__()
    (done,) = flown
    kinds = [e.response for e in done.entries]
    assert "defect" not in kinds
    assert {"local", "kept"} <= set(kinds)
    assert done.free


SCENE = {
    "schema_version": 1, "name": "two bars", "bounds": [-9, -8, -8, 10, 12, 0],
    "solids": [
        {"name": "pile", "capsule": {"a": [0, 0, -9], "b": [0, 0, 1], "radius": 0.3}},
        {"name": "mooring", "capsule": {"a": [5, -3, -2], "b": [5, 3, -4], "radius": 0.12}},
    ],
}  # fmt: skip

MISSION = {
    "schema_version": 1, "scene": "scene.json", "anchor": [-5, 0.3, -1], "start": [-4.8, 0.3, -1],
    "tether_length": 22.0, "waypoints": [[2, 0.5, -3]], "clearance": 0.2,
}  # fmt: skip


@pytest.mark.parametrize(
    ("site", "track"),
    [
        ("problem", [(0, 0, 0), (4, 1.5, -1), (6, 0, -1), (4, -1.5, -1), (0, 0, -1), (4, 1.5, -1)]),
        ("mission", [(-4.8, 0.3, -1), (0, 1.5, -2), (5, 1.5, -1), (6.5, 1.5, -3.5), (5, 1.5, -5),
                     (3.5, 1.5, -3.5), (3.5, 1.5, -1), (0, -1.5, -2)]),
    ],
)  # fmt: skip
def test_before_a_vehicle_is_watched_all_is_loaded_that_it_takes(tmp_path, site, track):
    (tmp_path / "problem.json").write_text(SITE.to_json())
    (tmp_path / "scene.json").write_text(json.dumps(SCENE))
    (tmp_path / "mission.json").write_text(json.dumps(MISSION))
    words, before, more, said = run(WATCHED, tmp_path / f"{site}.json", json.dumps(track))
    assert words > 1, said
    assert before > 10
    assert more == []
