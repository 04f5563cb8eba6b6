"""A lower bound is never shown without the tours that it holds for, nor used for other tours."""

import ast
import csv
import functools
import io
import json
import re
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from netsp import Problem, Solution, TravelGraph, solve, solve_graph, travel_graph, verify
from netsp.app.app_policy import AppPolicy
from netsp.app.facts import bound_message
from netsp.app.version_solver import VersionSolver
from netsp.base.errors import InputError
from netsp.command import gtsp as gtsp_command
from netsp.command import json_output
from netsp.command.progress_table import ProgressTable, summary
from netsp.gtsp.gtsplib.tour_file import tour_text
from netsp.gtsp.travel.result import Progress, Result, of_part
from netsp.model.bound_scope import LowerBound, Scope, above_shortest, gap_of, strongest
from netsp.model.solution import Status, proof, solution_scope
from netsp.plan import solve_problem as by_name
from netsp.plan.random_worlds import reachable_world
from netsp.plan.solve_policy import RoutePolicy, SolvePolicy, SubsetPolicy
from netsp.study.library.records import Record
from netsp.view.pictures.problem_picture import _title, save_trace
from netsp.view.report.page import _cells_table, _rows_link
from netsp.view.report.stats import bound_of, cells, is_proven
from netsp.view.report.tour_page import _summary

ROOT = Path(__file__).resolve().parent.parent

NOT_FLOWN = SimpleNamespace(run=None)
"""Files of a tour that was not carried out, as a report has them."""
lengths = st.floats(0.0, 1e9)
scopes = st.sampled_from(list(Scope))


@given(lengths, scopes, scopes)
def test_a_bound_holds_for_parts_of_its_tours_only(length, scope, other):
    bound = LowerBound(length, scope)
    if scope.includes(other):
        part = bound.for_part(other, "each is one of them")
        assert (part.length, part.scope) == (length, other)
    else:
        with pytest.raises(ValueError, match="are not all of"):
            bound.for_part(other, "each is one of them")
    with pytest.raises(ValueError, match="reason"):
        bound.for_part(scope, " ")


@given(scopes, scopes, scopes)
def test_scopes_are_ordered_by_inclusion(a, b, c):
    assert a.includes(a)
    assert not (a.includes(b) and b.includes(a)) or a is b
    assert not (a.includes(b) and b.includes(c)) or a.includes(c)
    assert Scope.ALL_TOURS.includes(a)


@given(st.lists(st.tuples(lengths, scopes), max_size=4))
def test_bounds_of_different_scopes_are_never_compared(stated):
    bounds = [LowerBound(v, s) for v, s in stated]
    if len({s for _, s in stated}) > 1:
        with pytest.raises(ValueError, match="say first why"):
            strongest(*bounds)
    else:
        best = strongest(None, *bounds)
        assert (best is None) == (not bounds)
        assert best is None or best.length == max(v for v, _ in stated)


@given(lengths, lengths, lengths)
def test_a_bound_with_the_rest_is_no_more_than_either(length, least, tour):
    whole = LowerBound(length, Scope.KEPT_CLASSES).or_elsewhere(least, Scope.ALL_TOURS, "why")
    assert whole == LowerBound(min(length, least), Scope.ALL_TOURS)
    assert 0.0 <= whole.gap(tour) <= 1.0
    assert whole.proves(tour) or whole.gap(tour) > 0.0
    assert gap_of(None, whole) is gap_of(tour, None) is None


def test_no_bound_is_negative_or_no_number():
    for length in (-1.0, float("nan")):
        with pytest.raises(ValueError, match="at least 0"):
            LowerBound(length, Scope.ALL_TOURS)


def test_bounds_of_a_part_do_not_reach_who_hears_of_the_whole():
    heard = []
    tell = of_part(heard.append, np.array([0, 4, 7]), lambda _: None)
    tell(Progress(0.0, "x", 8.0, LowerBound(7.9, Scope.PART), tour=(0, 2, 1)))
    assert heard[0].bound is None
    assert heard[0].tour == (0, 7, 4)


# places where a bound is shown, each with a bound of each scope -----------------------------------


@pytest.fixture(scope="module")
def small():
    return Problem(
        name="pier", base=(0, 0), goals=[(4, 1), (4, -1)], tether_length=9.0,
        obstacles=[{"center": (2, 0), "radius": 0.5}],
    )  # fmt: skip


