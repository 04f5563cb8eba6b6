"""Comparisons survive kills, crashes and torn lines, and nothing is run twice or lost."""

import functools
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netsp import InputError, solve
from netsp.command.main import main
from netsp.plan.solver_table import SOLVERS, Solver
from netsp.study.compare.rows import RowsFile, combine, read_rows
from netsp.study.compare.study import Study, shard
from netsp.study.compare.study_run import compare
from netsp.study.compare.trial import run, thinned, world_of
from netsp.study.compare.trial_policy import TrialPolicy

ROOT = Path(__file__).resolve().parent.parent

TOML = """
name = "small"
goals = [3, 4]
tether_lengths = [200]
seeds = [0, 1]
time_limit = 20

[worlds]
count = 2
obstacles = 6

[[solvers]]
name = "greedy"

[[solvers]]
name = "anneal"
label = "short"
iteration_limit = 200
options = {hot = 0.5}
"""

BAD = """
import os, signal, time
from dataclasses import dataclass
import numpy as np

@dataclass(frozen=True)
class Params:
    pass

def crash(graph, **_):
    raise ZeroDivisionError("on purpose")

def die(graph, **_):
    os.kill(os.getpid(), signal.SIGKILL)

def leave(graph, **_):
    os._exit(7)

def hang(graph, **_):
    time.sleep(1e4)

def eat(graph, **_):
    return np.ones(1 << 33)
"""


@pytest.fixture
def study(tmp_path):
    (tmp_path / "study.toml").write_text(TOML)
    return Study.load(tmp_path / "study.toml")


def here(trials):
    """Trials in this process, where a file of rows is in question and not who makes them."""
    for trial in trials:
        yield trial, run(trial)


def without_clock(rows):
    """Rows by trial, without what differs between two runs."""
    clock = {"roadmap_s", "matrix_s", "solve_s", "total_s", "cpu_s", "history", "finished"}
    return {r["trial"]: {k: v for k, v in r.items() if k not in clock} for r in rows}


def test_every_trial_has_one_row_that_solve_confirms(study, tmp_path):
    out = tmp_path / "r.jsonl"
    seen = []
    tally = compare(study, out, jobs=2, on_row=lambda row, t: seen.append((row["trial"], t.done)))
    rows = read_rows(out)
    assert tally.done == tally.total == len(rows) == 16
    assert tally.failed == 0
    assert [r["trial"] for r in rows] == [trial for trial, _ in seen]
    assert {t.id for t in study.trials()} == {r["trial"] for r in rows}
    trials = {t.id: t for t in study.trials()}
    for row in rows:
        problem, redrawn = world_of(trials[row["trial"]])
        assert (row["problem_sha256"], row["redrawn"]) == (problem.sha256, redrawn)
        again = solve(
            problem, row["solver"]["name"], seed=row["seed"], params=row["solver"]["options"],
            iteration_limit=row["solver"]["iteration_limit"],
        )  # fmt: skip
        assert row["length"] == again.length


def test_all_solvers_see_the_same_worlds(study):
    worlds = {}
    for trial in study.trials():
        key = (trial.world["seed"], trial.world["goals"])
        worlds.setdefault(key, set()).add(world_of(trial)[0].sha256)
    assert [len(v) for v in worlds.values()] == [1] * 4


def test_a_finished_comparison_is_left_as_it_is(study, tmp_path):
    out = tmp_path / "r.jsonl"
    compare(study, out, executor=here)
    before = out.read_bytes()
    assert compare(study, out).begun == 16
    assert out.read_bytes() == before


def test_a_torn_file_is_mended_wherever_it_is_torn(tmp_path):
    study = Study.checked(
        {
            "name": "tiny", "goals": [2], "tether_lengths": [150], "solvers": [{"name": "greedy"}],
            "worlds": {"count": 4, "obstacles": 2},
        },
        "test",
    )  # fmt: skip
    out = tmp_path / "r.jsonl"
    compare(study, out, executor=here)
    data = out.read_bytes()
    ends = [k for k, c in enumerate(data) if c == ord("\n")]
    for cut in (0, 30, ends[0], ends[0] + 1, len(data) - 1):
        out.write_bytes(data[:cut])
        assert compare(study, out, executor=here).begun == data[:cut].count(b"\n")
        rows = read_rows(out)
        assert [r["trial"] for r in rows] == [t.id for t in study.trials()]


