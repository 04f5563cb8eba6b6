"""Every feature of every input is used or left out for a reason: used + left out = all."""

import itertools
import json
import time

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from netsp import InputError, Problem
from netsp.command.main import main
from netsp.exchange.maps.feature import Unread
from netsp.exchange.maps.ledger import Ledger
from netsp.exchange.maps.line_work import outlines, widened
from netsp.exchange.maps.options import SiteOptions
from netsp.exchange.maps.projection import Projection
from netsp.exchange.maps.site_import import import_site
from netsp.model.import_record import LayerRecord, OmittedFeatures, Site

pytest.importorskip("pyogrio")
shapely = pytest.importorskip("shapely")

HERE = Projection(55.0, 12.0)
STEP = 1e-5  # degrees: about a metre


def at(k, dx=0.0, dy=0.0):
    """Place k of a grid about the base, in degrees, moved by metres."""
    row, column = divmod(k, 12)
    return [12.0 + STEP * (4 * column + dx + 2), 55.0 + STEP * (4 * row + dy + 2)]


def square(k, size=1.0):
    return [at(k), at(k, size), at(k, size, size), at(k, 0.0, size), at(k)]


GEOMETRIES = {
    "point": lambda k: {"type": "Point", "coordinates": at(k)},
    "points": lambda k: {"type": "MultiPoint", "coordinates": [at(k), at(k, 1.0)]},
    "line": lambda k: {"type": "LineString", "coordinates": [at(k), at(k, 1.0)]},
    "ring": lambda k: {"type": "LineString", "coordinates": square(k)},
    "lines": lambda k: {
        "type": "MultiLineString", "coordinates": [[at(k), at(k, 1.0)], [at(k, 0, 1), at(k, 1, 1)]],
    },
    "polygon": lambda k: {"type": "Polygon", "coordinates": [square(k)]},
    "polygons": lambda k: {"type": "MultiPolygon", "coordinates": [[square(k)]]},
    "collection": lambda k: {
        "type": "GeometryCollection",
        "geometries": [GEOMETRIES["point"](k), GEOMETRIES["ring"](k)],
    },
    "empty collection": lambda k: {"type": "GeometryCollection", "geometries": []},
    "nowhere": lambda k: None,
    "no coordinates": lambda k: {"type": "MultiPolygon", "coordinates": []},
}  # fmt: skip
"""Every type of geometry of RFC 7946, about place k."""

KINDS = (None, "goal", "obstacle", "path", "ignore")


def geojson(tmp_path, features):
    file = tmp_path / "map.geojson"
    base = {
        "type": "Feature", "properties": {"kind": "base"},
        "geometry": {"type": "Point", "coordinates": [12.0, 55.0]},
    }  # fmt: skip
    goal = {
        "type": "Feature", "properties": {},
        "geometry": {"type": "Point", "coordinates": [12.0 - STEP, 55.0]},
    }  # fmt: skip
    file.write_text(json.dumps({"type": "FeatureCollection", "features": [base, goal, *features]}))
    return file


@settings(max_examples=60, deadline=None)
@given(drawn=st.lists(st.tuples(st.sampled_from(sorted(GEOMETRIES)), st.sampled_from(KINDS)),
                      max_size=10))  # fmt: skip
def test_geojson_features_of_all_types_and_kinds_add_up(drawn, tmp_path_factory):
    features = [
        {"type": "Feature", "geometry": GEOMETRIES[name](k),
         "properties": {} if kind is None else {"kind": kind}}
        for k, (name, kind) in enumerate(drawn)
    ]  # fmt: skip
    file = geojson(tmp_path_factory.mktemp("map"), features)
    options = SiteOptions(tether=500.0, radius=0.5, line_width=0.4)
    impossible = {("goal", n) for n in ("line", "ring", "lines", "polygon", "polygons")}
    impossible |= {("path", n) for n in ("point", "points", "polygon", "polygons")}
    if any((kind, n) in impossible or (kind in ("goal", "path") and n == "collection")
           for n, kind in drawn):  # fmt: skip
        with pytest.raises(InputError, match=r"features\[\d+\].*cannot be a"):
            import_site(file, options=options)
        return
    found = import_site(file, options=options)
    (layer,) = found.problem.site.imported
    more = sum(name == "collection" for name, _ in drawn)  # of two parts each
    assert layer.features == 2 + len(drawn) + more
    assert sum(layer.used.values()) + sum(g.features for g in layer.left_out) == layer.features
    nowhere = {"nowhere", "empty collection", "no coordinates"}
    left_out = (
        sum(
            2 if name == "collection" else 1
            for name, kind in drawn
            if kind == "ignore" or name in nowhere
        )
        - sum(name == "empty collection" and kind == "ignore" for name, kind in drawn) * 0
    )
    assert sum(g.features for g in layer.left_out) == left_out
    assert len(found.problem.obstacles) >= layer.used.get("obstacle", 0)


