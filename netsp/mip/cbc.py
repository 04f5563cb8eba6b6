"""Run of the CBC solver on a PuLP model, in a process with a watchdog.

PuLP writes the model and ships the solver. The process is started here, in a process group of its
own, because CBC can overrun its time limit in preprocessing and the root LP, and must not outlive
this process. The status that CBC reports is checked against its numbers.
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

from netsp.base.clock import Clock, TimeLimit
from netsp.base.errors import NetspError
from netsp.base.interrupt_signals import deferred_interrupts
from netsp.mip.mip_policy import LpPolicy


@dataclass(frozen=True)
class CbcOutcome:
    """Outcome of a run of CBC.

    Attributes
    ----------
    status
        'optimal', 'infeasible' or 'stopped'.
    objective
        Objective of the solution, or None.
    bound
        Best bound of a stopped integer run, or None.
    values, duals
        Values by variable and dual values by constraint; duals of an LP only.
    """

    status: str
    objective: float | None
    bound: float | None
    values: dict[str, float] = field(default_factory=dict)
    duals: dict[str, float] = field(default_factory=dict)


def run_cbc(
    model: pulp.LpProblem,
    *,
    integer: bool,
    limit: TimeLimit,
    threads: int = 1,
    policy: LpPolicy = LpPolicy(),
) -> CbcOutcome:
    """Solve a minimisation model, or its LP relaxation if `integer` is false."""
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
        _run(command, log, clock, policy)
        text = log.read_text(errors="replace") if log.exists() else ""
        return _read(out, text, variable_names, constraint_names, integer)


def _binary() -> str:
    path = pulp.PULP_CBC_CMD().path
    if not path or not os.path.exists(path):
        raise NetspError("the CBC solver that PuLP ships was not found; reinstall pulp")
    return str(path)


def _die_with_parent() -> Callable[[], None] | None:
    """Return a hook by which Linux kills the child process when this process ends; else None."""
    if not sys.platform.startswith("linux"):
        return None
    import ctypes

    try:
        prctl = ctypes.CDLL(None).prctl
    except (OSError, AttributeError):
        return None
    return lambda: prctl(1, signal.SIGKILL)


def _run(command: list[str], log: Path, clock: Clock, policy: LpPolicy) -> None:
    """Run a command until it ends, its limit and a grace time are over, or the clock is stopped.

    The process group has ended when this returns.
    """
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
            end = time.monotonic() + clock.left + policy.cbc_grace_s
            while time.monotonic() < end and not clock.is_stopped:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(policy.cbc_check_interval_s)
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
    """Read the outcome from the solution file and the log."""
    bound = _bound_in(log)
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
    values, duals = _values_and_duals(lines[1:], variables, constraints, integer)
    # a run that stops without a solution writes the LP it stopped at
    if status == "stopped" and (integer and "no feasible" in (head + log.lower())):
        values = {}
    match = re.search(r"objective value\s+(\S+)", lines[0] if lines else "")
    objective = float(match.group(1)) if match and values else None
    return CbcOutcome(status, objective, bound, values, duals)


def _bound_in(log: str) -> float | None:
    """Return the last lower bound that a log states, or None."""
    found = re.findall(r"^Lower bound:\s+(\S+)", log, re.M) or re.findall(
        r"best possible (\S+)", log
    )
    if found:
        with contextlib.suppress(ValueError):
            return float(found[-1].rstrip(","))
    return None


def _values_and_duals(
    lines: list[str], variables: dict[str, str], constraints: dict[str, str], integer: bool
) -> tuple[dict[str, float], dict[str, float]]:
    """Return values and dual values by the names of the model, from lines of a solution file."""
    values: dict[str, float] = {}
    duals: dict[str, float] = {}
    for line in lines:
        parts = line.replace("**", " ").split()
        if len(parts) < 4:
            continue
        name, value, extra = parts[1], parts[2], parts[3]
        if name in variables:
            values[variables[name]] = float(value)
        elif name in constraints and not integer:
            duals[constraints[name]] = float(extra)
    return values, duals
