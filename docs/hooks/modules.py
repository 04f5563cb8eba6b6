"""The list of all modules, by room, from the first sentences of their docstrings."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def module_list(root: Path = ROOT / "netsp") -> list[str]:
    """Return Markdown: a section for each package, and in it a row for each module."""
    out: list[str] = []
    for package in sorted({file.parent for file in root.rglob("*.py")}):
        if package == root:
            continue
        rows = [
            f"| `{file.name}` | {first_sentence(file)} |"
            for file in sorted(package.glob("*.py"))
            if file.name != "__init__.py"
        ]
        if rows:
            name = package.relative_to(root)
            out += [f"## {name}/", "", first_sentence(package / "__init__.py"), ""]
            out += ["| module | subject |", "|---|---|", *rows, ""]
    return out


def first_sentence(file: Path) -> str:
    """Return the first sentence of a module's docstring in one line."""
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    sentence = re.split(r"(?<=[.?!])\s", " ".join(text.split("\n\n")[0].split()))[0]
    return sentence.replace("|", "\\|")


if __name__ == "__main__":
    print("\n".join(module_list()))
