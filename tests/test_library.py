"""The library of problems: records, contributions, and the ranking of solvers."""

import hashlib
import json
import shutil
import signal
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np
import pytest

from netsp import Problem, Solution, solve, verify
from netsp.base.errors import InputError, VerificationError
from netsp.command.main import main
from netsp.model.bound_scope import LowerBound, Scope
from netsp.plan.proof.certify import certify
from netsp.study.library import Library, Record, rank
from netsp.study.library.rank import Row, append_row, ranking, read_rows

FOLDER = Path(__file__).parent.parent / "problems" / "library"
SMALL = "jacket-6-0"


@pytest.fixture
def small(tmp_path):
    """A library of two problems, without records."""
    for name in (SMALL, "maze-5-0"):
        shutil.copy(FOLDER / f"{name}.json", tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def tour():
    return solve(Problem.load(FOLDER / f"{SMALL}.json"))


def test_every_problem_of_the_library_has_a_verified_record_of_what_is_there():
    library = Library(FOLDER)
    assert len(library) >= 150
    assert set(library.records) == set(library.paths)
    for name in library:
        record, problem = library.records[name], library.problem(name)
        assert record.verified
        assert record.sha256 == problem.sha256
        assert problem.name == name
        assert record.lower_bound is None or record.lower_bound <= record.length * (1 + 1e-9)
        assert sorted(goal for goal, _ in record.tour) == list(range(len(problem.goals)))


@pytest.mark.parametrize("name", ["jacket-8-1", "maze-10-2", "harbour-10-3", "jetty-8-0"])
def test_a_proven_record_is_found_again(name):
    library = Library(FOLDER)
    record = library.records[name]
    found = solve(library.problem(name), seed=5)
    assert record.proven
    assert found.length == pytest.approx(record.length, rel=1e-6)


def test_the_problems_are_those_of_their_recipes():
    sys.path.insert(0, str(FOLDER.parent.parent / "benchmarks"))
    from library_worlds import recipes

    made = {r.name: r for r in recipes()}
    assert set(made) == set(Library(FOLDER).paths)
    for name in ("windfarm-9-0", "jetty-14-1", "jacket-8-2", "maze-15-0", "clustered-10-1"):
        assert made[name].problem().to_json() == (FOLDER / f"{name}.json").read_text()


def test_a_first_tour_becomes_the_record_and_a_longer_one_does_not(small, tour):
    library = Library(small)
    assert library.submit(tour, by="me", bound=tour.bound).better
    library.save()
    again = Library(small)
    assert again.records[SMALL].length == tour.length
    assert again.records[SMALL].proven
    worse = solve(again.problem(SMALL), "greedy-2016")
    assert worse.length > tour.length
    assert not again.submit(worse, by="you").better
    assert again.records[SMALL].by == "me"


def test_a_bound_that_a_contribution_states_is_not_taken(small, tour):
    library = Library(small)
    library.submit(tour, by="me")
    assert library.records[SMALL].lower_bound is None
    library.submit(tour, by="me", bound=LowerBound(0.5 * tour.length, Scope.ALL_TOURS))
    assert library.records[SMALL].lower_bound == 0.5 * tour.length


def test_a_tour_that_the_judge_refuses_is_no_record(small, tour):
    library = Library(small)
    lie = tour.model_copy(update={"length": 0.9 * tour.length})
    assert not library.compared(lie).better
    with pytest.raises(VerificationError, match="did not pass: length"):
        library.submit(lie, by="me")


def test_solutions_of_other_problems_and_of_grown_obstacles_are_refused(small, tour):
    library = Library(small)
    other = solve(Problem.load(FOLDER / "maze-5-1.json"))
    with pytest.raises(InputError, match="none of the problems"):
        library.compared(other)
    grown = tour.model_copy(update={"margin": 0.1})
    with pytest.raises(InputError, match="margin or slack"):
        library.compared(grown)


def test_check_tells_keeps_and_exits_with_5_when_the_judge_refuses(small, tour, tmp_path, capsys):
    good, bad = tmp_path / "good.sol", tmp_path / "bad.sol"
    tour.save(good)
    tour.model_copy(update={"length": 0.9 * tour.length}).save(bad)
    words = ["library", "check", str(good), "--folder", str(small)]
    assert main([*words, "--keep", "--by", "me"]) == 0
    assert "no tour of this problem was known" in capsys.readouterr().out
    assert main(words) == 0
    assert "above the best known" in capsys.readouterr().out
    assert main(["library", "check", str(bad), "--folder", str(small), "--json"]) == 5
    told = json.loads(capsys.readouterr().out)["checked"][0]
    assert (told["verified"], told["better"]) == (False, False)


def test_a_folder_without_problems_is_no_library(tmp_path, capsys):
    assert main(["library", "list", "--folder", str(tmp_path)]) == 2
    assert "there are no problems here" in capsys.readouterr().err


def in_order_of_the_file(graph):
    """A poor solver: every goal in its shortest class, in the order of the file."""
    least = [min(graph.members(k), key=lambda v: graph.costs_to_base[v])
             for k in range(1, graph.goal_count + 1)]  # fmt: skip
    return [0, *(int(v) for v in least)]


def with_records(folder, tour):
    library = Library(folder)
    library.submit(tour, by="me", bound=tour.bound)
    library.submit(solve(library.problem("maze-5-0")), by="me")
    library.save()


def test_solvers_functions_and_commands_are_ranked_by_what_the_judge_passes(
    small, tour, tmp_path, capsys
):
    with_records(small, tour)
    rows = tmp_path / "rows.jsonl"
    words = ["library", "rank", "--folder", str(small), "-o", str(rows), "--time-limit", "3"]
    script = tmp_path / "mine.py"
    script.write_text(
        "import sys\nfrom netsp import Problem, solve\n"
        "solve(Problem.load(sys.argv[1]), 'greedy').save(sys.argv[2])\n"
    )
    assert main([*words, "--solver", "lns", "--quiet"]) == 0
    assert main([*words, "--solver", "tests.test_library:in_order_of_the_file", "--label", "file",
                 "--quiet"]) == 0  # fmt: skip
    command = f"{sys.executable} {script} {{problem}} {{solution}}"
    assert main([*words, "--command", command, "--label", "mine", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["library", "rank", "--folder", str(small), "-o", str(rows), "--json"]) == 0
    ranked = json.loads(capsys.readouterr().out)["ranking"]
    assert ranked[0]["solver"] == "lns"
    assert {e["solver"] for e in ranked} == {"lns", "file", "mine"}
    assert all(e["verified"] == e["problems"] == 2 for e in ranked)
    assert np.all(np.diff([e["above"] for e in ranked]) >= 0)
    # what is there is not run again
    before = rows.read_text()
    assert main([*words, "--solver", "lns", "--quiet"]) == 0
    assert rows.read_text() == before


def test_a_command_that_fails_costs_its_row_only(small, tour, tmp_path, capsys):
    with_records(small, tour)
    rows = tmp_path / "rows.jsonl"
    command = f"{sys.executable} -c 'raise SystemExit(3)' {{problem}} {{solution}}"
    assert main(["library", "rank", "--folder", str(small), "-o", str(rows),
                 "--command", command, "--label", "bad", "--time-limit", "1"]) == 0  # fmt: skip
    assert "exit code 3" in capsys.readouterr().err
    (entry,) = ranking(Library(small), read_rows(rows))
    assert (entry["verified"], entry["above"]) == (0, 1.0)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--command", "mine"], "expected {problem} in it"),
        (["--command", "/nowhere/mine {problem} {solution}"], "/nowhere/mine: No such file"),
        (["--solver", "no.such:thing"], "cannot be imported"),
        (["--solver", "lnz"], "lnz"),
        (["--only", "nothing-*", "--solver", "lns"], "no problem of"),
        ([], "nothing to rank"),
    ],
)
def test_what_cannot_be_ranked_is_told_in_a_line(small, tour, capsys, words, told):
    with_records(small, tour)
    assert main(["library", "rank", "--folder", str(small), *words]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1


def test_a_damaged_file_of_rows_names_its_line(small, tmp_path):
    path = tmp_path / "rows.jsonl"
    row = Row(solver="a", problem=SMALL, limit=1.0, seconds=0.1, length=3.0, verified=True)
    append_row(path, row)
    assert read_rows(path) == [row]
    path.write_text(path.read_text() + '{"solver": 1}\n')
    with pytest.raises(InputError, match="line 2"):
        read_rows(path)


def test_an_unverified_tour_never_ranks_as_short(small, tour):
    with_records(small, tour)
    library = Library(small)
    short = Row(solver="liar", problem=SMALL, limit=1.0, seconds=0.1, length=1.0)
    honest = Row(solver="honest", problem=SMALL, limit=1.0, seconds=9.0,
                 length=1.5 * tour.length, verified=True)  # fmt: skip
    assert [e["solver"] for e in ranking(library, [short, honest])] == ["honest", "liar"]


def test_an_excess_that_rounds_to_zero_is_printed_without_a_sign(small, tour, tmp_path, capsys):
    with_records(small, tour)
    rows = tmp_path / "rows.jsonl"
    best = Library(small).records[SMALL].length
    append_row(rows, Row(solver="lns", problem=SMALL, limit=1.0, seconds=0.1,
                         length=best * (1.0 - 1e-9), verified=True))  # fmt: skip
    assert main(["library", "rank", "--folder", str(small), "-o", str(rows)]) == 0
    assert capsys.readouterr().out.split()[-3:-1] == ["0.000", "0.00"]


def test_a_record_says_whether_it_is_proven():
    record = Record(problem="a", sha256="b", length=10.0, lower_bound=9.0, solver="s", by="me",
                    seconds=1.0, date="2026-11-25")  # fmt: skip
    assert not record.proven
    assert record.gap == pytest.approx(0.1)
    assert record.model_copy(update={"lower_bound": 10.0}).proven


def test_a_tour_of_the_record_is_judged_when_it_is_drawn_again():
    library = Library(FOLDER)
    record = library.records[SMALL]
    problem = library.problem(SMALL)
    found = solve(problem)
    assert isinstance(found, Solution)
    assert [(v.goal, v.signature) for v in found.tour] in (
        list(record.tour), [*reversed(record.tour)]
    )  # fmt: skip
    assert verify(problem, found)


def test_ctrl_c_ends_a_ranking_and_what_it_cut_short_has_no_row(small, tour, tmp_path):
    with_records(small, tour)
    rows = tmp_path / "rows.jsonl"
    shutil.copy(FOLDER / "windfarm-9-0.json", small)
    run = subprocess.Popen(
        [sys.executable, "-m", "netsp", "library", "rank", "--folder", str(small), "-o", str(rows),
         "--solver", "lns", "--time-limit", "2"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    for line in run.stderr:
        if line.startswith("[1/3]"):
            run.send_signal(signal.SIGINT)
            break
    out, _ = run.communicate()
    assert run.returncode == 0
    assert len(read_rows(rows)) == 1
    assert "lns" in out


def fails(graph):
    raise KeyError("on purpose")


def test_a_function_that_fails_costs_its_rows_only(small, tour, tmp_path, capsys):
    with_records(small, tour)
    rows = tmp_path / "rows.jsonl"
    words = ["library", "rank", "--folder", str(small), "-o", str(rows), "--time-limit", "1"]
    assert main([*words, "--solver", "tests.test_library:fails", "--label", "bad"]) == 0
    assert "KeyError: 'on purpose'" in capsys.readouterr().err
    assert len(read_rows(rows)) == 2
    assert main([*words, "--solver", "greedy", "--label", "bad", "--quiet"]) == 0
    assert len(read_rows(rows)) == 2
    assert main([*words, "--solver", "greedy", "--label", "bad"]) == 0
    assert "are not run again" in capsys.readouterr().err


def test_what_answers_late_does_not_count(small, tour):
    with_records(small, tour)

    def slow(problem, path, limit, should_stop):
        time.sleep(0.3)
        return tour

    (row,) = rank.run(
        Library(small), [SMALL], "slow", slow, 0.1, rank.RankPolicy(max_overtime_s=0.0)
    )
    assert not row.verified
    assert row.message.startswith("late: answered after")


@pytest.fixture(scope="module")
def proof(tour):
    certificate = certify(Problem.load(FOLDER / f"{SMALL}.json"), tour)
    assert certificate.level == "optimal"
    return certificate.proof


def published(folder, tour, proof):
    library = Library(folder)
    library.submit(tour, by="me", proof=proof)
    library.save()
    return Library(folder)


def test_a_bound_is_taken_with_its_proof_which_is_published_beside_the_record(small, tour, proof):
    library = published(small, tour, proof)
    record = library.records[SMALL]
    assert record.certified == "optimal"
    assert record.lower_bound == record.proof.bound <= record.length
    assert (small / "proofs" / f"{SMALL}.proof").read_bytes() == proof
    assert library.check_published(SMALL).bound == record.proof.bound
    assert library.check_published("maze-5-0") is None


def test_a_proof_of_another_problem_or_of_a_lie_changes_nothing(small, tour, proof):
    library = Library(small)
    other = solve(library.problem("maze-5-0"))
    with pytest.raises(VerificationError, match="the proof is refused"):
        library.submit(other, by="me", proof=proof)
    lie = json.loads(zlib.decompress(proof))
    lie["target"] = int(1.001 * lie["target"])
    with pytest.raises(VerificationError, match="the proof is refused"):
        library.submit(tour, by="me", proof=zlib.compress(json.dumps(lie).encode()))
    assert not library.records
    assert not (small / "proofs").exists()


def test_a_proof_about_grown_obstacles_is_no_proof_about_the_problem(small):
    problem = Problem.load(small / f"{SMALL}.json")
    grown = solve(problem, margin=0.01)
    certificate = certify(problem, grown)
    assert certificate.level == "optimal"
    with pytest.raises(VerificationError, match=r"for margin 0\.01; expected margin 0"):
        Library(small).checked_proof(SMALL, certificate.proof)


def test_a_record_that_states_more_than_its_proof_is_found(small, tour, proof):
    library = published(small, tour, proof)
    record = library.records[SMALL]
    stated = record.proof.model_copy(update={"bound": 1.000001 * record.proof.bound})
    library.records[SMALL] = record.model_copy(update={"proof": stated})
    with pytest.raises(VerificationError, match="the proof shows the bound"):
        library.check_published(SMALL)
    library.records[SMALL] = record.model_copy(update={"length": 0.99 * record.length})
    with pytest.raises(VerificationError, match="is above the record's length"):
        library.check_published(SMALL)
    library.records[SMALL] = record.model_copy(update={"proof": None})
    with pytest.raises(VerificationError, match="the record names no proof"):
        library.check_published(SMALL)


def test_a_better_tour_keeps_the_proof_and_a_damaged_proof_is_replaced(small, tour, proof):
    library = Library(small)
    library.submit(solve(library.problem(SMALL), "greedy-2016"), by="you", proof=proof)
    assert library.records[SMALL].certified == "bound"
    library.submit(tour, by="me")
    assert library.records[SMALL].certified == "optimal"
    library.proof_path(SMALL).write_bytes(proof[:-9])
    with pytest.raises(VerificationError, match="another sha256"):
        library.check_published(SMALL)
    assert library.publish(SMALL, proof)
    assert library.check_published(SMALL)


def test_the_command_checks_a_proof_publishes_it_and_lists_what_is_certified(
    small, tour, proof, tmp_path, capsys
):
    tour.save(tmp_path / "tour.sol")
    (tmp_path / "tour.proof").write_bytes(proof)
    words = ["library", "check", str(tmp_path / "tour.sol"), "--folder", str(small)]
    assert main(words) == 0
    assert "its bound is not taken: --proof FILE takes one" in capsys.readouterr().out
    assert main([*words, "--proof", str(tmp_path / "tour.proof"), "--keep"]) == 0
    assert "the proof holds: no tour is shorter than 52.4705" in capsys.readouterr().out
    assert main(["library", "list", "--folder", str(small), "--only", SMALL]) == 0
    assert capsys.readouterr().out.split("\n")[2].split()[4:6] == ["proven", "optimal"]
    assert main(["library", "proofs", "--folder", str(small)]) == 0
    assert "published proofs that hold: 1 of 1" in capsys.readouterr().out
    (small / "proofs" / f"{SMALL}.proof").unlink()
    assert main(["library", "proofs", "--folder", str(small)]) == 5
    assert "is missing" in capsys.readouterr().out
    assert main(["library", "list", "--folder", str(small), "--proof", "x"]) == 2
    assert capsys.readouterr().err.startswith("netsp: --proof: expected")


def test_published_proofs_match_their_records_and_small_ones_hold():
    library = Library(FOLDER)
    stated = {n: r.proof for n, r in library.records.items() if r.proof is not None}
    for name, proof in stated.items():
        data = library.proof_path(name).read_bytes()
        assert hashlib.sha256(data).hexdigest() == proof.sha256
        assert proof.bound <= library.records[name].lower_bound
    assert {p.stem for p in (FOLDER / "proofs").glob("*.proof")} == set(stated)
    small = sorted(stated, key=lambda n: library.proof_path(n).stat().st_size)[:5]
    for name in small:
        assert library.check_published(name).bound == stated[name].bound
