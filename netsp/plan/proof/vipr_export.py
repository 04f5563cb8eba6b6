"""Export of a proof's program to the format of VIPR, for a second opinion on its arithmetic.

The format (version 1.0) is that of Cheung, Gleixner and Steffy, "Verifying Integer Programming
Results" (IPCO 2017). Variables are the legs and vertices that the first stage of the proof leaves
over; if that stage closes the proof, the legs within its reach. From this program the file derives
that the objective is at least the target: by the duals of all further stages, reduced-cost fixing
and branching. The file takes from the proof, without deriving it, the costs of legs, that no other
legs are in shorter tours, and that the cuts hold: VIPR does not know what a tour is.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from netsp.base.errors import InputError
from netsp_check.dual_bound import UNLIMITED, Bound, Pair, Stage, read_cut
from netsp_check.leg_bounds import LegBounds
from netsp_check.proof_check import cover, read_proof

Terms = dict[int, Fraction | int]  # by the number of a variable, or of a row


def vipr(problem_text: str, proof: bytes) -> str:
    """Return VIPR's file for a proof that holds; raise InputError if there is no such file."""
    return _Program(problem_text, read_proof(proof)).text()


class _Program(Bound):
    """Program over the legs that the first stage leaves, and derivations along the tree.

    Variables are numbered legs first. Row i says that variable i is at least 0. `dead` has rows
    that say that a variable is at most 0, and `ones` that a pair of clusters is adjacent.
    """

    def __init__(self, problem_text: str, proof: dict[str, Any]) -> None:
        if proof["target"] is None or not proof["tree"].get("stages"):
            raise InputError(
                "proof: the tether is too short for some goal, so there is no program to export"
            )
        super().__init__(tree := cover(problem_text, proof), LegBounds(tree), proof["target"])
        self._cuts = [read_cut(cut, self.cluster) for cut in proof.get("cuts", ())]
        self._tree, self._cap = dict(proof["tree"]), UNLIMITED
        first = Stage(self._tree["stages"][0], self._cuts, self.cluster, set())
        alive = self.reachable()
        vertices, kept = self._strike_out(first, alive, None)
        if self._is_possible(vertices):
            self._tree["stages"] = self._tree["stages"][1:]
        else:
            vertices, near, self._cap = alive, self._near_legs(first, alive), first.reach
            kept = {leg for leg in near if self._price(first, *leg) < first.reach}
        self._legs = sorted(kept)
        self._cost: Terms = {k: self.legs.bound(*leg, 2) for k, leg in enumerate(self._legs)}
        self._number = {v: len(kept) + k for k, v in enumerate(sorted(vertices))}
        self._rows: list[tuple[str, Fraction | int, Terms]] = []
        self._lines: list[str] = []
        for i in range(len(kept) + len(vertices)):
            self._add("G", 0, {i: 1})
        self._groups = [[k, *(self._number[v] for v in e)] for k, e in enumerate(self._legs)]
        ends = [(k, x) for k, *both in self._groups for x in both]
        self._degree: dict[int, int] = {}
        self._members: list[list[int]] = [[] for _ in range(self.clusters)]
        for v, x in self._number.items():
            at = {k: 1 for k, y in ends if x == y}
            self._degree[x] = self._add("E", 0, {x: -2, **at})
            self._members[self.cluster[v]].append(x)
        self._once = [self._add("E", 1, dict.fromkeys(m, 1)) for m in self._members]
        self._link = {(k, x): self._add("L", 0, {k: 1, x: -1}) for k, x in ends}
        self._cut_rows = []
        for n, cut in enumerate(self._cuts):  # reduced costs by it alone are negated coefficients
            r = self._reduced({"a": [0] * self.clusters, "cuts": [[n, 1]]}, {}, {})
            self._cut_rows.append(self._add("G", cut.constant, {k: -a for k, a in r.items()}))

    def text(self) -> str:
        """Return the content of the file."""
        cost, target = self._cost, self.target
        constraints = len(self._lines)
        self._below = self._add("L", target - 1, cost, "{ asm } -1", "OBJ")
        above = self._add("G", target, cost, "{ asm } -1", "OBJ")
        end = self._close(self._tree, {}, {})
        self._add("G", target, cost, f"{{ uns {end} {self._below} {above} {above} }} -1", "OBJ")
        names = [f"y{u}_{v}" for u, v in self._legs] + [f"x{v}" for v in self._number]
        about, n = (__doc__ or "").strip().replace("\n", "\n% "), len(names)
        lines = [f"% {about}", "VER 1.0", f"VAR {n}", *names, f"INT {n}", *map(str, range(n))]
        lines += ["OBJ min", _shown(cost), f"CON {constraints} {n}", *self._lines[:constraints]]
        lines += [f"RTP range {target} inf", "SOL 0", f"DER {len(self._lines) - constraints}"]
        return "\n".join([*lines, *self._lines[constraints:], ""])

    def _reduced(self, data: Any, ones: dict[Pair, int], costs: dict[int, Any]) -> dict[int, int]:
        """Return the exact reduced costs of all legs in a stage."""
        stage, legs = Stage(data, self._cuts, self.cluster, set(ones)), enumerate(self._legs)
        stage.reach = UNLIMITED
        return {k: stage.reduced(*e, costs.get(k, 0), self._pair(*e)) for k, e in legs}

    def _add(self, sense: str, rhs: Fraction | int, a: Terms, why: str = "", obj: str = "") -> int:
        a = {i: factor for i, factor in a.items() if factor}
        self._lines.append(f"C{len(self._rows)} {sense} {rhs} {obj or _shown(a)} {why}".rstrip())
        self._rows.append((sense, rhs, a))
        return len(self._rows) - 1

    def _derive(self, terms: Terms, rule: str = "lin") -> int:
        """Add a combination of rows as "at most", rounded down by the rule "rnd"."""
        terms = {k: factor for k, factor in terms.items() if factor}
        rhs, a = self._total(terms)
        rhs = rhs // 1 if rule == "rnd" else rhs
        return self._add("L", rhs, a, f"{{ {rule} {_shown(terms)} }} -1")

    def _total(self, terms: Terms) -> tuple[Fraction | int, Terms]:
        a: Terms = {}
        for k, factor in terms.items():
            for i, coefficient in self._rows[k][2].items():
                a[i] = a.get(i, 0) + factor * coefficient
        return sum(factor * self._rows[k][1] for k, factor in terms.items()), a

    def _close(self, node: dict[str, Any], dead: dict[int, int], ones: dict[Pair, int]) -> int:
        """Return a row that shows a node to be impossible."""
        for data in (*node.get("stages", ()), None):
            for once, members in zip(self._once, self._members, strict=True):
                if dead.keys() >= set(members):
                    return self._derive({once: -1, **{dead[x]: 1 for x in members}})
            if data and (end := self._fix(data, dead, ones)) is not None:
                return end
        if "pair" not in node and "vertex" not in node:
            raise InputError(
                "proof: precedences close a branch, and the program for VIPR has no precedences"
            )
        kinds = ("apart", "next") if "pair" in node else ("without", "at")
        pair = tuple(sorted(node.get("pair", ())))
        chosen = [k for k, leg in enumerate(self._legs) if self._pair(*leg) == pair]
        chosen += [x for v, x in self._number.items() if v == node.get("vertex")]
        if not chosen:
            return self._close(node[kinds[0]], dead, ones)
        off, on = dict(dead), dict(dead)
        a: Terms = dict.fromkeys(chosen, 1)
        low, high = self._add("L", 0, a, "{ asm } -1"), self._add("G", 1, a, "{ asm } -1")
        for i in chosen:
            off[i] = self._derive({low: 1, **dict.fromkeys({*chosen} - {i}, -1)})
        if "vertex" in node:
            c = self.cluster[node["vertex"]]
            others = {*self._members[c]} - {*chosen}
            for x in others:
                on[x] = self._derive(
                    {self._once[c]: 1, high: -1, **dict.fromkeys(others - {x}, -1)}
                )
        more = {**ones, pair: high} if pair else ones
        ends = self._close(node[kinds[0]], off, ones), self._close(node[kinds[1]], on, more)
        return self._add("G", 1, {}, f"{{ uns {ends[0]} {low} {ends[1]} {high} }} -1")

    def _fix(self, data: dict[str, Any], dead: dict[int, int], ones: dict[Pair, int]) -> int | None:
        """Derive what a stage strikes out (Lemma 13), or return a row that closes the node."""
        self._drop_legs(dead)
        lowest: dict[int, list[tuple[int, int]]] = {x: [(self._cap, -1)] * 2 for x in self._degree}
        reduced = self._reduced(data, ones, self._cost)
        for k, x in self._link:
            lowest[x] = sorted([*lowest[x], (reduced[k], k)])[:2] if k not in dead else lowest[x]
        terms: Terms = {self._below: 2}
        for k, b in data["cuts"]:  # a cut may be listed twice
            terms[self._cut_rows[k]] = terms.get(self._cut_rows[k], 0) - 2 * b
        terms |= {ones[min(g, h), max(g, h)]: -2 * price for g, h, price in data.get("p", ())}
        for once, members, price in zip(self._once, self._members, data["a"], strict=True):
            left = [x for x in members if x not in dead]
            terms[once] = -4 * price - min(lowest[x][0][0] + lowest[x][1][0] for x in left)
            for x in members:
                (first, k), (second, _) = lowest[x]
                terms[self._degree[x]] = -2 * price - (second if x in left else 0)
                if x in left and k >= 0:
                    terms[self._link[k, x]] = second - first
        rhs, a = self._total(terms)
        for i in [i for i in a if a[i] and (rhs < 0 or i in dead)]:
            terms[i if a[i] > 0 else dead[i]] = -a[i]
        row = self._derive(terms)
        if rhs < 0:
            return row
        weight = {i: self._rows[row][2].get(i, 0) for i in (*self._cost, *self._degree)}
        self._strike(row, [[x] for x in self._degree if x not in dead and weight[x] > rhs], dead)
        self._drop_legs(dead)
        legs = [g for g in self._groups if g[0] not in dead]
        self._strike(row, [g for g in legs if sum(weight[i] for i in g) > rhs], dead)
        return None

    def _drop_legs(self, dead: dict[int, int]) -> None:
        """Derive that legs at vertices that are not visited are not used."""
        for (k, x), row in self._link.items():
            if x in dead and k not in dead:
                dead[k] = self._derive({row: 1, dead[x]: 1})

    def _strike(self, row: int, groups: list[list[int]], dead: dict[int, int]) -> None:
        """Derive of each group that its first variable, which is at most the others, is 0."""
        weight, half = self._rows[row][2], len(groups) // 2
        rest: Terms = {i: -weight[i] for i in weight.keys() - {i for g in groups for i in g}}
        if half:  # in halves, so that rows get shorter
            row = self._derive({row: 1, **rest})
            self._strike(row, groups[:half], dead)
            self._strike(row, groups[half:], dead)
        elif groups:
            first, *others = groups[0]
            total = sum(weight.get(i, 0) for i in groups[0])
            rest |= {row: 1, **{self._link[first, x]: weight.get(x, 0) for x in others}}
            dead[first] = self._derive({k: Fraction(f, total) for k, f in rest.items()}, "rnd")


def _shown(terms: Terms) -> str:
    return " ".join([str(len(terms)), *(f"{i} {a}" for i, a in terms.items())])
