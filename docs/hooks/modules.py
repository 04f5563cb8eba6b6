"""Lists of all modules and of all tolerances, from the docstrings of the code."""

from __future__ import annotations

import ast
import itertools
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
            out += [f"### {name}/", "", first_sentence(package / "__init__.py"), ""]
            out += ["| module | subject |", "|---|---|", *rows, ""]
    return out


def tolerances(root: Path = ROOT / "netsp") -> list[str]:
    """Return Markdown: a row for each constant whose docstring begins with "Tolerance"."""
    rows = []
    for file in sorted(root.rglob("*.py")):
        body = ast.parse(file.read_text(encoding="utf-8")).body
        for node, following in itertools.pairwise(body):
            match node, following:
                case (
                    ast.Assign(targets=[ast.Name(name)], value=value),
                    ast.Expr(ast.Constant(str(text))),
                ) if text.startswith("Tolerance"):
                    place = ".".join(file.relative_to(root).with_suffix("").parts)
                    meaning = " ".join(text.split()).replace("|", "\\|")
                    rows.append(f"| `{place}.{name}` | {ast.unparse(value)} | {meaning} |")
    return ["| name | value | meaning |", "|---|---|---|", *rows]


def first_sentence(file: Path) -> str:
    """Return the first sentence of a module's docstring in one line."""
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    sentence = re.split(r"(?<=[.?!])\s", " ".join(text.split("\n\n")[0].split()))[0]
    return sentence.replace("|", "\\|")


if __name__ == "__main__":
    print("\n".join([*module_list(), *tolerances()]))
