"""Tests of what a command loads before it works: time that every user waits for."""

import subprocess
import sys
from pathlib import Path

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
