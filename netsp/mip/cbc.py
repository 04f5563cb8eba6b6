"""One run of the CBC solver on a PuLP model, under a watchdog.

PuLP writes the model and ships the solver; the process is ours, in its own group, because CBC can
overrun its time limit in preprocessing and the root LP, and must never outlive us. CBC's word for
the status is not trusted beyond what its numbers show.
"""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pulp

from netsp.base.clock import Clock, TimeLimit, deferred_interrupts
from netsp.base.errors import NetspError

GRACE = 1.0
"""Seconds past its own limit after which CBC is killed."""

WAIT = 0.02
"""Seconds between two looks at the clock."""


@dataclass(frozen=True)
class CbcOutcome:
    """What CBC said.

    Attributes
    ----------
    status
        'optimal', 'infeasible' or 'stopped'.
    objective
        Of the solution, or None.
    bound
        CBC's best bound of a stopped integer run, or None.
    values, duals
        By variable and constraint name; duals of an LP only.
    """

    status: str
    objective: float | None
    bound: float | None
    values: dict[str, float] = field(default_factory=dict)
    duals: dict[str, float] = field(default_factory=dict)


def run_cbc(
    model: pulp.LpProblem, *, integer: bool, limit: TimeLimit, threads: int = 1
) -> CbcOutcome:
    """Solve a minimisation model as it stands (`integer=False`: its LP relaxation)."""
    with tempfile.TemporaryDirectory(prefix="netsp-cbc-") as folder:
        mps, out, log = (Path(folder) / n for n in ("model.mps", "solution.txt", "log.txt"))
        renamed = model.writeMPS(str(mps), rename=True, mip=1 if integer else 0)
        variable_names, constraint_names = renamed[1], renamed[2]
        command = [_binary(), str(mps)]
        clock = Clock.from_limit(limit)
        if (time_left := clock.left) != float("inf"):
            command += ["-sec", f"{max(time_left, 0.05):.3f}", "-timeMode", "elapsed"]
        if integer:
            command += ["-ratioGap", "1e-9", "-allowableGap", "1e-9"]
            command += ["-threads", str(threads)] if threads > 1 else []
            command += ["-branch"]
        else:
            command += ["-initialSolve"]
        command += ["-printingOptions", "all", "-solution", str(out)]
        _run(command, log, clock)
        text = log.read_text(errors="replace") if log.exists() else ""
        return _read(out, text, variable_names, constraint_names, integer)


def _binary() -> str:
    path = pulp.PULP_CBC_CMD().path
    if not path or not os.path.exists(path):
        raise NetspError("the CBC solver that PuLP ships was not found; reinstall pulp")
    return str(path)


def _die_with_parent() -> Callable[[], None] | None:
    """A hook that makes the child receive SIGKILL when we die, where the kernel can (Linux)."""
    if not sys.platform.startswith("linux"):
        return None
    import ctypes

    try:
        prctl = ctypes.CDLL(None).prctl
    except (OSError, AttributeError):
        return None
    return lambda: prctl(1, signal.SIGKILL)


def _run(command: list[str], log: Path, clock: Clock) -> None:
    """Run to the end, or until the clock is up: at a deadline CBC has a while to end by itself. The
    process group is gone when this returns."""
    process = None
    with log.open("wb") as stream:
        try:
            # Python calls hooks when it forks, and what is raised in those is lost
            with deferred_interrupts():
                process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=stream,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                    preexec_fn=_die_with_parent(),
                )
            end = time.monotonic() + clock.left + GRACE
            while time.monotonic() < end and not clock.is_stopped:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(WAIT)
                    break
        finally:
            if process is not None:
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def _read(
    out: Path,
    log: str,
    variable_names: dict[str, str],
    constraint_names: dict[str, str],
    integer: bool,
) -> CbcOutcome:
    bound = None
    found = re.findall(r"^Lower bound:\s+(\S+)", log, re.M) or re.findall(
        r"best possible (\S+)", log
    )
    if found:
        with contextlib.suppress(ValueError):
            bound = float(found[-1].rstrip(","))
    if "infeasible" in log.lower() and not out.exists():
        return CbcOutcome("infeasible", None, bound)
    if not out.exists():
        return CbcOutcome("stopped", None, bound)
    lines = out.read_text().splitlines()
    head = lines[0].lower() if lines else ""
    if "infeasible" in head:
        return CbcOutcome("infeasible", None, bound)
    status = "optimal" if head.startswith("optimal") else "stopped"
    variables = {new: old for old, new in variable_names.items()}
    constraints = {new: old for old, new in constraint_names.items()}
    values: dict[str, float] = {}
    duals: dict[str, float] = {}
    for line in lines[1:]:
        parts = line.replace("**", " ").split()
        if len(parts) < 4:
            continue
        name, value, extra = parts[1], parts[2], parts[3]
        if name in variables:
            values[variables[name]] = float(value)
        elif name in constraints and not integer:
            duals[constraints[name]] = float(extra)
    # a run that stops without a solution writes the LP it stopped at
    if status == "stopped" and (integer and "no feasible" in (head + log.lower())):
        values = {}
    match = re.search(r"objective value\s+(\S+)", lines[0] if lines else "")
    objective = float(match.group(1)) if match and values else None
    return CbcOutcome(status, objective, bound, values, duals)
