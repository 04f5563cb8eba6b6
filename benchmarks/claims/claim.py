"""What a claim is."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass

from table import RESULTS, ROOT

ALLOWANCE = 3.0
"""Of CPU seconds, for a busy machine and a slower one than that of the published figures."""

DATA = ROOT.parent / "shared" / "data"
"""Recorded flights and other people's data, where they are present."""

ABSENT = "not measured: the data are not here"


@dataclass(frozen=True)
class Claim:
    """One entry. measure : returns what was measured, and whether it held. timed : measured alone
    on the machine, and once more before it falls. beside : another one may be measured meanwhile,
    for it has a processor of its own and much time; if it falls, then once more, alone."""

    name: str
    threshold: str
    measure: Callable[[], tuple[str, bool]]
    timed: bool = False
    beside: bool = False


def published(table: str) -> list[dict[str, str]]:
    """The rows of a published table, by its columns."""
    kept = json.loads((RESULTS / f"{table}.json").read_text(encoding="utf-8"))
    return [dict(zip(kept["columns"], cells, strict=True)) for cells in kept["rows"]]
