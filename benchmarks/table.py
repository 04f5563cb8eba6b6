"""What the benchmark scripts share: where the project is, the heading, a table that grows."""

from __future__ import annotations

import datetime
import os
import platform
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))


def heading(title: str) -> None:
    """Title, date, commit and machine, as markdown."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
    ).stdout.strip()
    print(f"## {title}\n")
    print(
        f"{datetime.date.today()}, commit {commit or 'unknown'}, {os.cpu_count()} cores "
        f"{platform.machine()}, Python {platform.python_version()}\n"
    )


def head(*columns: str) -> None:
    """First two lines of a markdown table."""
    print("| " + " | ".join(columns) + " |")
    print("|" + "---|" * len(columns), flush=True)


def row(*cells: object) -> None:
    """One line of a markdown table."""
    print("| " + " | ".join(str(c) for c in cells) + " |", flush=True)
