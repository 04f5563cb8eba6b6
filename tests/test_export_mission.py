"""Planned missions handed to ground stations: the same path, classes and tether."""

import csv
import json
import math

import numpy as np
import pytest

from netsp.base.errors import InputError
from netsp.command.main import main
from netsp.exchange.missions import Projection
from netsp.exchange.missions.mission_export import export_mission
from netsp.exchange.missions.mission_files import ExportSettings
from netsp.plan.space.space_plan import plan
from netsp.world.mission.mission import Mission

SCENE = {
    "schema_version": 1, "bounds": [-1, -4, -4, 9, 4, 1],
    "solids": [
        {"post": {"center": [3.0, 0.4], "radius": 0.5}},
        {"post": {"center": [5.0, -1.0], "radius": 0.5}},
    ],
}  # fmt: skip
WAYPOINTS = [
    {"position": [4.2, 2.8, -1.0], "heading": 90.0}, [6.5, 0.2, -1.5],
    {"position": [4.0, -1.8, -0.5], "heading": -45.0}, [4.1, 0.4, -1.0],
]  # fmt: skip
ORIGIN = Projection(55.6, 12.95, 30.0, (0.0, 0.3))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("posts")
    (folder / "scene.json").write_text(json.dumps(SCENE))
    start = {
        "schema_version": 1, "scene": "scene.json", "anchor": [0, 0, -0.5], "start": [0, 0.3, -0.5],
        "waypoints": WAYPOINTS, "clearance": 0.2, "tether_length": 9.0,
    }  # fmt: skip
    (folder / "mission.json").write_text(json.dumps(start))
    planned = plan(Mission.load(folder / "mission.json"), time_limit=None).to_mission()
    planned = planned.model_copy(update={"scene": "scene.json"})
    (folder / "planned.json").write_text(planned.model_dump_json())
    return folder / "planned.json"


def test_the_waypoints_are_those_of_the_tour(file, tmp_path):
    mission, out = Mission.load(file), tmp_path / "m.csv"
    done = export_mission(mission, out, "csv", ORIGIN)
    rows = list(csv.DictReader(out.read_text().splitlines()))
    line = np.array([[float(r[a]) for a in "xyz"] for r in rows])
    assert np.linalg.norm(np.diff(line, axis=0), axis=1).sum() == pytest.approx(
        mission.tour.length, abs=1e-4
    )
    goals = [r for r in rows if r["kind"] == "goal"]
    assert [int(r["goal"]) for r in goals] == [0, 1, 2, 3]
    for r, stop in zip(goals, mission.tour.stops, strict=True):
        assert tuple(map(int, r["signature"].split())) == stop.signature
        assert float(r["tether_length"]) == pytest.approx(stop.tether_length, abs=1e-5)
    assert done.longest <= mission.tether_length
    assert done.room > 0.0
    # degrees lead back to metres
    back = ORIGIN.to_plane([(float(r["latitude"]), float(r["longitude"])) for r in rows])
    assert np.abs(np.array(back) - line[:, :2]).max() < 1e-3


def test_a_place_may_be_visited_twice_with_other_headings(file, tmp_path):
    mission, out = Mission.load(file), tmp_path / "m.csv"
    last, tour = mission.waypoints[-1], mission.tour
    again = tour.stops[-1].model_copy(update={"path": (tour.stops[-1].path[-1],) * 2})
    twice = mission.model_copy(update={
        "waypoints": (*mission.waypoints, last.model_copy(update={"heading": 10.0})),
        "tour": tour.model_copy(update={"stops": (*tour.stops, again)}),
    })  # fmt: skip
    export_mission(twice, out, "csv", ORIGIN)
    goals = [r for r in csv.DictReader(out.read_text().splitlines()) if r["kind"] == "goal"]
    assert [int(r["goal"]) for r in goals] == [0, 1, 2, 3, 4]
    assert [goals[3][a] for a in "xyz"] == [goals[4][a] for a in "xyz"]


