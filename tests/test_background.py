"""Tests of the process that compiles what is likely needed next."""

import argparse
import subprocess
from types import SimpleNamespace

import pytest

from netsp.command import background_warm_up, warm_up
from netsp.compiled import growing
from netsp.compiled.compile_lock import locked
from netsp.compiled.compile_policy import compiles
from netsp.compiled.disk_cache import lock_file
from netsp.compiled.tiered import TieredDispatcher

pytestmark = pytest.mark.skipif(not compiles(), reason="NUMBA_DISABLE_JIT is set")


@pytest.fixture
def started(monkeypatch):
    """The commands of processes that are noted instead of started."""
    commands = []

    def note(words, **options):
        assert options["start_new_session"]
        assert options["env"][background_warm_up.VARIABLE] == "0"
        commands.append(words)
        return SimpleNamespace()

    monkeypatch.setattr(subprocess, "Popen", note)
    return commands


@pytest.mark.parametrize(
    ("has_compiled", "variable", "count"), [(True, "1", 1), (True, "0", 0), (False, "1", 0)]
)
def test_it_starts_after_a_command_that_compiled_unless_it_is_turned_off(
    has_compiled, variable, count, started, monkeypatch
):
    monkeypatch.setattr(TieredDispatcher, "has_compiled", has_compiled)
    monkeypatch.setenv(background_warm_up.VARIABLE, variable)
    background_warm_up.begin("simulate")
    assert len(started) == count


def test_a_second_one_ends_at_once(monkeypatch):
    niceness, ran = [], []
    monkeypatch.setattr("os.nice", niceness.append)
    monkeypatch.setattr(warm_up, "steps", lambda: [("solver auto", lambda: ran.append(1))])
    args = warm_up_arguments("--after", "solve")
    with locked(lock_file(growing.longer).with_name("background.lock")):
        assert warm_up.run(args) == 0
    assert ran == []
    assert warm_up.run(args) == 0
    assert ran == [1]
    assert niceness == [background_warm_up.LOWEST_PRIORITY] * 2


def test_what_a_command_needs_is_compiled_first(monkeypatch):
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
    assert "      -  compiled.growing.longer" in rows
    assert last.endswith(f"in all, {len(rows)} functions")


def warm_up_arguments(*words):
    """Return the parsed arguments of `netsp warm-up`."""
    parser = argparse.ArgumentParser()
    warm_up.arguments(parser)
    return parser.parse_args(words)
