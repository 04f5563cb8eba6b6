"""What is kept of compiled functions must never outlive its sources."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import netsp
from netsp.base.compiled.disk_cache import KernelFile

CALLEE = """
from typing import NamedTuple
from netsp.base.compiled.kernel import kernel

class {name}(NamedTuple):
    x: float

@kernel
def times(pair: {name}) -> float:
    return {factor} * pair.x
"""

CALLER = """
from netsp.callee import {name}, times
from netsp.base.compiled.kernel import kernel

@kernel
def twice(pair: {name}) -> float:
    return 2.0 * times(pair)
"""

SCRIPT = """
from netsp.caller import *
from netsp.base.compiled.compile_policy import everything_compiled
with everything_compiled():
    print(twice({name}(1.0)))
"""


@pytest.fixture
def package(tmp_path):
    """A package `netsp` of two kernels of which one calls the other, and how to run it."""
    source = Path(netsp.__file__).parent
    (tmp_path / "netsp").mkdir()
    (tmp_path / "netsp" / "__init__.py").touch()
    shutil.copytree(source / "base", tmp_path / "netsp" / "base")

    def run(name: str, factor: float) -> float:
        for module, text in (("callee", CALLEE), ("caller", CALLER)):
            file = tmp_path / "netsp" / f"{module}.py"
            if not file.exists() or file.read_text() != text.format(name=name, factor=factor):
                file.write_text(text.format(name=name, factor=factor))
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT.format(name=name)],
            env={**os.environ, "PYTHONPATH": str(tmp_path)}, cwd=tmp_path, text=True,
            capture_output=True,
        )  # fmt: skip
        assert not done.returncode, done.stderr
        return float(done.stdout)

    return run


def test_a_kernel_is_compiled_again_when_one_that_it_calls_has_changed(package):
    assert package("Pair", 3.0) == 6.0
    assert package("Pair", 5.0) == 10.0


def test_a_class_in_a_signature_may_be_renamed(package):
    assert package("Pair", 3.0) == 6.0
    assert package("Couple", 3.0) == 6.0


def test_what_two_processes_compile_at_once_is_found_under_its_own_types_or_not_at_all(tmp_path):
    one, other = KernelFile(str(tmp_path), "f", "stamp"), KernelFile(str(tmp_path), "f", "stamp")
    write = one._save_data

    def while_the_other_keeps_its_own(name, data):
        other._load_index = dict  # it has looked before there was any
        other.save("of ints", "for ints")
        write(name, data)

    one._save_data = while_the_other_keeps_its_own
    one.save("of floats", "for floats")
    kept = KernelFile(str(tmp_path), "f", "stamp")
    assert kept.load("of ints") in ("for ints", None)
    assert kept.load("of floats") in ("for floats", None)


def test_nothing_older_is_found_under_a_name_while_it_is_compiled_anew(tmp_path):
    KernelFile(str(tmp_path), "f", "old").save("of floats", "as it was")
    new, seen = KernelFile(str(tmp_path), "f", "new"), []
    write = new._save_index

    def look_first(overloads):
        write(overloads)
        seen.append(KernelFile(str(tmp_path), "f", "new").load("of floats"))

    new._save_index = look_first
    new.save("of floats", "as it is")
    assert seen == ["as it is"]


def test_files_of_sources_that_are_no_more_are_removed(tmp_path):
    for stamp in ("one", "another", "a third"):
        KernelFile(str(tmp_path), "f", stamp).save(f"of {stamp}", "compiled")
    KernelFile(str(tmp_path), "g", "stamp").save("of floats", "compiled")
    assert len(list(tmp_path.glob("f.*.nbc"))) == len(list(tmp_path.glob("g.*.nbc"))) == 1


FIRST_KERNEL = """
import numpy as np
from netsp.base.compiled.kernel import kernel

@kernel
def doubled(values, out):
    for k in range(len(values)):
        out[k] = 2.0 * values[k]
    return len(values)

values, out = np.ones(500), np.zeros(500)
for _ in range(20_000):  # interpreted at first, then compiled
    assert doubled(values, out) == 500
print(out.sum())
"""


def test_the_first_function_that_a_process_compiles_may_be_a_kernel(tmp_path):
    """Numba's runtime begins with it; begun by a kernel, every call of it went to address 0."""
    (tmp_path / "first.py").write_text(FIRST_KERNEL)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NETSP_BACKGROUND": "0"}
    for _ in range(2):  # compiled, then loaded from disk
        done = subprocess.run(
            [sys.executable, "first.py"], cwd=tmp_path, env=environment, capture_output=True,
            text=True, timeout=120, check=False,
        )  # fmt: skip
        assert (done.returncode, done.stdout, done.stderr) == (0, "1000.0\n", "")
