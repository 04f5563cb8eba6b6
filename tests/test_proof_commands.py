"""Proofs on the command line: `solve --proof`, `verify --proof` and `python -m netsp_check`."""

import json
import signal
import subprocess
import sys
import time
import zlib
from pathlib import Path

import jsonschema
import pytest

from netsp import Problem, Solution
from netsp.base.errors import LimitReachedError
from netsp.command import proving
from netsp.command.main import main
from netsp.command.schema import schema_of
from netsp.model.solution import NO_PROOF, Status
from netsp.plan.proof.certify import Certificate
from netsp_check.__main__ import main as check_main

ROOT = Path(__file__).parent.parent
POOL, WHARF = (str(ROOT / "problems" / f"{name}.json") for name in ("pool", "wharf"))


@pytest.fixture(scope="module")
def pool(tmp_path_factory):
    """Tour and proof of the pool, as the command writes them."""
    folder = tmp_path_factory.mktemp("pool")
    tour, proof = str(folder / "pool.tour"), str(folder / "pool.proof")
    assert main(["solve", POOL, "-o", tour, "--proof", proof, "--quiet"]) == 0
    return tour, proof


def edited(tour, file, **fields):
    """Write a copy of a solution file with other fields, and return its name."""
    file.write_text(json.dumps(json.loads(Path(tour).read_text()) | fields))
    return str(file)


def last_check(capsys):
    """Return the line of the check that no tour is shorter."""
    lines = [s for s in capsys.readouterr().out.splitlines() if "no tour is shorter  " in s]
    assert len(lines) == 1
    return lines[0]


def refused(capsys, *words):
    """Return the line by which a command refuses its input."""
    assert main(list(words)) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    return captured.err


def test_a_proof_certifies_the_tour_in_the_file_and_by_both_commands(pool, capsys):
    tour, proof = pool
    solution = Solution.load(tour)
    assert (solution.certified, solution.certified_reason) == ("optimal", "")
    assert solution.certified_lower_bound.proves(solution.length)
    jsonschema.validate(json.loads(Path(tour).read_text()), schema_of("solution"))
    assert Solution.from_json(solution.to_json()) == solution
    assert solution.proof == "certified shortest"
    assert ", certified," in repr(solution)
    assert main(["verify", POOL, tour, "--proof", proof]) == 0
    line = last_check(capsys)
    assert line.startswith("ok")
    assert "certified shortest" in line
    assert check_main([POOL, tour, proof]) == 0
    assert "is certified shortest" in capsys.readouterr().out
    assert main(["verify", POOL, "--proof", proof]) == 0  # without a tour
    assert "29.58" in last_check(capsys)


def test_the_summary_says_what_the_claim_rests_on(pool, tmp_path, capsys):
    out, proof = str(tmp_path / "a.tour"), str(tmp_path / "a.proof")
    assert main(["solve", POOL, "-o", out]) == 0
    told = capsys.readouterr().err
    assert "proven shortest by this solver" in told
    assert "none written; --proof FILE" in told
    assert main(["solve", POOL, "-o", out, "--proof", proof]) == 0
    told = capsys.readouterr().err
    assert "certified shortest" in told
    assert f"proof    {proof}: no tour is shorter; anyone can check it" in told
    assert "s  proof      bound" in told


def test_what_no_proof_supports_is_not_checked(tmp_path, pool, capsys):
    plain, certified = str(tmp_path / "plain.tour"), pool[0]
    assert main(["solve", POOL, "-o", plain, "--quiet"]) == 0
    assert "certified" not in Path(plain).read_text()
    assert Solution.load(plain).certified_reason == NO_PROOF
    for file, says in ((plain, "optimal"), (certified, "certified: optimal")):
        assert main(["verify", POOL, file]) == 0
        line = last_check(capsys)
        assert line.startswith("?")
        assert f"says {says}; not checked" in line
        assert main(["verify", POOL, file, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["checks"][-1]["passed"] is None


def test_a_longer_tour_whose_file_says_optimal_is_found_out(pool, tmp_path, capsys):
    shortest, proof = pool
    order = str(tmp_path / "order.tour")
    assert main(["solve", POOL, "--keep-order", "-o", order, "--quiet"]) == 0
    length = Solution.load(order).length
    excess = length / Solution.load(shortest).length - 1.0
    assert excess > 0.01
    fields = {"kept_order": False, "lower_bound_of": "all_tours"}
    forged = edited(order, tmp_path / "forged.tour", **fields)
    assert main(["verify", POOL, forged]) == 0
    assert "not checked" in last_check(capsys)
    assert main(["verify", POOL, forged, "--proof", proof]) == 0
    above = f"{100.0 * excess:.3g} % above the shortest tour"
    assert f"{above}; optimal, as its file says, is not shown" in last_check(capsys)
    assert check_main([POOL, forged, proof]) == 0
    assert "not certified shortest" in capsys.readouterr().out
    fields |= {"certified": "optimal", "certified_bound": length}
    forged = edited(order, tmp_path / "forged.tour", **fields)
    assert main(["verify", POOL, forged, "--proof", proof]) == 5
    assert last_check(capsys).startswith("FAIL")


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"certified_bound": 20.0}, "below the length"),
        ({"certified_bound": 40.0}, "above length"),
        ({"certified_bound": None}, "without certified_bound"),
        ({"certified": "none"}, "yet with certified_bound"),
    ],
)
def test_a_certificate_that_contradicts_its_file_fails(fields, says, pool, tmp_path, capsys):
    assert main(["verify", POOL, edited(pool[0], tmp_path / "e.tour", **fields)]) == 5
    assert says in capsys.readouterr().out


