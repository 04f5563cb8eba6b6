"""Tests of the background process that compiles what is likely needed next."""

import argparse
import contextlib
import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from netsp.base.compiled import dynamic_array
from netsp.base.compiled.compile_lock import locked
from netsp.base.compiled.compile_policy import compiles
from netsp.base.compiled.disk_cache import lock_file
from netsp.base.compiled.tiered import TieredDispatcher
from netsp.command import background_warm_up, main, warm_up
from netsp.command.command_options import add_options
from netsp.command.command_table import WARM_UP

ROOT = Path(__file__).parent.parent

pytestmark = pytest.mark.skipif(not compiles(), reason="NUMBA_DISABLE_JIT is set")


@pytest.fixture
def started(monkeypatch):
    """Return a list of commands, to which each new process is added instead of being started."""
    commands = []

    def record(words, **options):
        assert options["start_new_session"]
        assert options["env"][background_warm_up.SWITCH_VARIABLE] == "0"
        commands.append(words)
        return SimpleNamespace()

    monkeypatch.setattr(subprocess, "Popen", record)
    return commands


@pytest.mark.parametrize(("argv", "count"), [(None, 1), (["world", "--seed", "1"], 0)])
def test_main_starts_a_process_after_commands_of_a_shell_only(argv, count, monkeypatch, capsys):
    begun = []
    monkeypatch.setattr(background_warm_up, "begin", begun.append)
    monkeypatch.setattr(sys, "argv", ["netsp", "world", "--seed", "1"])
    assert main._main(argv) == 0
    assert begun == count * ["world"]
    assert capsys.readouterr().out


@pytest.mark.parametrize(
    ("has_compiled", "is_disk_full", "variable", "count"),
    [(True, False, "1", 1), (True, False, "0", 0), (False, False, "1", 0), (True, True, "1", 0)],
)
def test_a_background_process_starts_after_a_command_that_compiled_unless_turned_off(
    has_compiled, is_disk_full, variable, count, started, monkeypatch
):
    monkeypatch.setattr(TieredDispatcher, "has_compiled", has_compiled)
    monkeypatch.setattr(TieredDispatcher, "is_disk_full", is_disk_full)
    monkeypatch.setenv(background_warm_up.SWITCH_VARIABLE, variable)
    background_warm_up.begin("simulate")
    assert len(started) == count


def test_a_second_background_process_ends_at_once(monkeypatch):
    niceness, ran = [], []
    monkeypatch.setattr("os.nice", niceness.append)
    monkeypatch.setattr(warm_up, "steps", lambda: [("solver auto", lambda: ran.append(1))])
    args = warm_up_arguments("--after", "solve")
    with locked(lock_file(dynamic_array.longer).with_name("background.lock")):
        assert warm_up.run(args) == 0
    assert ran == []
    assert warm_up.run(args) == 0
    assert ran == [1]
    assert niceness == [background_warm_up.LOWEST_PRIORITY] * 2


SITE = """
import netsp.command.warm_up as warm_up

def compiled():
    import os, time
    from pathlib import Path
    import likely_next
    folder = Path(os.environ["FOLDER"])
    with open(folder / "log", "a") as log:
        print(os.getpid(), os.nice(0), file=log)
    while not (folder / "go").exists():
        time.sleep(0.01)
    assert likely_next.double(21) == 42
    with open(folder / "log", "a") as log:
        print("compiled", sum(likely_next.double.stats.cache_misses.values()), file=log)

warm_up.steps = lambda: [("solver", compiled)]
"""

COMMAND = """
from netsp.command import background_warm_up
from netsp.base.compiled.tiered import TieredDispatcher

TieredDispatcher.has_compiled = True
for _ in range(2):
    background_warm_up.begin("solve")
print("done")
"""


def _wait_for(condition):
    """Wait until a condition holds."""
    end = time.monotonic() + 120.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_one_process_at_the_lowest_priority_compiles_and_ends_after_the_command(tmp_path):
    (tmp_path / "sitecustomize.py").write_text(SITE)
    (tmp_path / "likely_next.py").write_text(
        "from netsp.base.compiled.kernel import kernel\n\n"
        "@kernel\ndef double(x):\n    return 2 * x\n"
    )
    log, cache = tmp_path / "log", tmp_path / "cache"
    command = [sys.executable, "-c", COMMAND]
    env = {
        **os.environ, "FOLDER": str(tmp_path), "NUMBA_CACHE_DIR": str(cache),
        "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}", background_warm_up.SWITCH_VARIABLE: "1",
    }  # fmt: skip
    done = subprocess.run(command, env=env, capture_output=True, text=True, cwd=tmp_path)
    # the background process, which still runs, has closed standard output and standard error
    assert (done.stdout, done.stderr) == ("done\n", "")
    _wait_for(lambda: log.exists() and log.read_text().count("\n"))
    pid, niceness = map(int, log.read_text().split())
    assert niceness == background_warm_up.LOWEST_PRIORITY
    assert os.getsid(pid) == pid  # own session: no Ctrl-C or hang-up of a terminal
    (tmp_path / "go").touch()
    _wait_for(lambda: "compiled" in log.read_text())
    _wait_for(lambda: not list(cache.rglob("*.lock")))
    _wait_for(lambda: not psutil.pid_exists(pid) or psutil.Process(pid).status() == "zombie")
    # the other process ends at once, or finds nothing left to compile
    compiled = [line for line in log.read_text().splitlines() if line.startswith("compiled")]
    assert sum(int(line.split()[1]) for line in compiled) == 1
    assert len(list(cache.rglob("likely_next.double-*.nbc"))) == 1


