"""Charts: what each object class is, which depths count, and what is left out beyond the reach."""

import itertools
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError, Problem
from netsp.base.errors import UnansweredError
from netsp.command.main import main
from netsp.exchange.maps import chart_classes
from netsp.exchange.maps import site_import as read
from netsp.exchange.maps.chart_classes import REASONS, chart_kind, chart_radius, chart_width
from netsp.exchange.maps.crop import CropWindow, cropped
from netsp.exchange.maps.feature import Feature, Map
from netsp.exchange.maps.map_context import area_of
from netsp.exchange.maps.options import InspectionOptions, SiteOptions
from netsp.exchange.maps.projection import Projection
from netsp.exchange.maps.sea_floor import DepthArea, sea_floor
from netsp.exchange.maps.selection import Selection
from netsp.exchange.maps.site_import import import_site
from netsp.plan.sizing.base_placement import best_base

pyogrio = pytest.importorskip("pyogrio")
shapely = pytest.importorskip("shapely")

CHART = Path(__file__).resolve().parents[2] / "shared" / "data" / "charts" / "US5MIACB.000"
HERE = Projection(55.0, 12.0)


def feature(k, layer, shape, **properties):
    """Feature of a chart from a shape in the plane."""
    degrees = shapely.transform(
        shape, lambda c: np.column_stack([HERE.to_earth(c[:, :2])[:, ::-1], c[:, 2:]]),
        include_z=shape.has_z,
    )  # fmt: skip
    return Feature(f"{layer}[{k}]", layer, "", properties, degrees)


def chart(monkeypatch, *features):
    """Return the name of a chart that holds some features."""
    layers = Counter(f.layer for f in features)

    def found(file, *_):
        return Map(tuple(features), True, layers, is_chart=str(file).endswith(".000"))

    monkeypatch.setattr(read, "read_map", found)
    return "harbour.000"


def square(x, y, size):
    return shapely.box(x, y, x + size, y + size)


def test_every_object_class_of_the_catalogue_is_decided_once():
    groups = [
        chart_classes.STANDING, chart_classes.BEACONS, chart_classes.COURSES, frozenset(REASONS),
    ]  # fmt: skip
    for a, b in itertools.combinations(groups, 2):
        assert not a & b
    table = Path(pyogrio.__file__).parent / "gdal_data" / "s57objectclasses.csv"
    if not table.is_file():
        pytest.skip("GDAL comes without its table of object classes")
    rows = [line.split(",") for line in table.read_text(encoding="utf-8").splitlines()[1:]]
    of_s57 = {r[2].strip('"') for r in rows if r[0].isdigit() and 0 < int(r[0]) < 402}
    known = frozenset().union(*groups)
    assert {c for c in of_s57 if c.isupper() and c not in known} <= {"NEWOBJ"}


@pytest.mark.parametrize(
    ("layer", "properties", "shape", "kind"),
    [
        ("BCNLAT", {"BCNSHP": 5}, shapely.Point(0, 0), "obstacle"),
        ("BCNLAT", {"BCNSHP": 1}, shapely.Point(0, 0), "obstacle"),
        ("bcnlat", {}, shapely.Point(0, 0), "obstacle"),
        ("BCNCAR", {"BCNSHP": 7.0}, shapely.Point(0, 0), "ignore"),
        ("BOYLAT", {}, shapely.Point(0, 0), "ignore"),
        ("MORFAC", {"CATMOR": 1}, shapely.Point(0, 0), "obstacle"),
        ("MORFAC", {"CATMOR": 7}, shapely.Point(0, 0), "ignore"),
        ("CBLSUB", {}, shapely.LineString([(0, 0), (1, 0)]), "path"),
        ("PIPSOL", {}, shapely.Point(0, 0), "ignore"),
        ("CBLARE", {}, shapely.box(0, 0, 1, 1), "ignore"),
        ("SLCONS", {}, shapely.LineString([(0, 0), (1, 0)]), "obstacle"),
        ("DISMAR", {"CATDIS": 1}, shapely.Point(0, 0), "ignore"),
        ("DISMAR", {"CATDIS": 2}, shapely.Point(0, 0), "obstacle"),
        ("XYZABC", {}, shapely.Point(0, 0), "ignore"),
    ],
)
def test_class_and_attributes_decide_what_a_feature_of_a_chart_is(layer, properties, shape, kind):
    decision = chart_kind(Feature("f", layer, "", properties, shape))
    assert decision.kind == kind
    assert bool(decision.reason) == (kind == "ignore")


