"""Maps of every format become the same problem, and what is wrong with one is told at once."""

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError, Problem, Solution, solve, verify
from netsp.base.errors import SeveralErrors, UnansweredError
from netsp.command.main import main
from netsp.exchange.maps import Projection, read_site
from netsp.exchange.maps.drawn_shapes import circle_of

pyogrio = pytest.importorskip("pyogrio")
shapely = pytest.importorskip("shapely")

DATA = Path(__file__).parent.parent.parent / "shared" / "data"
HERE = Projection(55.0, 12.0)

PLANE = {
    "base": [(shapely.Point(0, 0, 0), {"name": "ship", "tether_length": 90.0, "clearance": 0.5})],
    "goal": [
        (shapely.Point(30, 5, -4), {"name": "north"}),
        (shapely.Point(28, -12, -6), {"name": "south"}),
        (shapely.Point(-9, 20, -2), {"name": "west"}),
    ],
    "obstacle": [
        (shapely.Point(15, 2), {"name": "pile", "radius_m": 1.5}),
        (shapely.Polygon([(18, -9), (24, -9), (24, -3), (18, -3)]), {"name": "caisson"}),
    ],
}
"""A site in metres about its base."""


def on_earth(shape):
    def degrees(c):
        out = c.copy()
        out[:, :2] = HERE.to_earth(c[:, :2])[:, ::-1]
        return out

    return shapely.transform(shape, degrees, include_z=bool(shape.has_z))


def rows():
    """(layer, shape on the earth, properties) of the site."""
    return [(k, on_earth(s), p) for k, things in PLANE.items() for s, p in things]


def feature(shape, **properties):
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": shapely.geometry.mapping(shape),
    }


def write_geojson(file, features):
    data = {"type": "FeatureCollection", "features": features}
    file.write_text(json.dumps(data))
    return file


def site(tmp_path):
    features = [feature(s, kind=k, **p) for k, s, p in rows()]
    return read_site(write_geojson(tmp_path / "site.geojson", features))


def write_vector(file, driver, crs="EPSG:4326", move=lambda s: s):
    """Every kind as a layer, or all as one where the format has one only."""
    names = ("name", "kind", "tether_len", "clearance", "radius_m")
    several = driver in ("GPKG", "LIBKML")
    pieces = {}
    for kind, shape, properties in rows():
        if driver == "ESRI Shapefile":
            key = f"{kind}-{shape.geom_type}"
        else:
            key = kind if several else "site"
        pieces.setdefault(key, []).append((kind, move(shape), properties))
    for key, things in pieces.items():
        columns = [
            np.array([p.get(n.replace("_len", "_length"), None) if n != "kind" else kind
                      for kind, _, p in things], dtype=object if n in ("name", "kind") else float)
            for n in names
        ]  # fmt: skip
        target = file.with_name(f"{key}.shp") if driver == "ESRI Shapefile" else file
        pyogrio.raw.write(
            target, np.array([shapely.to_wkb(s) for _, s, _ in things], dtype=object), columns,
            list(names), layer=key if several else None, driver=driver, crs=crs,
            geometry_type="Unknown" if driver != "ESRI Shapefile" else things[0][1].geom_type
            + (" Z" if things[0][1].has_z else ""),
            append=several and file.exists(),
        )  # fmt: skip


def same(a: Problem, b: Problem, places=1e-3) -> bool:
    """Goals and obstacles by name, in any order."""
    goals = {g.name: g.position for g in a.goals}
    return (
        np.allclose(a.base, b.base, atol=places)
        and goals.keys() == {g.name for g in b.goals}
        and all(np.allclose(goals[g.name], g.position, atol=places) for g in b.goals)
        and {o.name for o in a.obstacles} == {o.name for o in b.obstacles}
        and all(
            abs(
                o.shape()
                .symmetric_difference(next(p for p in b.obstacles if p.name == o.name).shape())
                .area
            )
            < 0.05
            for o in a.obstacles
        )
        and a.tether_length == pytest.approx(b.tether_length)
        and a.clearance == pytest.approx(b.clearance)
    )


