"""Tests of the messages that users read while kernels are compiled."""

import contextlib
import functools
import io
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from netsp.base.compiled import disk_cache, dynamic_array, numba_loading
from netsp.base.compiled.compile_policy import compiles, current_policy
from netsp.base.compiled.kernel import all_kernels
from netsp.base.errors import InputError, LimitReachedError, MemoryLimitError
from netsp.command import compiling, main, warm_up
from netsp.command.compiling import CompileTimes, Preparation, PreparationPolicy, compile_messages
from netsp.command.status_line import StatusLine, status_line

ROOT = Path(__file__).parent.parent


def _kernel(module):
    def body():
        pass

    body.__module__ = module
    return SimpleNamespace(py_func=body)


class _Terminal(io.StringIO):
    def isatty(self):
        return True


def test_one_line_is_written_however_many_kernels_are_compiled():
    stream = io.StringIO()
    preparation = Preparation(stream)
    outer, inner = _kernel("netsp.mip.flows"), _kernel("netsp.gtsp.search.links")
    for _ in range(40):
        preparation.begin(outer)
        preparation.begin(inner)
        preparation.end(inner)
        preparation.end(outer)
    preparation.close()
    (line,) = stream.getvalue().splitlines()
    assert re.fullmatch(r"preparing the solver, about \d+ s, once per installation", line)


