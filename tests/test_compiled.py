"""What is kept of compiled functions must never outlive its sources."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import netsp

CALLEE = """
from typing import NamedTuple
from netsp.compiled.kernel import kernel

class {name}(NamedTuple):
    x: float

@kernel
def times(pair: {name}) -> float:
    return {factor} * pair.x
"""

CALLER = """
from netsp.callee import {name}, times
from netsp.compiled.kernel import kernel

@kernel
def twice(pair: {name}) -> float:
    return 2.0 * times(pair)
"""


@pytest.fixture
def package(tmp_path):
    """A package `netsp` of two kernels of which one calls the other, and how to run it."""
    source = Path(netsp.__file__).parent
    (tmp_path / "netsp").mkdir()
    (tmp_path / "netsp" / "__init__.py").touch()
    shutil.copytree(source / "compiled", tmp_path / "netsp" / "compiled")

    def run(name: str, factor: float) -> float:
        for module, text in (("callee", CALLEE), ("caller", CALLER)):
            file = tmp_path / "netsp" / f"{module}.py"
            if not file.exists() or file.read_text() != text.format(name=name, factor=factor):
                file.write_text(text.format(name=name, factor=factor))
        done = subprocess.run(
            [sys.executable, "-c", f"from netsp.caller import *; print(twice({name}(1.0)))"],
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
