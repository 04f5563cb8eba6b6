"""Tests of what users read while kernels are compiled."""

import io
import re
from types import SimpleNamespace

from netsp.command.compiling import Preparation


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
