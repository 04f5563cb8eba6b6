"""Export to VIPR's format: every derivation holds in exact arithmetic, by a verifier of its own."""

import json
import zlib
from fractions import Fraction
from pathlib import Path

import pytest

from netsp import Problem, solve
from netsp.base.errors import InfeasibleError, InputError
from netsp.command.main import main
from netsp.plan.proof.certify import CertifyPolicy, certify
from netsp.plan.proof.dual_search import DualSearchPolicy
from netsp.plan.proof.vipr_export import vipr

FOLDER = Path(__file__).parent.parent / "problems"

SIGN = {"G": 1, "E": 0, "L": -1}


class Wrong(Exception):
    """A derivation that does not hold."""


def verified_bound(text):
    """Return the lower bound that a file proves, by the rules of VIPR's specification 1.0."""
    words = iter(" ".join(x for x in text.splitlines() if not x.startswith("%")).split())
    take = lambda: next(words)  # noqa: E731
    expect(take() == "VER" and take() == "1.0", "version")
    expect(take() == "VAR", "VAR")
    names = [take() for _ in range(int(take()))]
    expect(len(set(names)) == len(names), "names of variables")
    expect(take() == "INT", "INT")
    whole = {int(take()) for _ in range(int(take()))}
    expect(take() == "OBJ" and take() == "min", "objective")
    objective = terms(take, take())
    expect(take() == "CON", "CON")
    rows, assumed = [], []
    count, bounds = int(take()), int(take())
    for _ in range(count):
        rows.append(row(take, objective))
        assumed.append(set())
    expect(all(len(a) == 1 for _, _, a in rows[:bounds]), "bounds come first")
    expect(take() == "RTP" and take() == "range", "RTP")
    low = Fraction(take())
    expect(take() == "inf" and take() == "SOL" and take() == "0" and take() == "DER", "DER")
    for _ in range(int(take())):
        one = row(take, objective)
        expect(take() == "{", "reason")
        kind = take()
        if kind == "asm":
            held = {len(rows)}
        elif kind == "uns":
            i, p, j, q = (int(take()) for _ in range(4))
            expect(max(i, p, j, q) < len(rows), "order of rows")
            below, above = sorted((rows[p], rows[q]), key=lambda r: SIGN[r[0]])
            expect((below[0], above[0]) == ("L", "G") and below[2] == above[2], "a split")
            expect(above[1] == below[1] + 1 and below[1].denominator == 1, "a split of integers")
            expect(below[2].keys() <= whole and integers(below[2]), "a split of integers")
            expect(dominates(rows[i], one) and dominates(rows[j], one), "domination by cases")
            held = assumed[i] - {p} | assumed[j] - {q}
        else:
            factors = terms(take, take())
            expect(kind in ("lin", "rnd") and max(factors) < len(rows), "order of rows")
            found = combination(rows, factors)
            if kind == "rnd":
                expect(found[0] != "E" and found[2].keys() <= whole and integers(found[2]), "rnd")
                up = found[0] == "G"
                found = (found[0], Fraction(-(-found[1] // 1) if up else found[1] // 1), found[2])
            expect(dominates(found, one), f"domination: {kind} gives row {len(rows)}")
            held = set().union(*(assumed[k] for k in factors))
        expect(take() == "}", "end of a reason")
        take()
        rows.append(one)
        assumed.append(held)
    expect(not assumed[-1] and dominates(rows[-1], ("G", low, objective)), "what was to be proven")
    expect(next(words, None) is None, "end of the file")
    return low


def expect(holds, what):
    if not holds:
        raise Wrong(what)


def terms(take, count):
    found = {int(take()): Fraction(take()) for _ in range(int(count))}
    expect(len(found) == int(count), "distinct indices")
    return {i: a for i, a in found.items() if a}


def row(take, objective):
    take()
    sense, rhs, first = take(), Fraction(take()), take()
    return sense, rhs, objective if first == "OBJ" else terms(take, first)


def integers(coefficients):
    return all(a.denominator == 1 for a in coefficients.values())


def combination(rows, factors):
    signs = {SIGN[rows[k][0]] * (1 if a > 0 else -1) for k, a in factors.items()} - {0}
    expect(len(signs) < 2, "signs of multipliers")
    rhs, out = Fraction(0), {}
    for k, factor in factors.items():
        rhs += factor * rows[k][1]
        for i, a in rows[k][2].items():
            out[i] = out.get(i, Fraction(0)) + factor * a
    sense = {1: "G", -1: "L"}[signs.pop()] if signs else "E"
    return sense, rhs, {i: a for i, a in out.items() if a}


def dominates(one, other):
    (sense, rhs, a), (to, limit, b) = one, other
    if not a and ((sense != "L" and rhs > 0) or (sense != "G" and rhs < 0)):
        return True
    if a != b or (to == "E" and sense != "E"):
        return False
    return {"G": sense != "L" and rhs >= limit, "L": sense != "G" and rhs <= limit,
            "E": rhs == limit}[to]  # fmt: skip


def proof_of(name, search=DualSearchPolicy()):
    path = FOLDER / f"{name}.json"
    problem = Problem.load(path)
    certificate = certify(problem, solve(problem), policy=CertifyPolicy(search=search))
    return path.read_text(), certificate.proof


FEW_CUTS = DualSearchPolicy(max_idle_rounds=0, min_rise=10.0)
"""Policy without rounds of cuts, so that the tree branches."""


def target_of(proof):
    return json.loads(zlib.decompress(proof))["target"]


@pytest.fixture(scope="module")
def branched():
    text, proof = proof_of("library/maze-20-0", FEW_CUTS)
    return proof, vipr(text, proof)


def test_a_proof_of_one_stage_is_derived():
    text, proof = proof_of("library/jacket-6-0")
    assert verified_bound(vipr(text, proof)) == target_of(proof)


def test_strikes_and_branches_of_a_proof_are_derived(branched):
    proof, file = branched
    assert verified_bound(file) == target_of(proof)
    if len(json.loads(zlib.decompress(proof))["tree"]["stages"]) == 1:
        pytest.skip("the prover closes this problem in one stage")
    assert file.count("{ rnd") > 100
    assert file.count("{ uns") > 1


def test_a_larger_bound_and_changed_numbers_are_not_derived(branched):
    proof, file = branched
    target = target_of(proof)
    with pytest.raises(Wrong, match="what was to be proven"):
        verified_bound(file.replace(f"RTP range {target} inf", f"RTP range {target + 1} inf"))
    lines = file.splitlines()
    derived = [k for k, x in enumerate(lines) if "{ lin" in x]
    for k in derived[:: len(derived) // 20 or 1]:
        head, reason = lines[k].split(" { lin ")
        count, row, factor, *rest = reason.split()
        changed = " ".join([head, "{ lin", count, row, str(int(factor) + 1), *rest])
        with pytest.raises(Wrong, match="domination"):
            verified_bound("\n".join([*lines[:k], changed, *lines[k + 1 :]]))


def test_a_file_without_a_program_is_refused():
    problem = Problem.load(FOLDER / "library" / "maze-5-0.json")
    short = problem.model_copy(update={"tether_length": 1.0})
    with pytest.raises(InfeasibleError):
        solve(short)
    proof = {"format": "netsp-proof 1", "target": None, "tree": {}}
    with pytest.raises(InputError, match="there is no program to export"):
        vipr(short.to_json(), json.dumps(proof).encode())


def test_the_command_writes_the_file_beside_the_proof(tmp_path, capsys):
    problem, proof, file = str(FOLDER / "library" / "jacket-6-0.json"), "a.proof", "a.vipr"
    proof, file, out = (str(tmp_path / name) for name in (proof, file, "tour.json"))
    words = ["solve", problem, "-o", out, "--quiet"]
    assert main([*words, "--proof", proof, "--proof-vipr", file]) == 0
    assert verified_bound(Path(file).read_text()) == target_of(Path(proof).read_bytes())
    assert main([*words, "--proof-vipr", str(tmp_path / "b.vipr")]) == 2
    assert "expected --proof FILE beside it" in capsys.readouterr().err
    assert not (tmp_path / "b.vipr").exists()