@given(length=st.one_of(st.none(), st.floats(-5, 90)), width=st.one_of(st.none(), st.floats(0, 90)))
def test_a_point_with_a_length_and_a_width_has_a_circle_that_holds_it(length, width):
    point = Feature("f", "HULKES", "", {"HORLEN": length, "HORWID": width}, shapely.Point(0, 0))
    sizes = [s for s in (length, width) if s is not None and s > 0]
    radius = chart_radius(point)
    assert (radius is None) == (not sizes)
    if sizes:
        assert radius >= 0.5 * np.hypot(sizes[0], sizes[-1]) * (1 - 1e-12)
    assert chart_width(point) == (width if width is not None and width > 0 else None)


def test_lights_that_nothing_carries_are_obstacles(monkeypatch):
    at = shapely.Point
    file = chart(
        monkeypatch,
        feature(0, "LIGHTS", at(30, 0)), feature(1, "BCNLAT", at(30, 0)),
        feature(2, "LIGHTS", at(0, 30)), feature(3, "DAYMAR", at(-30, 0)),
        feature(4, "BOYLAT", at(-30, 0)),
    )  # fmt: skip
    options = SiteOptions(tether=60.0, radius=1.0, inspection=InspectionOptions(1, 2.0))
    found = import_site(file, HERE, options=options)
    used = {layer.layer: layer.used for layer in found.problem.site.imported}
    assert used == {"LIGHTS": {"obstacle": 1}, "BCNLAT": {"obstacle": 1}, "DAYMAR": {},
                    "BOYLAT": {}}  # fmt: skip


def test_shallow_and_unsurveyed_areas_are_obstacles_only_for_a_draught(monkeypatch, tmp_path):
    goals = tmp_path / "goals.csv"
    goals.write_text("name;lon;depth;lat\nwest;11,9997;2;55\n")
    file = chart(
        monkeypatch,
        feature(0, "DEPARE", square(10, 10, 5), DRVAL1=3.0, DRVAL2=5.0),
        feature(1, "DEPARE", square(20, 10, 5), DRVAL1=1.0, DRVAL2=3.0),
        feature(2, "DRGARE", square(30, 10, 5)),
        feature(3, "UNSARE", square(10, 20, 5)),
        feature(4, "DEPARE", square(900, 20, 5), DRVAL1=0.0, DRVAL2=1.0),
    )
    deep = import_site(file, HERE, options=SiteOptions(tether=60.0, goals=goals))
    assert not deep.problem.obstacles
    assert deep.problem.goals[0].name == "west"
    assert deep.problem.goals[0].position == pytest.approx((-19.19, 0.0, -2.0), abs=0.01)
    some = import_site(file, HERE, options=SiteOptions(tether=60.0, goals=goals, draught=2.0))
    used = {layer.layer: layer.used for layer in some.problem.site.imported}
    assert used == {"DEPARE": {"obstacle": 1}, "DRGARE": {"obstacle": 1},
                    "UNSARE": {"obstacle": 1}, "goals.csv": {"goal": 1}}  # fmt: skip
    none = SiteOptions(tether=60.0, goals=goals, draught=2.0, maps=[("ignore", "DRGARE")])
    assert len(import_site(file, HERE, options=none).problem.obstacles) == 2
    with pytest.raises(InputError, match="draught: expected a chart"):
        import_site("site.geojson", HERE, options=none)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_sea_floor_lies_within_the_depths_of_its_areas(seed):
    rng = np.random.default_rng(seed)
    edges = np.sort(rng.uniform(0, 40, 3))
    areas = []
    for low, high in itertools.pairwise([0.0, *edges, 40.0]):
        least, more = rng.uniform(0, 20), rng.uniform(0, 10)
        areas.append(DepthArea(shapely.box(low, 0, high, 30), least, least + more))
    soundings = np.column_stack(
        [rng.uniform(0, 40, 9), rng.uniform(0, 30, 9), rng.uniform(0, 40, 9)]
    )
    land = [shapely.box(5, 5, 12, 12)]
    floor = sea_floor(areas, soundings, land, (-5.0, 0.0, 40.0, 30.0), 1.0)
    rows, columns = floor.heights.shape
    assert (rows, columns) == (30, 45)
    for row, column in itertools.product(range(rows), range(columns)):
        at = shapely.Point(-5.0 + column + 0.5, rows - row - 0.5)
        height = floor.heights[row, column]
        inside = [a for a in areas if a.shape.contains(at)]
        if land[0].contains(at):
            assert height == 0.0
        elif not inside:
            assert np.isnan(height)
        else:
            assert -inside[0].max_depth - 1e-9 <= height <= -inside[0].min_depth + 1e-9


