"""What the benchmark scripts share: where the project is, the heading, a table that grows, and the
rows that are kept for the docs (`benchmarks/tables.py`) when a script is called with `--keep`. With
`--cpu-limits`, time limits count CPU seconds of the reference machine (`machine_speed.py`) instead
of those of the clock on the wall."""

from __future__ import annotations

import datetime
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
sys.path.insert(0, str(ROOT))

KEEP = "--keep" in sys.argv
if KEEP:
    sys.argv.remove("--keep")

CPU_LIMITS = "--cpu-limits" in sys.argv
SLOWNESS = 1.0
if CPU_LIMITS:
    from machine_speed import slowness

    sys.argv.remove("--cpu-limits")
    SLOWNESS = slowness()
    time.monotonic = lambda: time.process_time() / SLOWNESS

_kept: dict[str, Any] = {}


def source() -> dict[str, str]:
    """Date, commit and machine."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
    ).stdout.strip()
    return {
        "date": str(datetime.date.today()),
        "commit": commit or "unknown",
        "machine": f"{os.cpu_count()} cores {platform.machine()}, "
        f"Python {platform.python_version()}"
        + (f", limits in CPU seconds × {SLOWNESS:.2f}" if CPU_LIMITS else ""),
    }


def heading(title: str) -> None:
    """Title, date, commit and machine, as markdown."""
    s = source()
    print(f"## {title}\n")
    print(f"{s['date']}, commit {s['commit']}, {s['machine']}\n")


def head(*columns: str, name: str | None = None, **origin: str) -> None:
    """First two lines of a markdown table. name : under which its rows are kept. origin : date,
    commit or machine of rows that were measured before."""
    print("| " + " | ".join(columns) + " |")
    print("|" + "---|" * len(columns), flush=True)
    _kept.clear()
    if name is not None and KEEP:
        _kept.update({"name": name, "columns": list(columns), "rows": [], **source(), **origin})


def row(*cells: object) -> None:
    """One line of a markdown table."""
    print("| " + " | ".join(str(c) for c in cells) + " |", flush=True)
    if _kept:
        _kept["rows"].append([str(c) for c in cells])
        RESULTS.mkdir(exist_ok=True)
        text = json.dumps(_kept, indent=1, ensure_ascii=False)
        (RESULTS / f"{_kept['name']}.json").write_text(text + "\n", encoding="utf-8")