@pytest.fixture(scope="module")
def solved(small):
    """Its shortest tour: of two goals, each order is as good as the other."""
    found = solve(small, keep_order=True)
    return found.model_copy(update={"kept_order": False, "lower_bound_of": Scope.ALL_TOURS})


def stated(solution, scope, share=0.9):
    """A solution that states another bound."""
    low = share * solution.length
    return solution.model_copy(update={
        "status": Status.FEASIBLE if share < 1.0 else Status.optimal_of(scope),
        "lower_bound": low, "lower_bound_of": scope, "gap": 1.0 - share,
        "kept_order": scope.keeps_order,
    })  # fmt: skip


def table_row(bound):
    out = io.StringIO()
    with ProgressTable(out) as table:
        table(Progress(0.1, "root", 10.0, bound))
    return out.getvalue()


def study_row(scope):
    return {
        "trial": "t", "study": "s", "study_name": "n", "machine": "m", "finished": "2026",
        "world": {"family": "f", "seed": 0, "goals": 2, "tether_length": 9.0}, "seed": 0,
        "roadmap": {"name": "taut", "label": "taut", "options": {}},
        "solver": {"name": "mip", "label": "mip"}, "status": "feasible", "length": 10.0,
        "lower_bound": 9.0, "lower_bound_of": scope.value, "gap": 0.1, "total_s": 1.0,
        "problem_sha256": "x",
    }  # fmt: skip


def csv_of_rows(rows):
    import base64

    page = _rows_link(rows, {"x": 10.0})
    text = base64.b64decode(page.split("base64,")[1].split('"')[0]).decode()
    return next(csv.DictReader(io.StringIO(text)))


PLACES = {
    "repr of a solution": lambda p, s, b: repr(s),
    "repr of a result": lambda p, s, b: repr(
        Result((0, 1), 10.0, b.length, Status.FEASIBLE, lower_bound_of=b.scope)
    ),
    "summary of solve": lambda p, s, b: summary(p, s),
    "summary of solve as JSON": lambda p, s, b: json_output.of_solution(p, s)["lower_bound_of"],
    "solution file": lambda p, s, b: json.loads(s.to_json())["lower_bound_of"],
    "title of a picture": lambda p, s, b: _title(p, s),
    "report of a tour": lambda p, s, b: _summary(p, s, NOT_FLOWN),
    "progress": lambda p, s, b: table_row(b),
    "page of the app": lambda p, s, b: bound_message(s.status, s.length, s.bound)["proof"],
    "page of the app, for programs": lambda p, s, b: bound_message(s.status, s.length, s.bound)[
        "lower_bound_of"
    ],
    "cells of a comparison": lambda p, s, b: _cells_table(
        cells({"mip": [study_row(b.scope)]}), {"x": 10.0}
    ),
    "rows of a comparison": lambda p, s, b: csv_of_rows([study_row(b.scope)])["lower_bound_of"],
    "summary of gtsp": lambda p, s, b: gtsp_command._summary(
        Result((0, 1), 10.0, b.length, Status.FEASIBLE, lower_bound_of=b.scope), 1.0, None, None
    ),
    "tour of gtsp": lambda p, s, b: tour_text(
        SimpleNamespace(name="n"),
        Result((0, 1), 10.0, b.length, Status.FEASIBLE, lower_bound_of=b.scope),
    ),
    "judge": lambda p, s, b: str(verify(p, s)),
}
"""Every place that shows a bound."""


@pytest.mark.parametrize("scope", Scope)
@pytest.mark.parametrize("place", PLACES)
def test_every_place_names_the_tours_that_a_bound_holds_for(place, scope, small, solved):
    text = PLACES[place](small, stated(solved, scope), LowerBound(9.0, scope))
    # the longest words that fit are the ones meant: "tours of this roadmap in the given order"
    words = {s: (s.tours, s.shortest, s.column, s.value) for s in Scope}
    fits = {s: max((len(w) for w in ws if w in text), default=0) for s, ws in words.items()}
    assert max(fits, key=fits.get) is scope, text
    if scope is not Scope.ALL_TOURS:
        assert "all tours" not in text.replace("not of all tours", "")
        assert not re.search(r"the shortest tour(?! (over|of|between|in))", text)


