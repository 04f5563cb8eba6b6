"""Tests of kernels that get machine code only when Python calls them."""

import subprocess
import sys
import threading

import numpy as np
import pytest

from netsp.base.compiled import disk_cache, kernel, lazy_library
from netsp.base.compiled.compile_policy import compiles, everything_compiled
from netsp.base.compiled.interpretation import interpreted
from tests.fresh_modules import fresh_module

pytestmark = pytest.mark.skipif(
    not compiles() or not lazy_library.is_supported(), reason="nothing is compiled lazily"
)

MODULE = """
import numpy as np
from netsp.base.compiled.kernel import kernel

@kernel
def cells(a, n):
    if n < 0:
        raise ValueError("fewer than no cells")
    b = np.empty((n, 2))
    for i in range(n):
        b[i, 0] = a[i % len(a)] / 4.0
        b[i, 1] = i
    return b

@kernel
def total(a, n):
    return cells(a, n).sum()
"""
A = np.array([1.0, 2.5])


def _module(folder):
    return fresh_module(folder, "lazy", MODULE)


@pytest.fixture
def kernels(tmp_path):
    return _module(tmp_path)


def test_a_kernel_gets_machine_code_when_python_calls_it(kernels):
    with everything_compiled():
        assert kernels.total(A, 3) == interpreted(kernels.total)(A, 3)
        assert kernels.total.has_machine_code
        assert not kernels.cells.has_machine_code
        assert not disk_cache.is_any_on_disk(kernels.cells)
        assert np.array_equal(kernels.cells(A, 3), interpreted(kernels.cells)(A, 3))
        assert kernels.cells.has_machine_code
        assert disk_cache.is_any_on_disk(kernels.cells)
        with pytest.raises(ValueError, match="fewer than no cells"):
            kernels.total(A, -1)


def test_a_kernel_without_machine_code_runs_interpreted_until_that_pays(kernels):
    with everything_compiled():
        kernels.total(A, 3)
    assert not kernel.runs_compiled(kernels.cells)
    assert np.array_equal(kernels.cells(A, 3), interpreted(kernels.cells)(A, 3))
    assert not kernels.cells.has_machine_code


PROCESS = """
import importlib, sys
import numpy as np
from netsp.base.compiled.compile_policy import everything_compiled
import numba.core.compiler as compiler

translated = []
core = compiler.CompilerBase._compile_core
def counted(self):
    translated.append(self.state.func_id.func_name)
    return core(self)
compiler.CompilerBase._compile_core = counted

sys.path.insert(0, sys.argv[1])
lazy = importlib.import_module("lazy")
a = np.array([1.0, 2.5])
with everything_compiled():
    for name in sys.argv[2:]:
        value = getattr(lazy, name)(a, 5)
        print(name, np.sum(value), sum(t in ("cells", "total") for t in translated))
"""


def test_processes_share_code_with_and_without_machine_code(tmp_path):
    folder = tmp_path / "shared"
    _module(folder)
    total = interpreted(_module(folder).total)(A, 5)
    for names, translations in (
        (["total"], [2]),  # of both functions
        (["cells"], [0]),  # what was linked gets machine code
        (["total", "cells"], [0, 0]),  # first the constants of the linked one, then of the wrapped
        (["cells", "total"], [0, 0]),
    ):
        done = subprocess.run(
            [sys.executable, "-c", PROCESS, str(folder), *names],
            capture_output=True, text=True, timeout=120,
        )  # fmt: skip
        lines = [line.split() for line in done.stdout.splitlines()]
        assert [line[0] for line in lines] == names, done.stderr
        assert [float(line[1]) for line in lines] == [total] * len(names)
        assert [int(line[2]) for line in lines] == translations


def test_a_damaged_file_of_a_linked_kernel_is_replaced(kernels, tmp_path):
    with everything_compiled():
        kernels.total(A, 3)
        for path in (tmp_path / "__pycache__").glob("*.nbc"):
            path.write_bytes(path.read_bytes()[:100])
        fresh = _module(tmp_path)
        assert np.array_equal(fresh.cells(A, 3), interpreted(kernels.cells)(A, 3))
        assert fresh.total(A, 3) == interpreted(kernels.total)(A, 3)


def test_an_interrupted_kernel_is_compiled_again(kernels, monkeypatch):
    def interrupted(self):
        raise KeyboardInterrupt

    with everything_compiled():
        kernels.total(A, 3)
        with monkeypatch.context() as patch:
            patch.setattr(lazy_library.LazyLibrary, "_finalize_final_module", interrupted)
            with pytest.raises(KeyboardInterrupt):
                kernels.cells(A, 3)
        assert np.array_equal(kernels.cells(A, 3), interpreted(kernels.cells)(A, 3))


def test_threads_call_a_kernel_while_it_is_linked_into_another(tmp_path):
    for attempt in range(4):
        kernels = _module(tmp_path / str(attempt))
        expected = interpreted(kernels.cells)(A, 4)
        results, begin = [], threading.Barrier(4)

        def call(kernels=kernels, results=results, begin=begin):
            begin.wait()
            results.append((kernels.cells(A, 4), kernels.total(A, 4)))

        def call_outer_first(kernels=kernels, results=results, begin=begin):
            begin.wait()
            total = kernels.total(A, 4)
            results.append((kernels.cells(A, 4), total))

        threads = [threading.Thread(target=f) for f in (call, call_outer_first) * 2]
        with everything_compiled():
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        assert len(results) == 4
        assert all(np.array_equal(cells, expected) for cells, _ in results)
        assert all(total == expected.sum() for _, total in results)


def test_kernels_have_machine_code_at_once_where_numba_lacks_private_parts(tmp_path, monkeypatch):
    monkeypatch.setattr(lazy_library, "is_supported", lambda: False)
    kernels = _module(tmp_path)
    with everything_compiled():
        assert kernels.total(A, 3) == interpreted(kernels.total)(A, 3)
        assert kernels.cells.has_machine_code
        assert np.array_equal(kernels.cells(A, 3), interpreted(kernels.cells)(A, 3))
