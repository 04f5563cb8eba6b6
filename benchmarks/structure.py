"""Measures of the code's structure and language, as a table.

Run `python benchmarks/structure.py [FOLDER]`; with `--list NAME`, the places that a row counts.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import io
import re
import tokenize
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

MAX_LINES, MAX_PARAMETERS = 40, 7

BAD_OPENINGS = {
    "of", "what", "whether", "those", "that", "so", "the", "as", "where", "which", "with", "when",
    "how", "it", "its", "they", "such", "in", "at", "from", "if", "for",
}  # fmt: skip
"""First words of docstrings that hang on another sentence, except `The` before a head noun."""

ARTICLES = {"the", "a", "an", "all", "every", "each", "any", "no", "one", "two", "both"}
"""First words with which no docstring of a function begins: it begins with a verb."""

KINDS = ("tolerance", "sentinel", "code", "column", "index", "format", "physical", "unit")
"""First words of the docstrings of numbers that nobody chose."""

NAMES = {
    "told", "take", "of", "some", "own", "most", "least", "few", "there", "back", "here", "said",
    "heard", "asked",
}  # fmt: skip
"""Names that say nothing to a stranger."""

PARTS = {"most", "least", "told", "way", "ways", "said", "heard", "asked"}
"""Parts of names for which there is a field's term: max, min, on, path."""

PRONOUNS = re.compile(r"\b(so many|the first of these|that many|the others? of|those that)\b", re.I)

UNSAID = {
    "depot": r"depots?", "dock": r"dock(ed|ing)", "hop": r"hop(s|ping|ped)?", "rope": r"ropes?",
    "node": r"goal nodes?", "target": r"goal targets?", "state": r"(augmented|goal) states?",
    "edge": r"edges? (between|of) (the )?(goals|travel graph|tour)",
    "label": r"labels? of (a |the )?(paths?|class(es)?|tethers?)", "wrap angle": r"wrap angles?",
    "route": r"(best|closed|planned|shortest|robot's) routes?", "way": r"ways?",
    "wound around": r"wound (a)?round",
    "stop": r"(a|the|each|every|last|next|first|at|all|between) stops?(?! (flag|of|- 1))",
    "too long": r"tethers?( \w+){0,3} too long", "taking in": r"(take|takes|taking) in tether",
    "tether out": r"tether out(?! of)", "length out": r"length out",
    "lost": r"(goals?|waypoints?)( that)?( is| are| was| were)? (lost|skipped|given up)",
}  # fmt: skip
"""Patterns of the terms that the glossary says not to use, each in the sense that it has there."""

IDIOMS = re.compile(
    r"`[^`]*`|<[^>]*>|\b(on|along|in) (a|the|its|your|a robot's|the anchor's) way\b|\bunder way\b"
    r"|\bhalf[ -]way\b|\b(one|both|either|any|every|all|other|same|this|that|no|only|some|lead the)"
    r"[ -]ways?\b|\b(the wrong|a long|the whole|out of the|all the) way\b|\bthe way (to|in|that)\b"
    r"|\b(in|are) (two|three|several|different|many) ways\b|\bways? (of \w+ing|to \w+)\b",
    re.I,
)
"""Quoted names, and idioms in which a word of `UNSAID` has another sense."""

PHRASES = re.compile(
    r"\b(anew|sought|in vain|once more|at hand|all the same|as ever|for ever|half-made)\b"
    r"|\b(told|tells?)( \w+){0,3} apart\b|\bBesides,|\bbesides[.,;]|\bso (many|few) at most\b"
    r"|\b(Of|One of) (it|them|these)\.|\b[Hh]ow many, about\b|^(Which|When|Where|Who|How)\.$",
    re.M,
)
"""Phrases that no native speaker would write, and fragments instead of descriptions."""

Place = tuple[str, int, str]
"""File, line and text."""


