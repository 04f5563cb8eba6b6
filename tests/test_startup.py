"""Tests of what a command loads before it works: time that every user waits for."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from netsp.command import command_clock, main

ROOT = Path(__file__).parent.parent


def _loaded(code: str) -> set[str]:
    """Return the names of the packages that a new interpreter has loaded after running code."""
    code += "\nimport sys\nprint(*{m.split('.')[0] for m in sys.modules})"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    return set(done.stdout.splitlines()[-1].split())


def test_importing_netsp_loads_no_other_package():
    assert not _loaded("import netsp") & {"numpy", "numba", "scipy", "pydantic", "shapely"}


def test_a_problem_is_read_without_solvers_and_pictures():
    loaded = _loaded("from netsp import Problem\nProblem.load('problems/wharf.json')")
    assert not loaded & {"numba", "scipy", "matplotlib", "highspy", "pulp"}


def test_a_small_problem_is_solved_and_verified_without_what_only_others_need(tmp_path):
    tour = str(tmp_path / "tour.json")
    run = "from netsp.command.main import main\nmain({!r})"
    unused = {"matplotlib", "highspy", "pulp"}
    loaded = _loaded(run.format(["solve", "problems/pool.json", "-o", tour, "--quiet"]))
    assert not loaded & unused
    loaded = _loaded(run.format(["verify", "problems/pool.json", tour, "--quiet"]))
    assert not loaded & (unused | {"numba", "scipy"})


LIMITED = {
    "solve": "solve problems/pool.json",
    "solve, a mission": "solve missions/basin.json",
    "tether": "tether problems/pool.json",
    "base": "base problems/pool.json --grid 2,2",
    "gtsp": "gtsp examples/7ring28.gtsp",
}


@pytest.mark.parametrize("command", LIMITED)
def test_a_limit_counts_from_the_start_of_the_command(command, monkeypatch):
    """A command that was begun a thousand seconds ago has no time left."""
    ago = (time.monotonic() - 1000.0, time.process_time() - 1000.0)
    monkeypatch.setattr(main, "begin_command", lambda: command_clock._start.set(ago))
    monkeypatch.chdir(ROOT)
    assert main.main([*LIMITED[command].split(), "--time-limit", "100", "--quiet"]) == 4
