"""Plans, waypoint lists and GPX: all items are goals, base, fences or paths, or they are named."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, InputError, Polygon, Problem, solve
from netsp.command.main import main
from netsp.exchange.maps.mission_commands import (
    CIRCLES,
    NOT_VISITED,
    POLYGONS,
    VISITED,
    WITHOUT_PLACE,
)
from netsp.exchange.maps.options import SiteOptions
from netsp.exchange.maps.projection import Projection
from netsp.exchange.maps.site_import import import_site
from netsp.exchange.missions import export
from netsp.exchange.missions.mission_files import ExportSettings
from netsp.model.problem import Goal

pytest.importorskip("pyproj")
shapely = pytest.importorskip("shapely")

LAT, LON, STEP = 55.0, 12.0, 1e-4
HERE = Projection(LAT, LON)
TETHER = SiteOptions(tether=300.0)


def item(command, k=0, *, frame=3, alt=-2.0, params=(0, 0, 0, None), at=None, **more):
    lat, lon = (LAT + STEP * (k + 1), LON + STEP) if at is None else at
    return {"type": "SimpleItem", "command": command, "frame": frame, "autoContinue": True,
            "params": [*params, lat, lon, alt], "doJumpId": k + 1, **more}  # fmt: skip


def plan(tmp_path, items, home=(LAT, LON, 0), **more):
    data = {
        "fileType": "Plan", "version": 1, "groundStation": "QGroundControl",
        "mission": {"version": 2, "items": items, "plannedHomePosition": home}, **more,
    }  # fmt: skip
    (tmp_path / "m.plan").write_text(json.dumps(data))
    return tmp_path / "m.plan"


def waypoints(tmp_path, rows, home=(LAT, LON, 0)):
    lines = ["QGC WPL 110"]
    if home is not None:
        rows = [[1, 0, 16, 0, 0, 0, 0, *home, 1], *rows]
    lines += ["\t".join(map(str, [k, *row])) for k, row in enumerate(rows)]
    (tmp_path / "m.waypoints").write_text("\n".join(lines) + "\n")
    return tmp_path / "m.waypoints"


def row(command, k=0, *, frame=3, alt=-2.0, params=(0, 0, 0, 0), at=None):
    lat, lon = (LAT + STEP * (k + 1), LON + STEP) if at is None else at
    return [0, frame, command, *params, lat, lon, alt, 1]


def counts(site):
    used, left_out = {}, 0
    for layer in site.imported:
        for kind, n in layer.used.items():
            used[kind] = used.get(kind, 0) + n
        left_out += sum(g.features for g in layer.left_out)
    return used, left_out


COMMANDS = sorted({*VISITED, *NOT_VISITED, *WITHOUT_PLACE, 31000, 43000} - {5100})


@settings(max_examples=25, deadline=None)
@given(
    commands=st.lists(st.sampled_from(COMMANDS), max_size=12),
    frames=st.lists(st.sampled_from([0, 1, 2, 3, 4, 5, 6, 8]), min_size=12, max_size=12),
    is_list=st.booleans(),
)
def test_items_of_all_commands_and_frames_are_used_or_named(
    commands, frames, is_list, tmp_path_factory
):
    tmp_path = tmp_path_factory.mktemp("mission")
    make = row if is_list else item
    items = [make(16, 20), *(make(c, k, frame=f) for k, (c, f) in
                             enumerate(zip(commands, frames, strict=False)))]  # fmt: skip
    site = (waypoints if is_list else plan)(tmp_path, items)
    problem = import_site(site, options=TETHER).problem
    used, left_out = counts(problem.site)
    goals = 1 + sum(c in VISITED and f in (0, 3, 5, 6)
                    for c, f in zip(commands, frames, strict=False))  # fmt: skip
    assert used == {"base": 1, "goal": goals}
    assert sum(used.values()) + left_out == 2 + len(commands)
    assert len(problem.goals) == goals


def test_commands_without_a_place_are_named_in_groups(tmp_path):
    items = [item(16), item(178, at=(0, 0)), item(177, at=(0, 0)), item(178, at=(0, 0)),
             item(16, at=(0, 0)), item(16, at=(None, None)),
             {"type": "ComplexItem", "complexItemType": "survey"}]  # fmt: skip
    problem = import_site(plan(tmp_path, items), options=TETHER).problem
    notes = "\n".join(problem.site.notes)
    assert "2 features left out: DO_CHANGE_SPEED: a command without a place" in notes
    assert "1 feature left out: DO_JUMP" in notes
    assert "2 features left out: has no position (lat = lon = 0)" in notes
    assert "survey" in notes


@pytest.mark.parametrize("is_list", [True, False])
def test_altitudes_are_those_of_their_frame(tmp_path, is_list):
    """Home is at 400 m above the sea, on a lake."""
    make, write = (row, waypoints) if is_list else (item, plan)
    items = [make(16, 0, frame=3, alt=-2.5), make(16, 1, frame=0, alt=396.0)]
    found = import_site(write(tmp_path, items, home=(LAT, LON, 400.0)), options=TETHER)
    assert [g.position[2] for g in found.problem.goals] == pytest.approx([-2.5, -4.0])
    assert found.problem.base[2] == 0.0
    assert any("taken at 400 m" in note for note in found.notes)
    items.append(make(16, 2, frame=10, alt=3.0))
    with pytest.raises(InputError, match="altitudes above the terrain are not known"):
        import_site(write(tmp_path, items), options=TETHER)


def test_a_given_base_goes_before_the_planned_home_and_it_is_said(tmp_path):
    file = plan(tmp_path, [item(16)])
    found = import_site(file, Projection(LAT + STEP, LON), options=TETHER)
    assert any(
        "plannedHomePosition: the base is at the place that was given, 11.1" in n
        for n in found.notes
    )
    assert not any("that was given" in n for n in import_site(file, HERE, options=TETHER).notes)


def ring(size):
    return [(LAT - size, LON - size), (LAT - size, LON + size), (LAT + size, LON + size),
            (LAT + size, LON - size)]  # fmt: skip


@pytest.mark.parametrize("is_list", [True, False])
def test_fences_are_bounds_and_obstacles(tmp_path, is_list):
    inside, wall = ring(2e-3), [(a + 1e-3, b + 1e-3) for a, b in ring(1e-4)]
    pile = (LAT + 4e-4, LON + 4e-4)
    if is_list:
        (poly_in,) = (c for c, i in POLYGONS.items() if i)
        (poly_out,) = (c for c, i in POLYGONS.items() if not i)
        (round_out,) = (c for c, i in CIRCLES.items() if not i)
        rows = [row(16), row(round_out, params=(2.5, 0, 0, 0), at=pile)]
        for command, corners in ((poly_in, inside), (poly_out, wall)):
            rows += [row(command, params=(4, 0, 0, 0), at=c) for c in corners]
        site = waypoints(tmp_path, [*rows, row(5000), row(5100)])
    else:
        fence = {
            "version": 2, "breachReturn": [LAT, LON, 0],
            "polygons": [{"inclusion": True, "version": 1, "polygon": inside},
                         {"inclusion": False, "version": 1, "polygon": wall}],
            "circles": [{"inclusion": False, "version": 1,
                         "circle": {"center": pile, "radius": 2.5}}],
        }  # fmt: skip
        rally = {"version": 2, "points": [[LAT, LON, 5]]}
        site = plan(tmp_path, [item(16)], geoFence=fence, rallyPoints=rally)
    problem = import_site(site, options=TETHER).problem
    assert counts(problem.site) == ({"base": 1, "goal": 1, "bounds": 1, "obstacle": 2}, 2)
    circle = next(o for o in problem.obstacles if isinstance(o, Circle))
    np.testing.assert_allclose(circle.center, HERE.to_plane([pile])[0], atol=1e-3)
    assert circle.radius == 2.5
    corners = HERE.to_plane(inside)
    box = [*corners.min(axis=0), *corners.max(axis=0)]
    np.testing.assert_allclose(problem.bounds, box, atol=0.02)


def inside(corners):
    return {"inclusion": True, "version": 1, "polygon": corners}


def test_several_inclusion_fences_leave_what_is_in_all_of_them(tmp_path):
    left, right = ring(1e-3), [(a, b + 1e-3) for a, b in ring(1e-3)]
    circle = {"inclusion": True, "version": 1, "circle": {"center": [LAT, LON], "radius": 900.0}}
    fence = {"version": 2, "polygons": [inside(left), inside(right)], "circles": [circle]}
    found = import_site(plan(tmp_path, [item(16)], geoFence=fence), options=TETHER)
    assert found.problem.bounds[0] == pytest.approx(HERE.to_plane([right[0]])[0][0], abs=0.1)
    assert found.problem.bounds[2] == pytest.approx(HERE.to_plane([left[1]])[0][0], abs=0.1)
    assert counts(found.problem.site)[0]["bounds"] == 3
    assert any("where all of them overlap" in note for note in found.notes)
    apart = [(a, b + 1e-2) for a, b in ring(1e-3)]
    fence = {"version": 2, "polygons": [inside(left), inside(apart)], "circles": []}
    with pytest.raises(InputError, match="do not overlap"):
        import_site(plan(tmp_path, [item(16)], geoFence=fence), options=TETHER)


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_fences_and_rally_points_of_mission_planner_are_read_or_named(tmp_path, mark):
    corners = [*ring(1e-3), ring(1e-3)[0]]
    lines = "\n".join(f"{a}\t{b}" for a, b in [(LAT, LON), *corners])
    (tmp_path / "f.fen").write_text(f"{mark}#saved by APM Planner\n{lines}\n")
    (tmp_path / "g.csv").write_text("x,y,depth\n3,4,2\n")
    options = SiteOptions(tether=300.0, goals=tmp_path / "g.csv")
    problem = import_site(tmp_path / "f.fen", HERE, options=options).problem
    assert counts(problem.site) == ({"bounds": 1, "goal": 1}, 1)
    box = HERE.to_plane(corners)
    np.testing.assert_allclose(problem.bounds, [*box.min(axis=0), *box.max(axis=0)], atol=0.02)
    rally = f"{mark}#saved by Mission Planner\nRALLY\t{LAT}\t{LON}\t30\t0\t0\t0\n"
    (tmp_path / "r.ral").write_text(rally)
    problem = import_site(tmp_path / "r.ral", HERE, options=options).problem
    assert counts(problem.site) == ({"goal": 1}, 1)
    for name, text, says in (
        ("f.fen", "55\t12\n55.1\t12\n", "then three corners or more"),
        ("f.fen", "550\t12\n" * 5, "line 1: expected latitude and longitude"),
        ("r.ral", "55\t12\n", "expected RALLY first"),
        ("r.ral", "", "expected rally points"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match=says):
            import_site(tmp_path / name, HERE, options=options)


def test_a_plan_that_was_saved_as_json_is_a_plan(tmp_path):
    file = plan(tmp_path, [item(16)]).rename(tmp_path / "m.json")
    assert len(import_site(file, options=TETHER).problem.goals) == 1


def test_a_round_fence_to_stay_inside_is_bounds_on_its_circle(tmp_path):
    circle = {"inclusion": True, "version": 1, "circle": {"center": [LAT, LON], "radius": 90.0}}
    fence = {"version": 2, "polygons": [], "circles": [circle]}
    problem = import_site(plan(tmp_path, [item(16)], geoFence=fence), options=TETHER).problem
    np.testing.assert_allclose(problem.bounds, [-90.0, -90.0, 90.0, 90.0], atol=1e-3)
    walls = shapely.union_all([o.shape() for o in problem.obstacles])
    assert walls.distance(shapely.Point(0, 0)) == pytest.approx(90.0, rel=2e-3)


SITE = Problem(
    name="quay", base=(0, 0, 0), tether_length=40, clearance=0.3,
    goals=[Goal(name="A", position=(6, 4, -2)), Goal(name="B", position=(12, -3, -4)),
           Goal(position=(9, 9, -3))],
    obstacles=[Circle(center=(5, 2), radius=0.6), Polygon(polygon=((9, 0), (11, 0), (11, 2)))],
)  # fmt: skip


@pytest.mark.parametrize("kind", ["plan", "waypoints", "geojson", "kml", "kmz"])
@pytest.mark.parametrize("heading", [0.0, 25.0])
@pytest.mark.parametrize("hold", [None, 0, 1, 30])
def test_what_export_writes_comes_back_as_the_same_goals(tmp_path, kind, heading, hold):
    tour, file = solve(SITE), tmp_path / f"m.{kind}"
    form = "wpl" if kind == "waypoints" else kind
    export(
        SITE,
        tour,
        file,
        form,
        Projection(LAT, LON, heading),
        settings=ExportSettings(goal_hold_s=hold),
    )
    base = Projection(LAT, LON, heading) if kind == "waypoints" else None
    again = import_site(file, base, options=TETHER).problem
    mine = sorted(tuple(np.round(g.position, 3).tolist()) for g in again.goals)
    assert mine == sorted(tuple(map(float, g.position)) for g in SITE.goals)
    if kind != "waypoints":  # which have no place for names and obstacles
        assert {g.name for g in again.goals} == {"A", "B", None}
        assert len(again.obstacles) == len(SITE.obstacles)
        own = import_site(file).problem
        assert (own.tether_length, own.clearance) == (SITE.tether_length, SITE.clearance)


@pytest.mark.parametrize("hold", [None, 0, 1, 2])
def test_a_plan_that_a_ground_station_saved_keeps_its_goals(tmp_path, hold):
    """Ground stations drop members that they do not know, as `netsp`."""
    tour, file = solve(SITE), tmp_path / "m.plan"
    points = export(SITE, tour, file, "plan", HERE, settings=ExportSettings(goal_hold_s=hold))
    data = json.loads(file.read_text())
    holds = [i["params"][0] for i in data["mission"]["items"] if i["command"] == 16]
    stops = [p.goal is not None and p.goal >= 0 for p in points]
    assert not {h for h, s in zip(holds, stops, strict=True) if s} & {
        h for h, s in zip(holds, stops, strict=True) if not s
    }
    del data["netsp"]
    for one in data["mission"]["items"]:
        one.pop("netsp", None)
    file.write_text(json.dumps(data))
    again = import_site(file, options=TETHER).problem
    assert sorted(np.round(g.position, 3).tolist() for g in again.goals) == sorted(
        list(map(float, g.position)) for g in SITE.goals
    )
    assert len(again.obstacles) == len(SITE.obstacles)


ORDER = ["name", "visibility", "open", "description", "styleUrl", "Style", "ExtendedData", "Point",
         "LineString", "Polygon", "Folder", "Placemark"]  # fmt: skip
"""Order of elements by the schema of KML 2.2, of those that are written."""


def test_a_tour_in_kml_follows_the_schema_and_draws_every_tether(tmp_path):
    from xml.etree import ElementTree

    odd = SITE.model_copy(update={"goals": (*SITE.goals[:2], Goal(
        name="<C> & 'ä'", position=(9, 9, -3)))})  # fmt: skip
    tour, file = solve(odd), tmp_path / "tour.kml"
    points = export(odd, tour, file, "kml", Projection(LAT, LON))
    root = ElementTree.parse(file).getroot()
    tag = "{http://www.opengis.net/kml/2.2}"
    for element in root.iter():
        if element.tag in (f"{tag}Document", f"{tag}Folder", f"{tag}Placemark"):
            order = [ORDER.index(child.tag.removeprefix(tag)) for child in element]
            assert order == sorted(order)
    folders = {f.findtext(f"{tag}name"): f for f in root.iter(f"{tag}Folder")}
    assert list(folders) == ["base", "goals", "obstacles", "path", "tethers"]
    lines = {}
    for name in ("path", "tethers"):
        lines[name] = [
            np.array([list(map(float, c.split(","))) for c in e.text.split()])
            for e in folders[name].iter(f"{tag}coordinates")
        ]
    assert folders["tethers"].findtext(f"{tag}visibility") == "0"
    assert len(lines["path"][0]) == len(points)
    for line, visit in zip(lines["tethers"], tour.tour, strict=True):
        xy = Projection(LAT, LON).to_plane(line[:, 1::-1])
        taut = np.linalg.norm(np.diff(np.column_stack([xy, line[:, 2]]), axis=0), axis=1).sum()
        assert taut == pytest.approx(visit.tether_length, rel=2e-3)
    modes = {e.text for e in root.iter(f"{tag}altitudeMode")}
    assert modes == {"absolute"}
    assert len(import_site(file).problem.goals) == 3


def test_a_tour_in_kml_and_kmz_is_what_gdal_reads(tmp_path):
    import zipfile

    pyogrio = pytest.importorskip("pyogrio")
    tour = solve(SITE)
    page, packed = tmp_path / "tour.kml", tmp_path / "tour.kmz"
    points = export(SITE, tour, page, "kml", Projection(LAT, LON))
    export(SITE, tour, packed, "kmz", Projection(LAT, LON))
    with zipfile.ZipFile(packed) as archive:
        assert archive.namelist() == ["doc.kml"]
        assert archive.read("doc.kml") == page.read_bytes()
    assert import_site(packed).problem.goals == import_site(page).problem.goals
    for file in (page, packed):
        shapes = {
            layer: shapely.from_wkb(pyogrio.raw.read(file, layer=layer)[2])
            for layer, _ in pyogrio.list_layers(file)
        }
        assert {layer: len(own) for layer, own in shapes.items()} == {
            "base": 1, "goals": 3, "obstacles": 2, "path": 1, "tethers": 3,
        }  # fmt: skip
        drawn = shapely.get_coordinates(shapes["path"], include_z=True)
        flown = np.array([p.position for p in points])
        there = Projection(LAT, LON).to_plane(drawn[:, 1::-1])
        np.testing.assert_allclose(np.column_stack([there, drawn[:, 2]]), flown, atol=1e-3)


def test_waypoints_that_are_passed_are_named_and_may_be_goals(tmp_path, capsys):
    rows = [row(16, 0), row(16, 1, params=(20, 0, 0, 0)), row(16, 2, params=(1, 0, 0, 0))]
    file = waypoints(tmp_path, rows)
    problem = import_site(file, options=TETHER).problem
    assert counts(problem.site) == ({"base": 1, "goal": 1}, 2)
    argv = ["import", str(file), "--tether", "300", "-o", str(tmp_path / "p.json")]
    assert main([*argv, "--map", "goal=bends"]) == 0
    assert len(Problem.load(tmp_path / "p.json").goals) == 3
    assert "passed: it holds" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.waypoints", "QGC WPL 110\n0\t1\t0\t16\n", "line 2: expected 12 numbers"),
        ("a.waypoints", "0 1 0 16 0 0 0 0 1 2 3 1\n", "expected QGC WPL 110"),
        ("a.plan", '{"fileType": "Parameters"}', "fileType: expected Plan"),
        ("a.plan", '{"fileType": "Plan", "mission": []}', "mission: expected an object"),
        ("a.plan", '{"fileType": "Plan", "mission": {"items": [{"type": "SimpleItem"}]}}',
         "items.0.: expected numbers as command and frame"),
        ("a.gpx", "<kml/>", "expected a gpx element"),
    ],
)  # fmt: skip
def test_a_file_that_is_none_of_these_is_refused_in_a_line(tmp_path, name, text, says):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=says):
        import_site(tmp_path / name, HERE, options=TETHER)


GPX = {
    "wpt": '<wpt lat="55.0001" lon="12.0{k}"><ele>-3</ele><name>W{k}</name></wpt>',
    "dived": '<wpt lat="55.0001" lon="12.0{k}"><extensions><x:depth>7</x:depth></extensions></wpt>',
    "trk": "<trk><name>T</name><trkseg>{points}</trkseg><trkseg>{points}</trkseg></trk>",
    "rte": '<rte><rtept lat="55" lon="12"/><rtept lat="55.001" lon="12"/></rte>',
    "empty": "<trk><name>nothing</name></trk>",
    "one": '<rte><rtept lat="55" lon="12"/></rte>',
    "extensions": "<extensions><x:any>1</x:any></extensions>",
    "metadata": "<metadata><name>a dive</name></metadata>",
}
POINTS = "".join(f'<trkpt lat="55.00{k}" lon="12"><ele>{k}</ele></trkpt>' for k in range(3))


@settings(max_examples=40, deadline=None)
@given(drawn=st.lists(st.sampled_from(sorted(GPX)), max_size=8), old=st.booleans())
def test_elements_of_gpx_are_used_or_named(drawn, old, tmp_path_factory):
    file = tmp_path_factory.mktemp("gpx") / "m.gpx"
    space = "http://www.topografix.com/GPX/1/" + ("0" if old else "1")
    body = "".join(
        GPX[name].format(k=f"{k:03}", points=POINTS) for k, name in enumerate(["wpt", *drawn])
    )
    file.write_text(f'<gpx xmlns="{space}" xmlns:x="urn:x" version="1.1">{body}</gpx>')
    problem = import_site(file, HERE, options=SiteOptions(tether=2e4)).problem
    used, left_out = counts(problem.site)
    expected = {"goal": 1 + drawn.count("wpt") + drawn.count("dived")}
    paths = drawn.count("trk") + drawn.count("rte")
    assert used == expected | ({"path": paths} if paths else {})
    assert left_out == sum(drawn.count(name) for name in ("empty", "one", "extensions"))
    assert sorted(g.position[2] for g in problem.goals) == sorted(
        [-3.0] * (1 + drawn.count("wpt")) + [-7.0] * drawn.count("dived")
    )
    assert not problem.obstacles
