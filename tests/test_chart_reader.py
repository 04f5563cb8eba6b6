"""Cells of S-57 as files: units, datums, updates, and what a file that is no cell is told."""

import shutil
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import InputError
from netsp.exchange.maps.options import InspectionOptions, SiteOptions
from netsp.exchange.maps.projection import Projection
from netsp.exchange.maps.read_map import read_map
from netsp.exchange.maps.sea_floor import Danger, DepthArea, sea_floor
from netsp.exchange.maps.selection import Selection
from netsp.exchange.maps.site_import import import_site
from tests.chart_writer import write_cell

pytest.importorskip("pyogrio")
shapely = pytest.importorskip("shapely")

HERE = Projection(55.0, 12.0)
FATHOM, FOOT = 1.8288, 0.3048


def at(shape):
    """Return a shape of the plane about HERE in degrees."""
    return shapely.transform(
        shape, lambda c: np.column_stack([HERE.to_earth(c[:, :2])[:, ::-1], c[:, 2:]]),
        include_z=shape.has_z,
    )  # fmt: skip


def water(x, y, size, least=None, greatest=None):
    """Return a depth area in the plane about HERE."""
    depths = {"DRVAL1": least, "DRVAL2": greatest}
    known = {name: value for name, value in depths.items() if value is not None}
    return "DEPARE", at(shapely.box(x, y, x + size, y + size)), known


def soundings(*places):
    return "SOUNDG", at(shapely.MultiPoint(places)), {}


def pile(x, y, **attributes):
    return "PILPNT", at(shapely.Point(x, y)), attributes