def test_the_site_is_where_it_should_be(tmp_path):
    problem = site(tmp_path)
    expected = [tuple(s.coords[0]) for s, _ in PLANE["goal"]]
    assert np.allclose([g.position for g in problem.goals], expected, atol=1e-3)
    assert problem.origin.latitude == pytest.approx(55.0)
    assert verify(problem, solve(problem))


@pytest.mark.parametrize(
    ("name", "driver"), [("s.gpkg", "GPKG"), ("s.kml", "LIBKML"), ("s.kmz", "LIBKML")]
)
def test_every_format_gives_the_same_problem(name, driver, tmp_path):
    file = tmp_path / name
    write_vector(tmp_path / "doc.kml" if name.endswith("kmz") else file, driver)
    if name.endswith("kmz"):
        with zipfile.ZipFile(file, "w") as packed:
            packed.write(tmp_path / "doc.kml", "doc.kml")
    found = read_site(
        file, options=None, maps=[("tether_length", "tether_len")],
    )  # fmt: skip
    assert same(found, site(tmp_path))
    assert found.origin == site(tmp_path).origin or driver == "LIBKML"


def test_a_projected_system_gives_the_same_problem(tmp_path):
    from pyproj import Transformer

    utm = Transformer.from_crs("EPSG:4326", "EPSG:32633", always_xy=True)

    def move(shape):
        def there(c):
            out = c.copy()
            out[:, 0], out[:, 1] = utm.transform(c[:, 0], c[:, 1])
            return out

        return shapely.transform(shape, there, include_z=bool(shape.has_z))

    file = tmp_path / "s.gpkg"
    write_vector(file, "GPKG", "EPSG:32633", move)
    # axes of UTM lean by its convergence: the problem's point to the true north all the same
    assert same(read_site(file, maps=[("tether_length", "tether_len")]), site(tmp_path))


def test_a_shapefile_holds_one_layer_of_a_site(tmp_path):
    write_vector(tmp_path / "s.shp", "ESRI Shapefile")
    found = read_site(tmp_path / "goal-Point.shp", HERE, tether=90.0)
    assert [g.name for g in found.goals] == ["north", "south", "west"]
    (tmp_path / "goal-Point.prj").unlink()
    with pytest.raises(InputError, match="no coordinate system; give it with --crs EPSG:4326"):
        read_site(tmp_path / "goal-Point.shp", HERE, tether=90.0)
    again = read_site(tmp_path / "goal-Point.shp", HERE, tether=90.0, crs="EPSG:4326")
    assert again.goals == found.goals


DRAWING = """0
SECTION
2
ENTITIES
0
POINT
8
SHIP
10
0.0
20
0.0
30
0.0
0
POINT
8
goals
10
{far}
20
0.0
30
-3.0
0
CIRCLE
8
PILES
10
{half}
20
0.0
30
0.0
40
{radius}
0
LWPOLYLINE
8
PILES
90
4
70
1
10
-10.0
20
5.0
10
-6.0
20
5.0
10
-6.0
20
9.0
10
-10.0
20
9.0
0
LINE
8
NOTES
10
0.0
20
0.0
11
5.0
21
5.0
0
ENDSEC
0
EOF
"""


def test_a_drawing_has_its_layers_its_circles_and_its_units(tmp_path):
    file = tmp_path / "tank.dxf"
    file.write_text(DRAWING.format(far=20.0, half=10.0, radius=2.0))
    notes = []
    found = read_site(file, tether=60.0, maps=[("ignore", "NOTES")], on_note=notes.append)
    assert found.origin is None
    assert [g.position for g in found.goals] == [(20.0, 0.0, -3.0)]
    circle, square = found.obstacles
    assert circle.center == pytest.approx((10.0, 0.0), abs=1e-6)
    assert circle.radius == pytest.approx(2.0, abs=1e-6)
    assert square.shape().area == pytest.approx(16.0)
    assert any("1 feature left out" in n for n in notes)
    feet = read_site(file, tether=60.0, maps=[("ignore", "NOTES")], units="ft")
    assert feet.goals[0].position == pytest.approx((6.096, 0.0, -0.9144))
    assert feet.obstacles[0].radius == pytest.approx(0.6096, abs=1e-6)


