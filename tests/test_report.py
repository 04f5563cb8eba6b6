"""What a report says follows from the rows, and every number can be traced back to them."""

import base64
import csv
import gzip
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from netsp.base.errors import InputError
from netsp.command.main import main
from netsp.study.compare.rows import SCHEMA, read_rows
from netsp.study.compare.study import Study
from netsp.study.compare.study_run import compare
from netsp.view.report import stats
from netsp.view.report.page import write_report

STUDIES = Path(__file__).parent.parent / "studies"


def row(solver, world, *, length=None, status="feasible", seconds=1.0, **more):
    """A row with what statistics need."""
    return {
        "schema": SCHEMA, "study": "s", "study_name": "made up", "trial": f"{solver}-{world}",
        "world": {"seed": world, "family": "icra2017", "goals": 5, "tether_length": 200.0},
        "roadmap": {"name": "taut", "label": "taut"}, "solver": {"name": solver, "label": solver},
        "seed": 0, "status": status, "message": "", "length": length, "total_s": seconds,
        "problem_sha256": f"p{world}", "finished": "2026-01-01T00:00:00+00:00", "machine": "m",
        **more,
    }  # fmt: skip


def test_tours_that_entangle_are_no_best():
    rows = [
        row("a", 0, length=12.0), row("b", 0, length=10.0),
        row("blind", 0, length=8.0, status="invalid"), row("c", 1, status="no_solution_found"),
    ]  # fmt: skip
    best = stats.best_lengths(rows)
    assert best == {"p0": 10.0}
    assert [stats.over_best(r, best) for r in rows] == pytest.approx([20.0, 0.0, -20.0, None])


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=60))
def test_the_interval_of_a_median_is_between_order_statistics_that_hold_it(values):
    s = stats.summary(values)
    x = sorted(values)
    n = len(x)
    assert s.low <= s.median <= s.high
    # the chance that the true median is below the value of this rank, or above its mirror image
    rank = x.index(s.low)
    if rank > 0:
        assert 2 * binom.cdf(rank - 1, n, 0.5) <= 1 - stats.ReportPolicy.confidence
    assert s.low in x
    assert s.high in x
    assert (s.mean, s.count) == (pytest.approx(np.mean(values)), n)


def test_intervals_cover_the_median_as_often_as_they_say():
    rng = np.random.default_rng(0)
    held = 0
    for _ in range(2000):
        s = stats.summary(rng.exponential(1.0, 25).tolist())
        held += s.low <= np.log(2.0) <= s.high
    assert held / 2000 >= stats.ReportPolicy.confidence - 0.01


def test_a_profile_counts_what_is_proven_within_a_multiple_of_the_fastest():
    by_method = {
        "fast": [row("fast", k, length=1.0, status="optimal", seconds=1.0) for k in range(4)],
        "slow": [row("slow", k, length=1.0, status="optimal", seconds=3.0) for k in range(3)]
        + [row("slow", 3, length=1.0, seconds=0.1)],
        "never": [row("never", 0, length=1.0)],
    }
    found = stats.profile(by_method)
    assert found["fast"].tolist() == [1.0] * 4
    assert found["slow"].tolist() == [3.0, 3.0, 3.0, np.inf]
    assert "never" not in found


def test_gap_over_time_is_a_step_function_of_the_history():
    history = [[0.1, None, None], [1.0, 20.0, 5.0], [2.0, 10.0, 5.0]]
    rows = [row("a", 0, length=10.0, history=history)]
    at = np.array([0.01, 0.5, 1.0, 1.5, 2.0, 9.0])
    curve = stats.gap_over_time(rows, {"p0": 10.0}, at)
    assert curve.tolist() == [np.inf, np.inf, 100.0, 100.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    study = Study.checked(
        {
            "name": "shown <here>", "goals": [2, 3], "tether_lengths": [150, 200],
            "worlds": {"count": 2, "obstacles": 8},
            "solvers": [{"name": n} for n in ("auto", "greedy", "greedy-tsp")],
        },
        "test",
    )  # fmt: skip
    compare(study, folder / "r.jsonl", jobs=2)
    return folder / "r.jsonl"


def test_the_page_needs_nothing_else_and_holds_every_trial(results, tmp_path):
    out = tmp_path / "r.html"
    assert main(["report", str(results), "-o", str(out), "--figures", "svg"]) == 0
    page = out.read_text()
    assert "<h1>shown &lt;here&gt;</h1>" in page
    # length, time and the way to the best: only one method proves anything, so there is no profile
    assert page.count("<svg") == page.count("<figure>") == 3
    outside = re.findall(r'(?:src|href)="(?!data:|#)([^"]+)"', page.replace("xlink:", ""))
    assert outside == []
    rows = read_rows(results)
    shown = set(re.findall(r"[0-9a-f]{16}", "".join(re.findall(r"<code>(.*?)</code>", page))))
    assert shown == {r["trial"] for r in rows}
    data = base64.b64decode(re.search(r"base64,([^\"]+)\"", page)[1]).decode()
    table = list(csv.DictReader(io.StringIO(data)))
    assert {t["trial"]: float(t["length"]) for t in table} == {
        r["trial"]: r["length"] for r in rows
    }
    assert len(list(tmp_path.glob("r-*.svg"))) == page.count("<figure>")


def test_failures_are_listed(results, tmp_path):
    rows = [row("a", 0, length=2.0), row("b", 0, status="crashed"), row("b", 1, status="timeout")]
    for lost in rows[1:]:
        del lost["total_s"], lost["problem_sha256"]
    path = tmp_path / "f.jsonl"
    path.write_text("".join(json.dumps(r) + "\n" for r in rows))
    page = write_report(path, tmp_path / "f.html").read_text()
    assert "Failures (2)" in page
    assert "crashed" in page
    assert "timeout" in page


def test_a_report_on_nothing_is_refused(tmp_path, capsys):
    (tmp_path / "e.jsonl").write_text("")
    assert main(["report", str(tmp_path / "e.jsonl"), "-o", str(tmp_path / "e.html")]) == 2
    assert "holds no trial yet" in capsys.readouterr().err
    assert main(["report", str(tmp_path / "no.jsonl"), "-o", str(tmp_path / "e.html")]) == 2
    assert not (tmp_path / "e.html").exists()


def test_a_report_does_not_overwrite_its_rows(results, capsys):
    before = results.read_bytes()
    assert main(["report", str(results), "-o", str(results)]) == 2
    assert "would be overwritten, and it is an input" in capsys.readouterr().err
    assert results.read_bytes() == before


def test_gzipped_rows_are_read_and_damaged_ones_refused(results, tmp_path):
    packed = tmp_path / "rows.jsonl.gz"
    packed.write_bytes(gzip.compress(results.read_bytes()))
    assert read_rows(packed) == read_rows(results)
    packed.write_bytes(packed.read_bytes()[:-20])
    with pytest.raises(InputError, match="gzip"):
        read_rows(packed)


@pytest.mark.parametrize("study", sorted(STUDIES.glob("*.toml")), ids=lambda p: p.stem)
def test_the_rows_of_the_papers_studies_are_those_of_their_files(study):
    """Whole: one row for every trial of the study as it stands."""
    trials = {t.id for t in Study.load(study).trials()}
    rows = read_rows(STUDIES / "results" / f"{study.stem}.jsonl.gz")
    assert {r["trial"] for r in rows} == trials
    assert len(rows) == len(trials)
    assert {r["study"] for r in rows} == {Study.load(study).sha256}