def test_kill_nine_loses_only_what_was_running(tmp_path):
    (tmp_path / "study.toml").write_text(TOML.replace("count = 2", "count = 40"))
    out = tmp_path / "r.jsonl"
    command = [
        sys.executable,
        "-m",
        "netsp",
        "compare",
        str(tmp_path / "study.toml"),
        "-o",
        str(out),
    ]
    with subprocess.Popen([*command, "--jobs", "2", "--quiet"], cwd=ROOT) as process:
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and (not out.exists() or out.stat().st_size < 8000):
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    before = read_rows(out)
    assert 0 < len(before) < 320
    time.sleep(0.5)  # orphaned workers see their pipe close
    study = Study.load(tmp_path / "study.toml")
    part = shard(list(study.trials()), 1, 8)
    compare(study, out, part=(1, 8), executor=here)
    rows = read_rows(out)
    assert rows[: len(before)] == before
    ids = [r["trial"] for r in rows]
    assert len(ids) == len(set(ids))
    assert {t.id for t in part} <= set(ids)


def test_shards_are_a_partition_and_combine_to_the_whole(study, tmp_path):
    parts = [tmp_path / f"{k}.jsonl" for k in (1, 2, 3)]
    for k, path in enumerate(parts, start=1):
        compare(study, path, part=(k, 3), executor=here)
    assert sum(len(read_rows(p)) for p in parts) == 16
    joined, whole = tmp_path / "joined.jsonl", tmp_path / "whole.jsonl"
    assert combine([str(p) for p in [*parts, parts[0]]], str(joined)) == 16
    compare(study, whole)
    assert without_clock(read_rows(joined)) == without_clock(read_rows(whole))


