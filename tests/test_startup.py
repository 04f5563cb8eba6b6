"""Tests of the start of a command: which modules it loads, and when its time limit begins."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from netsp.base.clock import Clock, TimingPolicy
from netsp.base.compiled import kept_code
from netsp.command import command_clock, main

ROOT = Path(__file__).parent.parent
SMALL = "problems/pool.json"


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


def test_a_small_problem_is_solved_and_verified_without_numba_scipy_and_matplotlib(tmp_path):
    tour = str(tmp_path / "tour.json")
    # a slow machine may run kernels interpreted for long before Numba is loaded
    patient = (
        "from netsp.base.compiled.compile_policy import CompilePolicy, compiled_by\n"
        "with compiled_by(CompilePolicy(numba_s=60.0)): "
    )
    run = "from netsp.command.main import main\n" + patient + "main({!r})"
    for words in (["solve", SMALL, "-o", tour], ["verify", SMALL, tour]):
        loaded = _loaded(run.format([*words, "--quiet"]))
        assert not loaded & {"numba", "scipy", "matplotlib", "highspy", "pulp"}


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
def test_the_demo_installs_no_extras_and_compiles_nothing_ahead(tmp_path):
    steps = subprocess.run(
        ["make", "--no-print-directory", "-n", "demo", f"VENV={tmp_path / 'new'}"],
        cwd=ROOT, capture_output=True, text=True, check=True,
        env={k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")},
    ).stdout  # fmt: skip
    assert "solve problems/wharf.json" in steps
    assert "[" not in steps
    assert "warm-up" not in steps


KERNELS = """
import numpy as np
from netsp.base.compiled.kernel import kernel

@kernel
def twice(x: float) -> float:
    return 2.0 * x

@kernel
def fill(a, stop) -> float:
    total = 0.0
    for i in range(len(a)):
        a[i] += 1.0
        total += twice(a[i])
        if stop[0]:
            break
    return total
"""

DEFERRED = """
import pickle, sys
import numpy as np
import kernels
from netsp.base.compiled.compile_policy import CompilePolicy, compiled_by

stop = np.zeros(1, dtype=np.int64)
assert kernels.fill(np.zeros(3), stop) == 6.0
assert "numba" not in sys.modules
assert pickle.loads(pickle.dumps(kernels.fill)) is kernels.fill
a = np.zeros(10**6)
with compiled_by(CompilePolicy(numba_s=0.05, load_s=0.0, compile_s=0.0, compile_s_per_byte=0.0)):
    assert kernels.fill(a, stop) == 2e6
assert (a == 1.0).all()
assert kernels.fill.signatures and kernels.twice.signatures
"""


def test_a_kernel_that_runs_long_loads_numba_and_starts_again_compiled(tmp_path):
    """The compiled call starts from the original arguments, and calls another kernel compiled."""
    (tmp_path / "kernels.py").write_text(KERNELS)
    (tmp_path / "deferred.py").write_text(DEFERRED)
    done = subprocess.run(
        [sys.executable, "deferred.py"], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


PATIENT = """
import sys
from concurrent.futures import ThreadPoolExecutor
import numpy as np
import kernels
from netsp.base.compiled.compile_policy import CompilePolicy, compiled_by

stop, is_kept = np.zeros(1, dtype=np.int64), sys.argv[1] == "kept"
with compiled_by(CompilePolicy(numba_s=0.0, compile_s=60.0)):
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(kernels.fill, np.zeros(3), stop).result() == 6.0
    assert kernels.fill(np.zeros(3), stop) == 6.0
assert ("numba" in sys.modules) == is_kept
assert is_kept or not kernels.fill.signatures
"""


def test_numba_is_loaded_only_to_load_code_from_disk_or_to_compile(tmp_path):
    (tmp_path / "kernels.py").write_text(KERNELS)
    (tmp_path / "patient.py").write_text(PATIENT)
    cache = tmp_path / "cache" / "kernels"
    env = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(cache.parent)}
    for how in ("absent", "kept"):
        done = subprocess.run(
            [sys.executable, "patient.py", how], cwd=tmp_path, capture_output=True, text=True,
            env=env,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        cache.mkdir(parents=True, exist_ok=True)
        (cache / "other.nbi").touch()


def test_compiled_code_is_looked_for_where_numba_keeps_it(tmp_path, monkeypatch):
    places = {
        "package": tmp_path / "netsp" / "dp" / "__pycache__",
        "user": tmp_path / "numba" / "netsp_1",
        "chosen": tmp_path / "chosen" / "netsp_1",
    }
    monkeypatch.setattr(kept_code, "_PACKAGE", tmp_path / "netsp")
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "nobody")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    for place in places.values():
        place.mkdir(parents=True)
    for place in (None, *places):
        if place is not None:
            (places[place] / "labels.extend-12.py311.nbi").touch()
        monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
        assert kept_code.may_be_on_disk.__wrapped__() == (place in ("package", "user"))
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "chosen"))
        assert kept_code.may_be_on_disk.__wrapped__() == (place == "chosen")
        if place is not None:
            (places[place] / "labels.extend-12.py311.nbi").unlink()


LIMITED = {
    "solve": "solve problems/pool.json",
    "solve, a mission": "solve missions/basin.json",
    "tether": "tether problems/pool.json",
    "base": "base problems/pool.json --grid 2,2",
    "gtsp": "gtsp examples/7ring28.gtsp",
    "cover": "cover scenes/basin.json --anchor=-1,4.5,-1",
}


@pytest.mark.parametrize("command", LIMITED)
def test_a_limit_counts_from_the_start_of_the_command(command, monkeypatch):
    """A command that started 1,000 seconds ago has no time left of a limit of 100 seconds."""
    ago = (time.monotonic() - 1000.0, time.process_time() - 1000.0)
    monkeypatch.setattr(main, "begin_command", lambda: command_clock._start.set(ago))
    monkeypatch.setattr(Clock, "policy", TimingPolicy(untimed_steps=0, grace_s=0.0))
    monkeypatch.chdir(ROOT)
    assert main.main([*LIMITED[command].split(), "--time-limit", "100", "--quiet"]) == 4


FIGURES = """
import sys
from netsp.view.pictures.style import load_matplotlib
load_matplotlib()
from matplotlib import artist, figure
assert figure.Figure().subplots().plot([0], [1]) and "alpha" in artist.kwdoc(artist.Artist)
assert "pyplot" not in " ".join(sys.modules)
"""


def test_figures_are_loaded_without_pyplot_and_matplotlib_stays_unchanged():
    done = subprocess.run([sys.executable, "-c", FIGURES], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
