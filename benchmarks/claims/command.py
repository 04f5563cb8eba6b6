"""Claims about the command line: start, a comparison that is killed, documented commands."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from table import ROOT

from claims.claim import ALLOWANCE, Claim


def killed() -> tuple[str, bool]:
    """A comparison killed without a word, and continued: every trial once."""
    with tempfile.TemporaryDirectory() as folder:
        rows = Path(folder) / "r.jsonl"
        command = [sys.executable, "-m", "netsp", "compare", "-o", str(rows), "--goals", "6", "8",
                   "--tethers", "250", "--solvers", "auto", "greedy", "--worlds", "10",
                   "--quiet"]  # fmt: skip
        first = subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL)
        for _ in range(600):
            time.sleep(0.05)
            if rows.exists() and rows.read_bytes().count(b"\n") >= 5:
                break
        os.killpg(first.pid, signal.SIGKILL)
        first.wait()
        kept = rows.read_bytes()
        kept = kept[: kept.rfind(b"\n") + 1]
        again = subprocess.run(command, capture_output=True)
        ids = [json.loads(line)["trial"] for line in rows.read_text().splitlines()]
        whole = rows.read_bytes().startswith(kept)
    held = again.returncode == 0 and len(ids) == len(set(ids)) == 40 and whole
    before = kept.count(b"\n")
    return f"{len(set(ids))} of 40 trials, {before} before the kill", held


SAMPLE = 12
"""Step through the list of mutants in the gate, which tries every twelfth; all take minutes."""


def sabotaged() -> tuple[str, bool]:
    """Mutants of `benchmarks/mutants.toml` that the related tests notice."""
    command = [sys.executable, str(ROOT / "benchmarks" / "mutants.py"), "--every", str(SAMPLE)]
    done = subprocess.run(command, capture_output=True, text=True)
    lines = (done.stdout or done.stderr).strip().splitlines() or ["nothing was printed"]
    return f"{lines[-1]}, of {mutants_listed()} on the list", done.returncode == 0


def mutants_listed() -> int:
    """Return how many mutants there are."""
    text = (ROOT / "benchmarks" / "mutants.toml").read_text(encoding="utf-8")
    return text.count("[[mutant]]")


def later_solve() -> tuple[str, bool]:
    """Measure the CPU seconds of a solve after the first, most of which loading modules takes."""
    command = [sys.executable, "-m", "netsp", "solve", str(ROOT / "problems" / "wharf.json")]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return f"{spent:.2f} s CPU", done.returncode == 0 and spent <= ALLOWANCE * 0.8


def help_start() -> tuple[str, bool]:
    """Seconds of CPU until the help is printed, over those of Python's own start."""

    def spent(command: list[str]) -> float:
        runs = []
        for _ in range(5):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(command, capture_output=True, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            runs.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        return float(np.median(runs))

    ratio = spent([sys.executable, "-m", "netsp", "--help"]) / spent([sys.executable, "-c", ""])
    return f"{ratio:.1f} times", ratio <= 8.0


def page(name: str) -> Claim:
    """Every command and snippet of a page."""

    def measure() -> tuple[str, bool]:
        import pages

        with tempfile.TemporaryDirectory() as folder:
            try:
                ran = pages.run_page(name, Path(folder))
            except AssertionError as error:
                return str(error).strip().splitlines()[0], False
        return f"{len(ran)} run", True

    return Claim(f"{name}: commands and snippets", "run as written", measure)


def starting() -> Iterator[Claim]:
    """How long a command takes to start."""
    yield Claim("later solves of the wharf", "0.8 s CPU (x 3)", later_solve, timed=True)
    yield Claim("`netsp --help` over the start of Python", "8 times", help_start, timed=True)


def running() -> Iterator[Claim]:
    """What commands do."""
    import pages

    for name in pages.PAGES:
        if any(True for _ in pages.blocks(name)):
            yield page(name)
    yield Claim("comparison killed and continued", "every trial once", killed)
    yield Claim("sabotages that the tests notice", "every one of a sample", sabotaged)