FEATURES = [
    water(10, 10, 30, 2.5, 5.0), soundings((15, 15, 3.5), (20, 20, 4.0)),
    ("WRECKS", at(shapely.Point(30, 30)), {"VALSOU": 1.5}), pile(-20, 0, OBJNAM="Dolphin"),
    ("HULKES", at(shapely.Point(-40, 0)), {"HORLEN": 8.0, "HORWID": 6.0}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("units", "said", "depth", "length"),
    [
        ((1, 1), None, 1.0, 1.0), ((3, 2), None, FOOT, FOOT), ((4, 1), None, FATHOM, 1.0),
        ((2, 2), "fathom", FATHOM, FOOT), ((9, 9), "ft", FOOT, FOOT), ((1, 2), "ft", FOOT, FOOT),
    ],
)  # fmt: skip
def test_depths_and_lengths_are_in_metres_whatever_the_unit_of_the_chart(
    units, said, depth, length, tmp_path
):
    file = write_cell(
        tmp_path / "A.000", FEATURES, depth_unit=units[0], height_unit=units[1], sounding_factor=100
    )
    found = read_map(file, None, said)
    by_layer = {feature.layer: feature for feature in found.features}
    assert by_layer["DEPARE"].get("drval1") == pytest.approx(2.5 * depth)
    assert by_layer["WRECKS"].get("valsou") == pytest.approx(1.5 * depth)
    assert by_layer["HULKES"].get("horlen") == pytest.approx(8.0 * length)
    z = shapely.get_coordinates(by_layer["SOUNDG"].shape, include_z=True)[:, 2]
    assert z == pytest.approx([-3.5 * depth, -4.0 * depth])
    options = SiteOptions(tether=90.0, radius=1.0, units=said, inspection=InspectionOptions(1, 2.0))
    problem = import_site(file, HERE, options=options).problem
    radii = sorted(o.radius for o in problem.obstacles)
    assert radii == pytest.approx([1.0, 1.0, 5.0 * length])


@pytest.mark.parametrize("units", [(2, 1), (0, 1), (7, 2), (1, 3), (1, 0)])
def test_a_unit_that_is_not_known_is_refused_with_what_to_do(units, tmp_path):
    file = write_cell(tmp_path / "A.000", FEATURES, depth_unit=units[0], height_unit=units[1])
    with pytest.raises(InputError, match=r"A\.000: unit of (depths|lengths) .*--units"):
        read_map(file)


def test_areas_in_other_units_than_the_chart_are_refused(tmp_path):
    area = ("M_UNIT", at(shapely.box(0, 0, 50, 50)), {"DUNITS": 3})
    file = write_cell(tmp_path / "A.000", [*FEATURES, area])
    with pytest.raises(InputError, match=r"unit of depths 1, 3 \(DUNI\)"):
        read_map(file)
    same = ("M_UNIT", area[1], {"DUNITS": 1})
    assert read_map(write_cell(tmp_path / "B.000", [*FEATURES, same])).is_chart


def test_the_datum_of_depths_is_named_and_so_are_depths_below_another(tmp_path):
    other = (*FEATURES[1][:2], {"VERDAT": 23})
    notes = read_map(write_cell(tmp_path / "A.000", [other], datum=24)).notes
    assert "edition 2, no updates; depths in m below a local datum, lengths in m" in notes
    assert any("1 feature with depths below lowest astronomical tide instead" in n for n in notes)
    notes = read_map(write_cell(tmp_path / "B.000", FEATURES, datum=31)).notes
    assert any("below the datum of number 31 in S-57" in note for note in notes)


def test_updates_beside_a_cell_are_applied_or_named(tmp_path):
    file = write_cell(tmp_path / "A.000", FEATURES)
    write_cell(tmp_path / "A.001", [pile(0, 30)], update=1, deleted=[("HULKES", 5)])
    write_cell(tmp_path / "A.002", [pile(0, 40)], update=2)
    found = read_map(file)
    assert found.notes[0].startswith("edition 2, update 2;")
    assert found.layers["PILPNT"] == 3
    assert "HULKES" not in found.layers
    write_cell(tmp_path / "A.004", [pile(0, 50)], update=4)
    found = read_map(file)
    assert found.layers["PILPNT"] == 3
    assert "1 update beside the chart not applied: update 3 is missing (A.004)" in found.notes
    write_cell(tmp_path / "A.003", [pile(0, 60)], update=3, edition="1")
    assert any("of edition 1, and the chart is of edition 2 (A.003)" in n
               for n in read_map(file).notes)  # fmt: skip
    with pytest.raises(InputError, match=r"is an update of a chart; expected the chart itself"):
        read_map(tmp_path / "A.002")


def test_a_cell_issued_anew_takes_only_the_updates_after_it(tmp_path):
    file = write_cell(tmp_path / "A.000", FEATURES, reissue=2)
    write_cell(tmp_path / "A.002", [pile(0, 40)], update=2)
    write_cell(tmp_path / "A.003", [pile(0, 50)], update=3)
    found = read_map(file)
    assert found.layers["PILPNT"] == 2
    assert found.notes[0].startswith("edition 2, update 3;")


def test_files_that_are_no_single_cell_are_told_in_one_line(tmp_path):
    cell = write_cell(tmp_path / "A.000", FEATURES)
    exchange = tmp_path / "exchange" / "ENC_ROOT"
    exchange.mkdir(parents=True)
    shutil.copy(cell, exchange)
    (exchange / "CATALOG.031").write_bytes(b"004563LE1 0900065 ! 34040001CATD")
    with zipfile.ZipFile(tmp_path / "set.zip", "w") as archive:
        archive.write(cell, "ENC_ROOT/A.000")
    for file, expected in (
        (tmp_path / "exchange", r"a folder of charts; expected one .*ENC_ROOT/A\.000"),
        (tmp_path / "set.zip", r"an archive of charts; unpack it.*ENC_ROOT/A\.000"),
        (exchange / "CATALOG.031", r"the catalogue of an exchange set.*A\.000"),
    ):
        with pytest.raises(InputError, match=expected):
            read_map(file)
    (tmp_path / "B.000").write_text("no chart")
    with pytest.raises(InputError, match="not a chart of S-57"):
        read_map(tmp_path / "B.000")
    with pytest.raises(InputError, match="always in degrees"):
        read_map(cell, "EPSG:32632")
    shutil.copy(cell, tmp_path / "renamed.dat")
    assert read_map(tmp_path / "renamed.dat").is_chart


def test_every_feature_of_a_cell_is_used_or_left_out_with_a_reason(tmp_path):
    line = at(shapely.LineString([(5, 0), (5, 20), (9, 25)]))
    area = at(
        shapely.Polygon([(50, 0), (80, 0), (80, 30), (50, 30)], [[(60, 9), (70, 9), (65, 19)]])
    )
    shapes = (line, area, at(shapely.Point(-9, 9)))
    file = write_cell(tmp_path / "A.000", [
        *FEATURES, *(("SLCONS", shape, {}) for shape in shapes),
        *(("OBSTRN", shape, {"VALSOU": 2.0}) for shape in shapes), ("DEPCNT", line, {}),
        ("M_COVR", at(shapely.box(-500, -500, 500, 500)), {"CATCOV": 1}), pile(400, 0),
    ])  # fmt: skip
    options = SiteOptions(
        tether=90.0,
        radius=1.0,
        line_width=1.0,
        inspection=InspectionOptions(1, 2.0),
        floor=True,
        draught=1.0,
    )
    found = import_site(file, HERE, options=options)
    records = {layer.layer: layer for layer in found.problem.site.imported}
    used = {name: layer.used for name, layer in records.items() if layer.used}
    assert used == {
        "DEPARE": {"floor": 1}, "SOUNDG": {"floor": 1}, "WRECKS": {"obstacle": 1},
        "PILPNT": {"obstacle": 1}, "HULKES": {"obstacle": 1}, "SLCONS": {"obstacle": 3},
        "OBSTRN": {"obstacle": 3},
    }  # fmt: skip
    for layer in records.values():
        assert sum(layer.used.values()) + sum(g.features for g in layer.left_out) == layer.features
    reasons = {name: [g.reason for g in layer.left_out] for name, layer in records.items()}
    assert reasons["DEPCNT"] == ["a depth that the chart does not give"]
    assert reasons["PILPNT"][0].startswith("beyond the reach")


def test_goals_at_soundings_and_wrecks_are_as_deep_as_the_chart_says(tmp_path):
    file = write_cell(tmp_path / "A.000", FEATURES, depth_unit=4)
    options = SiteOptions(
        tether=90.0, radius=1.0, maps=[("goal", "SOUNDG"), ("goal", "WRECKS")]
    )  # fmt: skip
    depths = sorted(g.position[2] for g in import_site(file, HERE, options=options).problem.goals)
    assert depths == pytest.approx([-4.0 * FATHOM, -3.5 * FATHOM, -1.5 * FATHOM])


# Draught


def test_soundings_shallower_than_the_draught_are_obstacles(tmp_path):
    file = write_cell(tmp_path / "A.000", [
        water(10, -20, 40, 5.0, 10.0), soundings((20, 0, 1.5), (30, 0, 6.0), (-20, 5, 1.0)),
        water(-30, 0, 15, 0.0, 2.0), pile(0, 20),
    ])  # fmt: skip
    options = SiteOptions(
        tether=90.0, inspection=InspectionOptions(1, 2.0), radius=1.0, draught=2.0
    )
    circles = [o for o in import_site(file, HERE, options=options).problem.obstacles
               if hasattr(o, "radius")]  # fmt: skip
    assert sorted(o.center[0] for o in circles) == pytest.approx([0.0, 20.0], abs=0.01)
    without = SiteOptions(
        tether=90.0, inspection=InspectionOptions(1, 2.0), radius=1.0, draught=1.5
    )
    assert len(import_site(file, HERE, options=without).problem.obstacles) == 2


@pytest.mark.parametrize(
    ("draught", "obstacles"), [(None, 0), (0.0, 2), (1e-9, 3), (0.5, 3), (3.0, 4)]
)
def test_the_draught_decides_which_areas_are_too_shallow(draught, obstacles, tmp_path):
    table = tmp_path / "goals.csv"
    table.write_text("x,y,depth\n0,60,1\n")
    file = write_cell(tmp_path / "A.000", [
        water(10, 0, 8, -1.5, 0.0), water(20, 0, 8, 0.0, 2.0), water(30, 0, 8, 2.0, 5.0),
        water(40, 0, 8, 3.0, 5.0), ("UNSARE", at(shapely.box(-20, 0, -10, 10)), {}),
    ])  # fmt: skip
    options = SiteOptions(tether=90.0, goals=table, draught=draught)
    assert len(import_site(file, HERE, options=options).problem.obstacles) == obstacles


def test_places_in_water_that_may_be_too_shallow_are_named(tmp_path):
    table = tmp_path / "goals.csv"
    table.write_text("x,y,name\n25,5,weir\n0,60,pier\n")
    cells = [water(20, 0, 10, 0.0, 2.0), water(-5, -5, 10, 1.0, 2.0)]
    file = write_cell(tmp_path / "A.000", cells)
    options = SiteOptions(tether=90.0, goals=table, draught=2.0)
    with pytest.raises(InputError) as caught:
        import_site(file, HERE, options=options)
    base, goal = caught.value.complaints
    assert "base: lies in DEPARE[1], from 1 m of depth on, and the draught is 2 m" in base
    assert "(weir): lies in DEPARE[0], from 0 m of depth on" in goal
    with pytest.raises(InputError, match="draught: expected a depth of 0 m or more"):
        SiteOptions(draught=-1.0)


def test_shallow_water_is_inspected_only_where_its_layer_is_chosen(tmp_path):
    file = write_cell(tmp_path / "A.000", [pile(-20, 0), water(20, 0, 10, 0.0, 2.0)])

    def layers(*rules):
        inspection = InspectionOptions(1, 2.0, chosen=Selection.parse(rules))
        options = SiteOptions(tether=90.0, radius=1.0, draught=2.0, inspection=inspection)
        problem = import_site(file, HERE, options=options).problem
        return [g.position[0] > 0 for g in problem.goals], len(problem.obstacles)

    assert layers() == ([False], 2)
    assert layers(("layer", "DEPARE")) == ([True], 2)


def test_a_base_in_shallow_water_is_told_once(tmp_path):
    file = write_cell(tmp_path / "A.000", [water(-300, -300, 600, 0.0, 2.0), pile(0, 20)])
    options = SiteOptions(
        tether=90.0, radius=1.0, draught=2.0, inspection=InspectionOptions(1, 2.0)
    )
    with pytest.raises(InputError) as caught:
        import_site(file, HERE, options=options)
    assert sum("base: lies" in text for text in caught.value.complaints) == 1


def test_reach_without_depths_and_beyond_the_chart_is_told(tmp_path):
    cover = ("M_COVR", at(shapely.box(-100, -100, 0, 100)), {"CATCOV": 1})
    file = write_cell(tmp_path / "A.000", [cover, pile(-30, 0), water(-200, -200, 200, 5.0, 9.0)])
    inspection = InspectionOptions(1, 2.0)
    options = SiteOptions(tether=50.0, radius=1.0, inspection=inspection, draught=2.0)
    notes = import_site(file, HERE, options=options).notes
    assert "50 % of the tether's reach is not on this chart, and free of obstacles in the " \
           "problem" in notes  # fmt: skip
    assert any(n.startswith("75 % of the tether's reach is water whose depth") for n in notes)


# Sea floor


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_sea_floor_is_never_deeper_than_a_sounding_or_a_danger(seed):
    rng = np.random.default_rng(seed)
    cell = rng.uniform(0.7, 5.0)
    areas = [
        DepthArea(shapely.box(0, 0, 25, 30), 4.0, 9.0),
        DepthArea(shapely.box(25, 0, 40, 30), 8.0, None),
    ]
    spots = np.column_stack(
        [rng.uniform(0, 40, 12), rng.uniform(0, 30, 12), rng.uniform(-1, 20, 12)]
    )
    dangers = [
        Danger(shapely.Point(rng.uniform(5, 35, 2)), rng.uniform(-1, 9)),
        Danger(shapely.LineString(rng.uniform(5, 25, (3, 2))), rng.uniform(-1, 9)),
        Danger(
            shapely.Point(rng.uniform(5, 25, 2)).buffer(rng.uniform(0.2, 4)), rng.uniform(-1, 9)
        ),
    ]
    floor = sea_floor(
        areas, np.empty((0, 3)), [], (0.0, 0.0, 40.0, 30.0), cell, soundings=spots, dangers=dangers
    )
    known = [(x, y, d) for x, y, d in spots]
    for danger in dangers:
        inside = danger.shape.representative_point()
        places = [*shapely.get_coordinates(danger.shape).tolist(), (inside.x, inside.y)]
        known += [(x, y, danger.depth) for x, y in places]
    heights = floor.heights[::-1]
    for x, y, depth in known:
        row, column = (int(np.floor((v - low) / cell - 0.5)) for v, low in ((y, 0.0), (x, 0.0)))
        if 0 <= row < heights.shape[0] - 1 and 0 <= column < heights.shape[1] - 1:
            assert (heights[row : row + 2, column : column + 2] >= -depth - 1e-9).all()


def test_a_shoal_sounding_raises_the_floor_near_it_and_nowhere_else():
    area = [DepthArea(shapely.box(0, 0, 40, 40), 5.0, 10.0)]
    ring = [(x, y, 8.0) for x in (0, 10, 20, 30, 40) for y in (0, 10, 20, 30, 40)]
    around = np.array([p for p in ring if p[:2] != (20, 20)], dtype=float)
    shoal = np.array([(20.0, 20.0, 1.0)])
    floor = sea_floor(area, np.empty((0, 3)), [], (0, 0, 40, 40), 1.0,
                      soundings=np.vstack([around, shoal]))  # fmt: skip
    x, y = np.meshgrid(np.arange(0.5, 40), np.arange(0.5, 40))
    depth = -floor.heights[::-1]
    assert depth[np.maximum(abs(x - 20), abs(y - 20)) > 10.0] == pytest.approx(8.0)
    near = abs(x - 20) + abs(y - 20) < 9.0  # in every triangulation
    assert depth[20, 20] == 1.0
    assert (depth[near] < 8.0).all()
    assert depth[20, 20:30] == pytest.approx(np.sort(depth[20, 20:30]))
    deep = np.array([(20.0, 20.0, 30.0)])
    low = sea_floor(area, np.empty((0, 3)), [], (0, 0, 40, 40), 1.0,
                    soundings=np.vstack([around, deep]))  # fmt: skip
    assert -low.heights.min() == 10.0
