"""Types of command-line arguments, and the check of places to write to."""

from __future__ import annotations

import argparse
import importlib.metadata
import math
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from netsp.base.errors import InputError

if TYPE_CHECKING:
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution


def choices(builtin_names: str, group: str) -> str:
    """Help for a choice of names: ours, then those that other packages add to a group of entry
    points."""
    others = sorted({e.name for e in importlib.metadata.entry_points(group=group)})
    return f"{builtin_names}; from other packages: {', '.join(others)}" if others else builtin_names


def _above_zero(what: str) -> Callable[[str], float]:
    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = -1.0
        if not 0.0 < value < float("inf"):
            raise argparse.ArgumentTypeError(f"expected a positive number{what}, got {text!r}")
        return value

    return read


def depth(text: str) -> float:
    """Return a depth, 0 or more."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"expected a depth of 0 or more, got {text!r}")
    return value


def friction(text: str) -> float:
    """Return a coefficient of friction, 0 to 10."""
    from netsp.model.solution import MAX_FRICTION

    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= MAX_FRICTION:
        raise argparse.ArgumentTypeError(f"expected 0 to {MAX_FRICTION:g}, got {text!r}")
    return value


seconds, length = _above_zero(" of seconds"), _above_zero("")
"""A positive number."""


def shard(text: str) -> tuple[int, int]:
    """Parse I/N, part I of N parts."""
    part, _, of = text.partition("/")
    if not (part.isdigit() and of.isdigit() and 1 <= int(part) <= int(of)):
        raise argparse.ArgumentTypeError(f"expected I/N with 1 <= I <= N, got {text!r}")
    return int(part), int(of)


def option(text: str) -> tuple[str, str]:
    """Parse a name and its value."""
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise argparse.ArgumentTypeError(f"expected NAME=VALUE, got {text!r}")
    return name, value


MAX_SYSTEM_ID = 255
"""Highest system id of MAVLink."""

MAX_WHOLE_NUMBER = 2**62
"""Maximum whole number of an option."""


def natural(text: str) -> int:
    """Parse a whole number from 0."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value <= MAX_WHOLE_NUMBER:
        raise argparse.ArgumentTypeError(
            f"expected a whole number from 0 to {MAX_WHOLE_NUMBER}, got {text!r}"
        )
    return value


def system_id(text: str) -> int:
    """Parse the MAVLink system id of a vehicle, from 1 to 255."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if not 1 <= value <= MAX_SYSTEM_ID:
        raise argparse.ArgumentTypeError(
            f"expected a system id from 1 to {MAX_SYSTEM_ID}, got {text!r}"
        )
    return value


def whole_bytes(text: str) -> int:
    """Parse a number of bytes; the caller checks its range."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"expected a whole number of bytes, got {text!r}"
        ) from None


def count_or_range(text: str) -> int | tuple[int, int]:
    """Parse a whole number from 0 on, or two of them as in ``1-20``."""
    min_text, dash, max_text = text.partition("-")
    if not (min_text and dash):
        return natural(text)
    numbers = natural(min_text), natural(max_text)
    if numbers[0] > numbers[1]:
        raise argparse.ArgumentTypeError(f"expected minimum-maximum, got {text!r}")
    return numbers


def positive(text: str) -> int:
    """Parse a whole number from 1."""
    value = natural(text)
    if value == 0:
        raise argparse.ArgumentTypeError("expected a whole number from 1 on, got '0'")
    return value


def vector(text: str, name: str) -> tuple[float, float, float]:
    """Three numbers, separated by commas."""
    from netsp.world.scene.field import finite_point

    try:
        x, y, z = (float(v) for v in text.split(","))
    except ValueError:
        raise InputError(f"{name}: expected three numbers like 0.1,0,0, got {text!r}") from None
    return finite_point((x, y, z), name)


def margins(text: str) -> tuple[float, float]:
    """Least tether slack and clearance, from ``SLACK`` or ``SLACK,CLEARANCE``."""
    from netsp.exchange.missions.export_policy import DEFAULT_EXPORT

    try:
        numbers = [float(v) for v in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 2) or not all(0.0 <= v < float("inf") for v in numbers):
        raise InputError(f"--margin: expected SLACK or SLACK,CLEARANCE from 0 on, got {text!r}")
    return numbers[0], numbers[-1] if len(numbers) == 2 else DEFAULT_EXPORT.min_clearance


def check_writable(*paths: str | None, inputs: Sequence[str | None] = ()) -> None:
    """InputError before the work starts rather than after it; what is read is never written to."""
    from netsp.base.files import STANDARD

    paths = tuple(p for p in paths if p != STANDARD)
    read = {os.path.realpath(p) for p in inputs if p is not None}
    for path in paths:
        if path is not None and os.path.realpath(path) in read:
            raise InputError(f"{path}: would be overwritten, and it is an input")
    given = [os.path.realpath(p) for p in paths if p is not None and not p.startswith("/dev/")]
    twice = [name for name in given if given.count(name) > 1]
    if twice:
        raise InputError(f"{twice[0]}: is named for two different files")
    for path in paths:
        if path is None:
            continue
        folder = os.path.dirname(os.path.abspath(path))
        if len(os.path.basename(path).encode(errors="replace")) > 250:
            raise InputError(f"{path}: cannot be written: the name is too long")
        if os.path.isdir(path):
            raise InputError(f"{path}: cannot be written: it is a directory")
        if not os.path.isdir(folder):
            raise InputError(f"{path}: cannot be written: no directory {folder}")
        if not os.access(path if os.path.exists(path) else folder, os.W_OK):
            raise InputError(f"{path}: cannot be written: permission denied")


def roadmap_options(args: argparse.Namespace) -> dict[str, object]:
    """Return the options of a roadmap that were given."""
    options = {
        "samples": args.samples,
        "shortcut": args.shortcut or None,
        "max_classes": args.max_classes,
        "classes": args.classes_rule,
    }
    return {name: value for name, value in options.items() if value is not None}


def load_pair(problem: str, solution: str) -> tuple[Problem, Solution]:
    """Load a problem file and a solution file."""
    from netsp.model.problem import Problem
    from netsp.model.solution import Solution

    return Problem.load(problem), Solution.load(solution)
