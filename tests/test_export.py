"""Mission files hold what ground stations want, and maps come back as the problem they were."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InputError, Polygon, Problem, Solution, solve
from netsp.command.main import main
from netsp.exchange.maps.site_import import read_site
from netsp.exchange.missions import Projection, export, waypoints_of
from netsp.hsignature import reduce, signature
from netsp.model.solution import ProblemReference, Status, Visit

pytest.importorskip("pyproj")

PROBLEMS = Path(__file__).parent.parent / "problems"
SITE = Problem(
    name="site", base=(10, -5, 0), tether_length=60, clearance=1.0,
    goals=[{"name": "a", "position": (30, 10, -4)}, (40, -15, -6), (12, -30, -2)],
    obstacles=[
        Circle(center=(25, -5), radius=3, name="pile"),
        Polygon(polygon=[(20, -20), (28, -22), (27, -14)], name="wreck"),
    ],
)  # fmt: skip


@pytest.fixture(scope="module")
def plan():
    return solve(SITE)


def projection(heading=25.0):
    return Projection(55.5, 12.7, heading, SITE.base[:2])


@settings(max_examples=50, deadline=None)
@given(
    st.floats(-80, 80), st.floats(-179, 179), st.floats(-360, 360),
    st.lists(st.floats(-500, 500), min_size=2, max_size=2),
)  # fmt: skip
def test_there_and_back_on_the_earth_is_to_the_micrometre(lat, lon, heading, xy):
    p = Projection(lat, lon, heading, (3.0, 4.0))
    assert p.to_plane(p.to_earth([xy]))[0] == pytest.approx(xy, abs=1e-6)


def test_directions_are_those_of_the_compass():
    north = Projection(55.0, 12.0)
    (lat, lon), (lat2, lon2) = north.to_earth([(0, 100), (100, 0)])
    assert lat > 55.0
    assert lon == pytest.approx(12.0)
    assert lon2 > 12.0
    east = Projection(55.0, 12.0, 90.0)
    assert east.to_earth([(0, 100)])[0] == pytest.approx([lat2, lon2])


def test_distances_from_the_base_are_exact():
    pyproj = pytest.importorskip("pyproj")
    p = Projection(55.0, 12.0, 33.0)
    lat, lon = p.to_earth([(300.0, 400.0)])[0]
    _, _, far = pyproj.Geod(ellps="WGS84").inv(12.0, 55.0, lon, lat)
    assert far == pytest.approx(500.0, abs=1e-6)


def test_waypoints_are_of_the_plans_class_and_visit_all(plan):
    points = waypoints_of(SITE, plan)
    line = np.array([SITE.base, *(p.position for p in points)])
    assert reduce(signature(line[:, :2], SITE.representative_points)) == ()
    visits = [p for p in points if p.goal is not None and p.goal >= 0]
    assert [(p.goal, p.word) for p in visits] == [(v.goal, v.signature) for v in plan.tour]
    assert points[-1].position == SITE.base
    drawn = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
    assert plan.length * (1 - 1e-6) <= drawn <= plan.length * 1.05


def test_corners_may_be_cut_by_the_acceptance_radius(plan):
    """Whatever a vehicle does within the radius at a bend, it stays in the class: obstacles keep
    out of the triangles that it may cut off."""
    import shapely

    radius = 2.5
    points = waypoints_of(SITE, plan, radius)
    line = np.array([SITE.base, *(p.position for p in points)])[:, :2]
    for a, b, c in zip(line[:-2], line[1:-1], line[2:], strict=True):
        u, v = a - b, c - b
        lu, lv = np.linalg.norm(u), np.linalg.norm(v)
        cut = [b + u * min(1, radius / lu), b, b + v * min(1, radius / lv)]
        corner = shapely.LineString(cut).convex_hull
        assert not any(o.shape().intersects(corner) for o in SITE.obstacles)


def test_a_radius_too_large_for_the_site_is_refused(plan):
    with pytest.raises(InputError, match="acceptance: 40 would let the vehicle cut a corner"):
        waypoints_of(SITE, plan, 40.0)


def test_a_plan_is_what_qgroundcontrol_and_mavsdk_want(plan, tmp_path):
    file = tmp_path / "m.plan"
    points = export(SITE, plan, file, "plan", projection())
    data = json.loads(file.read_text())
    assert (data["fileType"], data["version"]) == ("Plan", 1)
    assert set(data) >= {"geoFence", "rallyPoints", "mission", "groundStation"}
    mission = data["mission"]
    assert (mission["firmwareType"], mission["vehicleType"]) == (3, 12)
    assert [i["doJumpId"] for i in mission["items"]] == list(range(1, len(points) + 2))
    # the speed takes effect as an item after the first waypoint, and with no change of throttle
    speed = mission["items"].pop(1)
    assert (speed["command"], speed["frame"]) == (178, 2)
    assert speed["params"] == [1, 0.5, -1, 0, 0, 0, 0]
    # the vehicle goes straight to the first item from where it was armed: that is the base, held
    assert points[0].position == SITE.base
    for item in mission["items"]:
        assert item["command"] == 16  # no take-off (22), no return to launch (20)
        assert item["frame"] == 3
        assert len(item["params"]) == 7
        assert item["params"][0] >= 1
        assert item["params"][3] is None
        assert item["params"][6] == item["Altitude"] <= -0.1
    fence = data["geoFence"]
    assert all(not f["inclusion"] for f in fence["circles"] + fence["polygons"])
    assert fence["circles"][0]["circle"]["radius"] == 3.0
    assert len(fence["polygons"][0]["polygon"]) == 3
    back = projection().to_plane([i["params"][4:6] for i in mission["items"]])
    assert back == pytest.approx(np.array([p.position[:2] for p in points]), abs=1e-3)


def test_waypoint_lists_load_in_pymavlink(plan, tmp_path):
    mavwp = pytest.importorskip("pymavlink.mavwp")
    file = tmp_path / "m.wpl"
    points = export(SITE, plan, file, "wpl", projection())
    lines = file.read_text().splitlines()
    assert lines[0] == "QGC WPL 110"
    assert all(len(row.split("\t")) == 12 for row in lines[1:])
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(file)) == len(points) + 2
    speed = loader.wp(2)
    assert (speed.command, speed.param1, speed.param2, speed.param3) == (178, 1, 0.5, -1)
    for k, p in enumerate(points):
        item = loader.wp(k + 1 if k == 0 else k + 2)
        assert (item.command, item.frame) == (16, 3)
        xy = projection().to_plane([[item.x, item.y]])[0]
        assert xy == pytest.approx(p.position[:2], abs=1e-3)
        assert item.z == pytest.approx(min(p.position[2], -0.1), abs=1e-3)


def test_a_map_comes_back_as_the_same_problem(plan, tmp_path):
    file = tmp_path / "m.geojson"
    export(SITE, plan, file, "geojson", projection())
    again = read_site(file, Projection(55.5, 12.7, 25.0, SITE.base[:2]))
    assert np.allclose(again.points, SITE.points, atol=1e-3)
    assert [g.name for g in again.goals] == [g.name for g in SITE.goals]
    assert [o.name for o in again.obstacles] == [o.name for o in SITE.obstacles]
    assert again.tether_length == SITE.tether_length
    assert again.clearance == SITE.clearance
    assert solve(again).length == pytest.approx(plan.length, rel=1e-4)
    north_up = read_site(file, None)
    assert solve(north_up).length == pytest.approx(plan.length, rel=1e-4)


def test_tables_hold_every_waypoint(plan, tmp_path):
    file = tmp_path / "m.csv"
    points = export(SITE, plan, file, "csv")
    with open(file) as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(points)
    assert rows[-1]["kind"] == "base"
    assert "latitude" not in rows[0]
    export(SITE, plan, file, "csv", projection())
    assert "latitude" in file.read_text().splitlines()[0]


def test_tags_of_sea_charts_are_read(tmp_path):
    def point(lon, **properties):
        return {
            "type": "Feature", "properties": properties,
            "geometry": {"type": "Point", "coordinates": [lon, 55.0]},
        }  # fmt: skip

    site = tmp_path / "s.geojson"
    features = [
        point(12.001, **{"seamark:type": "pile"}), point(12.002),
        point(12.003, **{"seamark:landmark:category": "windmotor"}, radius_m=4.0),
    ]  # fmt: skip
    site.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    problem = read_site(site, Projection(55.0, 12.0), tether=300.0, radius=1.5)
    assert [o.radius for o in problem.obstacles] == [1.5, 4.0]
    assert problem.goals[0].position[0] == pytest.approx(127.9, abs=0.5)
    with pytest.raises(InputError, match="without radius_m; expected one"):
        read_site(site, Projection(55.0, 12.0), tether=300.0)
    with pytest.raises(InputError, match="has no tether length; expected tether_length"):
        read_site(site, Projection(55.0, 12.0))
    with pytest.raises(InputError, match="has no base; expected a Point"):
        read_site(site, None, tether=300.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--origin", "95,12"], "--origin: latitude: expected -90 to 90, got 95"),
        (["--origin", "55,190"], "--origin: longitude: expected -180 to 180, got 190"),
        (["--origin", "55,12,400"], "--origin: heading: expected -360 to 360, got 400"),
        (["--origin", "here"], "--origin: expected lat,lon or lat,lon,heading, got 'here'"),
        ([], "origin: format 'plan' needs latitude"),
        (["--origin", "55,12", "--format", "dxf"], "format: expected plan, wpl, cockpit, geojson,"),
        (["--origin", "55,12", "--fence-bytes", "17"], "--fence-bytes: expected 18 or more"),
        (["--origin", "55,12", "--fence-bytes=-5"], "--fence-bytes: expected 18 or more, got -5"),
        (["--origin", "55,12", "--fence-bytes", "1e3"], "expected a whole number of bytes"),
        (["--origin", "55,12", "--max-waypoints", "3"], "waypoints, and the vehicle takes 3"),
        (["--origin", "55,12", "--hold", "9999"], "hold: expected whole seconds"),
    ],
)
def test_bad_exports_are_named_and_nothing_is_written(options, message, tmp_path, capsys):
    solution, out = tmp_path / "s.json", tmp_path / "m.plan"
    problem = str(PROBLEMS / "wharf.json")
    main(["solve", problem, "-o", str(solution), "--quiet"])
    capsys.readouterr()
    assert main(["export", str(solution), "--problem", problem, "-o", str(out), *options]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "expected a JSON object"),
        ('{"type": "Feature"}', "expected a feature with a geometry"),
        ('{"type": "Topology"}', "expected a GeoJSON FeatureCollection, Feature or geometry"),
        ('{"type": "FeatureCollection", "features": [1]}', "features[0]: expected a feature"),
        (
            '{"type": "FeatureCollection", "features": [{"geometry": {"type": "Point", '
            '"coordinates": [200, 5]}}]}',
            "expected [longitude, latitude] within 180 and 90 degrees",
        ),
        ('{"type": "FeatureCollection", "features": []}', "has no goal"),
    ],
)
def test_bad_maps_are_named(text, message, tmp_path, capsys):
    site = tmp_path / "s.geojson"
    site.write_text(text)
    assert main(["import", str(site), "--base", "55,12", "--tether", "50"]) == 2
    assert message in capsys.readouterr().err


def collection(*features):
    base = {"type": "Feature", "properties": {"kind": "base", "tether_length": 100},
            "geometry": {"type": "Point", "coordinates": [12.0, 55.0]}}  # fmt: skip
    goal = {"type": "Feature", "properties": {},
            "geometry": {"type": "Point", "coordinates": [12.0003, 55.0]}}  # fmt: skip
    return {"type": "FeatureCollection", "features": [base, goal, *features]}


def shape(form, coordinates, **properties):
    geometry = {"type": form, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


RING = [[12.0005, 55.0], [12.0007, 55.0], [12.0006, 55.0002], [12.0005, 55.0]]


@pytest.mark.parametrize(
    ("feature", "message"),
    [
        (shape("Polygon", None), "expected a polygon with an outer ring"),
        (shape("Polygon", [RING[:3]]), "expected a closed ring"),
        (shape("Polygon", [RING, RING]), "encloses nothing; expected a polygon with an area"),
        (shape("MultiPolygon", [[]]), "expected a polygon with an outer ring"),
        (shape("Polygon", [RING], kind="base"), "a base cannot be a Polygon"),
        (shape("LineString", RING[:3], kind="obstacle"), "1 open line .*; expected a width"),
        (shape("Point", [12, 55], kind="spaceship"), "got 'Point' of kind 'spaceship'"),
        (shape("Point", [float("nan"), 55]), "within 180 and 90 degrees"),
        ({**shape("Point", [12, 55]), "properties": [1]}, "expected an object"),
        (shape("Point", [12.001, 55], kind="base"), "expected one base, got 2"),
    ],
)
def test_odd_features_are_named(feature, message, tmp_path):
    site = tmp_path / "s.geojson"
    site.write_text(json.dumps(collection(feature)))
    with pytest.raises(InputError, match=message):
        read_site(site, None)


def test_repeated_corners_and_features_without_a_place_do_no_harm(tmp_path):
    site = tmp_path / "s.geojson"
    twice = [*RING[:2], RING[1], *RING[2:]]
    nowhere = {"type": "Feature", "properties": {}, "geometry": None}
    empty = shape("Polygon", [])
    site.write_text(json.dumps(collection(shape("Polygon", [twice]), nowhere, empty)))
    problem = read_site(site, None)
    assert len(problem.obstacles[0].polygon) == 3
    (layer,) = problem.site.imported
    assert {g.reason: g.features for g in layer.left_out} == {
        "has no geometry": 1, "has no coordinates": 1,
    }  # fmt: skip


def test_southern_and_western_places_can_be_typed(tmp_path, capsys):
    site = tmp_path / "s.geojson"
    site.write_text(json.dumps(collection()))
    assert main(["import", str(site), "--base", "-33.1,-151.2", "--tether", "2e7"]) == 0
    assert main(["import", str(site), "--base", "99,10"]) == 2
    assert "--base: latitude" in capsys.readouterr().err


@pytest.mark.parametrize(
    "argv",
    [
        ["execute", "p.json"], ["simulate", "m.json", "--seed", "x"], ["nonsense"],
        ["export", "s.json", "--problem", "p.json", "--max-waypoints", "0", "-o", "x"],
    ],
)  # fmt: skip
def test_wrong_flags_take_one_line(argv, capsys):
    assert main(argv) == 2
    err = capsys.readouterr().err
    assert len(err.strip().splitlines()) == 1
    assert err.startswith("netsp: ")


def test_a_mission_file_is_in_metres_and_heights_above_the_water_are_told(tmp_path, capsys):
    problem = Problem(base=(0, 0), goals=[(3, 4, 2), (4, 3, -2)], tether_length=8, units="ft")
    problem.save(tmp_path / "p.json")
    solve(problem).save(tmp_path / "s.json")
    told = ["export", str(tmp_path / "s.json"), "--problem", str(tmp_path / "p.json"),
            "--origin", "54,12", "-o", str(tmp_path / "x.plan")]  # fmt: skip
    assert main(told) == 2
    assert "units: format 'plan' is in metres" in capsys.readouterr().err
    metric = problem.model_copy(update={"units": "m"})
    metric.save(tmp_path / "p.json")
    solve(metric).save(tmp_path / "s.json")
    assert main(told) == 0
    assert "1 goal above the water (#0)" in capsys.readouterr().err


def drawn_tour(problem, there, back):
    """The tour to the only goal and home along two polylines."""
    line = np.array([*there, *back[1:]], dtype=float)
    word = signature(np.array(there), problem.representative_points)
    return Solution(
        problem=ProblemReference(name="x", sha256=problem.sha256), solver="drawn", roadmap="drawn",
        status=Status.FEASIBLE, length=float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()),
        lower_bound=None, gap=None, path=tuple((x, y, 0.0) for x, y in line.tolist()),
        tour=(Visit(goal=0, signature=word, tether_length=1.0),),
    )  # fmt: skip


CORNER = [(0, 0), (10, 0), (10, 10)]


@pytest.mark.parametrize("post", [(8.5, 1.2), (9.4, 2.2), (7.0, 0.6), (8.1, 1.8)])
def test_all_of_the_triangle_at_a_corner_is_kept_free(post):
    """A post between the corner and the line that joins the points a radius before and after it."""
    radius = 4.0
    problem = Problem(
        base=(0, 0), goals=[(10, 10)], tether_length=30, obstacles=[Circle(center=post, radius=0.1)]
    )
    points = waypoints_of(problem, drawn_tour(problem, CORNER, CORNER[::-1]), radius)
    line = np.array([problem.base, *(p.position for p in points)])[:, :2]
    assert tuple(line[1]) != CORNER[1]
    for a, b, c in zip(line[:-2], line[1:-1], line[2:], strict=True):
        if np.hypot(*(a - c)) > 1e-9:  # at the goal it turns back
            ends = [b + (q - b) * min(1.0, radius / np.hypot(*(q - b))) for q in (a, c)]
            triangle = shapely.Polygon([ends[0], b, ends[1]])
            assert triangle.distance(shapely.Point(post)) > 0.1


def test_lines_of_another_class_than_the_plans_are_refused():
    """At the goal, and on the way home: each is looked at."""
    pile = [Circle(center=(5, 5), radius=1)]
    problem = Problem(base=(0, 0), goals=[(10, 10)], tether_length=30, obstacles=pile)
    over = [(0, 0), (0, 10), (10, 10)]
    right = drawn_tour(problem, CORNER, CORNER[::-1])
    assert waypoints_of(problem, right)
    entangled = drawn_tour(problem, CORNER, over[::-1])
    with pytest.raises(InputError, match="not of the plan's homotopy class"):
        waypoints_of(problem, entangled)
    # a corner is moved outward because of the first post, and beyond the second
    posts = [Circle(center=(8.5, 1.2), radius=0.1), Circle(center=(11, -1), radius=0.1)]
    problem = Problem(base=(0, 0), goals=[(10, 10)], tether_length=30, obstacles=posts)
    with pytest.raises(InputError, match="not of the plan's homotopy class"):
        waypoints_of(problem, drawn_tour(problem, CORNER, CORNER[::-1]), 4.0)
    problem = Problem(base=(0, 0), goals=[(10, 10)], tether_length=30, obstacles=pile)
    through = drawn_tour(problem, [(0, 0), (10, 10)], [(10, 10), (0, 0)])
    with pytest.raises(InputError, match="enter an obstacle"):
        waypoints_of(problem, through)