def test_solvers_that_crash_hang_or_eat_cost_one_row_each(tmp_path, monkeypatch):
    names = {"crash": "crashed", "die": "killed", "leave": "crashed", "hang": "timeout"}
    names["eat"] = "out_of_memory"
    (tmp_path / "badsolvers.py").write_text(BAD)
    patch = f"""
        import sys
        sys.path.insert(0, {str(ROOT)!r})
        from netsp.plan.solver_table import SOLVERS, Solver
        for name in {sorted(names)}:
            SOLVERS[name] = Solver(name, f"badsolvers:{{name}}")
    """
    (tmp_path / "sitecustomize.py").write_text(textwrap.dedent(patch))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in names:
        monkeypatch.setitem(SOLVERS, name, Solver(name, f"badsolvers:{name}"))
    study = Study.checked(
        {
            "name": "bad", "goals": [2], "tether_lengths": [150], "time_limit": 0.5,
            "memory_limit": 4, "worlds": {"count": 1, "obstacles": 2},
            "solvers": [{"name": n} for n in (*names, "greedy")],
        },
        "test",
    )  # fmt: skip
    out = tmp_path / "r.jsonl"
    tally = compare(study, out, jobs=2, policy=TrialPolicy(hung_grace_s=10.0))
    status = {r["solver"]["name"]: r["status"] for r in read_rows(out)}
    assert status == {**names, "greedy": "feasible"}
    assert (tally.done, tally.failed) == (6, 5)
    messages = {r["solver"]["name"]: r["message"] for r in read_rows(out)}
    assert "ZeroDivisionError: on purpose (badsolvers.py:" in messages["crash"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('name = "greedy"', 'name = "gredy"'), "line 12: solvers[0]: name: unknown solver"),
        (("hot = 0.5", "hott = 1"), "unknown option 'hott'; expected one of chunk, cold, hot, max"),
        (("hot = 0.5", "hot = -1"), "line 15: solvers[1]: solver 'anneal'"),
        (("goals = [3, 4]", "goals = [0]"), "line 3: goals[0]"),
        (("count = 2", "cuont = 2"), "line 9: worlds.cuont"),
        (("tether_lengths = [200]", "tether_lengths = []"), "line 4: tether_lengths"),
        (('label = "short"', 'label = "greedy"'), "'greedy' appears twice; give each a label"),
        (("[worlds]", "[worlds]\nfamily = 'reef'"), "family: unknown 'reef'"),
        (("seeds = [0, 1]", "seeds = [0, 1"), "line"),
        (
            ("obstacles = 6", "radii = [30, 10]"),
            "radii: expected minimum <= maximum, got 30 and 10",
        ),
        (("count = 2", "count = 100000"), "800000 trials; expected at most 500000"),
        (("count = 2", "count = 10000000000"), "line 9: worlds.count"),
        (
            ("[worlds]", "[[roadmaps]]\nname = 'prm'\noptions = {samples = 'x'}\n[worlds]"),
            "roadmap",
        ),
        (("[worlds]", "[[roadmaps]]\nname = 'prm'\noptions = {sample = 1}\n[worlds]"), "sample"),
        (("obstacles = 6", "obstacles = [9, 6]"), "expected minimum <= maximum, got 9 and 6"),
        (("obstacles = 6", "obstacles = [1, 2, 3]"), "obstacles"),
    ],
)
def test_bad_studies_are_told_with_key_and_line(change, said, tmp_path, capsys):
    path, out = tmp_path / "s.toml", tmp_path / "r.jsonl"
    path.write_text(TOML.replace(*change))
    assert main(["compare", str(path), "-o", str(out)]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not out.exists()


def test_a_study_draws_its_obstacles_from_a_range_and_rows_tell_seconds_of_cpu():
    changed = TOML.replace("obstacles = 6", "obstacles = [1, 4]")
    changed = changed.replace("time_limit = 20", "time_limit = 300")
    changed = changed.replace('name = "greedy"', 'name = "mip-2017"')
    (trial, *_) = Study.checked(tomllib.loads(changed), "test").trials()
    assert 1 <= len(world_of(trial)[0].obstacles) <= 4
    row = run(trial)
    assert row["status"] == "optimal"
    assert 0.0 < row["cpu_s"] < 60.0


def test_results_of_another_study_or_kind_are_refused_and_kept(study, tmp_path):
    other = Study.checked({**study.model_dump(mode="json"), "seeds": [5]}, "test")
    rows = tmp_path / "r.jsonl"
    compare(study, rows, part=(1, 16), executor=here)
    for text, said in (
        (rows.read_text(), "line 1: is of another study"),
        ('{"schema_version": 1}\n', "line 1: expected a row of schema netsp-trial/1"),
        ("notes without an end", "another kind of file"),
    ):
        rows.write_text(text)
        with pytest.raises(InputError, match=said):
            compare(other, rows)
        assert rows.read_text() == text


def test_two_comparisons_do_not_write_to_one_file(study, tmp_path):
    out = tmp_path / "r.jsonl"
    with (
        RowsFile(out, study.sha256),
        pytest.raises(InputError, match="another comparison is writing"),
    ):
        RowsFile(out, study.sha256)


def test_flags_make_the_same_study_as_a_file(tmp_path, capsys):
    out = tmp_path / "r.jsonl"
    flags = ["--goals", "2", "--tethers", "150", "--solvers", "greedy", "lns", "--worlds", "2"]
    assert main(["compare", "-o", str(out), *flags, "--time-limit", "5", "--quiet"]) == 0
    assert {json.loads(s)["solver"]["name"] for s in out.read_text().splitlines()} == {
        "greedy",
        "lns",
    }
    assert main(["compare", "-o", str(out), "--goals", "2"]) == 2
    assert "expected a study file or --tethers" in capsys.readouterr().err
    assert main(["combine", str(out), str(out), "-o", str(tmp_path / "c.jsonl")]) == 0
    assert len(read_rows(tmp_path / "c.jsonl")) == 4


@given(st.integers(1, 2000))
def test_a_thinned_history_keeps_its_ends(n):
    out = thinned(list(range(n)))
    assert len(out) == min(n, TrialPolicy.max_progress_rows)
    assert (out[0], out[-1]) == (0, n - 1)
    assert out == sorted(set(out))


@pytest.fixture
def dask_cluster(tmp_path):
    """A scheduler and two workers, real processes on loopback."""
    dask = str(Path(sys.executable).parent / "dask")
    where = tmp_path / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    common = ["--scheduler-file", str(where)]
    scheduler = subprocess.Popen(
        [dask, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", *common],
        **quiet,
    )
    deadline = time.monotonic() + 60
    while not where.exists():
        assert time.monotonic() < deadline
        time.sleep(0.1)
    options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"]
    workers = [
        subprocess.Popen([dask, "worker", *common, *options], env=_with_netsp(), **quiet)
        for _ in range(2)
    ]
    yield json.loads(where.read_text())["address"], workers
    for process in (*workers, scheduler):
        process.kill()
        process.wait()


def _with_netsp():
    return {**os.environ, "PYTHONPATH": str(ROOT)}


def test_a_dask_cluster_gives_the_same_rows_though_a_worker_is_killed(dask_cluster, tmp_path):
    from netsp.study.compare.cluster import dask_executor

    address, workers = dask_cluster
    (tmp_path / "study.toml").write_text(TOML.replace("count = 2", "count = 3"))
    study = Study.load(tmp_path / "study.toml")
    remote, local = tmp_path / "remote.jsonl", tmp_path / "local.jsonl"

    def kill_one(row, tally):
        if tally.done == 8:
            workers[0].send_signal(signal.SIGKILL)

    tally = compare(study, remote, executor=dask_executor(address), on_row=kill_one)
    compare(study, local, executor=here)
    assert (tally.done, tally.failed) == (24, 0)
    assert workers[0].wait(timeout=10) == -signal.SIGKILL
    assert without_clock(read_rows(remote)) == without_clock(read_rows(local))


def test_a_scheduler_that_is_not_there_is_told_in_one_line(tmp_path, capsys, monkeypatch):
    from netsp.study.compare import cluster

    impatient = functools.partial(cluster.dask_executor, policy=TrialPolicy(connect_s=1.0))
    monkeypatch.setattr(cluster, "dask_executor", impatient)
    (tmp_path / "s.toml").write_text(TOML)
    command = ["compare", str(tmp_path / "s.toml"), "-o", str(tmp_path / "r.jsonl")]
    assert main([*command, "--scheduler", "tcp://127.0.0.1:9"]) == 2
    assert "no Dask scheduler at 'tcp://127.0.0.1:9'" in capsys.readouterr().err


@pytest.mark.parametrize("path", sorted((ROOT / "studies").glob("*.toml")), ids=lambda p: p.stem)
def test_shipped_studies_are_what_their_names_say(path):
    study = Study.load(path)
    assert study.name == path.stem
    trials = list(study.trials())
    assert len({t.id for t in trials}) == len(trials) > 100


@pytest.mark.parametrize(
    "line",
    [
        '{"schema": "netsp-trial/1"}',
        '{"schema": "netsp-trial/1", "study": 3, "trial": [1], "study_name": "x"}',
        "[" * 100_000,
        "\udcff".encode(errors="surrogateescape").decode(errors="replace"),
    ],
)
def test_rows_that_are_none_are_refused_by_every_command(line, tmp_path, capsys):
    bad, page = tmp_path / "b.jsonl", tmp_path / "b.html"
    bad.write_text(line + "\n")
    small = ["--goals", "2", "--tethers", "150", "--solvers", "greedy", "--worlds", "1"]
    for command in (
        ["report", str(bad), "-o", str(page)],
        ["combine", str(bad), "-o", str(page)],
        ["compare", "-o", str(bad), *small],
    ):
        assert main(command) == 2
        err = capsys.readouterr().err
        assert "line 1: expected a row of schema netsp-trial/1" in err
        assert err.count("\n") == 1
    assert bad.read_text() == line + "\n"
    assert not page.exists()


def test_combine_adds_to_results_of_its_study_and_touches_nothing_else(study, tmp_path, capsys):
    rows, other, empty = tmp_path / "r.jsonl", tmp_path / "o.json", tmp_path / "e.jsonl"
    compare(study, rows, part=(1, 8), executor=here)
    compare(study, tmp_path / "s.jsonl", part=(2, 8), executor=here)
    before = rows.read_text()
    assert combine([str(tmp_path / "s.jsonl")], str(rows)) == 4
    assert rows.read_text().startswith(before)
    other.write_text('{"mine": 1}\n')
    empty.write_text("")
    for sources, target in (([rows], other), ([empty], rows)):
        kept = target.read_text()
        assert main(["combine", *map(str, sources), "-o", str(target)]) == 2
        assert target.read_text() == kept
    with RowsFile(rows, study.sha256):
        assert main(["combine", str(rows), "-o", str(rows)]) == 2
    assert "another comparison is writing" in capsys.readouterr().err


def test_a_full_disk_is_told_and_leaves_whole_lines(tmp_path):
    out = tmp_path / "r.jsonl"
    small = "--goals 2 --tethers 150 --solvers greedy --worlds 3 --quiet"
    done = subprocess.run(
        ["bash", "-c", f"ulimit -f 2; {sys.executable} -m netsp compare -o {out} {small}"],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 2
    assert "cannot be written: File too large" in done.stderr
    assert "Traceback" not in done.stderr
    data = out.read_bytes()
    assert data == b"" or data.endswith(b"\n")


@pytest.mark.parametrize("device", ["/dev/full", "/dev/null", "/tmp"])
def test_results_must_be_a_file(device, capsys):
    small = ["--goals", "2", "--tethers", "150", "--solvers", "greedy", "--worlds", "1"]
    assert main(["compare", "-o", device, *small]) == 2
    assert "expected a file of results" in capsys.readouterr().err