def test_proofs_that_do_not_hold_are_refused(pool, tmp_path, capsys):
    proof = pool[1]
    data = json.loads(zlib.decompress(Path(proof).read_bytes()))
    higher = tmp_path / "higher.proof"
    higher.write_text(json.dumps(data | {"target": int(data["target"] * 1.01)}))
    broken = tmp_path / "broken.proof"
    broken.write_bytes(Path(proof).read_bytes()[:-40])
    for problem, file in ((POOL, higher), (POOL, broken), (WHARF, proof), (POOL, POOL)):
        assert main(["verify", problem, "--proof", str(file)]) == 5
        assert last_check(capsys).startswith("FAIL")
        assert check_main([problem, "-", str(file)]) == 5
        assert "NOT PROVEN" in capsys.readouterr().out


def test_margin_and_slack_of_proof_and_tour_agree(pool, tmp_path, capsys):
    tour, proof = str(tmp_path / "m.tour"), str(tmp_path / "m.proof")
    words = ["solve", POOL, "--margin", "0.05", "--slack", "0.01", "--quiet"]
    assert main([*words, "-o", tour, "--proof", proof]) == 0
    assert Solution.load(tour).certified == "optimal"
    assert main(["verify", POOL, tour, "--proof", proof]) == 0
    assert "grown by 0.05 m, 1 % slack" in last_check(capsys)
    assert main(["verify", POOL, tour, "--proof", pool[1]]) == 5
    assert "for margin 0, and the tour was planned with 0.05" in last_check(capsys)
    assert check_main([POOL, pool[0], proof]) == 5
    assert check_main([POOL, tour, proof]) == 0


def test_a_goal_out_of_reach_is_proven_out_of_reach(tmp_path, capsys):
    data = json.loads(Path(POOL).read_text()) | {"tether_length": 5.0}
    problem, proof = tmp_path / "short.json", tmp_path / "short.proof"
    problem.write_text(json.dumps(data))
    assert main(["solve", str(problem), "--proof", str(proof)]) == 3
    assert "there is no tour; anyone can check it" in capsys.readouterr().err
    for words, level in (["--proof", str(proof)], "optimal"), ([], "none"):
        out = ["-o", str(tmp_path / "short.tour"), "--json", "--quiet"]
        assert main(["solve", str(problem), *out, *words]) == 3
        assert json.loads(capsys.readouterr().out)["certified"] == level
    assert check_main([str(problem), "-", str(proof)]) == 0
    assert "there is no non-entangling tour with a tether of 5 m" in capsys.readouterr().out


def test_without_a_proof_the_solution_stays_and_no_file_is_written(monkeypatch, tmp_path, capsys):
    def late(*_, **__):
        raise LimitReachedError("time is up")

    def without(*_, **__):
        return Certificate("none", "there are more than 5000 classes")

    tour, proof = tmp_path / "a.tour", tmp_path / "a.proof"
    for stand_in, says in ((late, "time limit reached"), (without, "more than 5000 classes")):
        monkeypatch.setattr("netsp.plan.proof.certify.certify", stand_in)
        assert main(["solve", POOL, "-o", str(tour), "--proof", str(proof), "--quiet"]) == 0
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert says in err
        assert f"{proof} was not written" in err
        assert not proof.exists()
        solution = Solution.load(tour)
        assert solution.certified == "none"
        assert says in solution.certified_reason


