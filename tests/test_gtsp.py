"""Generalised TSPs: files of GTSPLIB, graphs without a base, and whole costs."""

import itertools
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from netsp import TravelGraph, solve_graph
from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.command.main import main
from netsp.gtsp.gtsplib import load
from netsp.gtsp.search.lns_solver import solve as lns
from netsp.mip.goal_relaxation import bound_by_one_trees
from netsp.model.solution import Status
from netsp.view.pictures.gtsp_picture import draw_gtsp

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from gtsp import OPTIMA, clustered

RING = Path(__file__).parent.parent / "examples" / "7ring28.gtsp"


def shortest(costs, clusters):
    """By trying every order of clusters and every choice of vertices."""
    groups = [np.flatnonzero(clusters == c) for c in range(clusters.max() + 1)]
    best = np.inf
    for order in itertools.permutations(range(1, len(groups))):
        for tour in itertools.product(*(groups[c] for c in (0, *order))):
            best = min(
                best, sum(costs[a, b] for a, b in zip(tour, (*tour[1:], tour[0]), strict=True))
            )
    return best


@st.composite
def instances(draw):
    """Costs and clusters of three to five clusters."""
    m = draw(st.integers(3, 5))
    extra = draw(st.lists(st.integers(0, m - 1), max_size=4))
    clusters = np.array(draw(st.permutations([*range(m), *extra])))
    n = len(clusters)
    costs = draw(arrays(float, (n, n), elements=st.integers(1, 50)))
    if draw(st.booleans()):
        costs = costs / 7.0
    return np.triu(costs, 1) + np.triu(costs, 1).T, clusters


@settings(max_examples=40, deadline=None)
@given(instances(), st.sampled_from(["auto", "mip", "dp"]))
def test_without_a_base_the_shortest_of_all_closed_tours_is_proven(instance, solver):
    costs, clusters = instance
    graph = TravelGraph.from_costs(costs, clusters, base=None)
    found = solve_graph(graph, solver)
    assert found.status is Status.OPTIMAL
    assert graph.is_tour(found.tour)
    assert found.length == pytest.approx(shortest(costs, clusters), rel=1e-9)
    assert found.lower_bound <= found.length


def planar(seed, clusters, vertices, least):
    """Places, rounded distances, and clusters of at least so many vertices."""
    rng = np.random.default_rng(seed)
    places = rng.integers(0, 1000, (vertices, 2))
    costs = np.rint(np.hypot(*(places[:, None] - places[None]).T))
    of = np.r_[np.repeat(np.arange(clusters), least),
               rng.integers(0, clusters, vertices - least * clusters)]  # fmt: skip
    return costs, of


def test_every_root_counts_where_no_cluster_is_single():
    costs, clusters = planar(3, 12, 48, 4)
    graph = TravelGraph.from_costs(costs, clusters, base=None)
    assert len(graph.roots) == 4
    found = solve_graph(graph, "auto")
    alone = []
    for root in graph.roots:
        part, _ = graph.rooted(int(root))
        alone.append(solve_graph(part, "auto").length)
    assert found.status is Status.OPTIMAL
    assert found.length == min(alone)


def test_a_bound_over_all_roots_is_never_above_the_shortest_tour():
    costs, clusters = planar(5, 14, 70, 5)
    graph = TravelGraph.from_costs(costs, clusters, base=None)
    best = solve_graph(graph, "auto").length
    for limit in (1, 2, 5, 20):
        found = solve_graph(graph, "mip", iteration_limit=5 * limit)
        assert (found.lower_bound or 0.0) <= best <= found.length


def test_whole_costs_make_whole_bounds():
    costs, clusters = planar(1, 14, 60, 1)
    graph = TravelGraph.from_costs(costs, clusters, base=None)
    assert graph.grain == 1.0
    found = solve_graph(graph, "mip", iteration_limit=4)
    assert found.lower_bound == int(found.lower_bound)
    assert TravelGraph.from_costs(costs + 0.5, clusters, base=None).grain == 0.0


def test_a_warm_start_is_kept_whatever_its_first_vertex():
    costs, clusters = planar(2, 9, 30, 2)
    graph = TravelGraph.from_costs(costs, clusters, base=None)
    best = solve_graph(graph, "auto")
    turned = best.tour[4:] + best.tour[:4]
    again = solve_graph(graph, "lns", warm_start=turned, iteration_limit=1)
    assert again.length == best.length


