"""Numbers for names that several goals or obstacles share."""

from __future__ import annotations

from collections import Counter
from typing import Any

from netsp.exchange.maps.map_context import MapContext
from netsp.model.import_record import MAX_NAMED


def number_names(context: MapContext, entries: list[dict[str, Any]], kind: str) -> None:
    """Number the names that several goals or obstacles share, and add a note."""
    _number_parts(entries)
    numbered = _number_repeated(entries)
    if numbered:
        shown_names = ", ".join(
            f"{old!r} is {new!r} ({where})" for old, new, where in numbered[:MAX_NAMED]
        )
        context.notes.append(
            f"names that several {kind} share are numbered: {shown_names}"
            + (f", and {len(numbered) - MAX_NAMED} more" if len(numbered) > MAX_NAMED else "")
        )


def _number_parts(entries: list[dict[str, Any]]) -> None:
    """Number the names of things that are parts of one collection: "pier 1", "pier 2"."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for entry in entries:
        whole, dot, _ = entry["where"].partition(".geometries[")
        if entry["name"] is not None and dot:
            groups.setdefault((whole, entry["name"]), []).append(entry)
    for (_, name), parts in groups.items():
        for number, part in enumerate(parts, 1):
            part["name"] = f"{name} {number}" if len(parts) > 1 else name


def _number_repeated(entries: list[dict[str, Any]]) -> list[tuple[str, str, str]]:
    """Number names that occur more than once ("pier", "pier 2"); return old, new and place."""
    used = {entry["name"] for entry in entries}
    seen: Counter[str] = Counter()
    changed = []
    for entry in entries:
        name = entry["name"]
        if name is None:
            continue
        seen[name] += 1
        number = seen[name]
        while number > 1:
            other = f"{name} {number}"
            if other not in used:
                entry["name"] = other
                used.add(other)
                changed.append((name, other, str(entry["where"])))
                break
            number += 1
        seen[name] = number
    return changed
