"""Programs talk to the commands: `-` is standard input and output, `--json` a summary."""

import io
import json
import subprocess
import sys
from pathlib import Path

import pytest

from netsp import Problem, Solution, solve
from netsp.base import files
from netsp.command.main import main

ROOT = Path(__file__).parent.parent
WHARF = ROOT / "problems" / "wharf.json"


def run_alone(*args, stdin=""):
    """In a process of its own, as a program would."""
    return subprocess.run(
        [sys.executable, "-m", "netsp", *map(str, args)],
        input=stdin, capture_output=True, text=True, timeout=120,
    )  # fmt: skip


@pytest.fixture
def run(capfd, monkeypatch):
    """In this process, with what is written to the descriptors: most of what a process of its own
    takes are imports."""

    def run(*args, stdin=""):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(stdin.encode())))
        files._standard_input.cache_clear()  # a process reads it but once
        capfd.readouterr()
        words = ["netsp", *map(str, args)]
        code = main(words[1:])
        return subprocess.CompletedProcess(words, code, *capfd.readouterr())

    yield run
    files._standard_input.cache_clear()


@pytest.fixture(scope="module")
def tour(tmp_path_factory):
    file = tmp_path_factory.mktemp("streams") / "tour.json"
    problem = Problem.load(WHARF)
    solve(problem, solver="greedy").save(file)
    return file


def test_a_problem_comes_from_standard_input_and_its_tour_goes_to_standard_output():
    words = ("solve", "-", "-o", "-", "--solver", "greedy", "--quiet")
    done = run_alone(*words, stdin=WHARF.read_text())
    assert done.returncode == 0, done.stderr
    found = Solution.from_json(done.stdout)
    assert found.length == solve(Problem.load(WHARF), solver="greedy").length


def test_a_mission_comes_from_standard_input_with_its_scene_beside_where_one_is(run):
    mission = json.loads((ROOT / "missions" / "basin.json").read_text())
    mission["scene"] = str(ROOT / "missions" / mission["scene"])
    mission["waypoints"] = mission["waypoints"][:2]
    done = run("simulate", "-", "--quiet", stdin=json.dumps(mission))
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["visited"] == 2


def test_what_is_wrong_on_standard_input_is_told_in_a_line():
    done = run_alone("solve", "-", stdin='{"schema_version": 1, "base": [0, 0]}')
    assert done.returncode == 2
    assert done.stderr.startswith("netsp: -: ")
    assert done.stderr.count("\n") == 1


def test_the_summary_of_a_solution_is_that_of_its_file(run, tmp_path):
    file = tmp_path / "tour.json"
    done = run("solve", WHARF, "--solver", "greedy", "--json", "--quiet", "-o", file)
    told, found = json.loads(done.stdout), Solution.load(file)
    assert told["length"] == found.length
    assert told["status"] == found.status.value
    assert told["lower_bound"] == found.lower_bound
    assert len(told["order"]) == len(found.tour)
    assert told["longest_tether"] == max(v.tether_length for v in found.tour)


def test_a_summary_and_data_do_not_share_standard_output(run):
    for output in ((), ("-o", "-")):
        done = run("solve", WHARF, "--json", *output)
        assert done.returncode == 2
        assert not done.stdout
        assert "--json" in done.stderr


def test_a_verdict_says_which_check_fails(run, tmp_path, tour):
    good = run("verify", WHARF, tour, "--json")
    assert good.returncode == 0
    assert json.loads(good.stdout)["verified"] is True
    data = json.loads(tour.read_text())
    data["length"] += 1.0
    (tmp_path / "wrong.json").write_text(json.dumps(data))
    bad = run("verify", WHARF, tmp_path / "wrong.json", "--json")
    assert bad.returncode == 5
    told = json.loads(bad.stdout)
    assert told["verified"] is False
    assert "length is right" in [c["name"] for c in told["checks"] if not c["passed"]]


def test_a_run_tells_the_summary_that_it_writes(run, tmp_path, tour):
    done = run("execute", WHARF, tour, "--json", "--quiet", "-o", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == json.loads((tmp_path / "run" / "summary.json").read_text())


def test_what_is_several_files_or_goes_on_later_does_not_go_to_standard_output(run, tour):
    for args in (
        ("execute", WHARF, tour, "-o", "-"),
        ("compare", "-o", "-", "--goals", "3", "--tethers", "200", "--solvers", "greedy"),
        ("plot", WHARF, "-o", "-"),
    ):
        done = run(*args)
        assert done.returncode == 2, args
        assert done.stderr.count("\n") == 1, done.stderr
        assert not (Path.cwd() / "-").exists()


def test_what_has_no_tour_is_a_summary_too_with_the_tether_that_it_takes(run, tmp_path):
    data = {**json.loads(WHARF.read_text()), "tether_length": 12.0}
    (tmp_path / "short.json").write_text(json.dumps(data))
    done = run("solve", tmp_path / "short.json", "--json", "-o", tmp_path / "x.json")
    assert done.returncode == 3
    told = json.loads(done.stdout)
    assert told["status"] == "infeasible"
    assert told["goal"] == "B4"  # of those out of reach, the farthest
    assert done.stderr.strip().splitlines()[-1].startswith("netsp: goal B4 is out of reach")
    data["tether_length"] = told["needed"] + 1e-3
    (tmp_path / "enough.json").write_text(json.dumps(data))
    assert run("solve", tmp_path / "enough.json", "--quiet", "-o", "-").returncode == 0


def test_import_export_and_combine_say_as_json_what_they_did(run, tmp_path, tour):
    done = run("import", ROOT / "examples" / "site.geojson", "-o", tmp_path / "p.json", "--json")
    summary = json.loads(done.stdout)
    problem = Problem.load(tmp_path / "p.json")
    assert summary["goals"] == len(problem.goals)
    assert summary["tether_length"] == problem.tether_length
    done = run("import", ROOT / "examples" / "site.geojson", "--json")
    assert done.returncode == 2
    assert "--json" in done.stderr
    plan = tmp_path / "w.csv"
    done = run("export", tour, "--problem", WHARF, "-o", plan, "--json")
    summary = json.loads(done.stdout)
    assert summary["stops"] == 8
    assert summary["waypoints"] == len(plan.read_text().splitlines()) - 1
    rows = tmp_path / "rows.jsonl"
    rows.write_text("")
    study = ["--goals", "3", "--tethers", "150", "--solvers", "greedy", "--worlds", "2"]
    assert run("compare", *study, "-o", rows, "--quiet").returncode == 0
    done = run("combine", rows, "-o", tmp_path / "all.jsonl", "--json")
    assert json.loads(done.stdout)["trials"] == 2


def test_reports_and_films_read_a_solution_from_standard_input(run, tmp_path, tour):
    text = Path(tour).read_text()
    page = run("report", "-", "--problem", WHARF, "-o", "-", stdin=text).stdout
    assert page.startswith("<!doctype html>")
    file = tmp_path / "x.gif"
    more = ["-o", file, "--seconds", "1", "--quiet"]
    assert run("animate", "-", "--problem", WHARF, *more, stdin=text).returncode == 0
    assert file.read_bytes().startswith(b"GIF8")