class Tree:
    """All modules of a package.

    Parameters
    ----------
    root : Path
        Folder of the package.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.files = sorted(root.rglob("*.py"))
        self.texts = {file: file.read_text(encoding="utf-8") for file in self.files}
        self.trees = {file: ast.parse(text) for file, text in self.texts.items()}

    def place(self, file: Path, node: ast.AST, text: str) -> Place:
        """Return where a node is."""
        return str(file.relative_to(self.root.parent)), getattr(node, "lineno", 1), text

    def functions(self) -> Iterator[tuple[Path, ast.FunctionDef | ast.AsyncFunctionDef]]:
        """Yield all functions and methods."""
        for file, tree in self.trees.items():
            for node in ast.walk(tree):
                if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                    yield file, node

    def constants(self) -> Iterator[tuple[Path, ast.stmt, str, object]]:
        """Yield the module-level names that are bound to chosen numbers, with their values."""
        for file, tree in self.trees.items():
            for node, following in zip(tree.body, [*tree.body[1:], None], strict=True):
                if _string(following).lower().startswith(KINDS):
                    continue
                if isinstance(node, ast.Assign) and len(node.targets) == 1:
                    targets, value = node.targets[0], node.value
                elif isinstance(node, ast.AnnAssign) and node.value is not None:
                    targets, value = node.target, node.value
                else:
                    continue
                for name, bound in _pairs(targets, value):
                    number = _number(bound)
                    if number is not None:
                        yield file, node, name, number


def _pairs(target: ast.expr, value: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    if isinstance(target, ast.Name):
        yield target.id, value
    elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        for one, bound in zip(target.elts, value.elts, strict=False):
            yield from _pairs(one, bound)


def _number(value: ast.expr) -> object:
    """Return the value of an expression of numeric literals, or None."""
    if any(not isinstance(n, _NUMERIC) for n in ast.walk(value)):
        return None
    literals = [n.value for n in ast.walk(value) if isinstance(n, ast.Constant)]
    if not literals or any(isinstance(v, bool | str | bytes | None.__class__) for v in literals):
        return None
    return ast.unparse(value)


_NUMERIC = (
    ast.Constant, ast.UnaryOp, ast.BinOp, ast.USub, ast.UAdd, ast.Add, ast.Sub, ast.Mult, ast.Div,
    ast.Pow, ast.FloorDiv, ast.Tuple, ast.List, ast.Load, ast.LShift,
)  # fmt: skip


def _string(node: ast.stmt | None) -> str:
    """Return the text of a statement that is a string, or an empty one."""
    value = getattr(node, "value", None) if isinstance(node, ast.Expr) else None
    text = value.value if isinstance(value, ast.Constant) else ""
    return text if isinstance(text, str) else ""


def _lines(tree: Tree) -> list[Place]:
    return [
        (str(f.relative_to(tree.root.parent)), k, "")
        for f, text in tree.texts.items()
        for k, _ in enumerate(text.splitlines(), 1)
    ]


def _names_twice(tree: Tree) -> list[Place]:
    by_name = defaultdict(list)
    for file in tree.files:
        if file.stem != "__init__":
            by_name[file.stem].append(file)
    return [
        (str(file.relative_to(tree.root.parent)), 1, name)
        for name, files in sorted(by_name.items())
        if len(files) > 1
        for file in files
    ]


def _rooms(tree: Tree) -> list[Place]:
    return [
        (path.name, 1, "")
        for path in sorted(tree.root.iterdir())
        if (path.suffix == ".py" and not path.stem.startswith("__"))
        or (path / "__init__.py").exists()
    ]


def _long(tree: Tree) -> list[Place]:
    return [
        tree.place(file, node, f"{node.name}: {length} lines")
        for file, node in tree.functions()
        if (length := _body_lines(node)) > MAX_LINES
    ]


def _body_lines(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Return the lines of a function, without its docstring."""
    first = node.body[0]
    documented = ast.get_docstring(node, clean=False) is not None
    docstring = (first.end_lineno or 0) - first.lineno + 1 if documented else 0
    return (node.end_lineno or 0) - node.lineno + 1 - docstring


