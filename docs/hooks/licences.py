"""What netsp needs of other packages, and under which licences: a bill for the page, and for the
test that knows which licences go with ours."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from importlib import metadata

from packaging.requirements import Requirement

EXTRAS = ("prm", "online", "geo", "mavlink", "app", "cluster", "video")
"""Of netsp, but for those that only its own development needs."""

PERMISSIVE = re.compile(
    r"MIT|BSD|ISC|Apache|Python Software Foundation|PSF|HPND|0BSD|Zlib|CC0|Unlicense|Public Domain",
    re.IGNORECASE,
)
"""Licences that ask for no more than to be named."""

LIMITED = re.compile(r"Mozilla|MPL|Lesser General Public|LGPL|Eclipse|EPL", re.IGNORECASE)
"""Licences that ask something of who changes the package itself, and nothing of who uses it."""


@dataclass
class Needed:
    """A package that is needed.

    Parameters
    ----------
    name : str
        Of the package.
    version : str
        That is installed here.
    licence : str
        As it says itself.
    by : set of str
        Extras of netsp that need it; "" without any.
    """

    name: str
    version: str
    licence: str
    by: set[str] = field(default_factory=set)

    @property
    def allowed(self) -> bool:
        """Whether netsp may use it and stay under its own licence."""
        return bool(PERMISSIVE.search(self.licence) or LIMITED.search(self.licence))


def bill() -> list[Needed]:
    """Every package that is installed because netsp, or one of its extras, asks for it."""
    found: dict[str, Needed] = {}
    for extra in ("", *EXTRAS):
        seen: set[tuple[str, str]] = set()
        waiting = [("netsp", extra)]
        while waiting:
            name, asked = waiting.pop()
            key = re.sub(r"[-_.]+", "-", name).lower()
            if (key, asked) in seen:
                continue
            seen.add((key, asked))
            try:
                package = metadata.distribution(name)
            except metadata.PackageNotFoundError:
                continue  # not for this platform, or this Python
            if key != "netsp":
                found.setdefault(key, Needed(key, package.version, licence_of(package)))
                found[key].by.add(extra)
            for line in package.requires or ():
                need = Requirement(line)
                if need.marker is None or need.marker.evaluate({"extra": asked}):
                    waiting += [(need.name, e) for e in ("", *need.extras)]
    return [found[name] for name in sorted(found)]


def licence_of(package: metadata.Distribution) -> str:
    """The licence as a package's metadata have it."""
    about = package.metadata
    told = about.get("License-Expression")
    if told:
        return str(told)
    classes = [
        line.split(" :: ")[-1]
        for line in about.get_all("Classifier") or ()
        if line.startswith("License :: ") and line.count(" :: ") > 1
    ]
    return "; ".join(classes) or (about.get("License") or "not told").strip().split("\n")[0]


def table() -> list[str]:
    """The bill as a table of Markdown."""
    rows = ["| package | version here | licence | needed by |", "|---|---|---|---|"]
    for needed in bill():
        by = "netsp" if "" in needed.by else ", ".join(f"`netsp[{e}]`" for e in sorted(needed.by))
        rows.append(f"| {needed.name} | {needed.version} | {needed.licence} | {by} |")
    return rows