def test_all_that_is_wrong_is_told_at_once(tmp_path, capsys):
    bad = [
        feature(shapely.Point(12.0, 55.0), kind="base", tether_length=50),
        feature(shapely.Point(12.0001, 55.0), kind="spaceship"),
        feature(shapely.Point(12.0002, 55.0), kind="obstacle"),
        feature(shapely.Point(55.0, 12.0), name="swapped"),
        feature(shapely.Point(12.0003, 55.0), depth="deep"),
    ]
    file = write_geojson(tmp_path / "s.geojson", bad)
    with pytest.raises(SeveralErrors) as error:
        read_site(file)
    told = error.value.complaints
    assert len(told) == 4
    assert "features[1]" in told[0]
    assert any("features[2]: an obstacle without radius_m" in t for t in told)
    assert any("(swapped)" in t and "latitude and longitude look swapped" in t for t in told)
    assert any("features[4]: depth: expected a number, got 'deep'" in t for t in told)
    assert main(["import", str(file)]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 4


@pytest.mark.parametrize("seed", range(3))
def test_goals_out_of_reach_are_left_out_only_when_asked(seed, tmp_path):
    rng = np.random.default_rng(seed)
    near, far = rng.uniform(-20, 20, (4, 2)), rng.uniform(100, 200, (7, 2))
    shapes = [on_earth(shapely.Point(*p)) for p in (*near, *far)]
    file = write_geojson(tmp_path / "s.geojson", [feature(s) for s in shapes])
    with pytest.raises(InputError, match="7 goals are farther from the base than the tether"):
        read_site(file, HERE, tether=50.0)
    notes = []
    found = read_site(file, HERE, tether=50.0, skip_unreachable=True, on_note=notes.append)
    assert len(found.goals) == 4
    (note,) = (n for n in notes if "left out" in n)
    assert "7 features left out: farther from the base than the tether is long (50 m)" in note


def test_a_drawing_without_a_unit_that_may_be_in_millimetres_asks_for_the_unit():
    """Its goals are kilometres away if its lengths are metres."""
    drawing = Path(__file__).parent.parent / "examples" / "tank.dxf"
    with pytest.raises(UnansweredError, match=r"states no unit.*--units mm") as caught:
        read_site(drawing, tether=25.0)
    assert caught.value.asks == ("units",)
    assert read_site(drawing, tether=25.0, units="mm").goals
    with pytest.raises(UnansweredError, match=r"GOALS.*skip-unreachable") as caught:
        read_site(drawing, tether=5000.0)
    assert caught.value.asks == ()


def test_goals_that_only_a_longer_way_round_reaches_are_left_out_too(tmp_path, capsys):
    wall = shapely.Polygon([(10, -40), (12, -40), (12, 40), (10, 40)])
    shapes = [(shapely.Point(5, 0), {"name": "near"}), (shapely.Point(20, 0), {"name": "behind"}),
              (wall, {"name": "wall"}),
              (shapely.Point(0, 0), {"kind": "base", "tether_length": 30.0})]  # fmt: skip
    file = write_geojson(tmp_path / "s.geojson", [feature(on_earth(s), **p) for s, p in shapes])
    out = tmp_path / "p.json"
    assert main(["import", str(file), "-o", str(out), "--skip-unreachable"]) == 0
    said = capsys.readouterr().err
    assert "note: goal behind is out of reach: tether_length is 30; expected at least 8" in said
    assert [g.name for g in Problem.load(out).goals] == ["near"]
    (layer,) = Problem.load(out).site.imported
    assert layer.used == {"goal": 1, "obstacle": 1, "base": 1}
    assert [(g.features, g.first) for g in layer.left_out] == [(1, ("features[1]",))]
    assert "1: out of the tether's reach among the obstacles" in said


def ring_about(x, y, r, holes=()):
    outer = [(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r)]
    return shapely.Polygon(outer, holes)


@pytest.mark.parametrize(
    ("shape", "note", "area", "parts"),
    [
        (shapely.Polygon([(20, 0), (30, 10), (30, 0), (20, 10)]), "crosses", 50.0, 2),
        (ring_about(25, 5, 5, [[(24, 4), (26, 4), (26, 6), (24, 6)]]), "filled", 100.0, 1),
        (
            ring_about(0, 0, 9, [[(-8, -8), (8, -8), (8, 8), (-8, 8)]]),
            "cut into parts", 18.0**2 - 16.0**2, 2,
        ),
        (shapely.MultiPolygon([ring_about(20, 0, 1), ring_about(30, 0, 2)]), None, 20.0, 2),
        (shapely.force_3d(ring_about(25, 5, 5), 7.0), None, 100.0, 1),
    ],
    ids=["crossing itself", "hole", "pool with the base", "two parts", "3D"],
)  # fmt: skip
def test_odd_polygons_become_simple_ones(shape, note, area, parts, tmp_path):
    goal = shapely.Point(3.0, 3.0)
    file = write_geojson(
        tmp_path / "s.geojson",
        [feature(on_earth(shape), name="pier"), feature(on_earth(goal), name="goal")],
    )
    notes = []
    found = read_site(file, HERE, tether=80.0, on_note=notes.append)
    assert len(found.obstacles) == parts
    assert sum(o.shape().area for o in found.obstacles) == pytest.approx(area, rel=1e-3)
    assert (note is None and not notes) or any(note in n and "pier" in n for n in notes)
    assert verify(found, solve(found))


@given(n=st.integers(16, 200), r=st.floats(0.1, 50), x=st.floats(-1e3, 1e3), y=st.floats(-1e3, 1e3))
def test_a_ring_of_many_even_corners_is_a_circle_that_holds_it(n, r, x, y):
    turn = 2 * np.pi * np.arange(n) / n
    ring = np.column_stack([x + r * np.cos(turn), y + r * np.sin(turn)])
    (cx, cy), radius = circle_of(ring)
    assert np.hypot(cx - x, cy - y) < 1e-6
    assert radius >= np.hypot(*(ring - (cx, cy)).T).max()
    ring[0] *= 1.0 + 0.05 * r / np.hypot(*ring[0]) if np.hypot(*ring[0]) > r else 0.5
    assert circle_of(ring * (1.0, 1.3)) is None


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_bounds_of_any_outline_hold_the_tour(seed):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 9))
    angle = angle[np.r_[True, np.diff(angle) > 0.15]]
    if len(angle) < 5 or np.diff(np.r_[angle, angle[0] + 2 * np.pi]).max() > 2.8:
        return
    outline = shapely.Polygon(
        np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(4, 12, len(angle))[:, None]
    )
    room = outline.buffer(-0.5)
    spots = []
    for _ in range(400):
        p = shapely.Point(*rng.uniform(-12, 12, 2))
        if room.contains(p) and len(spots) < 5:
            spots.append((p.x, p.y))
    if len(spots) < 5 or room.geom_type != "Polygon":
        return
    corners = [list(c) for c in outline.exterior.coords[:-1]]
    data = {"base": spots[0], "goals": spots[1:], "tether_length": 60.0, "clearance": 0.3}
    problem = Problem.model_validate({**data, "bounds": corners})
    found = solve(problem)
    assert verify(problem, found)
    path = shapely.LineString(np.array(found.path)[:, :2])
    assert outline.buffer(-0.3 + 1e-6).covers(path) or outline.buffer(-0.29).covers(path)
    # whatever a path inside the outline may do, the tour is no longer
    free = Problem.model_validate(data)
    assert found.length >= solve(free).length - 1e-6
    if outline.buffer(-0.3).covers(shapely.LineString(np.array(solve(free).path)[:, :2])):
        assert found.length == pytest.approx(solve(free).length, rel=1e-6)


