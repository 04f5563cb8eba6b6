"""A plan's fence fits into the vehicle, holds the obstacles, and lets the tour pass; what it does
not hold is said. Mission files are what ground stations load."""

import json
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InputError, Polygon, Problem, Solution, solve
from netsp.command.main import main
from netsp.exchange.maps.qgc_plan import read_plan
from netsp.exchange.missions import Projection, export
from netsp.exchange.missions.export_notes import fence_warnings
from netsp.exchange.missions.fence import FencePolicy, fence_of
from netsp.exchange.missions.mission_files import ExportSettings
from tests.plan_loaders import RefusedError, load_cockpit, load_fence, load_plan, stored_bytes

pytest.importorskip("pyproj")

PATH = [(0.0, 0.0), (40.0, 0.0)]
SITE = Problem(
    name="site", base=(10, -5, 0), tether_length=60, clearance=1.0,
    goals=[{"name": "a", "position": (30, 10, -4)}, (40, -15, -6)],
    obstacles=[
        Circle(center=(25, -5), radius=3, name="pile"),
        Polygon(polygon=[(20, -20), (28, -22), (27, -14)], name="wreck"),
    ],
)  # fmt: skip
PROJECTION = Projection(55.5, 12.7, 25.0, SITE.base[:2])


def ring(n, x, y=6.0, radius=3.0, dent=0.0):
    """A round polygon of n corners; every other one may lie farther inside."""
    out = []
    for k in range(n):
        r, a = radius - dent * (k % 2), 2.0 * math.pi * k / n
        out.append((x + r * math.cos(a), y + r * math.sin(a)))
    return Polygon(polygon=out)


def site(obstacles, clearance=1.0):
    return Problem(
        base=(0, 0), goals=[(40, 0)], tether_length=60, clearance=clearance, obstacles=obstacles
    )


@pytest.mark.parametrize(
    ("obstacles", "n_bytes", "fits"),
    [
        ([Circle(center=(k, 9), radius=0.2) for k in range(51)], 668, True),
        ([Circle(center=(k, 9), radius=0.2) for k in range(52)], 681, False),
        ([ring(83, 9)], 671, True),
        ([ring(84, 9)], 679, False),
        ([ring(40, 9), ring(40, 20), *[Circle(center=(30, 9), radius=1)]], 662, True),
    ],
)
def test_a_vehicle_takes_fences_by_their_bytes_and_not_by_their_points(obstacles, n_bytes, fits):
    policy = FencePolicy(max_bytes=10**6)
    assert fence_of(site(obstacles), PATH, policy).n_bytes == n_bytes
    fence = fence_of(site(obstacles), PATH)
    assert (not fence.simplified and not fence.left_out) == fits
    assert fence.n_bytes <= 672


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(3, 300), st.floats(0.0, 1.0), st.booleans(), st.floats(1.5, 3.0)),
        min_size=1, max_size=12,
    ),
    st.floats(0.0, 1.5), st.integers(40, 2000),
)  # fmt: skip
def test_zones_hold_their_obstacles_keep_within_the_clearance_and_off_the_tour(
    shapes, clearance, max_bytes
):
    obstacles = [
        Circle(center=(8.0 * k, 6.0), radius=r) if is_round
        else ring(n, 8.0 * k, radius=r, dent=dent)
        for k, (n, dent, is_round, r) in enumerate(shapes)
    ]  # fmt: skip
    problem, policy = site(obstacles, clearance), FencePolicy(max_bytes=max_bytes)
    fence = fence_of(problem, PATH, policy)
    assert fence.n_bytes == policy.size(fence.zones) <= max_bytes
    assert sorted([z.obstacle for z in fence.zones] + list(fence.left_out)) == list(
        range(len(obstacles))
    )
    line = shapely.LineString(PATH)
    for zone in fence.zones:
        shape, body = zone.shape.shape(), obstacles[zone.obstacle].shape()
        if isinstance(zone.shape, Circle):  # whose shape is a polygon in it
            middle, corners = shapely.Point(zone.shape.center), shapely.get_coordinates(body)
            far = shapely.distance(middle, shapely.points(corners)).max()
            assert far <= zone.shape.radius + 1e-9
        else:
            assert shape.buffer(1e-6).covers(body)
        assert zone.growth <= 0.5 * clearance
        assert body.buffer(zone.growth + 1e-3, quad_segs=64).covers(shape)
        assert shape.disjoint(line)
        assert not isinstance(zone.shape, Polygon) or len(zone.shape.polygon) <= 255


def test_a_large_fence_is_simplified_before_anything_is_left_out_and_both_are_said():
    obstacles = [ring(120, 9), ring(120, 20, dent=0.3), Circle(center=(30, 20), radius=1)]
    fence = fence_of(site(obstacles), PATH)
    assert not fence.left_out
    (line,) = fence_warnings(site(obstacles), fence)
    assert line.startswith("2 obstacles simplified in the fence")
    # without a clearance nothing may grow: the farthest from the tour are left out
    tight = [ring(60, 9), ring(60, 20, y=60.0), Circle(center=(30, 9), radius=1, name="post")]
    fence = fence_of(site(tight, 0.0), PATH)
    assert fence.left_out == (1,)
    (line,) = fence_warnings(site(tight, 0.0), fence)
    assert line.startswith("1 obstacle left out of the fence (#1)")


def test_an_obstacle_too_large_for_the_vehicle_does_not_keep_others_out_of_the_fence():
    obstacles = [ring(90, 9, dent=2.0), *[Circle(center=(k, 20), radius=0.2) for k in range(9)]]
    fence = fence_of(site(obstacles, 0.1), PATH)
    assert fence.left_out == (0,)
    (line,) = fence_warnings(site(obstacles, 0.1), fence)
    assert line.startswith("1 obstacle left out of the fence (#0), which takes the nearest")


