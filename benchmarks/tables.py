"""Writes the tables of the docs from the rows that the benchmarks keep.

    python benchmarks/tables.py            write
    python benchmarks/tables.py --check    exit 1 if a page differs from what would be written

A benchmark called with `--keep` keeps its rows in `benchmarks/results/NAME.json`, with date, commit
and machine. A page shows them between `<!-- table NAME -->` and `<!-- end -->`. Nothing there is
typed by hand.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"

_PLACE = re.compile(r"<!-- table ([\w.-]+) -->\n.*?<!-- end -->", re.S)


def rendered(name: str) -> str:
    """A kept table as markdown, with where it comes from."""
    kept = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    lines = ["| " + " | ".join(kept["columns"]) + " |", "|" + "---|" * len(kept["columns"])]
    lines += ["| " + " | ".join(cells) + " |" for cells in kept["rows"]]
    source = ", ".join(filter(None, (kept["date"], f"commit {kept['commit']}", kept["machine"])))
    return "\n".join([*lines, "", f"<sub>{source}</sub>"])


def filled(text: str) -> str:
    """A page with its tables as they are kept."""
    return _PLACE.sub(lambda m: f"<!-- table {m[1]} -->\n{rendered(m[1])}\n<!-- end -->", text)


def main() -> int:
    """Write, or check."""
    stale = []
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        text = page.read_text(encoding="utf-8")
        new = filled(text)
        if new != text:
            stale.append(page.name)
            if "--check" not in sys.argv:
                page.write_text(new, encoding="utf-8")
    for name in stale:
        print(f"{name}: {'differs' if '--check' in sys.argv else 'written'}")
    return 1 if stale and "--check" in sys.argv else 0


if __name__ == "__main__":
    sys.exit(main())