def test_a_defect_of_the_prover_does_not_lose_the_solution(monkeypatch, tmp_path, capsys):
    def defect(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr(proving, "_certificate", defect)
    with pytest.raises(ZeroDivisionError):
        main(["solve", POOL, "--proof", str(tmp_path / "a.proof"), "--quiet"])
    assert Solution.from_json(capsys.readouterr().out).status == "optimal"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_proof_leaves_the_solution(number, tmp_path):
    code = (
        "import sys\n"
        "import netsp.plan.proof.certify as prover\n"
        "def slow(*_, on_progress, **__):\n"
        "    on_progress('bound 1')\n"
        "    while True:\n"
        "        pass\n"
        "prover.certify = slow\n"
        "from netsp.command.main import main\n"
        "sys.exit(main())\n"
    )
    tour, proof = tmp_path / "a.tour", tmp_path / "a.proof"
    words = [sys.executable, "-c", code, "solve", POOL, "-o", str(tour), "--proof", str(proof)]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as run:
        line = ""
        while "proof      bound" not in line:
            line = run.stderr.readline()
            assert line
        begin = time.monotonic()
        run.send_signal(number)
        rest = run.stderr.read()
        assert run.wait() == 0
    assert time.monotonic() - begin < 30.0
    assert "no proof: interrupted" in rest
    assert Solution.load(tour).certified_reason == "interrupted"
    assert not proof.exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--roadmap", "prm"], "expected --roadmap taut"),
        (["--keep-order"], "--keep-order"),
        (["--proof", "-"], "expected the name of a file"),
        (["--proof", ""], "expected the name of a file"),
    ],
)
def test_proofs_that_can_never_be_are_refused_before_the_work(words, says, tmp_path, capsys):
    proof = tmp_path / "a.proof"
    assert says in refused(capsys, "solve", POOL, "--proof", str(proof), *words)
    assert not proof.exists()


def test_missions_have_no_proof(tmp_path, capsys):
    mission = str(next((ROOT / "missions").glob("*.json")))
    assert "is a mission" in refused(capsys, "solve", mission, "--proof", str(tmp_path / "p"))
    assert "is a mission" in refused(capsys, "verify", mission, "--proof", POOL)


def test_a_higher_proof_raises_the_bound_of_a_feasible_tour(pool):
    solution = Solution.load(pool[0])
    weak = solution.model_copy(update={"status": Status.FEASIBLE, "lower_bound": 20.0, "gap": 0.3})
    strong = weak.with_certificate("optimal", solution.certified_bound)
    assert (strong.status, strong.lower_bound) == ("optimal", solution.certified_bound)
    bound = weak.with_certificate("bound", 25.0, "time is up")
    assert (bound.status, bound.lower_bound) == ("feasible", 25.0)
    assert bound.proof == "certified: at most 18.3 % above the shortest tour"
    assert bound.certified_reason == "time is up"
    assert Solution.from_json(bound.to_json()).certified_bound == 25.0


def test_the_long_form_is_the_same_problem_for_the_checker(tmp_path):
    data = json.loads(Path(POOL).read_text())
    first, *others = data["goals"]
    places = [g["position"] if isinstance(g, dict) else g for g in (first, others[0])]
    short = tmp_path / "short.json"
    data["goals"] = [{"name": "either", "any_of": places}, *others[1:]]
    short.write_text(json.dumps(data))
    long = tmp_path / "long.json"
    assert main(["verify", str(short), "--problem-output", str(long)]) == 0
    assert "any_of" not in long.read_text()
    assert Problem.load(long) == Problem.load(short)


def test_the_checker_refuses_unreadable_files_in_one_line(pool, tmp_path, capsys):
    tour, proof = pool
    for words in ([POOL, tour, str(tmp_path / "none")], [proof, "-", proof], [POOL, proof, proof]):
        assert check_main(words) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert "cannot be read" in err
    assert check_main([]) == 2
    capsys.readouterr()
    assert check_main(["--help"]) == 0
    assert capsys.readouterr().out.startswith("Check a proof")


def test_the_checker_says_when_a_file_is_of_another_kind(pool, tmp_path, capsys):
    tour, proof = pool
    assert check_main([POOL, POOL, proof]) == 0
    assert "states no length" in capsys.readouterr().out
    outline = tmp_path / "outline.json"
    corners = [[0, 0], [12.5, 0], [12.5, 6], [0, 6]]
    outline.write_text(json.dumps(json.loads(Path(POOL).read_text()) | {"bounds": corners}))
    assert check_main([str(outline), tour, proof]) == 5
    assert "no outline; `netsp verify PROBLEM --problem-output FILE`" in capsys.readouterr().out
    lacking = tmp_path / "lacking.proof"
    lacking.write_text('{"format": "netsp-proof 1"}')
    assert check_main([POOL, tour, str(lacking)]) == 5
    assert "damaged: 'target' is missing" in capsys.readouterr().out


def test_the_checker_runs_without_netsp_and_its_packages(pool):
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", "import runpy, sys; sys.path.insert(0, sys.argv.pop(1));"
         "runpy.run_module('netsp_check', run_name='__main__', alter_sys=True)",
         str(ROOT), POOL, *pool],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("The proof holds: no non-entangling tour with a tether of 14 m")