def test_from_walls_the_clearance_is_kept():
    corners = [[-1, -2], [5, -2], [5, 4], [-1, 4]]
    data = {"base": (0, 0), "tether_length": 9, "clearance": 0.3, "bounds": corners}
    assert len(Problem.model_validate({**data, "goals": [(4.6, 3)]}).obstacles) == 4
    with pytest.raises(ValueError, match=r"lies inside obstacles\[.\] \(wall .\) grown by"):
        Problem.model_validate({**data, "goals": [(4.8, 3)]})


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ([[0, 0], [1, 0]], "at least 3"),
        ([[0, 0], [4, 4], [4, 0], [0, 5]], "bounds: polygon is not simple"),
        ([[0, 0], [1, 0], ["a", 1]], r"bounds\[2\]"),
    ],
)
def test_bad_outlines_are_named(bounds, message):
    with pytest.raises(InputError, match=message):
        Problem.from_json(
            json.dumps(
                {"schema_version": 1, "base": [0.5, 0.2], "goals": [[0.6, 0.2]],
                 "tether_length": 1, "bounds": bounds}
            )
        )  # fmt: skip


def test_a_structure_to_inspect_makes_its_goals():
    obstacles = [
        {"name": "A1", "center": [10, 0], "radius": 2},
        {"name": "hull", "polygon": [[-12, -2], [-4, -2], [-4, 2], [-12, 2]]},
    ]
    asked = [
        {"inspect": "A1", "viewpoints": 4, "standoff": 0.5, "depths": [-2, -6], "bearing": 90},
        {"inspect": "hull", "viewpoints": 6, "standoff": 1},
    ]
    problem = Problem.model_validate(
        {"base": [0, 0], "goals": [*asked, [0, 8]], "obstacles": obstacles, "tether_length": 40,
         "clearance": 0.4}
    )  # fmt: skip
    pile, hull = problem.obstacles
    xy = problem.points[1:, :2]
    assert len(problem.goals) == 15
    assert problem.goals[0].name == "A1/1 z-2"
    assert problem.goals[0].position == pytest.approx((12.5, 0, -2))
    assert np.allclose(pile.signed_distance(xy[:8]), 0.5)
    assert np.allclose(hull.signed_distance(xy[8:14]), 1.0, atol=1e-3)
    assert verify(problem, solve(problem))
    other = {**json.loads(problem.to_json()), "goals": [{"inspect": "B", "standoff": 1}]}
    with pytest.raises(InputError, match=r"goals\[0\].inspect: .* got 'B'; there are 'A1'"):
        Problem.from_json(json.dumps(other))