def _many_parameters(tree: Tree) -> list[Place]:
    found = []
    for file, node in tree.functions():
        a = node.args
        names = [p.arg for p in (*a.posonlyargs, *a.args, *a.kwonlyargs)]
        count = len([name for name in names if name not in ("self", "cls")])
        if count > MAX_PARAMETERS:
            found.append(tree.place(file, node, f"{node.name}: {count} parameters"))
    return found


def _constants(tree: Tree) -> list[Place]:
    return [tree.place(f, node, f"{name} = {value}") for f, node, name, value in tree.constants()]


def _ambiguous_constants(tree: Tree) -> list[Place]:
    values: dict[str, set[object]] = defaultdict(set)
    modules: dict[str, set[Path]] = defaultdict(set)
    for file, _, name, value in tree.constants():
        values[name].add(value)
        modules[name].add(file)
    return [
        ("", 0, f"{name}: {len(modules[name])} modules, {len(values[name])} values")
        for name in sorted(values)
        if len(modules[name]) > 1 and len(values[name]) > 1
    ]


def _documented(tree: Tree) -> Iterator[tuple[Path, ast.AST, str]]:
    for file, module in tree.trees.items():
        for node in ast.walk(module):
            body = getattr(node, "body", None)
            for statement in body if isinstance(body, list) else ():
                value = getattr(statement, "value", None)
                if (
                    isinstance(statement, ast.Expr)
                    and isinstance(value, ast.Constant)
                    and isinstance(value.value, str)
                ):
                    yield file, statement, value.value.strip()


def _openings(tree: Tree) -> list[Place]:
    found = []
    for file, node, text in _documented(tree):
        words = text.split()
        first = words[0].rstrip(",.:").lower() if words else ""
        if first in BAD_OPENINGS and not (first == "the" and len(words) > 2):
            found.append(tree.place(file, node, text.splitlines()[0]))
    for file, function in tree.functions():
        text = ast.get_docstring(function) or ""
        is_property = any("property" in ast.unparse(d) for d in function.decorator_list)
        first = text.split()[0].rstrip(",.:").lower() if text else ""
        if text and not is_property and (first in ARTICLES or not first[0].isalpha()):
            found.append(tree.place(file, function, text.splitlines()[0]))
    return found


def _identifiers(tree: Tree) -> list[Place]:
    found = []
    for file, module in tree.trees.items():
        seen = set()
        for node in ast.walk(module):
            name = _defined(node)
            words = set(name.lower().strip("_").split("_"))
            if name not in seen and (name.strip("_") in NAMES or words & PARTS):
                seen.add(name)
                found.append(tree.place(file, node, name))
    return found