def test_the_same_seed_gives_the_same_tour_without_a_base():
    graph = TravelGraph.from_costs(*planar(4, 10, 40, 2), base=None)
    runs = [solve_graph(graph, "lns", iteration_limit=40, seed=7) for _ in range(2)]
    assert runs[0].tour == runs[1].tour


def test_a_solver_called_by_itself_refuses_a_graph_without_a_base():
    with pytest.raises(InputError, match="has no base"):
        lns(TravelGraph.from_costs(*planar(4, 10, 40, 2), base=None))


def test_a_base_is_vertex_0_or_none():
    with pytest.raises(InputError, match="base: expected 0 or None"):
        TravelGraph.from_costs([[0, 1], [1, 0]], [0, 1], base=1)


def test_clusters_that_no_tour_can_join_are_refused():
    costs = np.full((4, 4), np.inf)
    costs[0, 1] = costs[1, 0] = costs[2, 3] = costs[3, 2] = 1.0
    with pytest.raises(InputError, match="cut cluster"):
        TravelGraph.from_costs(costs, [0, 1, 2, 3], base=None)
    # here two of the clusters have a vertex on each side
    assert len(TravelGraph.from_costs(costs, [0, 1, 0, 1], base=None)) == 4


# files


def written(tmp_path, *lines, name="a.gtsp"):
    path = tmp_path / name
    path.write_text("\n".join(lines) + "\n")
    return path


HEAD = ("NAME : a", "TYPE : GTSP", "DIMENSION : 4", "GTSP_SETS : 2")
PLACES = ("NODE_COORD_SECTION", "1 0 0", "2 3 4", "3 6 8.4", "4 0 10")
SETS = ("GTSP_SET_SECTION", "1 1 2 -1", "2 3 4 -1", "EOF")

# by the functions of TSPLIB95, section 2, by hand
DISTANCES = {
    "EUC_2D": (5, 10), "CEIL_2D": (5, 11), "MAN_2D": (7, 14), "MAX_2D": (4, 8), "ATT": (2, 4),
}  # fmt: skip


@pytest.mark.parametrize("metric", DISTANCES)
def test_distances_are_rounded_as_tsplib_rounds_them(tmp_path, metric):
    costs = load(written(tmp_path, *HEAD, f"EDGE_WEIGHT_TYPE : {metric}", *PLACES, *SETS)).costs
    assert (costs[0, 1], costs[0, 2]) == DISTANCES[metric]


def test_geographical_distances_are_those_of_the_published_optimum(tmp_path):
    # ulysses16, of which TSPLIB publishes the optimum 6859 by these distances
    places = [
        (38.24, 20.42), (39.57, 26.15), (40.56, 25.32), (36.26, 23.12), (33.48, 10.54),
        (37.56, 12.19), (38.42, 13.11), (37.52, 20.44), (41.23, 9.10), (41.17, 13.05),
        (36.08, -5.21), (38.47, 15.13), (38.15, 15.35), (37.51, 15.17), (35.49, 14.32),
        (39.36, 19.56),
    ]  # fmt: skip
    rows = [f"{k} {x} {y}" for k, (x, y) in enumerate(places, 1)]
    path = written(
        tmp_path, "NAME: ulysses16.tsp", "TYPE: TSP", "DIMENSION: 16", "EDGE_WEIGHT_TYPE: GEO",
        "DISPLAY_DATA_TYPE: COORD_DISPLAY", "NODE_COORD_SECTION", *rows, "EOF",
    )  # fmt: skip
    found = solve_graph(load(path).to_instance())
    assert (found.length, found.status) == (6859.0, Status.OPTIMAL)


MATRIX = np.array([[0, 1, 2, 3], [1, 0, 4, 5], [2, 4, 0, 6], [3, 5, 6, 0]])


@pytest.mark.parametrize("form", ["FULL_MATRIX", "UPPER_ROW", "LOWER_ROW", "UPPER_DIAG_ROW",
    "LOWER_DIAG_ROW", "UPPER_COL", "LOWER_COL", "UPPER_DIAG_COL", "LOWER_DIAG_COL"])  # fmt: skip
