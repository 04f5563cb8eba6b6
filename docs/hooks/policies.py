"""Tables of the numbers in policies, and of the thresholds of a guard's alarms, from the code."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
GUARD = ROOT / "netsp" / "online" / "guard" / "guard_policy.py"
FLIGHT = ROOT / "netsp" / "online" / "fly" / "flight_policy.py"
LINK = ROOT / "netsp" / "online" / "link" / "link_policy.py"


def guard() -> list[str]:
    """Return Markdown: a table for each policy of a guard."""
    return tables(GUARD)


def flight() -> list[str]:
    """Return Markdown: a table for each policy of a flight and of its link."""
    return [*tables(FLIGHT), *tables(LINK)]


def tables(file: Path) -> list[str]:
    """Return Markdown: a section for each class of a module with documented numbers."""
    out: list[str] = []
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if not isinstance(node, ast.ClassDef):
            continue
        text = ast.get_docstring(node) or ""
        meanings, defaults = attributes(text), _defaults(node)
        rows = [
            f"| {', '.join(f'`{part}`' for part in parts)} "
            f"| {', '.join(defaults[part] for part in parts)} | {meaning} |"
            for name, meaning in meanings.items()
            for parts in [name.split(", ")]
            if all(part in defaults for part in parts)
        ]
        if rows:
            subject = " ".join(text.split("\n\n")[0].split())
            head = ["| number | default | meaning |", "|---|---|---|"]
            out += [f"### {node.name}", "", subject, "", *head, *rows, ""]
    return out


def attributes(docstring: str) -> dict[str, str]:
    """Return the meanings of the attributes that a docstring in NumPy's style lists."""
    _, _, section = docstring.partition("Attributes\n----------\n")
    meanings: dict[str, str] = {}
    for found in re.finditer(r"^(\w[\w, ]*)(?: : .*)?\n((?:    .*\n?)+)", section, re.M):
        meanings[found[1]] = " ".join(found[2].split()).replace("|", "\\|")
    return meanings


def _defaults(node: ast.ClassDef) -> dict[str, str]:
    return {
        ast.unparse(line.target): ast.unparse(line.value)
        for line in node.body
        if isinstance(line, ast.AnnAssign) and line.value is not None
        if not any(isinstance(part, ast.Call) for part in ast.walk(line.value))  # other policies
    }


def alarms() -> list[str]:
    """Return Markdown: the level of each kind of alarm, by the thresholds of `AlarmPolicy`."""
    from netsp.online.guard.guard_policy import AlarmPolicy

    p = AlarmPolicy()
    loop = [
        f"{straight:g} s; on a turn {turn:g} s"
        for straight, turn in (
            (p.loop_caution_s, p.turn_caution_s), (p.loop_warning_s, p.turn_warning_s),
        )
    ]  # fmt: skip
    rows = [
        ("`loop-ahead`", "going on closes a loop", "", *loop, ""),
        ("`loop`", "a loop is closed", "the loop is part of the planned tour",
         f"{p.possible_share * 100:g} % likely", "", f"{p.loop_alarm_share * 100:g} % likely"),
        ("`short`", "going straight on needs more tether than there is", "",
         f"{p.short_caution_s:g} s", f"{p.short_warning_s:g} s", ""),
        ("`slack`", "share of the tether left", "", f"{p.slack_caution * 100:g} %",
         f"{p.slack_warning * 100:g} %", "none"),
        ("`class`", f"another class is at least {p.doubt_share * 100:g} % likely", "always", "",
         "", ""),
        ("`plan`", "the tether is in another class than planned at this visit", "", "always", "",
         ""),
        ("`position`", "nothing corrects the position, it is frozen, or it was reset", "", "",
         "always", ""),
        ("`estimate`", "no position that can be believed", "", "", "", "always"),
    ]  # fmt: skip
    head = ["| kind | reason | notice | caution | warning | alarm |", "|---|---|---|---|---|---|"]
    return [*head, *(f"| {' | '.join(row)} |" for row in rows)]


if __name__ == "__main__":
    print("\n".join([*alarms(), "", *guard(), *flight()]))