def _defined(node: ast.AST) -> str:
    """Return the name that a node defines or binds, or an empty string."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return node.name
    if isinstance(node, ast.arg):
        return node.arg
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        return node.id
    if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
        return node.attr
    return ""


def _pronouns(tree: Tree) -> list[Place]:
    return [
        tree.place(file, node, text.splitlines()[0])
        for file, node, text in _documented(tree)
        if PRONOUNS.search(text)
    ]


def said(text: str) -> list[str]:
    """Return the terms of `UNSAID` that a text uses, once each."""
    plain = IDIOMS.sub("_", " ".join(text.split()))
    return [t for t, pattern in UNSAID.items() if re.search(rf"\b({pattern})\b", plain, re.I)]


def _prose(tree: Tree) -> Iterator[tuple[Path, int, str]]:
    """Yield docstrings without the names of parameters and examples, and comments."""
    for file, node, text in _documented(tree):
        prose = re.sub(r"^\s*\w+(, \w+)*( : .*)?$|^\s*>>>.*$", "", text, flags=re.M)
        yield file, getattr(node, "lineno", 1), prose
    for file, text in tree.texts.items():
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT:
                yield file, token.start[0], token.string


def _unsaid(tree: Tree) -> list[Place]:
    return [
        (str(file.relative_to(tree.root.parent)), line, f"{term}: {text.strip().splitlines()[0]}")
        for file, line, text in _prose(tree)
        for term in said(text)
    ]


def phrases(text: str) -> list[str]:
    """Return the `PHRASES` that a text uses."""
    return [m[0] for line in text.splitlines() for m in PHRASES.finditer(line.strip())]


def _phrases(tree: Tree) -> list[Place]:
    return [
        (str(file.relative_to(tree.root.parent)), line, phrase)
        for file, line, text in _prose(tree)
        for phrase in phrases(text)
    ]


SECTION = re.compile(r"^(Parameters|Attributes)\n-+\n(.*?)(?=^\w[\w ]*\n-{3,}$|\Z)", re.M | re.S)


def _documented_names(text: str, kind: str) -> list[str]:
    """Return the names that a section of a docstring describes."""
    return [
        name.strip("* ")
        for section, lines in SECTION.findall(inspect.cleandoc(text))
        if section == kind
        for entry in re.findall(r"^(\S[^:\n]*)(?: : .*)?$", lines, re.M)
        for name in entry.split(",")
    ]


def _undocumented(tree: Tree) -> list[Place]:
    """Return the parameters and attributes in docstrings that the code does not have."""
    found = []
    for file, node in tree.functions():
        a = node.args
        own = {p.arg for p in (*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg) if p}
        names = _documented_names(ast.get_docstring(node, clean=False) or "", "Parameters")
        found += [tree.place(file, node, f"{node.name}: {n}") for n in names if n not in own]
    for file, module in tree.trees.items():
        for node in ast.walk(module):
            if isinstance(node, ast.ClassDef) and not _bases(node) - {"NamedTuple", "Protocol"}:
                text = ast.get_docstring(node, clean=False) or ""
                names = [
                    *_documented_names(text, "Parameters"),
                    *_documented_names(text, "Attributes"),
                ]
                own = {_defined(n) for n in ast.walk(node)}
                found += [
                    tree.place(file, node, f"{node.name}: {n}") for n in names if n not in own
                ]
    return found


def _bases(node: ast.ClassDef) -> set[str]:
    return {ast.unparse(base).split("[")[0] for base in node.bases}


def _skips(tree: Tree) -> list[Place]:
    return [
        (str(file.relative_to(tree.root.parent)), k, line.strip())
        for file, text in tree.texts.items()
        for k, line in enumerate(text.splitlines(), 1)
        if "fmt: skip" in line
    ]


ROWS: dict[str, tuple[str, Callable[[Tree], list[Place]]]] = {
    "lines": ("lines", _lines),
    "rooms": ("rooms and modules at the root", _rooms),
    "basenames": ("modules whose basename is not unique", _names_twice),
    "constants": ("module-level names of chosen numbers", _constants),
    "ambiguous": (
        "names of numbers in several modules with different values",
        _ambiguous_constants,
    ),
    "long": (f"functions of more than {MAX_LINES} lines", _long),
    "parameters": (f"functions of more than {MAX_PARAMETERS} parameters", _many_parameters),
    "openings": ("docstrings that open with no verb or head noun", _openings),
    "identifiers": ("names that the language rules forbid, once a file", _identifiers),
    "pronouns": ("docstrings with a pronoun for a number", _pronouns),
    "unsaid": ("terms that the glossary says not to use", _unsaid),
    "phrases": ("phrases that no native speaker would write", _phrases),
    "undocumented": ("documented names that the code does not have", _undocumented),
    "skips": ("`# fmt: skip`", _skips),
}


def main() -> None:
    """Print all measures, or the places of one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("netsp"))
    parser.add_argument("--list", choices=ROWS, help="print the places that a row counts")
    args = parser.parse_args()
    tree = Tree(args.folder.resolve())
    if args.list:
        for file, line, text in ROWS[args.list][1](tree):
            print(f"{file}:{line}: {text}")
        return
    for text, measure in ROWS.values():
        print(f"| {text} | {len(measure(tree))} |")
    for room, count in Counter(_room(file) for file, _, _ in _lines(tree)).most_common():
        print(f"| lines in {room} | {count} |")


def _room(file: str) -> str:
    parts = Path(file).parts
    return parts[1] + "/" if len(parts) > 2 else "modules at the root"


if __name__ == "__main__":
    main()