def test_every_form_of_a_matrix_gives_the_same_costs(tmp_path, form):
    half = {
        "UPPER": lambda m, k: m.T[np.tril_indices(4, -k)] if "COL" in form
        else m[np.triu_indices(4, k)],
        "LOWER": lambda m, k: m.T[np.triu_indices(4, k)] if "COL" in form
        else m[np.tril_indices(4, -k)],
    }  # fmt: skip
    numbers = (
        MATRIX.ravel() if form == "FULL_MATRIX"
        else half[form[:5]](MATRIX, 0 if "DIAG" in form else 1)
    )  # fmt: skip
    path = written(
        tmp_path, *HEAD, "EDGE_WEIGHT_TYPE : EXPLICIT", f"EDGE_WEIGHT_FORMAT : {form}",
        "EDGE_WEIGHT_SECTION", " ".join(map(str, numbers)), *SETS,
    )  # fmt: skip
    assert (load(path).costs == MATRIX).all()


def test_keywords_are_read_in_any_case_and_with_or_without_a_colon(tmp_path):
    path = written(tmp_path, "Name : b", "Dimension: 4", "GTSP_SETS : 2", *PLACES,
        "GTSP_SET_SECTION:", "1 1 2", "-1", "2 3 4 -1")  # fmt: skip
    instance = load(path)
    assert (instance.name, instance.clusters.tolist()) == ("b", [0, 0, 1, 1])


WRONG = {
    "DIMENSION: expected a number": (HEAD[:2], PLACES, SETS),
    "DIMENSION: expected 1 to": (("DIMENSION : 0",), PLACES, SETS),
    "TYPE: expected one of": (("TYPE : CVRP", "DIMENSION : 4"), PLACES, SETS),
    "EDGE_WEIGHT_TYPE: expected EXPLICIT": ((*HEAD, "EDGE_WEIGHT_TYPE : XRAY1"), PLACES, SETS),
    "line 8: expected a vertex from 1 to 4, got '9'": (HEAD, (*PLACES[:3], "9 1 1", "4 0 0"), SETS),
    "12 numbers, got 9": (HEAD, PLACES[:-1], SETS),
    "vertex 2 is there twice": (HEAD, (*PLACES[:3], "2 1 1", "4 0 0"), SETS),
    "line 12: vertex 2 is in the sets 1 and 2": (HEAD, PLACES, (*SETS[:2], "2 2 3 4 -1")),
    "vertex 4 is in no set": (HEAD, PLACES, (*SETS[:2], "2 3 -1")),
    "expected 2 sets, got 1": (HEAD, PLACES, (SETS[0], "1 1 2 3 4 -1")),
    "expected -1 at the end": (HEAD, PLACES, (SETS[0], "1 1 2 3 4")),
    "set 2 is empty": (HEAD, PLACES, (SETS[0], "1 1 2 3 4 -1", "2 -1")),
    "set 1 is there twice": (HEAD, PLACES, (SETS[0], "1 1 2 -1", "1 3 4 -1")),
    "GTSP_SET_SECTION: expected one": (HEAD, PLACES, ()),
    "expected a number, got 'north'": (HEAD, (*PLACES[:4], "4 north 1"), SETS),
    "unknown keyword": (("SPEED : 4", *HEAD), PLACES, SETS),
    "expected a keyword": (("4", *HEAD), PLACES, SETS),
    "expected symmetric costs": (
        (*HEAD, "EDGE_WEIGHT_TYPE : EXPLICIT"),
        ("EDGE_WEIGHT_SECTION", "0 1 2 3 1 0 1 1 9 1 0 1 3 1 1 0"), SETS,
    ),
}  # fmt: skip