def test_depths_are_below_the_surface_and_headings_of_the_compass(file, tmp_path):
    mission, out = Mission.load(file), tmp_path / "m.plan"
    export_mission(mission, out, "plan", ORIGIN, surface=0.5)
    items = json.loads(out.read_text())["mission"]["items"]
    places = [i for i in items if i["command"] == 16]
    assert max(i["params"][6] for i in places) <= -0.1
    assert min(i["params"][6] for i in places) == pytest.approx(-2.0)
    told = sorted(i["params"][3] for i in places if i["params"][3] is not None)
    # the y axis points to 30 degrees; 90 from x is along it, and -45 is 135 to its right
    assert told == pytest.approx(sorted([30.0, 30.0 + 135.0]))
    assert math.isclose(json.loads(out.read_text())["mission"]["plannedHomePosition"][0], 55.6)


@pytest.mark.parametrize("kind", ["plan", "wpl", "geojson", "csv"])
def test_every_format_is_written(file, tmp_path, kind, capsys):
    ending = {"wpl": "waypoints"}.get(kind, kind)
    out = tmp_path / f"m.{ending}"
    assert main(["export", str(file), "--origin", "55.6,12.95,30", "-o", str(out)]) == 0
    assert "4 of them stops" in capsys.readouterr().err
    assert out.stat().st_size > 100


def test_corners_that_cannot_be_cut_are_told(file, tmp_path):
    mission = Mission.load(file)
    with pytest.raises(InputError, match="acceptance: the vehicle could cut the corner"):
        export_mission(mission, tmp_path / "m.csv", "csv", acceptance=2.5)
    assert not (tmp_path / "m.csv").exists()


def test_lines_of_other_classes_or_over_the_limit_are_not_written(file, tmp_path):
    mission, out = Mission.load(file), tmp_path / "m.csv"
    stops = list(mission.tour.stops)
    stops[1] = stops[1].model_copy(update={"signature": (7,)})
    other = mission.model_copy(
        update={"tour": mission.tour.model_copy(update={"stops": tuple(stops)})}
    )
    with pytest.raises(InputError, match="waypoint #1 the lines are not of the planned class"):
        export_mission(other, out, "csv")
    short = mission.model_copy(update={"tether_length": 5.0})
    with pytest.raises(InputError, match="tether_length: the lines between waypoints take"):
        export_mission(short, out, "csv")
    loop = [(2.2, -0.4, -0.5), (3.8, -0.4, -0.5), (3.8, 1.2, -0.5), (2.2, 1.2, -0.5)]
    wound = mission.tour.model_copy(
        update={"home": (*mission.tour.home[:-1], *loop, loop[0], mission.tour.home[-1])}
    )
    with pytest.raises(InputError, match="not of the plan's homotopy class"):
        export_mission(mission.model_copy(update={"tour": wound}), out, "csv")
    assert not out.exists()


BAD = {
    "not planned": ("mission.json", ["-o", "x.csv"], "tour: the mission has none"),
    "a problem beside it": ("planned.json", ["--problem", "p.json", "-o", "x.csv"], "--problem"),
    "no origin": ("planned.json", ["-o", "x.plan"], "origin: format 'plan' needs"),
    "a low surface": (
        "planned.json", ["--origin", "1,2", "--surface", "-3", "-o", "x.plan"],
        "surface: -3 is below",
    ),
    "too many": (
        "planned.json", ["--origin", "1,2", "--max-waypoints", "2", "-o", "x.plan"],
        "the vehicle takes 2",
    ),
    "no format": ("planned.json", ["-o", "x.doc"], "file: expected a name that ends in"),
}  # fmt: skip


@pytest.mark.parametrize(("name", "flags", "expected"), BAD.values(), ids=BAD)
def test_bad_input_is_told_in_one_line(file, name, flags, expected, monkeypatch, capsys):
    monkeypatch.chdir(file.parent)
    assert main(["export", name, *flags]) == 2
    said = capsys.readouterr().err
    assert expected in said
    assert said.count("\n") == 1


def test_settings_are_checked(file, tmp_path):
    with pytest.raises(InputError, match="hold: expected whole seconds"):
        export_mission(
            Mission.load(file), tmp_path / "m.csv", "csv", settings=ExportSettings(goal_hold_s=-1)
        )
