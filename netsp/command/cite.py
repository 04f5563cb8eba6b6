"""`netsp cite`: how to cite netsp and the problem that it solves."""

from __future__ import annotations

import argparse
from dataclasses import dataclass


@dataclass(frozen=True)
class Work:
    """Work to cite. `CITATION.cff` describes the same works; a test compares the two.

    Parameters
    ----------
    reason : str
        What the work is cited for.
    key, kind : str
        Key and kind of the entry for BibTeX.
    title, authors, year : str
        As in the entry; several authors are joined by " and ".
    source : sequence of (field, value)
        Further fields of the entry, in the order in which text names them.
    """

    reason: str
    key: str
    kind: str
    title: str
    authors: str
    year: str
    source: tuple[tuple[str, str], ...] = ()

    def to_text(self) -> str:
        """Return the work as a line of a list of references."""
        source = [f"Version {v}" if name == "version" else v for name, v in self.source]
        parts = [self.authors, self.title, ", ".join([*source, self.year])]
        return " ".join(f"{part.removesuffix('.')}." for part in parts)

    def to_bibtex(self) -> str:
        """Return the work as an entry for BibTeX."""
        # double braces keep the case of titles and the name of a group of authors
        authors = self.authors if "," in self.authors else f"{{{self.authors}}}"
        fields = [("title", f"{{{self.title}}}"), ("author", authors), *self.source]
        lines = [f"  {name} = {{{value}}}," for name, value in (*fields, ("year", self.year))]
        return "\n".join([f"@{self.kind}{{{self.key},", *lines, "}"])


def works() -> tuple[Work, ...]:
    """Return the works to cite: netsp, and the paper that states the problem."""
    from netsp import __version__

    return (
        Work(
            "netsp",
            "netsp",
            "software",
            "netsp: shortest non-entangling tours for tethered underwater robots, with proof",
            "The netsp authors",
            "2026",
            (("version", __version__),),
        ),
        Work(
            "the Non-Entangling Travelling Salesperson Problem",
            "mccammon2017planning",
            "inproceedings",
            "Planning and executing optimal non-entangling paths for tethered underwater vehicles",
            "McCammon, Seth and Hollinger, Geoffrey A.",
            "2017",
            (("booktitle", "IEEE International Conference on Robotics and Automation"),),
        ),
    )


def run(args: argparse.Namespace) -> int:
    """Print the works, and return the exit code."""
    if args.format == "bibtex":
        print("\n\n".join(work.to_bibtex() for work in works()))
    else:
        print("\n\n".join(f"To cite {work.reason}:\n  {work.to_text()}" for work in works()))
    return 0
