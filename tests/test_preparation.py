"""Tests of what users read while kernels are compiled."""

import io
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

from netsp.command.compiling import Preparation

ROOT = Path(__file__).parent.parent


def _kernel(module):
    def body():
        pass

    body.__module__ = module
    return SimpleNamespace(py_func=body)


class _Terminal(io.StringIO):
    def isatty(self):
        return True


def test_one_line_in_words_is_written_however_many_kernels_are_compiled():
    stream = io.StringIO()
    told = Preparation(stream)
    outer, inner = _kernel("netsp.mip.flows"), _kernel("netsp.lns.links")
    for _ in range(3):
        told.begin(outer)
        told.begin(inner)
        told.end(inner)
        told.end(outer)
    told.close()
    (line,) = stream.getvalue().splitlines()
    assert re.fullmatch(r"preparing the solver, about \d+ s, once per installation", line)


def test_a_terminal_shows_a_bar_that_fills():
    stream = _Terminal()
    told = Preparation(stream)
    kernel = _kernel("netsp.online.tether.pull")
    told.begin(kernel)
    told.end(kernel)
    told.close()
    begin, end = stream.getvalue().strip("\r\n").split("\r")
    assert "[" + " " * 20 + "]" in begin
    assert "[" + "#" * 20 + "]" in end
    assert "preparing the simulation" in begin
    assert stream.getvalue().count("\n") == 1


def test_kernels_of_other_packages_are_not_told():
    stream = io.StringIO()
    told = Preparation(stream)
    told.begin(_kernel("elsewhere.fast"))
    told.end(_kernel("elsewhere.fast"))
    told.close()
    assert stream.getvalue() == ""


COMPILED = """
import sys
from netsp.command.compiling import compile_messages
from netsp.compiled.compile_policy import everything_compiled
from netsp.compiled.kernel import kernel

with compile_messages(sys.stderr):
    pass  # over before Numba is loaded: it tells nothing later

def minimum_violated_cut(x):
    return x + 1

minimum_violated_cut.__module__ = "netsp.mip.flows"
with compile_messages(sys.stderr), everything_compiled():
    kernel(minimum_violated_cut)(1)
"""


def test_no_internal_name_is_told_while_a_kernel_is_compiled(tmp_path):
    (tmp_path / "compiled.py").write_text(COMPILED)
    done = subprocess.run(
        [sys.executable, "compiled.py"], cwd=tmp_path, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
    )  # fmt: skip
    lines = done.stderr.splitlines()  # on a slow machine more than one
    told = re.compile(r"preparing the solver, about [1-9]\d* s, once per installation")
    assert lines
    assert all(map(told.fullmatch, lines))
