"""Readers of command-line arguments, and the check that files can be written."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from netsp.base.errors import InputError

if TYPE_CHECKING:
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution


@dataclass(frozen=True)
class Number:
    """Reader of a number in a range, for argparse.

    Parameters
    ----------
    expected : str
        Words for the range in messages.
    minimum, maximum : float
        The range; by default, finite numbers above 0.
    is_whole : bool
        Whether only whole numbers are read.
    """

    expected: str = "a positive number"
    minimum: float = math.ulp(0.0)
    maximum: float = sys.float_info.max
    is_whole: bool = False

    def __call__(self, text: str) -> Any:
        """Return the number that a text is."""
        try:
            value: float = int(text) if self.is_whole else float(text)
        except ValueError:
            value = math.nan
        if not self.minimum <= value <= self.maximum:
            raise argparse.ArgumentTypeError(f"expected {self.expected}, got {text!r}")
        return value


length = Number()
seconds = Number("a positive number of seconds")
depth = Number("a depth of 0 or more", 0.0)
natural = Number(f"a whole number from 0 to {2**62}", 0, 2**62, is_whole=True)
system_id = Number("a system id from 1 to 255", 1, 255, is_whole=True)
whole_bytes = Number("a whole number of bytes", -math.inf, math.inf, is_whole=True)


def positive(text: str) -> int:
    """Parse a whole number from 1."""
    if (value := natural(text)) == 0:
        raise argparse.ArgumentTypeError("expected a whole number from 1 on, got '0'")
    return int(value)


def friction_coefficient(text: str) -> float:
    """Parse a coefficient of friction, 0 to 10."""
    from netsp.model.solution import MAX_FRICTION

    return float(Number(f"0 to {MAX_FRICTION:g}", 0.0, MAX_FRICTION)(text))


def shard(text: str) -> tuple[int, int]:
    """Parse I/N, part I of N parts."""
    part, _, total = text.partition("/")
    if not (part.isdigit() and total.isdigit() and 1 <= int(part) <= int(total)):
        raise argparse.ArgumentTypeError(f"expected I/N with 1 <= I <= N, got {text!r}")
    return int(part), int(total)


def option(text: str) -> tuple[str, str]:
    """Parse a name and its value."""
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise argparse.ArgumentTypeError(f"expected NAME=VALUE, got {text!r}")
    return name, value


def count_or_range(text: str) -> int | tuple[int, int]:
    """Parse a whole number from 0 on, or two of them as in ``1-20``."""
    min_text, dash, max_text = text.partition("-")
    if not (min_text and dash):
        return int(natural(text))
    numbers = int(natural(min_text)), int(natural(max_text))
    if numbers[0] > numbers[1]:
        raise argparse.ArgumentTypeError(f"expected minimum-maximum, got {text!r}")
    return numbers


def vector(text: str, name: str) -> tuple[float, float, float]:
    """Parse three numbers that are separated by commas."""
    from netsp.world.scene.field import finite_point

    try:
        x, y, z = (float(v) for v in text.split(","))
    except ValueError:
        raise InputError(f"{name}: expected three numbers like 0.1,0,0, got {text!r}") from None
    return finite_point((x, y, z), name)


def margins(text: str) -> tuple[float, float]:
    """Parse the minimum tether slack and clearance: ``SLACK`` or ``SLACK,CLEARANCE``."""
    from netsp.exchange.missions.export_policy import DEFAULT_EXPORT

    try:
        numbers = [float(v) for v in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 2) or not all(0.0 <= v < float("inf") for v in numbers):
        raise InputError(f"--margin: expected SLACK or SLACK,CLEARANCE from 0 on, got {text!r}")
    return numbers[0], numbers[-1] if len(numbers) == 2 else DEFAULT_EXPORT.min_clearance


def check_writable(*paths: str, inputs: Sequence[str] = ()) -> None:
    """Raise InputError before the work starts, rather than after it, for a file that cannot be
    written or is an input."""
    from netsp.base.files import STANDARD

    paths = tuple(p for p in paths if p != STANDARD)
    input_paths = {os.path.realpath(p) for p in inputs}
    for path in paths:
        if os.path.realpath(path) in input_paths:
            raise InputError(f"{path}: would be overwritten, and it is an input")
    real_paths = [os.path.realpath(p) for p in paths if not p.startswith("/dev/")]
    duplicates = [name for name in real_paths if real_paths.count(name) > 1]
    if duplicates:
        raise InputError(f"{duplicates[0]}: is named for two different files")
    for path in paths:
        folder = os.path.dirname(os.path.abspath(path))
        if len(os.path.basename(path).encode(errors="replace")) > 250:
            raise InputError(f"{path}: cannot be written: the name is too long")
        if os.path.isdir(path):
            raise InputError(f"{path}: cannot be written: it is a directory")
        if not os.path.isdir(folder):
            raise InputError(f"{path}: cannot be written: no directory {folder}")
        if not os.access(path if os.path.exists(path) else folder, os.W_OK):
            raise InputError(f"{path}: cannot be written: permission denied")


def load_pair(problem: str, solution: str) -> tuple[Problem, Solution]:
    """Load a problem file and a solution file."""
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution

    return Problem.load(problem), Solution.load(solution)


def load_verified_pair(problem: str, solution: str) -> tuple[Problem, Solution]:
    """Load a problem and a solution that passes all checks; InputError if one fails."""
    from netsp.judge import verify

    pair = load_pair(problem, solution)
    failed = next((c for c in verify(*pair).checks if not c.passed), None)
    if failed is not None:
        raise InputError(f"{solution}: fails its check {failed.name!r}: {failed.detail}")
    return pair
