"""Measures of given paths, by closed forms and against the planned tour."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from netsp import Circle, InputError, Problem, Tethers, solve, verify
from netsp.command.main import main
from netsp.exchange.maps.gpx import read_gpx
from netsp.exchange.maps.path_file import path_to_geojson, read_paths
from netsp.exchange.maps.projection import Projection
from netsp.hsignature import crossings, invert, reduce
from netsp.model.problem import Origin
from netsp.study.paths import PathPolicy, measure_path

ROOT = Path(__file__).parent.parent
WHARF = ROOT / "problems" / "wharf.json"
SYSTEMATIC = [ROOT / "examples" / "paths" / f"wharf-systematic-{k}.csv" for k in (1, 2)]
PILE = Problem(
    base=(-4, 0), goals=[(4, 0), (0, 3)], tether_length=30, clearance=0.2,
    obstacles=[Circle(center=(0, 0), radius=1, name="pile"), Circle(center=(9, 5), radius=1)],
)  # fmt: skip


@pytest.fixture(scope="module")
def tour():
    return solve(Problem.load(WHARF))


def wrapped(turns, radius=2.0, corners=48):
    """A path from the base round the pile and home."""
    angle = np.pi - np.linspace(0.0, 2.0 * np.pi * turns, max(abs(turns), 1) * corners + 1)
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([[-4, 0], ring, [-4, 0]])


@pytest.mark.parametrize("direction", [(1, 0), (0, 1), (-3, 4), (0.1, 0.3)])
@given(places=st.lists(st.integers(-9, 9), min_size=1, max_size=5), at=st.integers(-2000, 2000))
@settings(max_examples=25, deadline=None)
def test_without_obstacles_the_tether_is_straight_also_where_all_points_are_on_one_line(
    direction, places, at
):
    base = np.array([at, 2 * at], dtype=float)
    path = base + np.outer([0, *places, 0], direction)
    assume(np.ptp(path, axis=0).any())
    goals = [tuple(p) for p in np.unique(path, axis=0) if np.any(p != base)]
    problem = Problem(base=tuple(base), goals=goals, tether_length=99)
    m = measure_path(problem, path)
    straight = {tuple(p): math.dist(p, base) for p in path.tolist()}
    assert m.longest_tether == pytest.approx(max(straight.values()), rel=1e-9)
    assert m.end_tether == pytest.approx(0.0, abs=1e-9)
    for visit in m.visits:
        assert visit.tether == pytest.approx(straight[goals[visit.goal]], rel=1e-9)
    assert verify(problem, solve(problem))


@pytest.mark.parametrize("turns", [-3, -1, 1, 2])
def test_a_path_wrapped_around_a_circle_is_entangled_and_its_tether_has_its_closed_form(turns):
    m = measure_path(PILE, wrapped(turns))
    assert m.is_closed
    assert not m.is_free
    assert m.entangled == (0,)
    assert len(m.word) == abs(turns)
    # back at the base: a tangent on either side, and the arcs between
    tangent, r = math.sqrt(16 - 1.2**2), 1.2
    arc = 2.0 * math.pi * abs(turns) - 2.0 * math.acos(1.2 / 4.0)
    assert m.end_tether == pytest.approx(2 * tangent + r * arc, abs=1e-6)
    assert m.longest_tether >= m.end_tether - 1e-9


def test_a_path_unwound_again_is_free():
    there = wrapped(2)
    m = measure_path(PILE, np.vstack([there, there[::-1]]))
    assert m.is_free
    assert m.word == ()
    assert m.length == pytest.approx(2 * measure_path(PILE, there).length)


milli = st.integers(-6000, 6000).map(lambda v: v / 1000.0)
points = st.tuples(milli, milli)


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
@given(st.lists(points, min_size=1, max_size=5))
def test_the_tether_of_any_free_path_is_that_of_its_word_by_another_method(inner):
    """Tethers are pulled over a triangulation here, and found over bitangents by `Tethers`."""
    path = np.array([(-4.0, 0.0), *inner])
    near = [o.signed_distance(path + s * (np.roll(path, -1, 0) - path)).min()
            for o in PILE.obstacles for s in np.linspace(0, 1, 200)]  # fmt: skip
    assume(min(near) > 0.25)  # the closing segment, too
    m = measure_path(PILE, path)
    words = [
        reduce(crossings(path[: k + 1], PILE.representative_points)) for k in range(len(path))
    ]  # fmt: skip
    assert m.end_word == words[-1]
    assert m.stretches == ()
    other = Tethers(PILE.model_copy(update={"tether_length": 90.0}))
    lengths = [other.to(*p, w).length for p, w in zip(path, words, strict=True)]
    assert m.end_tether == pytest.approx(lengths[-1], abs=1e-6)
    assert m.longest_tether == pytest.approx(max(lengths), abs=1e-4)
    back = measure_path(PILE, np.vstack([path, path[:1]])[::-1])
    assert back.length == pytest.approx(measure_path(PILE, np.vstack([path, path[:1]])).length)
    assert back.word == invert(m.word)


def test_a_reversed_tour_is_as_long_visits_in_reverse_and_needs_the_same_tether(tour):
    problem = Problem.load(WHARF)
    there, back = (measure_path(problem, np.array(tour.path)[::step]) for step in (1, -1))
    assert back.length == pytest.approx(there.length)
    assert back.order == there.order[::-1]
    assert back.longest_tether == pytest.approx(there.longest_tether)
    assert back.is_free


def test_the_planned_tour_measured_as_a_path_has_the_figures_of_its_solution(tour):
    problem = Problem.load(WHARF)
    m = measure_path(problem, tour.path)
    assert m.length == pytest.approx(tour.length, rel=1e-3)
    assert m.is_free
    assert m.fits
    assert m.stretches == ()
    assert m.missing == ()
    assert m.revisits == {}
    assert m.order == tuple(v.goal for v in tour.tour)
    for visit, planned in zip(m.visits, tour.tour, strict=True):
        assert visit.word == planned.signature
        assert visit.tether == pytest.approx(planned.tether_length, abs=1e-6)
    assert m.longest_tether == pytest.approx(max(v.tether_length for v in tour.tour), abs=1e-4)


def test_without_heights_a_path_takes_those_of_the_goals_it_visits(tour):
    problem = Problem.load(WHARF)
    deep, flat = (measure_path(problem, np.array(tour.path)[:, :k]) for k in (3, 2))
    assert deep.has_heights
    assert not flat.has_heights
    assert flat.length == pytest.approx(deep.length)
    assert [v.tether for v in flat.visits] == pytest.approx([v.tether for v in deep.visits])


def test_a_spur_between_goals_counts_for_the_longest_tether():
    m = measure_path(PILE, [(-4, 0), (-20, 0), (-4, 0), (0, 3), (-4, 0)])
    assert m.longest_tether == pytest.approx(16.0)
    assert m.longest_place == (-20.0, 0.0)
    assert m.visits[0].tether == pytest.approx(5.0)
    assert m.fits
    assert not measure_path(PILE, [(-4, 0), (-40, 0), (-4, 0)]).fits


def test_a_part_through_an_obstacle_is_named_and_goes_round_on_the_shorter_side():
    over = measure_path(PILE, [(-4, 0), (-4, 0.5), (4, 0.5), (4, 0), (4, -3), (-4, -3), (-4, 0)])
    (part,) = over.stretches
    assert (part.kind, part.obstacles) == ("obstacle", (0,))
    assert part.end - part.start == pytest.approx(2 * math.sqrt(1 - 0.25), abs=1e-3)
    assert part.depth == pytest.approx(0.5, abs=1e-3)
    assert not over.is_inside
    assert over.entangled == (0,)  # above the pile, and home below it
    under = measure_path(PILE, [(-4, 0), (-4, -0.5), (4, -0.5), (4, -3), (-4, -3), (-4, 0)])
    assert under.is_free


def test_a_path_between_obstacles_that_touch_is_named_and_does_not_count_as_between_them():
    boxes = [[(2, 0), (4, 0), (4, 2), (2, 2)], [(2, 2), (4, 2), (4, 4), (2, 4)]]
    problem = Problem(base=(0, 2), goals=[(6, 2)], tether_length=20,
                      obstacles=[{"polygon": b} for b in boxes])  # fmt: skip
    m = measure_path(problem, [(0, 2), (6, 2), (6, 5), (0, 5), (0, 2)])
    assert ("touching", (0, 1)) in [(s.kind, s.obstacles) for s in m.stretches]
    assert not m.is_inside
    assert m.word == () or m.entangled == (0, 1)  # round both, on either side of both


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.integers(-3, 6), st.integers(-3, 6)), min_size=1, max_size=6))
def test_a_path_through_anything_and_its_reverse_are_led_round_the_same_way(corners):
    """Whole numbers: corners on outlines, parts along walls, two ways round that are as long."""
    boxes = [[(1, 0), (3, 0), (3, 2), (1, 2)], [(1, 2), (2, 2), (2, 4), (1, 4)],
             [(4, 1), (5, 1), (5, 3), (4, 3)]]  # fmt: skip
    problem = Problem(base=(0, 0), goals=[(6, 6)], tether_length=40,
                      obstacles=[{"polygon": b} for b in boxes])  # fmt: skip
    path = np.array([(0, 0), *corners, (7, 7), (0, 0)], dtype=float)
    there, back = measure_path(problem, path), measure_path(problem, path[::-1])
    assert there.word == invert(back.word)
    assert there.is_free == (there.end_tether < 1e-6)


def test_a_part_within_the_clearance_keeps_its_side():
    m = measure_path(PILE, [(-4, 0), (0, 1.1), (4, 0), (0, 1.1), (-4, 0)])
    assert {s.kind for s in m.stretches} == {"clearance"}
    assert m.is_inside
    assert m.is_free
    assert measure_path(PILE, [(-4, 0), (0, 1.1), (4, 0), (0, -1.1), (-4, 0)]).entangled == (0,)


def test_a_part_out_of_bounds_is_named():
    bounded = PILE.model_copy(update={"bounds": (-5.0, -4.0, 11.0, 8.0)})
    m = measure_path(bounded, [(-4, 0), (-4, 9.5), (-3, 3), (-4, 0)])
    (part,) = m.stretches
    assert part.kind == "bounds"
    assert part.depth == pytest.approx(1.5)
    assert m.is_free
    assert m.longest_tether <= 8.1


def test_a_path_into_a_place_that_is_shut_in_has_no_tether():
    walls = [
        [(2, 2), (8, 2), (8, 3), (2, 3)], [(2, 7), (8, 7), (8, 8), (2, 8)],
        [(2, 2), (3, 2), (3, 8), (2, 8)], [(7, 2), (8, 2), (8, 8), (7, 8)],
    ]  # fmt: skip
    room = Problem(base=(0, 0), goals=[(10, 0)], tether_length=40,
                   obstacles=[{"polygon": w} for w in walls])  # fmt: skip
    m = measure_path(room, [(0, 0), (0, 5), (5, 5), (0, 5), (0, 0)])
    assert m.longest_tether is None
    assert not m.is_free
    assert [s.obstacles for s in m.stretches] == [(2,), (2,)]


def test_a_goal_is_visited_once_while_the_path_stays_near_and_again_after_it_left():
    policy = PathPolicy(radius=0.5)
    near = [(3.8, 0), (4.6, 0), (4.2, 0.1), (4.6, 0), (4.0, 0)]  # leaves the radius, not twice it
    path = [(-4, 0), (-2, -2), (3, -1.5), *near, (7, 0), (4, 0.2), (0, 3), (-4, 0)]
    m = measure_path(PILE, path, policy=policy)
    assert m.order == (0, 1)
    assert m.revisits == {0: 1}
    assert [v.goal for v in m.visits] == [0, 0, 1]


def test_a_goal_behind_an_obstacle_is_not_visited_from_the_other_side():
    thin = Problem(base=(0, -5), goals=[(0, 0.1)], tether_length=30,
                   obstacles=[{"polygon": [(-5, -0.1), (5, -0.1), (5, 0), (-5, 0)]}])  # fmt: skip
    m = measure_path(thin, [(0, -5), (-1, -0.15), (1, -0.15), (0, -5)],
                     policy=PathPolicy(radius=0.5))  # fmt: skip
    assert m.visits == ()
    assert m.missing == (0,)


def test_a_path_that_does_not_come_home_is_not_free():
    m = measure_path(PILE, [(-4, 0), (0, 3)])
    assert not m.is_closed
    assert not m.is_free
    assert m.end_gap == pytest.approx(5.0)
    assert m.word == ()


def test_times_count_where_there_are_some_and_the_speed_else():
    path = [(-4, 0), (-4, 3), (0, 3)]
    assert measure_path(PILE, path, speed=2.0).duration_s == pytest.approx(3.5)
    m = measure_path(PILE, path, times=[100, 110, 128])
    assert m.duration_s == 28.0
    assert m.visits[0].time_s == pytest.approx(28.0)
    with pytest.raises(InputError, match="never fall"):
        measure_path(PILE, path, times=[0, 5, 4])


@pytest.mark.parametrize(
    "path", [[(0, 0)], [], [(0, 0), (1, math.nan)], [[1, 2, 3, 4]] * 2, "ab", [(0, 0), (0, 1e300)]]
)  # fmt: skip
def test_what_is_no_path_is_refused(path):
    with pytest.raises(InputError, match="path: expected"):
        measure_path(PILE, path)


# files

AT = PILE.model_copy(update={"origin": Origin(latitude=57.7, longitude=11.9, heading=30.0)})
LINE = np.array([(-4.0, 0.0, 0.0), (-4.0, 3.0, -1.0), (0.0, 3.0, -2.0), (-4.0, 0.0, 0.0)])


def degrees():
    return Projection.for_problem(AT).to_earth(LINE[:, :2])


def gpx_of(latlon, tag="trk"):
    point = {"trk": "trkpt", "rte": "rtept"}[tag]
    rows = "".join(
        f'<{point} lat="{a!r}" lon="{b!r}"><ele>{z}</ele><time>2026-05-01T12:00:{10 * k:02}Z</time>'
        f"</{point}>"
        for k, ((a, b), z) in enumerate(zip(latlon.tolist(), LINE[:, 2].tolist(), strict=True))
    )
    inner = f"<trkseg>{rows}</trkseg>" if tag == "trk" else rows
    return (
        '<?xml version="1.0"?><gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">'
        f'<wpt lat="57.7" lon="11.9"/><{tag}><name>dive</name>{inner}</{tag}></gpx>'
    )


def test_every_kind_of_file_reads_back_the_same_path(tmp_path):
    latlon = degrees()
    table = "LON,Lat,Depth,time\n" + "".join(
        f"{b!r},{a!r},{-z},{10 * k}\n"
        for k, ((a, b), z) in enumerate(zip(latlon.tolist(), LINE[:, 2].tolist(), strict=True))
    )
    files = {
        "a.gpx": gpx_of(latlon), "b.gpx": gpx_of(latlon, "rte"), "c.csv": table,
        "d.geojson": path_to_geojson("dive", LINE, AT),
        "e.csv": "z,y,x\n" + "".join(f"{z},{y},{x}\n" for x, y, z in LINE.tolist()),
        "f.json": json.dumps(LINE.tolist()),
        "g.geojson": json.dumps({"type": "LineString", "coordinates": LINE.tolist()}),
    }  # fmt: skip
    for name, text in files.items():
        (tmp_path / name).write_text(text)
        frame = "local" if name == "g.geojson" else None
        (found,) = read_paths(tmp_path / name, AT, frame)
        np.testing.assert_allclose(found.points, LINE, atol=2e-4)
        if name in ("a.gpx", "b.gpx", "c.csv"):
            np.testing.assert_allclose(found.times - found.times[0], [0, 10, 20, 30])
    local = path_to_geojson("drawn", LINE, PILE)  # no origin: its own metres
    (tmp_path / "h.geojson").write_text(local)
    for problem in (PILE, AT):
        (found,) = read_paths(tmp_path / "h.geojson", problem)
        np.testing.assert_allclose(found.points, LINE)


BAD = [
    ("a.gpx", "<gpx", "not XML"),
    ("a.gpx", "<kml/>", "expected a gpx element"),
    ("a.gpx", '<gpx><wpt lat="1" lon="2"/></gpx>', "expected a track or a route"),
    ("a.gpx", '<gpx><trk><trkseg><trkpt lat="91" lon="0"/><trkpt lat="1" lon="0"/></trkseg></trk>'
              "</gpx>", r"trk\[0\]: point 0: lat: expected a number within 90"),
    ("a.gpx", '<!DOCTYPE x [<!ENTITY a "b">]><gpx/>', "without a document type"),
    ("a.gpx", gpx_of(np.array([(1.0, 2.0)] * 4)).replace("2026-05", "2026-15"), "expected a time"),
    ("a.csv", "", "expected columns"),
    ("a.csv", "easting,northing\n1,2\n3,4\n", "expected columns x, y or lon, lat"),
    ("a.csv", "x,y\n1,2\n3,far\n", "line 3, point 1: y: expected a number, got 'far'"),
    ("a.csv", "x,y,t\n1,2,5\n3,4,1\n", "never fall"),
    ("a.csv", "x,y\n1,2\n1,2\n", "that differ"),
    ("a.csv", "x,y\n1,2\n", "at least 2 points"),
    ("a.geojson", '{"type": [1, 2]}', "type: expected a type of GeoJSON"),
    ("a.geojson", '{"type": "Point", "coordinates": [1, 2]}', "LineString"),
    ("a.geojson", '{"type": "LineString", "coordinates": [[1, 2], [3]]}', "position 1"),
    ("a.geojson", '{"type": "FeatureCollection", "features": 3}', "features: expected a list"),
    ("a.xyz", "1 2\n", "expected a path in a file that ends in"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "told"), BAD)
def test_a_file_that_is_no_path_is_refused_in_one_line(name, text, told, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=told) as caught:
        read_paths(tmp_path / name, PILE)
    assert "\n" not in str(caught.value)


def test_degrees_need_an_origin(tmp_path):
    (tmp_path / "a.gpx").write_text(gpx_of(degrees()))
    assert len(read_gpx(tmp_path / "a.gpx")[0].points) == 4
    with pytest.raises(InputError, match="no origin"):
        read_paths(tmp_path / "a.gpx", PILE)


# commands


def test_the_command_sets_the_shipped_paths_beside_the_tour(tmp_path, capsys, tour):
    solution, table = (tmp_path / n for n in ("s.json", "t.csv"))
    solution.write_text(tour.to_json())
    words = [
        "compare-path", str(WHARF), *map(str, SYSTEMATIC), str(solution), "--solution",
        str(solution),
    ]  # fmt: skip
    assert main([*words, "--json", "-o", str(table)]) == 0
    first, second, same = json.loads(capsys.readouterr().out)["paths"]
    assert first["longer_by_percent"] == pytest.approx(15.75, abs=0.01)
    assert second["longer_by_percent"] == pytest.approx(8.78, abs=0.01)
    assert same["longer_by_percent"] == pytest.approx(0.0, abs=2e-3)
    for row in (first, second, same):
        assert row["free"]
        assert row["goals_visited"] == row["goals"] == 8
        assert row["order_length"] <= row["length"]
    assert second["order_length"] == pytest.approx(tour.length)
    rows = table.read_text().splitlines()
    assert len(rows) == 5
    assert rows[1].startswith("planned tour,51.96")


def test_verify_measures_tells_the_same_figures(capsys, tmp_path, tour):
    solution = tmp_path / "s.json"
    solution.write_text(tour.to_json())
    words = ["compare-path", str(WHARF), str(SYSTEMATIC[0]), "--solution", str(solution)]
    assert main([*words, "--quiet", "-o", "-"]) == 0
    capsys.readouterr()
    assert main(words) == 0
    compared = capsys.readouterr().out
    assert main(["verify", str(WHARF), str(SYSTEMATIC[0]), "--measures"]) == 0
    told = capsys.readouterr().out
    for name in ("length", "time", "goals visited", "longest tether", "word", "comes home"):
        (line,) = [x for x in told.splitlines() if x.startswith(f"{name}  ")]
        value = line[len(name) :].strip()
        assert any(x.startswith(name) and x.endswith(value) for x in compared.splitlines())


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--radius", "-1"], "radius"),
        (["--speed", "0"], "speed"),
        (["-o", "x.txt"], "ending in .csv or .json"),
        (["--html", "x.pdf"], "a page is HTML"),
        (["--plot", "x.bmp"], "cannot draw"),
        (["--json", "-o", "-"], "standard output"),
        (["--solution", "nothing.json"], "cannot be read"),
        (["--frame", "polar"], "local or global"),
    ],
)
def test_wrong_arguments_end_in_one_line(more, told, capsys):
    words = ["compare-path", str(WHARF), str(SYSTEMATIC[0]), *more]
    assert main(words) == 2
    err = capsys.readouterr().err
    assert told in err
    assert err.count("\n") == 1


def test_a_path_that_misses_goals_is_compared_with_a_tour_of_those_it_visits(tmp_path, capsys):
    problem, path = tmp_path / "p.json", tmp_path / "a.csv"
    problem.write_text(PILE.to_json())
    path.write_text("x,y\n-4,0\n-4,3\n0,3\n-4,0\n")
    outputs = ["--html", str(tmp_path / "p.html"), "--plot", str(tmp_path / "p.svg")]
    assert main(["compare-path", str(problem), str(path), "--json", *outputs]) == 0
    text = (tmp_path / "p.html").read_text()
    assert text.count("<svg") == 2
    assert "goals missed" in text
    assert "planned tour" in (tmp_path / "p.svg").read_text()
    (row,) = json.loads(capsys.readouterr().out)["paths"]
    assert row["missing"] == ["#0"]
    assert row["visited_length"] == pytest.approx(10.0)
    assert row["order_length"] == pytest.approx(10.0)


def test_a_recorded_flight_is_measured_by_its_time_stamps(tmp_path):
    from netsp.online.guard.recorded_path import read_any_paths

    problem = Problem.load(WHARF)
    (flight,) = read_any_paths(ROOT / "examples" / "wharf-flight.csv.gz", problem, noise=0.1)
    m = measure_path(problem, flight.points, times=flight.times)
    assert m.is_timed
    assert m.duration_s == pytest.approx(228.4)
    assert len(m.order) == 8
    assert m.is_free
    (tmp_path / "a.csv").write_text("t,north,east,down\n0,0,0,0\n1,0,3,1\n2,2,3,1\n")
    (found,) = read_any_paths(tmp_path / "a.csv", problem)
    np.testing.assert_allclose(found.points, [[0, 0, 0], [3, 0, -1], [3, 2, -1]])
