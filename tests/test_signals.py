"""Ctrl-C and SIGTERM end every command alike: one exit code, no traceback, only whole files."""

import json
import re
import signal
import sys
import threading
from pathlib import Path

import pytest

from netsp import Problem, solve
from netsp.command.main import COMMANDS, main
from netsp.online.fly.flight_rehearsal import rehearse
from netsp.plan.space.space_plan import plan
from netsp.world.mission.mission import Mission
from tests.autopilot import reserve_port
from tests.written_problems import written

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "netsp"
KNOWN = ROOT / "problems" / "known"

ENDS_AT_ONCE = {"schema", "completion", "cite"}
"""Commands that print a text which is at hand."""


class Pressed:
    """Send a signal when a function of one module is first entered.

    Parameters
    ----------
    number : signal.Signals
        The signal.
    module : str
        File of the module, relative to the package.
    """

    def __init__(self, number, module):
        self.number, self.file, self.sent = number, str(PACKAGE / module), False

    def _entered(self, frame, event, _):
        code = frame.f_code
        if self.sent or event != "call" or code.co_filename != self.file:
            return
        if code.co_name.startswith("<") or not code.co_flags & 2:  # bodies of modules and classes
            return
        self.sent = True
        sys.setprofile(None)
        threading.setprofile(None)
        signal.pthread_kill(threading.main_thread().ident, self.number)

    def __enter__(self):
        self.before = signal.signal(signal.SIGINT, signal.default_int_handler)
        threading.setprofile(self._entered)
        sys.setprofile(self._entered)
        return self

    def __exit__(self, *_):
        sys.setprofile(None)
        threading.setprofile(None)
        signal.signal(signal.SIGINT, self.before)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Folder with the inputs of all commands."""
    folder = tmp_path_factory.mktemp("inputs")
    problem = Problem.load(KNOWN / "square.json")
    (folder / "p.json").write_text(problem.to_json())
    (folder / "s.json").write_text(solve(problem).to_json())
    mission = written(folder)
    planned = plan(Mission.load(mission), time_limit=None).to_mission()
    planned = planned.model_copy(update={"scene": "scene.json"})
    text = json.dumps(planned.model_dump(mode="json", exclude_none=True))
    (folder / "planned.json").write_text(text)
    return folder


RUNS = {
    "solve": ("solve p.json -o out.json", "roadmap/taut.py", 0),
    "solve, late": ("solve p.json -o out.json --solver lns", "gtsp/search/local_search.py", 0),
    "solve mission": ("solve mission.json -o out.json", "plan/space/space_signature.py", 0),
    "solve mission, late": ("solve mission.json -o out.json", "plan/space/space_legs.py", 0),
    "order": ("order mission.json -o out.json", "world/scene/seams.py", 130),
    "app": ("app p.json --no-browser --port 0", "app/server.py", 130),
    "cover": ("cover scene.json --anchor 0,0,0 -o out.json", "world/simulator/coverage.py", 0),
    "verify": ("verify p.json s.json", "judge/tour_checks.py", 130),
    "verify mission": ("verify planned.json", "plan/space/judge.py", 0),
    "margins": ("margins p.json s.json -o out.json", "plan/sizing/tether_margins.py", 130),
    "plot": ("plot p.json s.json -o out.svg", "view/pictures/problem_picture.py", 130),
    "animate": ("animate s.json --problem p.json -o out.gif", "view/pictures/animation.py", 130),
    "base": ("base p.json --grid 4,4 -o out.csv", "plan/sizing/base_placement.py", 130),
    "tether": ("tether p.json -o out.csv", "plan/sizing/tether_sizing.py", 130),
    "gtsp": (f"gtsp {ROOT}/examples/7ring28.gtsp -o out.tour", "gtsp/search/local_search.py", 0),
    "world": ("world --goals 9 -o out.json", "plan/random_worlds.py", 130),
    "simulate": ("simulate mission.json --quiet", "world/simulator/simulation.py", 4),
    "execute": ("execute p.json s.json -o out", "online/execute/tour_execution.py", 130),
    "execute mission": ("execute planned.json -o out", "plan/space/judge.py", 130),
    "fly": ("fly p.json s.json --link udpin:{port} -o out", "online/fly/flight_rehearsal.py", 130),
    "guard": ("guard p.json --link udpin:{port} -o out.jsonl", "online/guard/live.py", 4),
    "export": ("export planned.json -o out.csv", "exchange/missions/mission_export.py", 0),
    "import": (
        f"import {ROOT}/examples/site.geojson -o out.json", "exchange/maps/read_map.py", 130,
    ),
    "compare": (
        "compare --goals 4 --tethers 300 --solvers lns --worlds 1 --time-limit 1 -o out.jsonl",
        "study/compare/rows.py", 130,
    ),
    "compare-path": (
        f"compare-path {ROOT}/problems/wharf.json {ROOT}/examples/paths/wharf-systematic-1.csv "
        "-o out.csv", "study/paths/path_measures.py", 130,
    ),
    "library": (
        f"library rank --folder {ROOT}/problems/library --only clustered-10-0 --solver lns "
        "--time-limit 1 -o out.jsonl", "study/library/rank.py", 130,
    ),
    "combine": ("combine rows.jsonl -o out.jsonl", "study/compare/rows.py", 130),
    "report": ("report s.json --problem p.json -o out.html", "view/report/briefing.py", 130),
    "warm-up": ("warm-up", "model/problem.py", 130),
}  # fmt: skip
"""Commands by name: arguments, the module where the signal comes, the exit code. Short work that
is broken off within the grace of `netsp.base.clock.TimingPolicy` ends as if nobody had pressed."""


def test_every_command_that_takes_time_is_here():
    names = {name for group in COMMANDS.values() for name in group}
    assert names - ENDS_AT_ONCE == {run[0].split()[0] for run in RUNS.values()}


def _end(words, module, number, folder, inputs, monkeypatch, capsys):
    """Return exit code and messages of a command that a signal ends, and the files it wrote."""
    folder.mkdir()
    for file in inputs.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    monkeypatch.chdir(folder)
    rehearse.cache_clear()  # another test of this process may have rehearsed already
    with reserve_port() as reservation, Pressed(number, module) as pressed:
        code = main(words.replace("{port}", str(reservation.getsockname()[1])).split())
    assert pressed.sent, f"{words} entered no function of {module}"
    written = sorted(
        str(f.relative_to(folder))
        for f in folder.rglob("*")
        if f.is_file() and not (inputs / f.name).exists()
    )
    for name in written:
        if name.endswith(".json"):
            json.loads((folder / name).read_text())
    said = capsys.readouterr()
    assert "Traceback" not in said.err
    return code, re.findall(r"^netsp: .*", said.err, re.M), written


@pytest.mark.parametrize("name", RUNS)
def test_sigterm_ends_a_command_as_ctrl_c_does(name, inputs, tmp_path, monkeypatch, capsys):
    words, module, expected = RUNS[name]
    ends = [
        _end(words, module, number, tmp_path / number.name, inputs, monkeypatch, capsys)
        for number in (signal.SIGINT, signal.SIGTERM)
    ]
    assert ends[0] == ends[1]
    code, said, written = ends[0]
    assert code == expected
    assert ("what was compiled is kept" in "".join(said)) == (name == "warm-up")
    assert not written or code != 130