@pytest.mark.parametrize("scope", Scope)
def test_what_closes_a_bound_is_the_shortest_of_its_scope_only(scope, small, solved):
    found = stated(solved, scope, 1.0)
    wide = scope in (Scope.ALL_TOURS, Scope.GIVEN_ORDER, Scope.TRAVEL_GRAPH)
    assert (found.status is Status.OPTIMAL) == wide
    for text in (found.proof, summary(small, found), _title(small, found)):
        assert ("proven shortest by this solver" in text) == wide
    assert above_shortest(None, found.bound) == above_shortest(3.0, None) == "no bound"


def test_a_trace_names_the_tours_of_its_bounds(tmp_path):
    rows = [Progress(0.0, "x", 9.0, LowerBound(8.0, s), iteration=k) for k, s in enumerate(Scope)]
    save_trace(rows, "trace", "m", tmp_path / "trace.svg")
    drawn = (tmp_path / "trace.svg").read_text()
    assert all(s.tours in drawn for s in Scope) or "<path" in drawn  # letters may be outlines


def test_records_take_bounds_on_all_tours_only(solved):
    record = Record(
        problem="p", sha256="x", length=10.0, lower_bound=9.0, solver="s", by="b", seconds=1.0,
        date="2026-11-28",
    )  # fmt: skip
    assert record.bound == LowerBound(9.0, Scope.ALL_TOURS)


SHOWN = {"lower_bound", "gap", "bound_of_all", "gap_to_all"}
ELSEWHERE = {
    "netsp/base/moved_modules.py": "names of modules",
    "netsp/model/bound_scope.py": "the type itself",
    "netsp/plan/space/judge.py": "quotes what a file states wrongly",
    "netsp/study/library/records.py": "a record is updated; it holds bounds on all tours only",
}


def names(node):
    """Names, attributes and keys in an expression."""
    for n in ast.walk(node):
        if isinstance(n, ast.Attribute):
            yield n.attr
        elif isinstance(n, ast.Name):
            yield n.id
        elif isinstance(n, ast.Subscript) and isinstance(n.slice, ast.Constant):
            yield n.slice.value