def test_a_record_that_does_not_add_up_is_refused():
    group = OmittedFeatures(reason="has no geometry", features=2)
    good = LayerRecord(layer="piles", features=5, used={"obstacle": 3}, left_out=(group,))
    assert Site(file="s.kml", imported=(good,)).notes == [
        "layer 'piles': 2 features left out: has no geometry"
    ]
    with pytest.raises(InputError, match="expected 6 features used or left out, got 5"):
        LayerRecord(layer="piles", features=6, used={"obstacle": 3}, left_out=(group,))


def test_the_problem_file_and_the_table_say_what_became_of_each_feature(tmp_path, capsys):
    features = [
        {"type": "Feature", "geometry": GEOMETRIES["polygon"](0), "properties": {"name": "quay"}},
        {"type": "Feature", "geometry": GEOMETRIES["line"](1), "properties": {"kind": "path"}},
        {"type": "Feature", "geometry": GEOMETRIES["line"](2), "properties": {"kind": "ignore"}},
        {"type": "Feature", "geometry": None, "properties": {}},
    ]
    out, picture = tmp_path / "problem.json", tmp_path / "picture.svg"
    argv = ["import", str(geojson(tmp_path, features)), "--tether", "60", "-o", str(out)]
    assert main([*argv, "--plot", str(picture)]) == 0
    said = capsys.readouterr().err
    head, row = said.splitlines()[:2]
    assert head.split() == ["layer", "features", "base", "goal", "obstacle", "path", "left", "out"]
    assert row.split()[:6] == ["(all)", "6", "1", "1", "1", "1"]
    assert "1: its kind is ignore" in row
    assert "1: has no geometry" in row
    (layer,) = Problem.load(out).site.imported
    assert layer.used == {"base": 1, "goal": 1, "obstacle": 1, "path": 1}
    assert [(g.features, g.first) for g in layer.left_out] == [
        (1, ("features[5]",)), (1, ("features[4]",)),
    ]  # fmt: skip
    assert "stroke-dasharray" in picture.read_text()


def test_open_lines_ask_for_a_width_and_get_it(tmp_path, capsys):
    pier = {
        "type": "Feature",
        "geometry": GEOMETRIES["line"](0),
        "properties": {"man_made": "pier"},
    }
    file = geojson(tmp_path, [pier])
    out = tmp_path / "p.json"
    assert main(["import", str(file), "--tether", "60", "-o", str(out)]) == 2
    said = capsys.readouterr().err
    assert "1 open line (features[2])" in said
    assert "--line-width" in said
    assert not out.exists()
    assert main(["import", str(file), "--tether", "60", "--line-width", "0.5", "-o", str(out)]) == 0
    (obstacle,) = Problem.load(out).obstacles
    line = shapely.LineString(HERE.to_plane([at(0)[::-1], at(0, 1.0)[::-1]]))
    assert obstacle.shape().covers(line.buffer(0.25 - 1e-3))
    assert obstacle.shape().area == pytest.approx((line.length + 0.5) * 0.5, rel=0.01)


def test_a_wall_drawn_out_and_back_is_kept_or_asked_about(tmp_path):
    quay = [at(0), at(0, 4), at(0, 4, 1), at(0, 4, 9), at(0, 4, 1), at(0, 4, 2), at(0, 0, 2), at(0)]
    feature = {
        "type": "Feature", "properties": {"name": "quay"},
        "geometry": {"type": "Polygon", "coordinates": [quay]},
    }  # fmt: skip
    file = geojson(tmp_path, [feature])
    with pytest.raises(InputError, match=r"1 open line \(features\[2\]\)"):
        import_site(file, options=SiteOptions(tether=60.0))
    found = import_site(file, options=SiteOptions(tether=60.0, line_width=0.2))
    whole = shapely.union_all([o.shape() for o in found.problem.obstacles])
    assert whole.covers(shapely.LineString(HERE.to_plane([at(0, 4, 2)[::-1], at(0, 4, 9)[::-1]])))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), pieces=st.integers(1, 9), gap=st.floats(0.0, 0.004))
