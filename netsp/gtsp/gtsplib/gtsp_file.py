"""Reader of TSPLIB and GTSPLIB files: keywords, then sections of numbers.

No library reads sets of vertices: `tsplib95` (last release 2020) knows only the sections of TSPLIB.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from netsp.base.arrays import ComparesArrays, Floats, Ints
from netsp.base.deprecated import deprecated_method, deprecated_names
from netsp.base.errors import InputError
from netsp.base.files import read_text
from netsp.base.ram import check_available
from netsp.base.validated import shown
from netsp.gtsp.gtsp_policy import FilePolicy
from netsp.gtsp.gtsplib.metrics import METRICS
from netsp.gtsp.instance import BaselessInstance
from netsp.gtsp.instance import Instance as Instance_

SYMMETRIC, ASYMMETRIC = ("GTSP", "TSP"), ("AGTSP", "ATSP")
"""Types of problems; a TSP is a GTSP with one vertex in each cluster."""

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
"""Format of half a matrix: whether it is the upper half, row by row, and its distance from the
diagonal. One half of a symmetric matrix by columns is the other by rows."""

FORMATS = ("FULL_MATRIX", *TRIANGLES)


@dataclass(frozen=True, eq=False)
class GtsplibInstance(ComparesArrays):
    """A generalised TSP.

    Parameters
    ----------
    name : str
        Name in the file.
    costs : ndarray, shape (n, n)
        Symmetric costs.
    clusters : ndarray of int, shape (n,)
        Cluster of each vertex, from 0.
    places : ndarray, shape (n, 2), optional
        Coordinates of the vertices, for a picture.

    Examples
    --------
    >>> ring = load("examples/7ring28.gtsp")
    >>> ring.summary
    '28 vertices in 7 clusters of 4 to 4'
    """

    name: str
    costs: Floats
    clusters: Ints
    places: Floats | None = None

    @property
    def summary(self) -> str:
        """One line with the numbers of vertices and clusters."""
        sizes = np.bincount(self.clusters)
        return (
            f"{len(self.clusters)} vertices in {len(sizes)} clusters of {sizes.min()} to "
            f"{sizes.max()}"
        )

    def to_instance(self) -> Instance_:
        """Return the instance, without a base, for `netsp.solve_graph`.

        Its vertex k is the file's vertex k + 1.

        Raises
        ------
        InputError
            Asymmetric costs, or no tour of finite cost.
        """
        return BaselessInstance.from_costs(self.costs, self.clusters, base=None)

    to_travel_graph = deprecated_method("to_travel_graph", "to_instance")


def load(path: str | Path, policy: FilePolicy = FilePolicy()) -> GtsplibInstance:
    """Read a file in TSPLIB's format, with the sets of GTSPLIB.

    Parameters
    ----------
    path : str or Path
        File; ``-`` for standard input.
    policy : FilePolicy
        Size of the files that are read.

    Raises
    ------
    InputError
        The file is malformed, its sets overlap or its costs are asymmetric; names the line.
    MemoryLimitError
        There is no room for the costs.

    Examples
    --------
    >>> from netsp import solve_graph
    >>> from netsp.gtsp.gtsplib import load
    >>> instance = load("examples/7ring28.gtsp")
    >>> solve_graph(instance.to_instance()).length
    136.0
    """
    return _Reader(str(path), read_text(path), policy).read()


class _Reader:
    """Reader of one file: values of its keywords, and tokens of its sections with their lines."""

    def __init__(self, path: str, text: str, policy: FilePolicy) -> None:
        self.path, self.policy = path, policy
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
        """Return an error in a line of the file, or in the file as a whole."""
        return InputError(f"{self.path}: {'' if line is None else f'line {line}: '}{text}")

    def read(self) -> GtsplibInstance:
        kind = self.values.get("TYPE", "GTSP").upper()
        if kind not in (*SYMMETRIC, *ASYMMETRIC):
            known = ", ".join((*SYMMETRIC, *ASYMMETRIC))
            raise self.wrong(None, f"TYPE: expected one of {known}, got {shown(kind)}")
        n = self.whole("DIMENSION", 1, self.policy.max_vertices)
        size = self.policy.bytes_per_leg * n * n
        check_available(
            size, f"{self.path}: the legs among {n} vertices", "take a smaller instance"
        )
        metric = self.values.get("EDGE_WEIGHT_TYPE", "EUC_2D").upper()
        if metric == "EXPLICIT":
            costs, places = self.matrix(n), None
        elif metric in METRICS:
            dimensions, measure = METRICS[metric]
            places = self.places(n, dimensions)
            costs = measure(places)
        else:
            expected = f"EXPLICIT or one of {', '.join(METRICS)}"
            raise self.wrong(None, f"EDGE_WEIGHT_TYPE: expected {expected}, got {shown(metric)}")
        np.fill_diagonal(costs, 0.0)
        self.check_symmetric(costs)
        clusters = self.sets(n) if "GTSP_SET_SECTION" in self.sections else None
        if clusters is None:
            if kind in ("GTSP", "AGTSP"):
                raise self.wrong(None, "GTSP_SET_SECTION: expected one in a GTSP, got none")
            clusters = np.arange(n)
        flat = None if places is None else places[:, :2]
        name = self.values.get("NAME", "") or Path(self.path).stem
        return GtsplibInstance(name, costs, clusters, flat)

    def whole(self, name: str, minimum: int, maximum: int) -> int:
        """Return the value of a keyword, a whole number."""
        text = self.values.get(name)
        if text is None:
            raise self.wrong(None, f"{name}: expected a number from {minimum} on, got none")
        if not (text.isascii() and text.isdigit() and len(text) < 10):
            raise self.wrong(None, f"{name}: expected a whole number, got {shown(text)}")
        if not minimum <= int(text) <= maximum:
            raise self.wrong(None, f"{name}: expected {minimum} to {maximum}, got {text}")
        return int(text)

    def numbers(self, section: str, count: int, what: str) -> list[tuple[int, float]]:
        """Return the numbers of a section, with their lines."""
        tokens = self.sections.get(section)
        if tokens is None:
            raise self.wrong(None, f"{section}: expected {what}, got none")
        if len(tokens) != count:
            raise self.wrong(
                tokens[-1][0] if tokens else None,
                f"{section}: expected {what}, {count} numbers, got {len(tokens)}",
            )
        return [(line, self.number(line, token)) for line, token in tokens]

    def number(self, line: int, token: str) -> float:
        try:
            value = float(token)
        except ValueError:
            value = np.nan
        if not abs(value) <= 1e100:
            raise self.wrong(line, f"expected a number, got {shown(token)}")
        return value

    def vertex(self, line: int, token: str, n: int) -> int:
        """Return a vertex, counted from 0; the file counts from 1."""
        value = self.number(line, token)
        if value != int(value) or not 1 <= value <= n:
            raise self.wrong(line, f"expected a vertex from 1 to {n}, got {shown(token)}")
        return int(value) - 1

    def places(self, n: int, dimensions: int) -> Floats:
        """Return the coordinates (n, k)."""
        expected = f"a number and {dimensions} coordinates for each of {n} vertices"
        tokens = self.numbers("NODE_COORD_SECTION", n * (dimensions + 1), expected)
        rows = [tokens[k : k + dimensions + 1] for k in range(0, len(tokens), dimensions + 1)]
        out = np.full((n, dimensions), np.nan)
        for (line, number), *coordinates in rows:
            v = self.vertex(line, f"{number:g}", n)
            if not np.isnan(out[v, 0]):
                raise self.wrong(line, f"vertex {v + 1} is there twice")
            out[v] = [x for _, x in coordinates]
        return out

    def matrix(self, n: int) -> Floats:
        """Return the costs (n, n) that the file lists."""
        form = self.values.get("EDGE_WEIGHT_FORMAT", "FULL_MATRIX").upper()
        if form not in FORMATS:
            raise self.wrong(
                None, f"EDGE_WEIGHT_FORMAT: expected one of {', '.join(FORMATS)}, got {shown(form)}"
            )
        section = "EDGE_WEIGHT_SECTION"
        if form == "FULL_MATRIX":
            tokens = self.numbers(section, n * n, f"a row for each of {n} vertices")
            return np.array([x for _, x in tokens]).reshape(n, n)
        upper, off = TRIANGLES[form]
        rows, columns = np.triu_indices(n, off) if upper else np.tril_indices(n, -off)
        tokens = self.numbers(section, len(rows), f"half a matrix of {n} vertices ({form})")
        out = np.zeros((n, n))
        out[rows, columns] = out[columns, rows] = [x for _, x in tokens]
        return out

    def check_symmetric(self, costs: Floats) -> None:
        """Raise InputError for asymmetric costs."""
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
        """Return the cluster (n,) of each vertex."""
        tokens = self.sections["GTSP_SET_SECTION"]
        groups: list[tuple[int, list[tuple[int, str]]]] = []
        open_: list[tuple[int, str]] = []
        for line, token in tokens:
            if token == "-1":
                if not open_:
                    raise self.wrong(line, "expected the number of a set before -1")
                groups.append((open_[0][0], open_))
                open_ = []
            else:
                open_.append((line, token))
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
        """Write a set's number at its members, and check that no vertex is in two sets."""
        for line, token in members:
            v = self.vertex(line, token, len(out))
            if out[v] == cluster:
                raise self.wrong(line, f"vertex {v + 1} is in set {cluster + 1} twice")
            if out[v] >= 0:
                raise self.wrong(
                    line,
                    f"vertex {v + 1} is in the sets {out[v] + 1} and {cluster + 1}; expected each "
                    "vertex in one",
                )
            out[v] = cluster


__getattr__ = deprecated_names(globals(), Instance="GtsplibInstance")