def bare_bounds(text):
    """Lines that format a bound or a gap, compute a gap, or name a bound without its tours."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FormattedValue):
            inside = [n for n in ast.walk(node.value) if isinstance(n, ast.Attribute)]
            if any(n.attr in SHOWN for n in inside):
                yield node.lineno
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            top = node.left
            if (
                isinstance(top, ast.BinOp) and isinstance(top.op, ast.Sub)
                and ast.unparse(top.left) == ast.unparse(node.right)
                and {*names(top.right)} & {"bound", "low", *SHOWN}
            ):  # fmt: skip
                yield node.lineno
        elif isinstance(node, ast.Dict | ast.List | ast.Tuple):
            parts = node.keys if isinstance(node, ast.Dict) else node.elts
            texts = {p.value for p in parts if isinstance(p, ast.Constant)}
            # a mission has two bounds, each named for its tours
            named = texts & {"lower_bound_of", "bound_of_all"}
            if "lower_bound" in texts and len(texts) > 1 and not named:
                yield node.lineno


def test_no_code_shows_a_bound_but_through_the_type():
    found = {
        f"{path.relative_to(ROOT)}:{line}"
        for path in (ROOT / "netsp").rglob("*.py")
        if str(path.relative_to(ROOT)) not in ELSEWHERE
        for line in bare_bounds(path.read_text())
    }
    assert found == set()


def test_the_walk_sees_what_it_is_to_see():
    seen = 'f"{row.gap:.3f}"', "(length - bound) / length", '{"length": 1, "lower_bound": 2}'
    assert all(list(bare_bounds(text)) for text in seen)
    assert not list(bare_bounds('{"lower_bound": 1, "lower_bound_of": 2}'))


# files --------------------------------------------------------------------------------------------


def as_of_version_one(solution, **changes):
    data = json.loads(solution.to_json())
    del data["lower_bound_of"]
    return Solution.from_json(json.dumps({**data, **changes}))


def test_older_files_are_read_as_what_they_held(small, solved):
    plain = as_of_version_one(solved)
    assert (plain.status, plain.lower_bound_of) == (Status.OPTIMAL, Scope.ALL_TOURS)
    sampled = as_of_version_one(solved, roadmap="prm", classes="non-looping")
    assert sampled.status is Status.OPTIMAL_OF_ROADMAP
    assert sampled.lower_bound_of is Scope.ROADMAP
    ruled = as_of_version_one(solved, classes="non-looping")
    assert (ruled.status, ruled.lower_bound_of) == (Status.OPTIMAL_OF_KEPT, Scope.KEPT_CLASSES)
    ordered = as_of_version_one(solved, kept_order=True)
    assert (ordered.status, ordered.lower_bound_of) == (Status.OPTIMAL, Scope.GIVEN_ORDER)
    none = as_of_version_one(solved, lower_bound=None, gap=None, status="feasible")
    assert none.bound is none.lower_bound_of is None
    for read in (plain, sampled, ruled, ordered, none):
        assert Solution.from_json(read.to_json()) == read
        assert verify(small, read), str(verify(small, read))


def test_rows_of_older_studies_are_read_as_what_they_held():
    row = study_row(Scope.ALL_TOURS) | {"status": "optimal", "gap": 0.0}
    del row["lower_bound_of"]
    assert bound_of(row).scope is Scope.ALL_TOURS
    assert is_proven(row)
    assert bound_of(row | {"roadmap": {"name": "prm", "label": "prm"}}).scope is Scope.ROADMAP
    assert is_proven(row | {"status": "optimal_of_roadmap"})
    assert not is_proven(row | {"status": "optimal_of_kept", "gap": 0.2})
    assert not is_proven(row | {"status": "crashed"})


def test_the_judge_refuses_bounds_on_more_tours_than_a_run_can_bound(small, solved):
    for changes in (
        {"roadmap": "prm"},
        {"classes": "non-looping"},
        {"kept_order": True},
        {"status": Status.OPTIMAL_OF_ROADMAP},
        {"lower_bound_of": Scope.ROADMAP, "roadmap": "prm"},
    ):
        refused = verify(small, solved.model_copy(update=changes))
        assert [c.name for c in refused.checks if not c.passed] == ["bound, gap and status agree"]


# runs ---------------------------------------------------------------------------------------------


def test_scopes_of_runs(small):
    assert solve(small).lower_bound_of is Scope.ALL_TOURS
    assert solve(small, keep_order=True).lower_bound_of is Scope.GIVEN_ORDER
    ruled = solve(small, roadmap_options={"classes": "non-looping"})
    assert (ruled.status, ruled.lower_bound_of) == (Status.OPTIMAL_OF_KEPT, Scope.KEPT_CLASSES)
    assert verify(small, ruled)
    graph = TravelGraph.from_costs([[0, 3, 4], [3, 0, 5], [4, 5, 0]], [0, 1, 2])
    found = solve_graph(graph)
    assert (found.status, found.lower_bound_of) == (Status.OPTIMAL, Scope.TRAVEL_GRAPH)
    part = solve_graph(travel_graph(small).subgraph([0, 1, 2]))
    assert part.lower_bound_of is Scope.PART
    assert solution_scope("another package's", "all") is Scope.ROADMAP


@pytest.fixture(scope="module")
def restricted():
    """A world whose shortest tour takes a class of longer tether, and its length."""
    problem, _ = reachable_world(family="icra2017", seed=4, goals=4, tether_length=350.0)
    shortest = solve(problem, "mip")
    assert shortest.status is Status.OPTIMAL
    kept = solve(problem, "mip", roadmap_options={"max_classes": 4})
    assert kept.length > 1.3 * shortest.length
    return problem, shortest.length


def claimed(text):
    """Bounds on all tours that a text claims, as lengths or as shares above the bound."""
    for bound in re.findall(r"bound ([\d.e+]+)[^;,]* on all tours", text):
        yield float(bound)
    for line in text.splitlines():
        if (row := line.split()) and "all" in row[5:] and "tours" in row[5:]:
            yield from (float(v) for v in row[3:4] if v != "-")


def above(text):
    """Shares above the shortest of all tours that a text claims, per cent."""
    return [
        float(v) for v in re.findall(r"at most ([\d.e+]+) % above the shortest tour(?! )", text)
    ]


FEW_CLASSES = SolvePolicy(
    routes=RoutePolicy(max_walk_goals=2, first_tour_classes=1), subsets=SubsetPolicy(max_sums=0)
)


@pytest.mark.parametrize("most", [4, 12])
@pytest.mark.parametrize("solver", ["auto", "mip", "dp"])
def test_no_row_over_few_classes_claims_a_bound_on_all_tours(restricted, most, solver):
    problem, shortest = restricted
    rows, text = [], io.StringIO()
    params = {"policy": FEW_CLASSES} if solver == "auto" else None
    graph = travel_graph(problem, max_classes=most)
    assert not graph.is_complete
    with ProgressTable(text) as table:
        found = solve_graph(
            graph,
            solver,
            time_limit=3,
            params=params,
            on_progress=lambda r: (rows.append(r), table(r)),
        )
    assert rows
    for row in (*rows, *found.trace):
        assert row.bound is None or row.bound.scope is Scope.ALL_TOURS
        assert row.bound is None or row.bound.length <= shortest * (1 + 1e-9)
    assert found.lower_bound_of is Scope.ALL_TOURS
    assert found.lower_bound <= shortest * (1 + 1e-9)
    assert found.status is not Status.OPTIMAL or found.length <= shortest * (1 + 1e-6)
    assert all(v <= shortest * (1 + 1e-5) for v in claimed(text.getvalue()))


def test_no_place_claims_more_of_a_tour_over_few_classes(restricted):
    problem, shortest = restricted
    found = solve(problem, "mip", roadmap_options={"max_classes": 4})
    assert found.status is Status.OPTIMAL_OF_KEPT
    for place in (repr(found), summary(problem, found), _title(problem, found), found.proof,
                  _summary(problem, found, NOT_FLOWN), str(verify(problem, found))):  # fmt: skip
        assert "proven shortest by this solver" not in place
        assert all(v <= shortest * (1 + 1e-5) for v in claimed(place))
        assert all(found.length <= shortest * (1.0 + v / 100.0) * 1.01 for v in above(place))


def told_to_the_page(problem, time_limit, monkeypatch):
    """Return the messages of the app's worker about tours, over a roadmap of few classes."""
    whole = by_name.travel_graph
    monkeypatch.setattr(
        by_name, "travel_graph", lambda p, *name, **o: whole(p, *name, **{"max_classes": 4, **o})
    )
    ours, theirs = Pipe()
    policy = AppPolicy(tour_interval_s=0.0)
    VersionSolver(theirs, 1, problem.to_json(), policy).solve(time_limit, None)
    said = []
    while ours.poll():
        said.append(ours.recv())
    return [s for s in said if "proof" in s]