@pytest.mark.parametrize("told", WRONG)
def test_what_is_wrong_in_a_file_is_told_in_a_line(tmp_path, capsys, told):
    path = written(tmp_path, *itertools.chain(*WRONG[told]))
    assert main(["gtsp", str(path), "-o", str(tmp_path / "out.tour")]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.tour").exists()


def test_the_command_writes_a_tour_whose_length_adds_up(tmp_path, capsys):
    out = tmp_path / "ring.tour"
    assert main(["gtsp", str(RING), "-o", str(out), "--quiet", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    words = out.read_text().split()
    tour = [int(w) - 1 for w in words[words.index("TOUR_SECTION") + 1 : words.index("-1")]]
    instance = load(RING)
    assert [v + 1 for v in tour] == told["tour"]
    assert sorted(instance.clusters[tour]) == list(range(7))
    assert instance.costs[tour, np.roll(tour, -1)].sum() == told["length"] == told["lower_bound"]


def test_the_picture_shows_every_vertex_and_the_tour():
    instance = load(RING)
    found = solve_graph(instance.to_instance())
    ax = draw_gtsp(instance, found)
    drawn = {line.get_label(): line.get_xydata() for line in ax.lines}
    assert (drawn["vertex, with its cluster"] == instance.places).all()
    assert (drawn["tour"][:-1] == instance.places[list(found.tour)]).all()


def test_distances_without_places_have_no_picture(tmp_path, capsys):
    path = written(
        tmp_path, *HEAD, "EDGE_WEIGHT_TYPE : EXPLICIT", "EDGE_WEIGHT_SECTION",
        " ".join(map(str, MATRIX.ravel())), *SETS,
    )  # fmt: skip
    assert main(["gtsp", str(path), "--plot", str(tmp_path / "a.png"), "--quiet"]) == 2
    assert "nothing to draw" in capsys.readouterr().err


EIL51 = np.array([
    (37, 52), (49, 49), (52, 64), (20, 26), (40, 30), (21, 47), (17, 63), (31, 62), (52, 33),
    (51, 21), (42, 41), (31, 32), (5, 25), (12, 42), (36, 16), (52, 41), (27, 23), (17, 33),
    (13, 13), (57, 58), (62, 42), (42, 57), (16, 57), (8, 52), (7, 38), (27, 68), (30, 48),
    (43, 67), (58, 48), (58, 27), (37, 69), (38, 46), (46, 10), (61, 33), (62, 63), (63, 69),
    (32, 22), (45, 35), (59, 15), (5, 6), (10, 17), (21, 10), (5, 64), (30, 15), (39, 10),
    (32, 39), (25, 32), (25, 55), (48, 28), (56, 37), (30, 40),
])  # fmt: skip
"""Places of TSPLIB's eil51 (Christofides & Eilon 1969)."""


def test_clusters_are_made_as_those_of_gtsplib_whose_optimum_is_known():
    """Of 11eil51 Fischetti, Salazar & Toth (1997) proved that it is 174."""
    costs = np.floor(np.hypot(*(EIL51[:, None] - EIL51[None]).T) + 0.5)
    graph = TravelGraph.from_costs(costs, clustered(costs, 11), base=None)
    found = solve_graph(graph)
    assert found.status is Status.OPTIMAL
    assert found.length == found.lower_bound == OPTIMA["eil51"] == 174


@pytest.mark.parametrize("base", [0, None])
@pytest.mark.parametrize("seed", range(3))
def test_there_is_a_tour_and_a_bound_whatever_the_time(seed, base):
    rng = np.random.default_rng(seed)
    clusters = np.r_[0, np.repeat(np.arange(1, 13), 3)]
    at = rng.random((13, 2))[clusters] + 0.02 * rng.random((len(clusters), 2))
    costs = np.linalg.norm(at[:, None] - at[None], axis=2)
    best = solve_graph(TravelGraph.from_costs(costs, clusters, base=base), "auto").length
    clock = Clock()
    clock.end()
    found = solve_graph(TravelGraph.from_costs(costs, clusters, base=base), time_limit=clock)
    assert 0.7 * best < found.lower_bound <= best <= found.length


def test_the_bound_of_no_time_holds_where_legs_are_missing():
    costs = np.full((6, 6), np.inf)
    ring = np.arange(6)
    costs[ring, np.roll(ring, 1)] = costs[np.roll(ring, 1), ring] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    costs[0, 3] = costs[3, 0] = 1.0
    graph = TravelGraph.from_costs(costs, range(6))
    bound_by_one_trees(graph)
    assert 10.0 < graph.bound_in_any_class <= 21.0


def test_least_costs_between_clusters_are_those_of_their_vertices():
    rng = np.random.default_rng(0)
    clusters = rng.permutation(np.repeat(np.arange(1, 6), 4))
    clusters = np.r_[0, clusters]
    costs = rng.random((21, 21))
    graph = TravelGraph.from_costs(costs + costs.T, clusters)
    between = graph.distances_between_goals()
    for a, b in itertools.permutations(range(6), 2):
        assert between[a, b] == graph.costs[clusters == a][:, clusters == b].min()
    assert not between.diagonal().any()