def test_an_outline_in_pieces_is_the_outline_in_one(seed, pieces, gap):
    """Pieces in any order and sense, whose ends miss each other by less than the tolerance."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(max(pieces, 3), 14))
    turn = np.sort(rng.uniform(0, 2 * np.pi, n)) + np.arange(n) * 1e-3
    corners = np.column_stack([np.cos(turn), np.sin(turn)]) * rng.uniform(5, 9, n)[:, None]
    ring = shapely.Polygon(corners)
    if not ring.is_valid or min(np.hypot(*(corners - np.roll(corners, 1, 0)).T)) < 0.05:
        return
    cuts = np.sort(rng.choice(n, pieces, replace=False))
    lines = []
    for a, b in zip(cuts, [*cuts[1:], cuts[0] + n], strict=True):
        points = corners[np.arange(a, b + 1) % n] + 0.0
        points[[0, -1]] += rng.uniform(-gap, gap, (2, 2)) / 2
        lines.append(shapely.LineString(points[:: rng.choice([-1, 1])]))
    order = rng.permutation(len(lines))
    areas, rest = outlines([lines[k] for k in order], 0.01)
    ((area, members),) = areas
    assert (members, rest) == (list(range(len(lines))), [])
    assert area.symmetric_difference(ring).area < 0.05 * ring.length
    assert outlines([*lines, shapely.LineString([(20, 0), (30, 0)])], 0.01)[1] == [len(lines)]


@given(points=st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=2, max_size=6),
       width=st.floats(0.1, 3.0))  # fmt: skip
@example([(-5, 2), (1, -3), (3, 0), (-5, 2), (1, -3)], 2.5)
@example([(1, 2), (-2, -1), (-4, 0), (2, -3), (-2, -2)], 2.555165860166079)
@example([(-2, -2), (0, -2), (-1, 2), (0, 2), (-2, -2)], 2.5593006508723932)
def test_a_widened_line_holds_all_within_half_its_width(points, width):
    line = shapely.LineString(points)
    if line.length == 0.0:
        return
    # GEOS may fill holes in the buffer of a line that runs over itself, not in those of its pieces
    area = widened(line, width).buffer(1e-6)
    for a, b in itertools.pairwise(points):
        assert a == b or area.covers(shapely.LineString([a, b]).buffer(0.5 * width * 0.999))


def test_a_cropped_problem_refuses_a_tether_that_leaves_its_part_of_the_map(tmp_path):
    near = {"type": "Feature", "geometry": GEOMETRIES["polygon"](0), "properties": {}}
    far = {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [
        [[12.01, 55.0], [12.02, 55.0], [12.02, 55.001], [12.01, 55.0]]]},
        "properties": {}}  # fmt: skip
    land = {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [
        [[12.0005, 54.9], [12.1, 54.9], [12.1, 55.1], [12.0005, 55.1], [12.0005, 54.9]]]},
        "properties": {}}  # fmt: skip
    file = geojson(tmp_path, [near, far, land])
    found = import_site(file, options=SiteOptions(tether=60.0, crop=True))
    (layer,) = found.problem.site.imported
    assert layer.used["obstacle"] == 2
    assert "beyond the reach" in layer.left_out[0].reason
    circle = found.problem.site.cropped
    assert (circle.center, circle.radius) == ((0.0, 0.0), pytest.approx(63.0))
    everywhere = np.array([v for o in found.problem.obstacles for v in o.polygon])
    assert np.hypot(*everywhere.T).max() < 64.0
    data = json.loads(found.problem.to_json())
    with pytest.raises(InputError, match="reaches beyond the part of the map that was imported"):
        Problem.from_json(json.dumps({**data, "tether_length": 64.0}))


def feature(geometry, **properties):
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def sides(corners, **properties):
    """Return the sides of a square as features, each with a name of its own."""
    return [
        feature({"type": "LineString", "coordinates": [a, b]}, name=f"N{n}", **properties)
        for n, (a, b) in enumerate(itertools.pairwise(corners))
    ]


def test_all_pieces_of_a_cropped_outline_are_counted_as_left_out(tmp_path):
    far = [[lon + 0.01, lat] for lon, lat in square(0)]
    file = geojson(tmp_path, sides(far))
    found = import_site(file, options=SiteOptions(tether=60.0, crop=True))
    (layer,) = found.problem.site.imported
    assert "obstacle" not in layer.used
    assert [group.features for group in layer.left_out] == [4]


def test_a_layer_that_a_map_without_layers_lacks_is_named_as_typed(tmp_path):
    file = geojson(tmp_path, sides(square(0)))
    with pytest.raises(InputError, match=r"the map has no layers; expected one of .*, got 'FOO'$"):
        import_site(file, options=SiteOptions(tether=60.0, maps=(("goal", "FOO"),)))


def test_the_other_names_of_a_joined_outline_are_told(tmp_path):
    found = import_site(geojson(tmp_path, sides(square(0))), options=SiteOptions(tether=60.0))
    (obstacle,) = found.problem.obstacles
    assert obstacle.name == "N0"
    assert any("'N1', 'N2', 'N3'" in note for note in found.notes)


@pytest.mark.parametrize("is_joined", [True, False])
def test_an_outline_holds_the_width_that_its_lines_state(tmp_path, is_joined):
    ring = feature({"type": "LineString", "coordinates": square(0)}, width_m=0.8)
    drawn = sides(square(0), width_m=0.8) if is_joined else [ring]
    found = import_site(geojson(tmp_path, drawn), options=SiteOptions(tether=60.0))
    (obstacle,) = found.problem.obstacles
    outline = shapely.Polygon(HERE.to_plane([c[::-1] for c in square(0)]))
    assert obstacle.shape().covers(outline.buffer(0.4 - 1e-3))


def test_a_hole_in_the_bounds_is_an_obstacle(tmp_path):
    rim = [[11.9995, 54.9995], [12.0005, 54.9995], [12.0005, 55.0005], [11.9995, 55.0005]]
    basin = feature({"type": "Polygon", "coordinates": [[*rim, rim[0]], square(0)]}, kind="bounds")
    found = import_site(geojson(tmp_path, [basin]), options=SiteOptions(tether=60.0))
    island = shapely.Polygon(HERE.to_plane([c[::-1] for c in square(0)]))
    whole = shapely.union_all([o.shape() for o in found.problem.obstacles])
    assert whole.covers(island.buffer(-1e-3))
    assert any("1 hole in the bounds" in note for note in found.notes)


def test_points_keep_their_heights_beside_points_without(tmp_path):
    both = {"type": "MultiPoint", "coordinates": [[*at(0), -3.0], at(1)]}
    found = import_site(geojson(tmp_path, [feature(both)]), options=SiteOptions(tether=60.0))
    assert [goal.position[2] for goal in found.problem.goals] == [0.0, -3.0, 0.0]


def test_an_empty_part_of_a_collection_takes_no_other_part_with_it(tmp_path):
    parts = [{"type": "Point", "coordinates": []}, GEOMETRIES["polygon"](0)]
    mixed = feature({"type": "GeometryCollection", "geometries": parts})
    found = import_site(geojson(tmp_path, [mixed]), options=SiteOptions(tether=60.0))
    assert len(found.problem.obstacles) == 1
    (layer,) = found.problem.site.imported
    assert layer.left_out[0].first == ("features[2].geometries[0]",)


def test_a_goal_just_out_of_reach_is_not_said_to_be_swapped(tmp_path):
    here = Projection(0.0, 0.0)
    file = geojson(tmp_path, [feature({"type": "Point", "coordinates": [0.0, 0.001]})])
    text = file.read_text().replace("12.0", "0.0").replace("55.0", "0.0")
    file.write_text(text.replace("11.99999", "0.00001"))
    with pytest.raises(InputError) as refused:
        import_site(file, here, options=SiteOptions(tether=60.0))
    assert "swapped" not in str(refused.value)


KML = '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{}</Document></kml>'


def placemark(name, lon, lat, more=""):
    place = f"<Point><coordinates>{lon},{lat}</coordinates></Point>"
    return f"<Placemark><name>{name}</name>{more}{place}</Placemark>"


def test_a_word_of_a_shape_that_is_a_layer_stands_for_that_layer_only(tmp_path):
    file = tmp_path / "m.kml"
    inner = placemark("A", 12.0001, 55.0)
    goal = placemark("G", 12.0, 55.0001)
    folders = (
        f"<Folder><name>Points</name>{inner}</Folder><Folder><name>Goals</name>{goal}</Folder>"
    )
    file.write_text(KML.format(folders))
    options = SiteOptions(tether=60.0, radius=1.0, maps=[("obstacle", "points")])
    problem = import_site(file, HERE, options=options).problem
    assert ([g.name for g in problem.goals], [o.name for o in problem.obstacles]) == (["G"], ["A"])


def test_depths_in_elements_of_other_namespaces_are_read(tmp_path):
    file = tmp_path / "m.kml"
    data = '<ExtendedData xmlns:c="urn:c"><c:depth>4</c:depth></ExtendedData>'
    file.write_text(KML.format(placemark("G", 12.0, 55.0001, data)))
    (goal,) = import_site(file, HERE, options=SiteOptions(tether=60.0)).problem.goals
    assert goal.position[2] == -4.0


def test_a_system_that_outweighs_the_files_own_is_told(tmp_path):
    pyogrio = pytest.importorskip("pyogrio")
    file = tmp_path / "m.gpkg"
    places = np.array([shapely.to_wkb(shapely.Point(500_000, 6_000_000))], dtype=object)
    pyogrio.raw.write(
        file, geometry=places, field_data=[np.array(["base"], dtype=object)], fields=["kind"],
        crs="EPSG:32632", geometry_type="Point", layer="a",
    )  # fmt: skip
    from netsp.exchange.maps.read_map import read_map

    assert any("EPSG:32632 is not used" in note for note in read_map(file, "EPSG:32633").notes)
    assert not any("is not used" in note for note in read_map(file, "epsg:32632").notes)


def test_messages_of_a_damaged_drawing_name_no_temporary_file(tmp_path):
    pytest.importorskip("pyogrio")
    file = tmp_path / "damaged.dxf"
    tags = "0 SECTION 2 ENTITIES 0 SPLINE 5 A1 8 X 70 8 71 3 72 0 73 0 74 0 0 ENDSEC 0 EOF"
    file.write_text("\n".join(tags.split()) + "\n")
    with pytest.raises(InputError, match=r"damaged\.dxf: .*audit the drawing") as refused:
        import_site(file, options=SiteOptions(tether=60.0))
    assert "drawing.dxf" not in str(refused.value)
    assert ".cpp" not in str(refused.value)


def test_parts_of_a_feature_beyond_the_crop_are_told(tmp_path):
    far = [12.01, 55.0]
    piles = feature({"type": "MultiPoint", "coordinates": [at(0), far]}, radius_m=0.2)
    file = geojson(tmp_path, [piles])
    found = import_site(file, options=SiteOptions(tether=60.0, crop=True))
    assert len(found.problem.obstacles) == 1
    assert any("1 obstacle cut off where the reach" in note for note in found.notes)


def test_a_property_that_no_feature_has_is_refused(tmp_path):
    file = geojson(tmp_path, [feature(GEOMETRIES["point"](0), tiefe=4)])
    options = SiteOptions(tether=60.0, maps=[("depth", "TIEFEN")])
    with pytest.raises(InputError, match=r"no feature of .* has the property 'tiefen'.*tiefe"):
        import_site(file, options=options)


def test_degrees_out_of_range_in_a_table_name_the_row(tmp_path):
    table = tmp_path / "goals.csv"
    table.write_text("lat,lon\n55,12\n3,200\n")
    with pytest.raises(InputError, match=r"goals\.csv: row 2: .*got 3 and 200"):
        import_site(geojson(tmp_path, []), options=SiteOptions(tether=60.0, goals=table))


def test_units_of_an_occupancy_image_are_refused(tmp_path, capsys):
    assert main(["import", str(tmp_path / "m.yaml"), "--units", "ft", "--base", "1,1"]) == 2
    assert "--units: expected a map with features" in capsys.readouterr().err


def test_the_record_of_many_layers_takes_time_by_their_number():
    layers = {f"F{k}": 1 for k in range(12_000)}
    ledger = Ledger(layers)
    for layer in layers:
        ledger.leave_out(Unread(f"{layer}[0]", layer, "has no geometry"), "has no geometry")
    start = time.process_time()
    assert len(ledger.records()) == len(layers)
    assert time.process_time() - start < 2.0  # 0.3 s; several times the limit if quadratic