def test_the_page_claims_no_more(restricted, monkeypatch):
    problem, shortest = restricted
    solve_over = functools.partial(by_name.solve_over, params={"policy": FEW_CLASSES})
    monkeypatch.setattr(by_name, "solve_over", solve_over)
    for s in told_to_the_page(problem, 3.0, monkeypatch):
        assert s["lower_bound"] is None or s["lower_bound"] <= shortest * (1 + 1e-9)
        assert all(s["length"] <= shortest * (1.0 + v / 100.0) * 1.01 for v in above(s["proof"]))


def test_the_page_is_not_behind_the_command_line(restricted, monkeypatch):
    problem, _ = restricted
    last = told_to_the_page(problem, 60.0, monkeypatch)[-1]
    assert last["stage"] == "done"
    assert last["length"] <= solve(problem, time_limit=60.0).length * (1 + 1e-9)


def test_the_page_keeps_classes_of_the_tour_before_an_edit(restricted):
    problem, shortest = restricted
    best = solve(problem, "mip")
    edited = problem.model_copy(update={"name": "edited"})
    found = solve(edited, "lns", warm_start=best, roadmap_options={"max_classes": 4},
                  iteration_limit=1)  # fmt: skip
    assert found.length <= shortest * (1 + 1e-6)


def test_a_record_refuses_a_bound_on_other_tours(tmp_path, small, solved):
    from netsp.study.library import Library

    (tmp_path / "records.json").write_text('{"schema_version": 1, "records": []}')
    (tmp_path / "pier.json").write_text(small.to_json())
    library = Library(tmp_path)
    with pytest.raises(InputError, match="tours of this roadmap"):
        library.submit(solved, by="me", bound=LowerBound(1.0, Scope.ROADMAP))


def test_words_of_a_proof_for_each_status():
    bound = LowerBound(8.0, Scope.ALL_TOURS)
    assert proof(Status.FEASIBLE, 10.0, bound) == "at most 25 % above the shortest tour"
    kept = proof(Status.OPTIMAL_OF_KEPT, 10.0, bound)
    assert kept == f"{Status.OPTIMAL_OF_KEPT.verdict}; at most 25 % above the shortest tour"
    assert proof(Status.OPTIMAL, 8.0, bound) == "proven shortest by this solver"
    in_order = LowerBound(8.0, Scope.GIVEN_ORDER)
    assert (
        proof(Status.OPTIMAL, 8.0, in_order) == "proven shortest by this solver, in the given order"
    )
    assert "blind" in proof(Status.INVALID, 8.0, None)
