"""Words, kind and reading ease of pages, ours and those of other projects.

    python benchmarks/page_statistics.py                            our pages
    python benchmarks/page_statistics.py FILE... [--label NAME]     other pages, Markdown or RST

Reading ease is Flesch's: 206.835 - 1.015 words per sentence - 84.6 syllables per word. 60 to 70 is
plain English, 30 to 50 reads like a paper. Code, tables and links' addresses are left out; words
are counted with code, as a reader sees them. Syllables are estimated from groups of vowels.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parent.parent

SHORT_PARAGRAPH = 4  # words; shorter paragraphs are labels, not sentences


def syllables(word: str) -> int:
    """Return an estimate of a word's syllables: groups of vowels, without a silent e at its end."""
    word = re.sub(r"[^a-z]", "", word.lower())
    plain = re.sub(r"(?<=[^aeiouyl])e$|(?<=[^aeiouytd])ed$", "", word)
    return max(1, len(re.findall(r"[aeiouy]+", plain)))


def sentences(text: str) -> list[list[str]]:
    """Return the sentences of a page as lists of words, without code, tables and headings."""
    text = re.sub(r"^---\n.*?^---$", "", text, count=1, flags=re.S | re.M)  # front matter
    text = re.sub(
        r"^( *)(```|~~~).*?^\1\2\s*$|<!--.*?-->|^\$\$.*?\$\$", "", text, flags=re.S | re.M
    )
    text = re.sub(r"^\.\. [\w-]+::.*\n(?:[ \t]*\n|[ \t]+.*\n)*", "", text, flags=re.M)  # RST
    text = re.sub(r"^(\||#|\s*:\w|::: |[=~^\"*+-]{3,}).*$", "", text, flags=re.M)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)|<[^>]+>", "", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r":\w+:`~?\.?([^`<]*)[^`]*`", r"\1", text)
    text = re.sub(r"^\s*([-*+]|\d+\.) +", "\n", text, flags=re.M)  # an item begins a sentence
    found = []
    for paragraph in re.split(r"\n\s*\n", text):
        for sentence in re.split(r"(?<=[.!?:;])[\"”)*_]*\s+", " ".join(paragraph.split())):
            words = re.findall(r"[A-Za-z][A-Za-z'’-]*", sentence)
            if len(words) >= SHORT_PARAGRAPH:
                found.append(words)
    return found


def reading_ease(text: str) -> float | None:
    """Return Flesch's reading ease of a page; None without a sentence."""
    found = sentences(text)
    if not found:
        return None
    words = [word for sentence in found for word in sentence]
    per_word = sum(map(syllables, words)) / len(words)
    return 206.835 - 1.015 * len(words) / len(found) - 84.6 * per_word


def kind(name: str) -> str:
    """Return the kind of one of our pages: its folder, or `start` for the first pages."""
    parts = Path(name).parts
    if parts[0] == "docs" and len(parts) > 2:
        return parts[1]
    return "reference" if parts[0] in ("problems", "scenes") else "start"


def our_pages() -> list[str]:
    """Return the names of our pages."""
    docs = sorted(p.relative_to(ROOT).as_posix() for p in (ROOT / "docs").rglob("*.md"))
    return ["README.md", *docs, "problems/README.md", "scenes/README.md"]


def main() -> int:
    """Print a table with a row for each page, and one for each kind."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("files", nargs="*", help="pages elsewhere; by default our own")
    parser.add_argument("--label", default="elsewhere", help="kind of pages elsewhere")
    args = parser.parse_args()
    rows = []
    for name in args.files or our_pages():
        path = Path(name) if args.files else ROOT / name
        text = path.read_text(encoding="utf-8")
        of = args.label if args.files else kind(name)
        found = sentences(text)
        length = sum(map(len, found)) / len(found) if found else 0.0
        rows.append((of, name, len(text.split()), length, reading_ease(text)))
    print("| page | kind | words | words a sentence | reading ease |\n|---|---|---|---|---|")
    for of, name, words, length, ease in sorted(rows):
        shown = "" if ease is None else f"{ease:.0f}"
        print(f"| {name} | {of} | {words} | {length:.1f} | {shown} |")
    print("\n| kind | pages | words | median words | median reading ease |\n|---|---|---|---|---|")
    for of in sorted({row[0] for row in rows}):
        group = [row for row in rows if row[0] == of]
        eases = [row[4] for row in group if row[4] is not None]
        ease = f"{median(eases):.0f}" if eases else ""
        total = sum(row[2] for row in group)
        print(f"| {of} | {len(group)} | {total} | {median(row[2] for row in group):.0f} | {ease} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