def test_a_tour_that_touches_the_fence_is_told():
    beside = [Circle(center=(9, 2), radius=2, name="pier"), Circle(center=(20, 2), radius=1.9)]
    corner = Polygon(polygon=[(30, 0), (33, 3), (27, 3)], name="quay")
    fence = fence_of(site([*beside, corner], 0.0), PATH)
    assert fence.touched == (0, 2)
    (line,) = fence_warnings(site([*beside, corner], 0.0), fence)
    assert line.startswith("the tour touches the fence at 2 obstacles (pier, quay)")
    assert fence_of(site(beside[1:]), PATH).touched == ()


def test_a_policy_out_of_range_is_refused(tmp_path, capsys):
    for wrong in ({"max_bytes": 17}, {"max_growth": 1.0}, {"max_growth": -0.1}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            FencePolicy(**wrong)


@pytest.fixture(scope="module")
def plan():
    return solve(SITE)


def test_plans_are_what_ground_stations_load(plan, tmp_path):
    export(SITE, plan, tmp_path / "m.plan", "plan", PROJECTION)
    data = json.loads((tmp_path / "m.plan").read_text())
    load_plan(data)
    assert stored_bytes(data["geoFence"]) == 5 + 13 + 2 + 3 * 8
    many = SITE.model_copy(update={"obstacles": (*SITE.obstacles, ring(200, 100.0, y=90.0))})
    export(many, plan, tmp_path / "n.plan", "plan", PROJECTION)
    data = json.loads((tmp_path / "n.plan").read_text())
    load_plan(data)
    assert stored_bytes(data["geoFence"]) <= 672
    assert len(data["geoFence"]["circles"]) + len(data["geoFence"]["polygons"]) == 3
    assert data["netsp"]["fence"] == {"simplified": ["#2"], "left_out": []}
    (note,) = read_plan(tmp_path / "n.plan").notes  # else the plan would pass for the problem
    assert note.startswith("the fence has 1 obstacle ('#2') simplified")
    export(many, plan, tmp_path / "n.plan", "plan", PROJECTION, settings=ExportSettings(
        fence=FencePolicy(max_bytes=18)))  # fmt: skip
    assert any("lacks 2 obstacles" in line for line in read_plan(tmp_path / "n.plan").notes)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda f: f["circles"][0].pop("version"),
        lambda f: f["circles"][0]["circle"].update(radius=0.0),
        lambda f: f["polygons"][0].update(inclusion=0),
        lambda f: f["polygons"][0]["polygon"].append(f["polygons"][0]["polygon"][0]),
        lambda f: f.pop("polygons"),
    ],
)
def test_a_fence_that_no_ground_station_loads_is_seen(plan, tmp_path, spoil):
    export(SITE, plan, tmp_path / "m.plan", "plan", PROJECTION)
    fence = json.loads((tmp_path / "m.plan").read_text())["geoFence"]
    spoil(fence)
    with pytest.raises(RefusedError):
        load_fence(fence)


def test_a_mission_of_cockpit_uploads_the_waypoints_of_a_plan(plan, tmp_path):
    points = export(SITE, plan, tmp_path / "m.cmp", "cockpit", PROJECTION)
    data = json.loads((tmp_path / "m.cmp").read_text())
    items = load_cockpit(data)
    assert data["settings"]["defaultCruiseSpeed"] == 0.5
    assert (items[1]["command"], items[1]["params"]) == ("MAV_CMD_DO_CHANGE_SPEED", [1, 0.5, -1, 0])
    items.pop(1)
    assert {i["command"] for i in items} == {"MAV_CMD_NAV_WAYPOINT"}
    back = PROJECTION.to_plane([(i["x"] * 1e-7, i["y"] * 1e-7) for i in items])
    assert back == pytest.approx(np.array([p.position[:2] for p in points]), abs=0.02)
    for item, p in zip(items, points, strict=True):
        assert item["z"] == pytest.approx(min(p.position[2], -0.1), abs=1e-3)
        assert item["params"][0] == (5 if p.goal is not None and p.goal >= 0 else 1)
    again = tmp_path / "again.cmp"
    export(SITE, plan, again, "cockpit", PROJECTION, settings=ExportSettings(speed=None))
    assert len(load_cockpit(json.loads(again.read_text()))) == len(points)


def test_the_command_writes_missions_of_cockpit_and_says_what_the_fence_lacks(
    plan, tmp_path, capsys
):
    crowd = [Circle(center=(float(k), 900.0), radius=0.2) for k in range(60)]
    wide = SITE.model_copy(update={"obstacles": (*SITE.obstacles, *crowd)})
    wide.save(tmp_path / "p.json")
    solve(wide, seed=0).save(tmp_path / "s.json")
    line = ["export", str(tmp_path / "s.json"), "--problem", str(tmp_path / "p.json"),
            "--origin", "55.5,12.7", "-o"]  # fmt: skip
    assert main([*line, str(tmp_path / "m.plan")]) == 0
    err = capsys.readouterr().err
    assert "12 obstacles left out of the fence" in err
    assert main([*line, str(tmp_path / "m.plan"), "--fence-bytes", "2000"]) == 0
    assert "left out of the fence" not in capsys.readouterr().err
    assert main([*line, str(tmp_path / "m.cmp")]) == 0
    assert "not written in this format: the tether's length, the clearance, obstacles" in (
        capsys.readouterr().err
    )
    load_cockpit(json.loads((tmp_path / "m.cmp").read_text()))
    assert isinstance(Solution.load(tmp_path / "s.json"), Solution)
