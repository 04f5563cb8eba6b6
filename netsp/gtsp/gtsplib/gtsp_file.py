"""Reading the files: keywords, then sections of numbers.

No library reads the sets: `tsplib95` (the last release is of 2020) knows the sections of TSPLIB
alone.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from netsp.base.arrays import ComparesArrays, Floats, Ints
from netsp.base.errors import InputError
from netsp.base.files import read_text
from netsp.base.ram import check_available
from netsp.base.validated import shown
from netsp.gtsp.gtsplib.metrics import METRICS
from netsp.gtsp.travel.graph import TravelGraph

SYMMETRIC, ASYMMETRIC = ("GTSP", "TSP"), ("AGTSP", "ATSP")
"""Types of problem; a TSP is a GTSP whose clusters are its vertices."""

IGNORED = ("DISPLAY_DATA_SECTION",)

SECTIONS = ("NODE_COORD_SECTION", "EDGE_WEIGHT_SECTION", "GTSP_SET_SECTION", *IGNORED)

KEYWORDS = (
    "NAME", "TYPE", "COMMENT", "DIMENSION", "GTSP_SETS", "EDGE_WEIGHT_TYPE", "EDGE_WEIGHT_FORMAT",
    "EDGE_DATA_FORMAT", "NODE_COORD_TYPE", "DISPLAY_DATA_TYPE", "CAPACITY",
)  # fmt: skip

TRIANGLES = {
    "UPPER_ROW": (True, 1), "LOWER_COL": (True, 1),
    "LOWER_ROW": (False, 1), "UPPER_COL": (False, 1),
    "UPPER_DIAG_ROW": (True, 0), "LOWER_DIAG_COL": (True, 0),
    "LOWER_DIAG_ROW": (False, 0), "UPPER_DIAG_COL": (False, 0),
}  # fmt: skip
"""Half a matrix: whether row by row it is the upper half, and how far from the diagonal it begins.
Of a symmetric matrix, one half by columns is the other by rows."""

FORMATS = ("FULL_MATRIX", *TRIANGLES)

MOST_VERTICES = 20_000

BYTES_PER_LEG = 40.0


@dataclass(frozen=True, eq=False)
class Instance(ComparesArrays):
    """A generalised TSP.

    Parameters
    ----------
    name : str
        As the file says.
    costs : ndarray, shape (n, n)
        Symmetric.
    clusters : ndarray of int, shape (n,)
        Cluster of each vertex, from 0.
    places : ndarray, shape (n, 2), optional
        Where the vertices are, for a picture.
    """

    name: str
    costs: Floats
    clusters: Ints
    places: Floats | None = None

    @property
    def summary(self) -> str:
        """In a line."""
        sizes = np.bincount(self.clusters)
        return (
            f"{len(self.clusters)} vertices in {len(sizes)} clusters of {sizes.min()} to "
            f"{sizes.max()}"
        )

    def to_travel_graph(self) -> TravelGraph:
        """The travel graph, without a base.

        Returns
        -------
        TravelGraph
            For `netsp.solve_graph`; its vertex k is the file's vertex k + 1.

        Raises
        ------
        InputError
            Asymmetric costs, or none that make a tour.
        """
        return TravelGraph.from_costs(self.costs, self.clusters, base=None)


def load(path: str | Path) -> Instance:
    """Read a file of TSPLIB's format with the sets of GTSPLIB's.

    Parameters
    ----------
    path : str or Path
        The file; ``-`` for standard input.

    Returns
    -------
    Instance
        What it holds.

    Raises
    ------
    InputError
        Anything that is wrong, by line; overlapping sets, asymmetric costs.

    Examples
    --------
    >>> from netsp import solve_graph
    >>> from netsp.gtsp.gtsplib import load
    >>> instance = load("examples/7ring28.gtsp")
    >>> solve_graph(instance.to_travel_graph()).length
    136.0
    """
    return _Reader(str(path), read_text(path)).read()


class _Reader:
    """One file: `words` are the numbers of each section, with their lines."""

    def __init__(self, path: str, text: str) -> None:
        self.path = path
        self.values: dict[str, str] = {}
        self.sections: dict[str, list[tuple[int, str]]] = {}
        section: list[tuple[int, str]] | None = None
        for number, line in enumerate(text.lstrip("\ufeff").splitlines(), 1):
            bare = line.strip()
            keyword = re.match(r"[A-Za-z][A-Za-z_0-9]*", bare)
            if not bare:
                continue
            if keyword is None:
                if section is None:
                    raise self.wrong(number, f"expected a keyword, got {shown(bare[:40])}")
                section += [(number, w) for w in bare.split()]
                continue
            name = keyword.group().upper()
            if name == "EOF":
                break
            rest = bare[keyword.end() :].strip().removeprefix(":").strip()
            if name in SECTIONS:
                if name in self.sections:
                    raise self.wrong(number, f"{name}: is there twice")
                section = self.sections[name] = [(number, w) for w in rest.split()]
            elif name in KEYWORDS:
                self.values[name] = f"{self.values[name]} {rest}" if name in self.values else rest
                section = None
            elif section is not None:
                raise self.wrong(number, f"expected a number, got {shown(bare[:40])}")
            else:
                known = ", ".join((*KEYWORDS, *SECTIONS))
                raise self.wrong(number, f"unknown keyword {shown(name)}; expected one of {known}")

    def wrong(self, line: int | None, text: str) -> InputError:
        return InputError(f"{self.path}: {'' if line is None else f'line {line}: '}{text}")

    def read(self) -> Instance:
        kind = self.values.get("TYPE", "GTSP").upper()
        if kind not in (*SYMMETRIC, *ASYMMETRIC):
            raise self.wrong(
                None, f"TYPE: expected one of {', '.join((*SYMMETRIC, *ASYMMETRIC))}, got "
                f"{shown(kind)}",
            )  # fmt: skip
        n = self.whole("DIMENSION", 1, MOST_VERTICES)
        check_available(
            BYTES_PER_LEG * n * n, f"{self.path}: the legs among {n} vertices",
            "take a smaller instance",
        )  # fmt: skip
        metric = self.values.get("EDGE_WEIGHT_TYPE", "EUC_2D").upper()
        if metric == "EXPLICIT":
            costs, places = self.matrix(n), None
        elif metric in METRICS:
            dimensions, measure = METRICS[metric]
            places = self.places(n, dimensions)
            costs = measure(places)
        else:
            raise self.wrong(
                None, f"EDGE_WEIGHT_TYPE: expected EXPLICIT or one of {', '.join(METRICS)}, got "
                f"{shown(metric)}",
            )  # fmt: skip
        np.fill_diagonal(costs, 0.0)
        self.symmetric(costs)
        clusters = self.sets(n) if "GTSP_SET_SECTION" in self.sections else None
        if clusters is None:
            if kind in ("GTSP", "AGTSP"):
                raise self.wrong(None, "GTSP_SET_SECTION: expected one in a GTSP, got none")
            clusters = np.arange(n)
        flat = None if places is None else places[:, :2]
        name = self.values.get("NAME", "") or Path(self.path).stem
        return Instance(name, costs, clusters, flat)

    def whole(self, name: str, least: int, most: int) -> int:
        """The value of a keyword."""
        text = self.values.get(name)
        if text is None:
            raise self.wrong(None, f"{name}: expected a number from {least} on, got none")
        if not (text.isascii() and text.isdigit() and len(text) < 10):
            raise self.wrong(None, f"{name}: expected a whole number, got {shown(text)}")
        if not least <= int(text) <= most:
            raise self.wrong(None, f"{name}: expected {least} to {most}, got {text}")
        return int(text)

    def numbers(self, section: str, count: int, what: str) -> list[tuple[int, float]]:
        """A section of so many numbers, with their lines."""
        words = self.sections.get(section)
        if words is None:
            raise self.wrong(None, f"{section}: expected {what}, got none")
        if len(words) != count:
            raise self.wrong(
                words[-1][0] if words else None,
                f"{section}: expected {what}, {count} numbers, got {len(words)}",
            )
        return [(line, self.number(line, word)) for line, word in words]

    def number(self, line: int, word: str) -> float:
        try:
            value = float(word)
        except ValueError:
            value = np.nan
        if not abs(value) <= 1e100:
            raise self.wrong(line, f"expected a number, got {shown(word)}")
        return value

    def vertex(self, line: int, word: str, n: int) -> int:
        """A vertex, from 0; the file counts from 1."""
        value = self.number(line, word)
        if value != int(value) or not 1 <= value <= n:
            raise self.wrong(line, f"expected a vertex from 1 to {n}, got {shown(word)}")
        return int(value) - 1

    def places(self, n: int, dimensions: int) -> Floats:
        """(n, k) coordinates."""
        words = self.numbers(
            "NODE_COORD_SECTION", n * (dimensions + 1),
            f"a number and {dimensions} coordinates for each of {n} vertices",
        )  # fmt: skip
        rows = [words[k : k + dimensions + 1] for k in range(0, len(words), dimensions + 1)]
        out = np.full((n, dimensions), np.nan)
        for (line, number), *coordinates in rows:
            v = self.vertex(line, f"{number:g}", n)
            if not np.isnan(out[v, 0]):
                raise self.wrong(line, f"vertex {v + 1} is there twice")
            out[v] = [x for _, x in coordinates]
        return out

    def matrix(self, n: int) -> Floats:
        """(n, n) costs."""
        form = self.values.get("EDGE_WEIGHT_FORMAT", "FULL_MATRIX").upper()
        if form not in FORMATS:
            raise self.wrong(
                None, f"EDGE_WEIGHT_FORMAT: expected one of {', '.join(FORMATS)}, got {shown(form)}"
            )
        section = "EDGE_WEIGHT_SECTION"
        if form == "FULL_MATRIX":
            words = self.numbers(section, n * n, f"a row for each of {n} vertices")
            return np.array([x for _, x in words]).reshape(n, n)
        upper, off = TRIANGLES[form]
        rows, columns = np.triu_indices(n, off) if upper else np.tril_indices(n, -off)
        words = self.numbers(section, len(rows), f"half a matrix of {n} vertices ({form})")
        out = np.zeros((n, n))
        out[rows, columns] = out[columns, rows] = [x for _, x in words]
        return out

    def symmetric(self, costs: Floats) -> None:
        """InputError for asymmetric costs."""
        uneven = np.argwhere(np.triu(costs != costs.T))
        if len(uneven):
            u, v = uneven[0].tolist()
            raise self.wrong(
                None,
                f"from vertex {u + 1} to {v + 1} costs {costs[u, v]:g} and back {costs[v, u]:g}; "
                "expected symmetric costs: legs here are as long both ways, and so the bounds "
                "assume",
            )

    def sets(self, n: int) -> Ints:
        """(n,) cluster of each vertex."""
        words = self.sections["GTSP_SET_SECTION"]
        groups: list[tuple[int, list[tuple[int, str]]]] = []
        open_: list[tuple[int, str]] = []
        for line, word in words:
            if word == "-1":
                if not open_:
                    raise self.wrong(line, "expected the number of a set before -1")
                groups.append((open_[0][0], open_))
                open_ = []
            else:
                open_.append((line, word))
        if open_:
            raise self.wrong(open_[-1][0], "expected -1 at the end of a set")
        out = np.full(n, -1)
        seen: set[int] = set()
        count = self.whole("GTSP_SETS", 1, n) if "GTSP_SETS" in self.values else len(groups)
        for line, ((_, number), *members) in groups:
            if not (number.isascii() and number.isdigit()) or not 1 <= int(number) <= count:
                raise self.wrong(line, f"expected a set from 1 to {count}, got {shown(number)}")
            if int(number) in seen:
                raise self.wrong(line, f"set {number} is there twice")
            if not members:
                raise self.wrong(line, f"set {number} is empty; expected at least one vertex")
            seen.add(int(number))
            self.put(out, int(number) - 1, members)
        if len(seen) != count:
            raise self.wrong(None, f"GTSP_SET_SECTION: expected {count} sets, got {len(seen)}")
        if (out < 0).any():
            missing = int(np.argmin(out)) + 1
            raise self.wrong(None, f"vertex {missing} is in no set; expected each in one")
        return out

    def put(self, out: Ints, cluster: int, members: Sequence[tuple[int, str]]) -> None:
        for line, word in members:
            v = self.vertex(line, word, len(out))
            if out[v] == cluster:
                raise self.wrong(line, f"vertex {v + 1} is in set {cluster + 1} twice")
            if out[v] >= 0:
                raise self.wrong(
                    line,
                    f"vertex {v + 1} is in the sets {out[v] + 1} and {cluster + 1}; expected each "
                    "vertex in one",
                )
            out[v] = cluster