@pytest.mark.parametrize("name", ["floor.asc", "floor.tif"])
def test_a_written_sea_floor_is_read_by_scenes(name, tmp_path):
    pytest.importorskip("rasterio")
    from netsp.world.scene.floor import load_floor

    area = DepthArea(shapely.box(-4, -2, 4, 6), 3.0, 9.0)
    points = np.array([(-4, -2, 4.0), (4, -2, 8.0), (4, 6, 8.0), (-4, 6, 4.0)])
    sea_floor([area], points, [], (-4.0, -2.0, 4.0, 6.0), 1.0).save(tmp_path / name)
    vertices, *_ = load_floor(tmp_path / name)
    top = vertices[: len(vertices) // 2]
    assert top[:, 2] == pytest.approx(-(6.0 + 0.5 * top[:, 0]), abs=1e-3)
    with pytest.raises(InputError, match=r"ends in .asc, .tif, .tiff"):
        sea_floor([area], points, [], (-4.0, -2.0, 4.0, 6.0), 1.0).save(tmp_path / "floor.obj")


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_crop_changes_nothing_within_the_reach_of_any_base(seed):
    rng = np.random.default_rng(seed)
    bases = rng.uniform(-20, 20, (int(rng.integers(1, 4)), 2))
    window = CropWindow.about(bases.tolist(), 15.0, 0.05)
    assert all(np.hypot(*(b - window.center)) + 15.0 <= window.radius for b in bases)
    things = []
    for _ in range(12):
        x, y = rng.uniform(-90, 90, 2)
        if rng.random() < 0.3:
            things.append({"name": None, "center": (x, y), "radius": rng.uniform(0.5, 40)})
        else:
            shape = shapely.Point(x, y).buffer(rng.uniform(1, 70), quad_segs=2)
            things.append({"name": None, "polygon": shapely.get_coordinates(shape)[:-1].tolist()})
    kept, dropped, cut_off = cropped(things, window)
    assert len(dropped) + len({id(t) for t in kept if t in things}) + len(cut_off) == len(things)
    reach = shapely.union_all(shapely.points(bases)).buffer(15.0)
    before, after = (
        shapely.union_all([area_of(t) for t in some]).intersection(reach) for some in (things, kept)
    )
    assert before.symmetric_difference(after).area < 1e-6


def test_a_base_is_sought_only_where_the_imported_map_holds_its_reach(monkeypatch, tmp_path):
    table = tmp_path / "quays.csv"
    table.write_text("x,y,name\n0,40,north\n")
    file = chart(
        monkeypatch, feature(0, "PILPNT", shapely.Point(5, 20)),
        feature(1, "LNDARE", square(500, 0, 9)), feature(2, "PILPNT", shapely.Point(0, 85)),
    )  # fmt: skip
    inspection = InspectionOptions(2, 1.0, chosen=Selection.parse([("box", "0,0,20,30")]))
    options = SiteOptions(tether=50.0, radius=1.0, inspection=inspection)
    alone = import_site(file, HERE, options=options)
    assert len(alone.problem.obstacles) == 1
    with pytest.raises(InputError, match="candidates: #0: the tether reaches beyond"):
        best_base(alone.problem, [[0.0, 40.0]])
    wide = import_site(
        file, HERE, options=SiteOptions(**{**vars(options), "candidates": table})
    ).problem
    assert len(wide.obstacles) == 2
    assert wide.site.imported[-1].used == {"candidate": 1}
    with pytest.raises(InputError, match="candidates: far and 1 more: the tether reaches beyond"):
        best_base(wide, [[0, 40], [90, 0], [0, 90]], names=["quay", "far", None])
    assert Problem.model_validate({**wide.model_dump(), "base": (0.0, 40.0, 0.0)})
    assert best_base(wide, [[0.0, 40.0]]).best is not None


def test_obstacles_to_inspect_are_chosen_by_layer_name_and_box(monkeypatch):
    file = chart(
        monkeypatch,
        feature(0, "SLCONS", shapely.LineString([(10, 0), (10, 9)]), OBJNAM="Pier 1"),
        feature(1, "SLCONS", shapely.LineString([(20, 0), (20, 9)]), OBJNAM="<Null>"),
        feature(2, "PILPNT", shapely.Point(-20, 0), OBJNAM="Pier 1"),
        feature(3, "PILPNT", shapely.Point(-20, 20), OBJNAM="Mole"),
    )

    def goals(*rules):
        inspection = InspectionOptions(1, 2.0, chosen=Selection.parse(rules))
        options = SiteOptions(tether=60.0, radius=1.0, line_width=1.0, inspection=inspection)
        return sorted(g.name for g in import_site(file, HERE, options=options).problem.goals)

    assert goals(("layer", "slcons")) == ["#3/1", "Pier 1 2/1"]
    assert goals(("name", "pier*")) == ["Pier 1 2/1", "Pier 1/1"]
    assert goals(("layer", "PILPNT"), ("name", "Pier 1")) == ["Pier 1/1"]
    assert goals(("box", "-25,-5,-15,5"), ("box", "15,0,25,5")) == ["#3/1", "Pier 1/1"]
    south, west, north, east = (*HERE.to_earth([[-25, 15]])[0], *HERE.to_earth([[-15, 25]])[0])
    assert goals(("earth", f"{south},{west},{north},{east}")) == ["Mole/1"]
    with pytest.raises(InputError, match="there are obstacles of the layers"):
        goals(("layer", "WRECKS"))
    for rule, wrong in (("row", "expected one of layer"), ("box", "expected XMIN,YMIN")):
        with pytest.raises(InputError, match=wrong):
            goals((rule, "4,4,1,1"))


def test_viewpoints_without_room_are_told_and_left_out(monkeypatch):
    file = chart(
        monkeypatch,
        feature(0, "LNDARE", square(5, 5, 20)),
        feature(1, "SLCONS", shapely.LineString([(5, 5), (5, 25)])),
        feature(2, "PILPNT", shapely.Point(0, 47)),
    )
    options = SiteOptions(
        tether=50.0, radius=1.0, line_width=1.0, inspection=InspectionOptions(4, 3.0)
    )
    found = import_site(file, HERE, options=options)
    assert any("left out: within an obstacle" in note for note in found.notes)
    assert any("farther from the base" in note for note in found.notes)
    assert set(found.viewpoints) == {g.name for g in found.problem.goals}


def test_a_base_on_land_is_told_before_lost_viewpoints(monkeypatch):
    file = chart(monkeypatch, feature(0, "LNDARE", square(-900, -900, 1800), OBJNAM="Isle"))
    options = SiteOptions(tether=50.0, inspection=InspectionOptions(1, 2.0))
    with pytest.raises(InputError, match=r"base: lies inside LNDARE\[0\] \(Isle\)"):
        import_site(file, HERE, options=options)


def test_what_is_missing_is_asked_for_without_options_of_the_command_line(monkeypatch):
    file = chart(
        monkeypatch, feature(0, "SLCONS", shapely.LineString([(5, 5), (5, 25)])),
        feature(1, "PILPNT", shapely.Point(9, 0)),
    )  # fmt: skip
    with pytest.raises(UnansweredError) as caught:
        import_site(file, HERE)
    assert caught.value.asks == ("tether", "radius", "line_width", "inspect")
    assert not any("--" in text for text in caught.value.plain)
    assert all("--" in text for text in caught.value.complaints)
    with pytest.raises(UnansweredError) as caught:
        import_site(file)
    assert caught.value.asks == ("base",)


def test_the_report_says_what_became_of_each_layer(monkeypatch):
    from netsp.view.report.briefing import imported

    file = chart(
        monkeypatch, feature(0, "PILPNT", shapely.Point(5, 0)),
        feature(1, "PILPNT", shapely.Point(500, 0)), feature(2, "M_COVR", square(0, 0, 900)),
    )  # fmt: skip
    options = SiteOptions(tether=50.0, radius=1.0, inspection=InspectionOptions(1, 2.0))
    page = imported(import_site(file, HERE, options=options).problem.site)
    assert "Imported from harbour.000" in page
    for cell in ("PILPNT", "1: beyond the reach of the tether", "1: says how the chart was made"):
        assert cell in page


def test_a_real_chart_is_imported_in_one_command(tmp_path):
    if not CHART.is_file():
        pytest.skip("needs ../shared/data/charts/US5MIACB.000")
    out, floor = tmp_path / "p.json", tmp_path / "floor.asc"
    argv = ["import", str(CHART), "--base", "25.7787,-80.1854", "--tether", "100", "--radius", "1",
            "--line-width", "1", "--inspect", "1", "--standoff", "3", "--of", "layer=SLCONS",
            "--floor", str(floor), "-o", str(out), "--plot", str(tmp_path / "p.png")]  # fmt: skip
    assert main(argv) == 0
    problem = Problem.load(out)
    records = {layer.layer: layer for layer in problem.site.imported}
    for name, kind in pyogrio.list_layers(CHART):
        if kind is not None:
            assert records[name].features == pyogrio.read_info(CHART, layer=name)["features"]
    assert records["SLCONS"].used["obstacle"] > 10
    assert not any(o.name and "null" in o.name.lower() for o in problem.obstacles)
    assert floor.read_text().startswith("ncols 256")
