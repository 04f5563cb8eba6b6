"""Checks of the pages that `make docs` runs before the site is built; each finds lines to mend.

    python docs/hooks/check_pages.py              all checks
    python docs/hooks/check_pages.py spelling     one of them

mkdocs itself checks anchors, and that every page is in the navigation; `check_site.py` checks what
only a browser sees.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import command_reference  # noqa: E402

from benchmarks.structure import phrases, said  # noqa: E402

MAX_GUIDE_WORDS = 900  # a page of the guide is read within five minutes

MAX_NOTEBOOK_LINKS = 1  # figures of the notebook that a page for users quotes

BLOCK = re.compile(r"^( *)```.*?^\1```$|^<!-- table .*?^<!-- end -->$|<!--.*?-->", re.S | re.M)
"""Code, generated tables and comments: no prose."""

AMERICAN = re.compile(
    r"\b((color|neighbor|behavior|favor|labor|harbor)(s|ed|ing|hoods?)?|centers?|centered|meters?"
    r"|liters?|fibers?|grays?|analyz(e|ed|es|ing)|catalogs?|artifacts?|defense|skeptical"
    r"|(travel|model|label|cancel|signal|tunnel|level)(ed|ing|er)"
    r"|(optim|minim|maxim|normal|general|real|recogn|summar|organ|initial|visual|util|discret"
    r"|linear|random|parallel|penal|special|synchron)iz(e|es|ed|ing|ation|er|ers))\b",
    re.I,
)
"""American spellings; the pages are British."""

TITLES = re.compile(
    r"“[^”]*”|\"[^\"\n]*\"|(?<!\*)\*[^*\n]+\*(?!\*)|^- \[\w+\d\d\w?\] .*(?:\n  .*)*", re.M
)
"""Quoted titles and entries of lists of references, which keep their spelling."""

NAMES = {
    "Bendix", "Bishop", "Bishop's", "Blue", "Carlo", "Cockpit", "Dask", "Dijkstra", "Euclidean",
    "Fischetti", "Hamiltonian", "Held", "Hollinger", "Karp", "Knuth", "Knuth-Bendix", "Lagrangian",
    "Lillgrund", "Lin-Kernighan", "Linux", "Miami", "Monte", "Noon-Bean", "Pareto", "Pixhawk",
    "Python", "Robotics", "Salazar", "Steiner", "Toth", "Wang", "Windows", "Xiong", "Yang",
    "Appendix", "Corollary", "Definition", "Fig", "Figure", "Lemma", "Proposition", "Table",
    "Tables", "Theorem",
}  # fmt: skip
"""Capitalised words that may stand within a heading, beside those with a capital inside."""

Found = tuple[str, int, str]
"""File, line and what is wrong there."""


def pages(root: Path = ROOT) -> Iterator[tuple[str, str]]:
    """Yield name and text of each page that is written by hand."""
    files = [root / "README.md", *sorted((root / "docs").rglob("*.md"))]
    files += [root / "problems/README.md", root / "scenes/README.md"]
    for file in files:
        if file.exists():
            yield file.relative_to(root).as_posix(), file.read_text(encoding="utf-8")


def prose(text: str) -> str:
    """Return a page without code, tables and comments, with its lines where they were."""
    return BLOCK.sub(lambda m: "\n" * m[0].count("\n"), text)


def line_of(text: str, position: int) -> int:
    """Return the number of the line at a position."""
    return text.count("\n", 0, position) + 1


def links(root: Path = ROOT) -> Iterator[Found]:
    """Yield links to files that do not exist, also those of the changelog."""
    changelog = root / "CHANGELOG.md"
    more = [("CHANGELOG.md", changelog.read_text())] if changelog.exists() else []
    for name, text in [*pages(root), *more]:
        for match in re.finditer(r"\]\(([^)\s]+)\)", prose(text)):
            target = match[1].split("#")[0]
            if target and "://" not in target and not target.startswith("mailto:"):
                place = (root / name).parent / target
                made = re.search(r"docs/tutorials/([\w-]+)\.md$", place.as_posix())
                beside = re.search(r"docs/reference/(problems|scenes)\.md$", place.as_posix())
                source = root / (
                    f"examples/{made[1]}.ipynb"
                    if made
                    else f"{beside[1]}/README.md"
                    if beside
                    else ""
                )
                if not (place.exists() or ((made or beside) and source.exists())):
                    yield name, line_of(prose(text), match.start()), f"no file {match[1]}"


def spelling(root: Path = ROOT) -> Iterator[Found]:
    """Yield American spellings, and misspellings that codespell knows."""
    for name, text in pages(root):
        plain = TITLES.sub(lambda m: "\n" * m[0].count("\n"), prose(text))
        plain = re.sub(r"`[^`]*`|\]\([^)]*\)|https?://\S+", "", plain)
        for number, line in enumerate(plain.splitlines(), 1):
            for match in AMERICAN.finditer(line):
                yield name, number, f"American spelling: {match[0]}"
    if find_spec("codespell_lib") is None:
        print("spelling: codespell is not installed (extra docs): only British spelling is checked")
        return
    files = [str(root / name) for name, _ in pages(root)]
    done = subprocess.run(
        [sys.executable, "-m", "codespell_lib", "--toml", str(ROOT / "pyproject.toml"), *files],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode not in (0, 65):  # none found, some found
        raise RuntimeError(f"codespell ended with {done.returncode}: {done.stderr.strip()[-300:]}")
    for row in done.stdout.splitlines():
        file, number, what = row.rsplit(":", 2)
        yield Path(file).relative_to(root).as_posix(), int(number), what.strip()


def headings(root: Path = ROOT) -> Iterator[Found]:
    """Yield headings that are not in sentence case: only the first word and names have capitals."""
    for name, text in pages(root):
        for match in re.finditer(r"^#+ (.*)$", prose(text), re.M):
            plain = re.sub(r"`[^`]*`|\{.*\}|\(.*?\)|\$[^$]*\$|\*[^*]*\*", "_", match[1]).strip()
            sentences = re.split(r"(?<=[.:?!]) ", plain)
            words = [w.strip(".,:;?!()'’“”\"") for s in sentences for w in s.split()[1:]]
            titled = [w for w in words if re.fullmatch(r"[A-Z][a-z]+(-[A-Za-z]+)*", w)]
            wrong = [w for w in titled if w not in NAMES]
            starts_small = bool(re.match(r"[a-z]", plain)) and not plain.startswith("netsp")
            if wrong or starts_small:
                yield name, line_of(prose(text), match.start()), f"not sentence case: {match[1]}"


def language(root: Path = ROOT) -> Iterator[Found]:
    """Yield terms that the glossary says not to use, and phrases of no native speaker."""
    for name, text in pages(root):
        if name.endswith("glossary.md"):
            continue
        number = 1
        for paragraph in prose(text).split("\n\n"):
            for what in [*said(paragraph), *phrases(paragraph)]:
                yield name, number, f"do not say: {what}"
            number += paragraph.count("\n") + 2


def guide(root: Path = ROOT) -> Iterator[Found]:
    """Yield pages of the guide that are too long, or do not begin with their readers."""
    for name, text in pages(root):
        if not name.startswith("docs/guide/"):
            continue
        n_words = len(text.split())
        if n_words > MAX_GUIDE_WORDS:
            yield name, 1, f"{n_words} words; expected at most {MAX_GUIDE_WORDS}"
        first = next((p for p in text.split("\n\n") if not p.startswith(("#", "<!--"))), "")
        if not re.search(r"\bfor\b", first, re.I) or not re.search(r"\byou\b|\bcan\b", first, re.I):
            yield (
                name,
                3,
                "the first paragraph does not say for whom the page is and what it enables",
            )


def notebook(root: Path = ROOT) -> Iterator[Found]:
    """Yield pages for users that quote more than one figure of the notebook, or hold its tables."""
    for name, text in pages(root):
        if not (name.startswith("docs/guide/") or name in ("docs/index.md", "README.md")):
            continue
        for match in re.finditer(r"^<!-- table ([\w.-]+) -->", text, re.M):
            yield name, line_of(text, match.start()), f"measured table {match[1]}; move it"
        quoted = list(re.finditer(r"\]\((?:\.\./|docs/)?notebook/[^)]*\)", text))
        for match in quoted[MAX_NOTEBOOK_LINKS:] if name.startswith("docs/guide/") else []:
            yield name, line_of(text, match.start()), "more than one reference to the notebook"


def options(root: Path = ROOT) -> Iterator[Found]:
    """Yield options of commands without a description."""
    for option in command_reference.undocumented():
        yield "netsp/command/command_table.py", 1, f"no description: {option}"


def words_of(name: str) -> set[str]:
    """Return the words of a title or a file's name, in lower case and without a plural's s."""
    return {w.removesuffix("s") for w in re.findall(r"[a-z0-9]+", name.lower())}


def navigation(root: Path = ROOT) -> Iterator[Found]:
    """Yield entries of the navigation that are named unlike their files or their headings."""
    text = (root / "mkdocs.yml").read_text(encoding="utf-8")
    nav = yaml.safe_load(text[text.index("\nnav:") :])["nav"]
    for section in nav:
        for entries in section.values():
            for entry in entries if isinstance(entries, list) else []:
                ((title, file),) = entry.items()
                number = line_of(text, text.index(f": {file}\n"))
                if Path(file).stem != "index" and not words_of(Path(file).stem) & words_of(title):
                    yield "mkdocs.yml", number, f"{title!r} has no word of {file}"
                page = root / "docs" / file
                heading = re.search(r"^# (.*)$", page.read_text() if page.exists() else "", re.M)
                if heading and not heading[1].replace("`", "").startswith(title):
                    yield "mkdocs.yml", number, f"{title!r} is headed {heading[1]!r} in {file}"


CHECKS: dict[str, Callable[[Path], Iterator[Found]]] = {
    "links": links,
    "spelling": spelling,
    "headings": headings,
    "language": language,
    "guide": guide,
    "notebook": notebook,
    "options": options,
    "navigation": navigation,
}
"""Checks by name. Each takes the root of a repository."""


def main(names: list[str]) -> int:
    """Print what the checks find, and return 1 if that is anything."""
    found = [(check, *each) for check in names or CHECKS for each in CHECKS[check](ROOT)]
    for check, name, line, what in found:
        print(f"{name}:{line}: {check}: {what}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