def test_a_killed_process_leaves_no_lock_that_keeps_others_from_compiling(tmp_path):
    file = tmp_path / "background.lock"
    script = f"""
import time
from functools import partial
from pathlib import Path
from netsp.base.compiled.compile_lock import locked
with locked(Path({str(file)!r})):
    print("locked", flush=True)
    time.sleep(60)
"""
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert process.stdout.readline() == "locked\n"
    with locked(file, max_wait_s=0.0) as is_held:
        assert not is_held
    process.kill()
    process.communicate()
    with locked(file, max_wait_s=0.0) as is_held:
        assert is_held


def test_the_background_process_ends_once_the_disk_is_full(monkeypatch):
    def fill():
        monkeypatch.setattr(TieredDispatcher, "is_disk_full", True)

    ran = []
    steps = [("solver a", lambda: ran.append(1)), ("b", fill), ("c", lambda: ran.append(2))]
    monkeypatch.setattr("os.nice", lambda _: 0)
    monkeypatch.setattr(warm_up, "steps", lambda: steps)
    assert warm_up.run(warm_up_arguments("--after", "solve")) == 0
    assert ran == [1]


def test_steps_of_the_last_command_run_first(monkeypatch):
    ran = []
    steps = [(name, lambda name=name: ran.append(name)) for name in ("solver dp", "missions, x")]
    monkeypatch.setattr("os.nice", lambda _: 0)
    monkeypatch.setattr(warm_up, "steps", lambda: steps)
    assert warm_up.run(warm_up_arguments("--after", "simulate")) == 0
    assert ran == ["missions, x", "solver dp"]


def test_warm_up_lists_all_functions(monkeypatch, capsys):
    monkeypatch.setattr(warm_up, "steps", lambda: [("nothing", lambda: None)])
    assert warm_up.run(warm_up_arguments("--list", "--quiet")) == 0
    *rows, last = capsys.readouterr().out.splitlines()
    assert "      -  base.compiled.dynamic_array.longer" in rows
    assert last.endswith(f"total, {len(rows)} functions")


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_each_process_runs_all_steps_and_first_those_of_no_other(jobs):
    runs, begins = [], []
    steps = [(str(k), partial(runs.append, k)) for k in range(7)]
    for part in range(jobs):
        runs.clear()
        warm_up._compile(warm_up._part_first(steps, part, jobs), True)
        assert sorted(runs) == list(range(7))
        begins += runs[: len(range(part, 7, jobs))]
    assert sorted(begins) == list(range(7))


class _Process:
    def __init__(self, command, **_):
        self.command, self.calls = command, []

    def wait(self):
        self.calls.append("wait")

    def terminate(self):
        self.calls.append("terminate")


@pytest.mark.parametrize("is_interrupted", [False, True])
def test_the_other_processes_of_warm_up_are_waited_for_or_ended(is_interrupted, monkeypatch):
    started = []

    def start(command, **options):
        started.append(_Process(command, **options))
        return started[-1]

    def step():
        if is_interrupted:
            raise KeyboardInterrupt

    monkeypatch.setattr(warm_up.subprocess, "Popen", start)
    monkeypatch.setattr(warm_up, "steps", lambda: [("solver", step)])
    with pytest.raises(KeyboardInterrupt) if is_interrupted else contextlib.nullcontext():
        warm_up.run(warm_up_arguments("--jobs", "3", "--quiet"))
    assert [process.command[-1] for process in started] == ["1", "2"]
    expected = ["terminate"] if is_interrupted else ["wait", "terminate"]
    assert [process.calls for process in started] == [expected] * 2
    started.clear()
    with contextlib.suppress(KeyboardInterrupt):
        warm_up.run(warm_up_arguments("--jobs", "3", "--part", "1", "--quiet"))
    assert not started


def warm_up_arguments(*words):
    """Return the parsed arguments of `netsp warm-up`."""
    parser = argparse.ArgumentParser()
    add_options(parser, WARM_UP.options)
    return parser.parse_args(words)