def test_exports_know_where_the_site_is(tmp_path):
    problem = site(tmp_path)
    file, solution = tmp_path / "p.json", tmp_path / "s.json"
    file.write_text(problem.to_json())
    solve(problem).save(solution)
    plan = tmp_path / "m.geojson"
    argv = ["export", str(solution), "--problem", str(file), "-o", str(plan)]
    assert main(argv) == 0
    again = read_site(plan)
    assert same(again, problem)
    assert Solution.load(solution).problem.sha256 == problem.sha256


@pytest.mark.parametrize("name", ["dudgeon", "hornsrev1"])
def test_whole_wind_farms_are_read(name):
    file = DATA / f"{name}.geojson"
    if not file.is_file():
        pytest.skip(f"{file} is not here")
    base = None if name == "dudgeon" else Projection(55.486, 7.84)
    from netsp.exchange.maps.options import InspectionOptions

    found = read_site(
        file, base, tether=9000.0, radius=4.0, inspection=InspectionOptions(1, 3.0, (-10.0,))
    )
    assert len(found.goals) == len(found.obstacles) == (67 if name == "dudgeon" else 80)
    assert found.goals[0].name == f"{found.obstacles[0].name}/1"


def image(tmp_path, cells, suffix="pgm", **said):
    """A map file over an image of cells: 1 occupied, 0 free, -1 unknown; its first row on top."""
    rasterio = pytest.importorskip("rasterio")
    values = np.where(cells == 1, 0, np.where(cells == 0, 254, 205)).astype(np.uint8)
    if suffix == "pgm":  # plain, as any program might write it
        rows = "\n".join(" ".join(map(str, r)) for r in values)
        (tmp_path / "map.pgm").write_text(
            f"P2\n# a comment\n{cells.shape[1]} {cells.shape[0]}\n255\n{rows}\n"
        )
    else:
        with rasterio.open(
            tmp_path / "map.png", "w", driver="PNG", width=cells.shape[1], height=cells.shape[0],
            count=1, dtype="uint8",
        ) as out:  # fmt: skip
            out.write(values, 1)
    data = {"image": f"map.{suffix}", "resolution": 0.5, "origin": [-3.0, -2.0, 0.0],
            "negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196} | said  # fmt: skip
    file = tmp_path / "map.yaml"
    file.write_text("".join(f"{k}: {v}\n" for k, v in data.items()))
    return file


def basin(rng, rows=30, columns=40):
    """Random blocks and specks; the lower left corner and its surroundings are free."""
    cells = np.zeros((rows, columns), dtype=int)
    for _ in range(6):
        r, c = rng.integers(rows), rng.integers(columns)
        cells[r : r + rng.integers(1, 7), c : c + rng.integers(1, 7)] = 1
    cells[rng.random(cells.shape) < 0.01] = 1
    cells[-5:, :5] = 0
    return cells


@pytest.mark.filterwarnings("ignore::Warning")
@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6), suffix=st.sampled_from(["pgm", "png"]),
    turn=st.sampled_from([0.0, 0.3]), share=st.floats(0.3, 3.0),
)  # fmt: skip
def test_polygons_hold_every_occupied_cell_and_little_more(
    tmp_path_factory, seed, suffix, turn, share
):
    from netsp.exchange.maps.occupancy import read_occupancy

    tmp = tmp_path_factory.mktemp("map")
    cells = basin(np.random.default_rng(seed))
    file = image(tmp, cells, suffix, origin=[-3.0, -2.0, turn])
    right = 0.5 * np.array([np.cos(turn), np.sin(turn)])
    up = 0.5 * np.array([-np.sin(turn), np.cos(turn)])

    def at(column, row):  # rows from below
        return tuple(np.array([-3.0, -2.0]) + column * right + row * up)

    tolerance = 0.5 * share
    problem = read_occupancy(file, at(1, 1), [at(1.2, 1.2)], 5.0, tolerance=tolerance)
    shapes = [shapely.Polygon(o.polygon) for o in problem.obstacles if o.name[0] == "W"]
    union = shapely.union_all(shapes)
    rows = len(cells)
    squares = [
        shapely.Polygon([at(c, rows - r), at(c + 1, rows - r), at(c + 1, rows - r - 1),
                         at(c, rows - r - 1)])
        for r, c in zip(*np.nonzero(cells), strict=True)
    ]  # fmt: skip
    exact = shapely.union_all(squares)
    assert exact.difference(union).area <= 1e-9
    holes = [shapely.Polygon(i) for p in getattr(exact.buffer(tolerance), "geoms",
             [exact.buffer(tolerance)]) for i in p.interiors]  # fmt: skip
    most = shapely.union_all([exact.buffer(1.001 * tolerance, quad_segs=64), *holes])
    assert union.difference(most).area <= 1e-9