def test_a_time_limit_that_compiling_has_used_up_says_so(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr(compiling.time, "monotonic", lambda: clock[0])
    kernel = _kernel("netsp.world.tether.pull")

    def error_after(seconds, error):
        def listen(begin, end):
            begin(kernel)
            clock[0] += seconds
            return contextlib.nullcontext()

        monkeypatch.setattr(compiling, "_listening", listen)
        monkeypatch.setattr(numba_loading, "when_numba_is_loaded", lambda then: then())
        with pytest.raises(LimitReachedError) as caught, compile_messages(io.StringIO()):
            raise error
        return str(caught.value)

    limit = LimitReachedError("time limit reached while laying the tether")
    said = error_after(12.0, limit)
    assert said.startswith(f"{limit}; compiling took 12 s of it")
    assert said.endswith("run the command again, or run `netsp warm-up` first")
    assert error_after(0.2, limit) == str(limit)
    memory = MemoryLimitError("too much")
    assert error_after(12.0, memory) == "too much"


def test_without_a_terminal_another_line_is_written_every_half_minute(monkeypatch):
    clock, stream = [100.0], io.StringIO()
    monkeypatch.setattr(compiling.time, "monotonic", lambda: clock[0])
    preparation = Preparation(stream, policy=PreparationPolicy(every_s=30.0))
    kernel = _kernel("netsp.plan.space.walk")
    for _ in range(65):
        preparation.begin(kernel)
        clock[0] += 1.0
        preparation.end(kernel)
    first, *more = stream.getvalue().splitlines()
    assert first.startswith("preparing planning in space, about ")
    assert len(more) == 2
    for seconds, line in zip((30, 60), more, strict=True):
        assert re.fullmatch(
            rf"preparing planning in space, {seconds} s so far, about \d+ s left", line
        )


def test_a_terminal_shows_a_bar_that_fills():
    stream = _Terminal()
    preparation = Preparation(stream, StatusLine(stream))
    kernel = _kernel("netsp.world.tether.pull")
    preparation.begin(kernel)
    preparation.end(kernel)
    begin, end = stream.getvalue().strip("\r\n").split("\r")
    preparation.close()
    assert re.search(r"\[ +\]", begin)
    assert re.search(r"\[#+\]", end)
    assert "preparing the simulation" in begin
    assert all(len(shown.removesuffix("\x1b[K")) < 80 for shown in (begin, end))
    assert "\n" not in stream.getvalue()
    assert stream.getvalue().endswith("\r\x1b[K")


def test_a_status_line_is_cut_to_the_width_of_the_terminal():
    stream = _Terminal()
    StatusLine(stream).show("preparing " + 100 * "x")
    (shown,) = _screen(stream.getvalue())
    assert shown == "preparing " + 69 * "x"


def test_a_bar_has_at_least_and_at_most_the_columns_of_the_policy():
    policy = PreparationPolicy(min_bar_columns=4, max_bar_columns=8)
    assert policy.bar(0.5, -3) == "[##  ]"
    assert policy.bar(0.5, 6) == "[###   ]"
    assert policy.bar(1.0, 100) == "[########]"


def _screen(written):
    """Return the lines that a terminal shows after text with carriage returns and erasures."""
    lines, column = [""], 0
    for part in filter(None, re.split(r"(\n|\r|\x1b\[K)", written)):
        if part == "\n":
            lines.append("")
        elif part == "\x1b[K":
            lines[-1] = lines[-1][:column]
        elif part != "\r":
            lines[-1] = lines[-1][:column] + part + lines[-1][column + len(part) :]
            column += len(part)
            continue
        column = column if part == "\x1b[K" else 0
    return lines


def test_other_output_never_runs_into_the_status_line(monkeypatch):
    stream = _Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(sys, "stdout", stream)
    with status_line() as line:
        print("first", file=sys.stderr)
        print("\r  1.0s  finding words …", end="", file=sys.stderr)
        line.show("preparing [##  ]")
        assert _screen(stream.getvalue()) == ["first", "preparing [##  ]"]
        print("\r  2.0s  finding words …", end="", file=sys.stderr)
        line.show("preparing [### ]")
        print("\ndone", file=sys.stdout)
        line.show("preparing [####]")
    assert _screen(stream.getvalue()) == ["first", "  2.0s  finding words …", "done", ""]
    assert sys.stderr is stream


@pytest.mark.parametrize("field", ["expected_share", "every_s"])
def test_a_policy_of_messages_has_positive_numbers(field):
    with pytest.raises(InputError, match=f"{field}: expected a positive number"):
        PreparationPolicy(**{field: 0.0})


def test_kernels_are_timed_without_those_that_they_call(monkeypatch):
    clock, times = [0.0], CompileTimes()
    monkeypatch.setattr(compiling.time, "thread_time", lambda: clock[0])
    outer, inner = _kernel("netsp.mip.flows"), _kernel("netsp.gtsp.search.links")
    for begin_or_end, kernel, spent in (
        (times._begin, outer, 1.0), (times._begin, inner, 4.0), (times._end, inner, 2.0),
        (times._end, outer, 0.0), (times._begin, inner, 8.0), (times._end, inner, 0.0),
    ):  # fmt: skip
        begin_or_end(kernel)
        clock[0] += spent
    assert times.seconds == {"mip.flows.body": 3.0, "gtsp.search.links.body": 12.0}


@pytest.mark.skipif(not compiles(), reason="NUMBA_DISABLE_JIT is set")
def test_kernels_of_a_folder_that_are_compiled_or_on_disk_need_no_time(monkeypatch, tmp_path):
    monkeypatch.setattr(disk_cache, "lock_file", lambda _: tmp_path / "a.lock")
    folder = Path(dynamic_array.__file__).parent
    missing = [
        kernel.py_func for kernel in all_kernels()
        if Path(kernel.py_func.__code__.co_filename).parent == folder and not kernel.overloads
    ]  # fmt: skip
    expected = [current_policy().compile_time_s(len(f.__code__.co_code)) for f in missing]
    kernel = getattr(dynamic_array.longer, "dispatcher", dynamic_array.longer)
    assert missing
    assert compiling._folder_compile_time_s(kernel) == pytest.approx(sum(expected))
    kept = f"{Path(missing[0].__code__.co_filename).stem}.{missing[0].__qualname__}"
    (tmp_path / f"{kept}-12.py311.nbi").touch()
    assert compiling._folder_compile_time_s(kernel) == pytest.approx(sum(expected[1:]))


@pytest.mark.parametrize(
    ("command", "is_quiet", "count"),
    [("solve", False, 1), ("solve", True, 0), ("warm-up", False, 0)],
)
def test_quiet_commands_write_no_compile_messages(command, is_quiet, count, monkeypatch):
    told = []
    monkeypatch.setattr(
        compiling, "compile_messages", lambda *args: told.append(args) or contextlib.nullcontext()
    )
    with main._preparation_messages(command, is_quiet):
        assert len(told) == count


@pytest.mark.parametrize("is_watched", [False, True])
def test_warm_up_shows_its_progress(is_watched, monkeypatch):
    stream = _Terminal() if is_watched else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    always = functools.partial(PreparationPolicy, every_s=1e-9)
    monkeypatch.setattr(compiling, "PreparationPolicy", always)
    warm_up._compile([("solvers", lambda: None), ("missions", lambda: time.sleep(0.01))], False)
    shown = stream.getvalue()
    assert "preparing netsp: solvers (1 of 2)" in shown
    assert re.search(r"preparing netsp: missions \(2 of 2, about \d+:\d\d left\)", shown)
    assert ("[" in shown) == is_watched
    warm_up._compile([("solvers", lambda: None)], True)
    assert stream.getvalue() == shown


def test_kernels_of_other_packages_are_not_reported():
    stream = io.StringIO()
    preparation = Preparation(stream)
    preparation.begin(_kernel("elsewhere.fast"))
    preparation.end(_kernel("elsewhere.fast"))
    preparation.close()
    assert stream.getvalue() == ""


COMPILED = """
import sys
from netsp.command.compiling import compile_messages
from netsp.base.compiled.compile_policy import everything_compiled
from netsp.base.compiled.kernel import kernel

with compile_messages(sys.stderr):
    pass  # ends before Numba is loaded, so it reports nothing later

def minimum_violated_cut(x):
    return x + 1

minimum_violated_cut.__module__ = "netsp.mip.flows"
with compile_messages(sys.stderr), everything_compiled():
    kernel(minimum_violated_cut)(1)
"""


def test_no_internal_name_is_shown_while_a_kernel_is_compiled(tmp_path):
    (tmp_path / "compiled.py").write_text(COMPILED)
    done = subprocess.run(
        [sys.executable, "compiled.py"], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
    )  # fmt: skip
    lines = done.stderr.splitlines()
    message = re.compile(r"preparing the solver, about [1-9]\d* s, once per installation")
    assert len(lines) == 1
    assert message.fullmatch(lines[0])
