"""Files of an execution."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from netsp.base.files import csv_cell, make_folder, write_text
from netsp.online.execute.execution_log import Execution


def write_execution(done: Execution, folder: str | Path) -> None:
    """Write log.csv, visits.csv, events.csv, tethers.json, summary.json, and problem and solution
    at the end; also maps.json, the problem at each change, if it changed."""
    place = make_folder(folder)
    write_text(place / "log.csv", _table([asdict(r) for r in done.rows]))
    visits = [
        {
            **asdict(a),
            "word": " ".join(map(str, a.word)),
            "planned": " ".join(map(str, a.planned)),
            "as_planned": a.as_planned,
        }
        for a in done.arrivals
    ]
    write_text(place / "visits.csv", _table(visits))
    write_text(place / "events.csv", _table([asdict(e) for e in done.entries]))
    write_text(place / "summary.json", json.dumps(done.summary, indent=1, allow_nan=False) + "\n")
    frames = [
        {"time": t, "nodes": [[round(float(v), 4) for v in p] for p in n]} for t, n in done.tethers
    ]
    write_text(place / "tethers.json", json.dumps(frames, allow_nan=False) + "\n")
    if len(done.maps) > 1:
        maps = [{"time": t, "problem": json.loads(p.to_json())} for t, p in done.maps]
        write_text(place / "maps.json", json.dumps(maps, allow_nan=False) + "\n")
    write_text(place / "problem.json", done.problem.to_json())
    write_text(place / "solution.json", done.solution.to_json())


def _table(rows: Sequence[dict[str, Any]]) -> str:
    if not rows:
        return ""
    text = io.StringIO()
    table = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(
        {
            k: round(v, 6) if isinstance(v, float) else csv_cell(v) if isinstance(v, str) else v
            for k, v in r.items()
        }
        for r in rows
    )
    return text.getvalue()