def test_an_occupancy_image_becomes_a_plan(tmp_path, capsys):
    cells = np.zeros((20, 30), dtype=int)
    cells[:, 15] = 1
    cells[8:11, 15] = 0
    cells[0, :] = -1
    file = image(tmp_path, cells)
    (tmp_path / "goals.csv").write_text("x,y,name\n10,3,far\n-1,3,near\n")
    out = tmp_path / "p.json"
    argv = ["import", str(file), "--base=-2,-1", "--goals", str(tmp_path / "goals.csv"),
            "--tether", "20", "--clearance", "0.1", "-o", str(out)]  # fmt: skip
    assert main(argv) == 0
    said = capsys.readouterr().err
    assert "30 cells that the map does not know: taken as obstacles" in said
    problem = Problem.load(out)
    assert problem.bounds == (-3.0, -2.0, 12.0, 8.0)
    assert [g.name for g in problem.goals] == ["far", "near"]
    found = solve(problem)
    assert verify(problem, found)
    x, y = np.array(found.path)[:, :2].T
    gate = y[np.abs(x - 4.75) < 0.6]  # of the wall, 1.5 m wide, at rows 9 to 11 from below
    assert gate.min() > 2.5
    assert gate.max() < 4.0


@pytest.mark.parametrize(
    ("said", "complaint"),
    [
        ({"resolution": -1}, "resolution: expected"),
        ({"image": "none.png"}, "none.png: cannot be read"),
        ({"free_thresh": 0.9}, "free_thresh: expected less than occupied_thresh"),
        ({"origin": "[1, 2]"}, "origin"),
        ({"mode": "raw"}, "mode: expected trinary or scale"),
        ({"negate": 3}, "negate"),
        ({"resolution": "[" * 2000 + "]" * 2000}, "not YAML"),
        ({"resolution": "!!int abc"}, "resolution: expected a number"),
    ],
)
def test_what_is_wrong_with_a_map_file_is_one_line(tmp_path, capsys, said, complaint):
    file = image(tmp_path, np.zeros((4, 4), dtype=int), **said)
    (tmp_path / "goals.csv").write_text("x,y\n0,0\n")
    argv = ["import", str(file), "--base=-2,-1", "--goals", str(tmp_path / "goals.csv"),
            "--tether", "9"]  # fmt: skip
    assert main(argv) == 2
    err = capsys.readouterr().err
    # on a busy machine, a progress line about reading may come first
    lines = [line for line in err.splitlines() if not line.startswith("reading ")]
    assert len(lines) == 1
    assert complaint in lines[0]


def test_fields_that_matter_to_nobody_and_numbers_of_any_style_are_read(tmp_path):
    from netsp.exchange.maps.occupancy import read_occupancy

    file = image(tmp_path, np.zeros((9, 9), dtype=int), resolution="5e-1", negate="false",
                 date="2024-13-01", odd="0x_")  # fmt: skip
    assert read_occupancy(file, (-2, -1), [(-1, -1)], 5.0).bounds == (-3.0, -2.0, 1.5, 2.5)


def test_options_of_images_and_of_maps_do_not_mix(tmp_path, capsys):
    file = image(tmp_path, np.zeros((4, 4), dtype=int))
    assert main(["import", str(file), "--tether", "9"]) == 2
    assert "needs --base X,Y" in capsys.readouterr().err
    assert main(["import", str(file), "--crs", "EPSG:32632"]) == 2
    assert "--crs: expected a map with features" in capsys.readouterr().err
    assert main(["import", "examples/site.geojson", "--resolution", "1"]) == 2
    assert "--resolution: expected an occupancy image" in capsys.readouterr().err
    assert main(["import", "examples/site.geojson", "--floor", "f.asc"]) == 2
    assert "floor: expected a chart" in capsys.readouterr().err
    (tmp_path / "alone.png").write_bytes(b"no image")
    (tmp_path / "goals.csv").write_text("x,y\n0,0\n")
    argv = ["import", str(tmp_path / "alone.png"), "--base", "0,0", "--goals",
            str(tmp_path / "goals.csv"), "--tether", "9"]  # fmt: skip
    assert main(argv) == 2
    assert "expected --resolution" in capsys.readouterr().err
    assert main([*argv, "--resolution", "1"]) == 2
    assert "alone.png: not an image" in capsys.readouterr().err


def test_degrees_taken_for_metres_are_told(tmp_path):
    shapes = [(shapely.Point(0.0, 55.0), {"kind": "base", "tether_length": 300.0}),
              (shapely.Point(0.001, 55.001), {"kind": "goal", "name": "g"})]  # fmt: skip
    file = write_geojson(tmp_path / "s.geojson", [feature(s, **p) for s, p in shapes])
    with pytest.raises(InputError, match="they look like degrees; expected metres"):
        read_site(file, crs="local")
    assert len(read_site(file).goals) == 1
