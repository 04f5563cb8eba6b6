"""Heights point upwards and lengths are metres, whatever columns, grids, clouds and meshes say."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from netsp.base.errors import InputError
from netsp.command.main import main
from netsp.exchange.maps import read_site
from netsp.exchange.maps.csv_table import from_table
from netsp.exchange.maps.goal_depths import surface_warning, with_depth
from netsp.exchange.maps.import_policy import DEFAULT_READ
from netsp.exchange.maps.path_file import read_paths
from netsp.exchange.maps.projection import Projection
from netsp.model.problem import Problem
from netsp.world.scene.readers import Placement, read_cloud_file, read_mesh_file

PILE = np.array([(4.0, -1.0, -10.0), (6.0, 1.0, 0.0), (5.0, 0.5, -3.25), (5.5, -0.25, -7.0)])
"""Points of a pile that fit no other order or sign of their coordinates."""


def pile(file, text, encoding="utf-8"):
    file.write_bytes(text.encode(encoding))
    cloud = read_cloud_file(file)
    return cloud.points, cloud.notes


def rows(separator, columns, decimal="."):
    return "\n".join(
        separator.join(f"{v:.2f}".replace(".", decimal) for v in row)
        for row in np.column_stack(columns)
    )


X, Y, Z = PILE.T
COUNT = np.arange(4.0) * 7.0


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("id.csv", "id,x,y,z\n" + rows(",", (COUNT, X, Y, Z))),
        ("depth.csv", "depth,y,x\n" + rows(",", (-Z, Y, X))),
        ("german.csv", "Y;Tag;X;Depth (m)\n" + rows(";", (Y, COUNT, X, -Z), ",")),
        ("feet.txt", "x_m\ty_m\tdepth_ft\n" + rows("\t", (X, Y, -Z / 0.3048))),
        ("survey.xyz", rows(" ", (X, Y, Z), ",")),
        ("named.xyz", "//Z Easting Northing\n" + rows(" ", (Z, X, Y))),
        ("scan.pts", "4\n" + rows(" ", (X, Y, Z, COUNT))),
        ("scan.pcd", "VERSION .7\nFIELDS z x y\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4\n"
         "HEIGHT 1\nPOINTS 4\nDATA ascii\n" + rows(" ", (Z, X, Y))),
    ],
)  # fmt: skip
def test_a_cloud_stands_where_its_columns_say(tmp_path, name, text):
    points, _ = pile(tmp_path / name, text)
    assert points == pytest.approx(PILE, abs=0.01)


def test_a_cloud_of_binary_records_keeps_its_fields_apart(tmp_path):
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS rgb x y z\nSIZE 4 8 8 8\nTYPE U F F F\nCOUNT 1 1 1 1\n"
        "WIDTH 5\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 5\nDATA binary\n"
    )
    records = [struct.pack("<Iddd", 255, *p) for p in (*PILE, (np.nan,) * 3)]
    (tmp_path / "c.pcd").write_bytes(head.encode() + b"".join(records))
    cloud = read_cloud_file(tmp_path / "c.pcd")
    points, notes = cloud.points, cloud.notes
    assert points.tolist() == PILE.tolist()
    assert notes == ("1 point without coordinates left out",)
    (tmp_path / "c.pcd").write_bytes(head.encode() + b"".join(records)[:-1])
    with pytest.raises(InputError, match="cut short"):
        read_cloud_file(tmp_path / "c.pcd")


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "lat,lon,depth\n57.1,9.2,3\n", "in degrees"),
        ("a.csv", "x,y,colour\n1,2,3\n", "z .or depth."),
        ("a.csv", "x,y,z,depth\n1,2,-3,3\n", "both hold z"),
        ("a.csv", "x,y,z\n1,0000,2,5000,3,2500\n", "decimal commas"),
        ("a.pts", "3\n1 2 3\n4 5 6\n", "states 3 points"),
        ("a.pcd", "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nDATA zip\n",
         "ascii, binary or binary_compressed"),
        ("a.pcd", "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nDATA binary_compressed\n",
         "cut short"),
        ("a.pcd", "FIELDS x y\nDATA ascii\n", "expected x, y and z"),
    ],
)  # fmt: skip
def test_an_ambiguous_cloud_is_refused_in_one_line(tmp_path, name, text, message):
    with pytest.raises(InputError, match=message) as error:
        pile(tmp_path / name, text)
    assert "\n" not in str(error.value)


def test_noise_in_a_table_is_left_out_and_named(tmp_path):
    text = "x,y,z,Classification\n1,2,3,6\n50,2,3,7\n1,2,4,18\n1,2,5,0\n"
    points, notes = pile(tmp_path / "c.csv", text)
    assert points.tolist() == [[1, 2, 3], [1, 2, 5]]
    assert notes == (
        "1 point of class 7 (low noise) left out", "1 point of class 18 (high noise) left out",
    )  # fmt: skip


def test_rows_without_coordinates_are_left_out_and_counted(tmp_path):
    points, notes = pile(tmp_path / "c.csv", "x,y,z\n1,2,3\nnan,nan,nan\n,,\n4,5,6\n,nan,\n")
    assert points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert notes == ("2 rows without coordinates left out",)
    with pytest.raises(InputError, match="line 3: y: expected a number, got 'nan'"):
        pile(tmp_path / "c.csv", "x,y,z\n1,2,3\n1,nan,3\n")


def las(file, points, crs=None, **fields):
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = [1e-3] * 3
    if crs is not None:
        header.add_crs(pytest.importorskip("pyproj").CRS.from_user_input(crs))
    data = laspy.LasData(header)
    data.x, data.y, data.z = np.asarray(points).T
    for name, values in fields.items():
        setattr(data, name, np.array(values, dtype=np.uint8))
    data.write(str(file))
    return file


def test_las_noise_and_withheld_points_are_no_surface(tmp_path):
    file = las(tmp_path / "c.las", PILE, classification=[2, 18, 7, 2], withheld=[0, 0, 0, 1])
    cloud = read_cloud_file(file)
    points, notes = cloud.points, cloud.notes
    assert points == pytest.approx(PILE[:1], abs=1e-3)
    assert len(notes) == 3


@pytest.mark.parametrize(
    ("crs", "factor"),
    [("EPSG:25832", (1, 1, 1)), ("EPSG:2263", (0.3048006,) * 3), ("EPSG:25832+5715", (1, 1, -1)),
     ("EPSG:2263+5703", (0.3048006, 0.3048006, 1))],
)  # fmt: skip
def test_las_is_in_metres_with_z_upwards(tmp_path, crs, factor):
    cloud = read_cloud_file(las(tmp_path / "c.las", PILE, crs))
    points, notes = cloud.points, cloud.notes
    assert points == pytest.approx(PILE * np.array(factor), abs=1e-3)
    assert bool(notes) == (factor != (1, 1, 1))


def test_las_in_degrees_is_refused(tmp_path):
    with pytest.raises(InputError, match="in degrees"):
        read_cloud_file(las(tmp_path / "c.las", PILE, "EPSG:4326"))
    with pytest.raises(InputError, match="scale: the file states its unit"):
        read_cloud_file(las(tmp_path / "d.las", PILE, "EPSG:2263"), Placement(scale=0.3048))


def box_mesh(tmp_path, name, low, high):
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.box(bounds=(low, high))
    mesh.export(tmp_path / name)
    return tmp_path / name


def box_of(file, placement=None):
    mesh = read_mesh_file(file, placement)
    vertices, notes = mesh.vertices, mesh.notes
    return np.round([vertices.min(0), vertices.max(0)], 6).tolist(), notes


def test_gltf_points_upwards_along_y(tmp_path):
    file = box_mesh(tmp_path, "pile.glb", (4, -10, -1), (6, 0, 2))
    box, notes = box_of(file)
    assert box == [[4, -2, -10], [6, 1, 0]]
    assert any("y is up" in note for note in notes)
    assert box_of(file, Placement(up="z"))[0] == [[4, -10, -1], [6, 0, 2]]


@pytest.mark.parametrize("kind", ["stl", "obj", "ply"])
def test_a_mesh_without_metadata_is_placed_by_the_scene(tmp_path, kind):
    file = box_mesh(tmp_path, f"pile.{kind}", (4, -10, -1), (6, 0, 2))
    assert box_of(file)[0] == [[4, -10, -1], [6, 0, 2]]
    assert box_of(file, Placement(up="y"))[0] == [[4, -2, -10], [6, 1, 0]]
    turned = Placement(up="y", origin=(4.0, 0.0), rotate=(0.0, 0.0, 90.0), scale=2.0)
    assert box_of(file, turned)[0] == [[-2, 0, -20], [4, 4, 0]]


def test_up_and_rotate_are_rotations():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(5, 3))
    gram = points @ points.T
    for up in ("x", "y", "z"):
        placed = Placement(up=up, rotate=(20.0, -35.0, 70.0)).apply(points)
        assert placed @ placed.T == pytest.approx(gram)
        assert np.linalg.det(placed[:3]) == pytest.approx(np.linalg.det(points[:3]))
        unit = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}[up]
        assert Placement(up=up).apply(np.array([unit], float)).tolist() == [[0, 0, 1]]


DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{asset}</asset>
<library_geometries><geometry id="g"><mesh>
<source id="s"><float_array id="a" count="12">0 0 0 200 0 0 0 300 0 0 0 500</float_array>
<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>
"""


@pytest.mark.parametrize(
    ("asset", "high"),
    [
        ('<unit name="cm" meter="0.01"/><up_axis>Z_UP</up_axis>', [2, 3, 5]),
        ('<unit meter="0.1"/><up_axis>Y_UP</up_axis>', [20, 0, 30]),
        ("<up_axis>Y_UP</up_axis>", [200, 0, 300]),
    ],
)
def test_collada_states_its_axis_and_its_unit(tmp_path, asset, high):
    pytest.importorskip("collada", reason="pycollada (extra online) is not installed")
    (tmp_path / "m.dae").write_text(DAE.format(asset=asset), encoding="utf-8")
    box, notes = box_of(tmp_path / "m.dae")
    assert box[1] == pytest.approx(high)
    assert notes


def grid(file, z, crs="EPSG:25832", cell=1.0, **tags):
    rasterio = pytest.importorskip("rasterio")
    with rasterio.open(
        file, "w", driver="GTiff", height=z.shape[0], width=z.shape[1], count=1, dtype=z.dtype,
        crs=crs, transform=rasterio.Affine(cell, 0, 0, 0, -cell, cell * len(z)),
    ) as out:  # fmt: skip
        out.write(z, 1)
        for name, value in tags.items():
            setattr(out, name, (value,))
    return file


def floor_of(file, **options):
    from netsp.world.scene.floor import load_floor

    vertices, _, notes = load_floor(file, **options)
    return vertices[: len(vertices) // 2], notes


SLOPE = np.tile(np.linspace(-20.0, -12.0, 6), (4, 1))


@pytest.mark.parametrize(
    ("values", "kind", "options"),
    [
        (SLOPE * 100, "int16", {"scales": 0.01}),
        (SLOPE + 50, "float64", {"offsets": -50.0}),
        (SLOPE / 0.3048, "float64", {"units": "ft"}),
        (SLOPE / 1.8288, "float64", {"units": "fathom"}),
        (-SLOPE, "float64", {"crs": "EPSG:25832+5715"}),
    ],
)
def test_grids_are_metres_upwards_whatever_their_band_and_system_say(
    tmp_path, values, kind, options
):
    top, notes = floor_of(grid(tmp_path / "z.tif", values.round(9).astype(kind), **options))
    assert (top[:, 2].min(), top[:, 2].max()) == pytest.approx((-20.0, -12.0), abs=0.01)
    assert top[:, 0].max() == 5.5
    assert notes


def test_grids_in_feet_are_converted_in_plan_and_height(tmp_path):
    file = grid(tmp_path / "z.tif", SLOPE / 0.3048006, crs="EPSG:2263", cell=1 / 0.3048006)
    top, notes = floor_of(file)
    assert top[:, 0].max() == pytest.approx(5.5, abs=1e-4)
    assert top[:, 2].min() == pytest.approx(-20.0, abs=1e-4)
    assert "0.3048006" in notes[0]
    with pytest.raises(InputError, match="scale"):
        floor_of(file, scale=0.3048)


@pytest.mark.parametrize("value", [-9999.0, -32768.0, 3.4028234663852886e38, -3.4e38])
def test_customary_marks_of_no_height_are_no_floor(tmp_path, value):
    z = SLOPE.copy()
    z[1, 2:4] = value
    top, notes = floor_of(grid(tmp_path / "z.tif", z))
    assert top[:, 2].min() == -20.0
    assert top[:, 2].max() == -12.0
    assert notes[0].startswith("2 cells of ")


def test_a_height_among_others_is_a_height(tmp_path):
    z = (np.arange(24).reshape(4, 6) - 10005).astype("int16")
    top, notes = floor_of(grid(tmp_path / "z.tif", z, scales=0.01))
    assert top[:, 2].min() == pytest.approx(-100.05)
    assert len(notes) == 1


def test_a_goal_is_as_deep_as_its_table_says(tmp_path):
    file = tmp_path / "g.csv"
    for text, encoding in (
        ("x,y,depth,name\n18,17.5,4,G1\n", "utf-8-sig"),
        ("name;Depth (m);Y;X\nG1;4,0;17,5;18,0\n", "utf-8"),
        ("id\tnorthing\teasting\theight\nG1\t17.5\t18\t-4\n", "utf-16"),
    ):
        file.write_bytes(text.encode(encoding))
        places, names = from_table(file)
        assert (places.tolist(), names) == ([[18.0, 17.5, -4.0]], ["G1"])
    file.write_text("lat,lon\n57,9\n", encoding="utf-8")
    with pytest.raises(InputError, match="degrees"):
        from_table(file)
    projection = Projection(57.0, 9.0)
    assert from_table(file, projection)[0] == pytest.approx(np.zeros((1, 2)), abs=1e-6)
    file.write_text("easting,northing\n500000,6300000\n", encoding="utf-8")
    with pytest.raises(InputError, match="lat, lon"):
        from_table(file, projection)
    notes: list[str] = []
    file.write_text("x,y,Tiefe\n1,2,3\n", encoding="utf-8")
    from_table(file, on_note=notes.append)
    assert "Tiefe" in notes[0]


PROBLEM = Problem(base=(0, 0), goals=[(3, 0), (3, 4)], tether_length=9)


def test_a_path_is_read_by_the_names_of_its_columns(tmp_path):
    file = tmp_path / "p.csv"
    file.write_text("time_ms;depth;y;x\n0;1,5;2;3\n500;2,5;4;6\n", encoding="utf-8")
    (path,) = read_paths(file, PROBLEM)
    assert path.points.tolist() == [[3, 2, -1.5], [6, 4, -2.5]]
    assert path.times.tolist() == [0.0, 0.5]


@pytest.mark.parametrize(
    ("mode", "pixel", "kinds"),
    [
        ("trinary", (255, 255), "free"), ("trinary", (255, 0), "unknown"),
        ("trinary", (0, 255), "occupied"), ("scale", (255, 0), "unknown"),
        ("scale", (0, 254), "unknown"), ("scale", (0, 255), "occupied"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("form", ["LA", "RGBA"])
def test_transparency_means_what_map_server_takes_it_for(tmp_path, form, mode, pixel, kinds):
    from PIL import Image

    from netsp.exchange.maps.occupancy import MapFile, _kinds, _values

    image = Image.new(form, (2, 2), pixel if form == "LA" else (*(pixel[:1] * 3), pixel[1]))
    image.save(tmp_path / "m.png")
    occupied, unknown = _kinds(
        *_values(tmp_path / "m.png", DEFAULT_READ.max_image_cells),
        MapFile(image="m.png", resolution=1.0, mode=mode),
    )
    assert (occupied.all(), unknown.all()) == (kinds == "occupied", kinds == "unknown")


def test_one_depth_is_set_for_all_goals():
    assert surface_warning(PROBLEM) is not None
    deep = with_depth(PROBLEM, 2.5)
    assert [g.position[2] for g in deep.goals] == [-2.5, -2.5]
    assert surface_warning(deep) is None
    with pytest.raises(InputError, match="depth"):
        with_depth(PROBLEM, -1.0)


def test_an_exported_tour_dives_to_the_depth_given(tmp_path, capsys):
    from netsp import solve

    PROBLEM.save(tmp_path / "p.json")
    solve(PROBLEM, solver="greedy").save(tmp_path / "s.json")
    told = ["export", str(tmp_path / "s.json"), "--problem", str(tmp_path / "p.json"),
            "-o", str(tmp_path / "s.csv")]  # fmt: skip
    assert main(told) == 0
    assert "depth 0" in capsys.readouterr().err
    assert main([*told, "--depth", "2"]) == 0
    lines = [line.split(",") for line in (tmp_path / "s.csv").read_text().splitlines()]
    goals = [line for line in lines[1:] if line[lines[0].index("kind")] == "goal"]
    assert {float(line[2]) for line in goals} == {-2.0}
    far = max(float(line[lines[0].index("tether_length")]) for line in goals)
    assert far == pytest.approx(np.hypot(5.0, 2.0), abs=1e-3)
    assert main([*told, "--depth", "8"]) == 2
    assert "--depth" in capsys.readouterr().err


def test_a_cloud_stands_beside_a_mesh_and_a_floor(tmp_path, capsys):
    trimesh = pytest.importorskip("trimesh")
    from netsp.world import Scene

    z = "\n".join(" ".join(["-8"] * 12) for _ in range(12))
    (tmp_path / "z.asc").write_text(
        "ncols 12\nnrows 12\nxllcorner 0\nyllcorner 0\ncellsize 1\n" + z, encoding="utf-8"
    )
    box_mesh(tmp_path, "b.stl", (9, 5, -8), (11, 7, -4))
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.0).vertices
    table = np.column_stack([-ball[:, 2] + 4.0, np.arange(len(ball)), ball[:, :2] + [504.0, 6.0]])
    np.savetxt(tmp_path / "c.csv", table, delimiter=";", header="depth;id;x;y", comments="")
    scene = {
        "schema_version": 1, "floor": {"file": "z.asc", "voxel": 0.3}, "mesh": {"file": "b.stl"},
        "cloud": {"file": "c.csv", "origin": [500.0, 0.0]},
    }  # fmt: skip
    (tmp_path / "s.json").write_text(json.dumps(scene), encoding="utf-8")
    field = Scene.load(tmp_path / "s.json").field()
    at = np.array([(4, 6, -4), (4, 6, -2), (10, 6, -6), (10, 6, -3), (2, 2, -7)], dtype=float)
    assert field.distance(at) == pytest.approx([-1.0, 1.0, -1.0, 1.0, 1.0], abs=0.3)
    assert any("unused columns: id" in note for note in field.notes)


@pytest.mark.parametrize(("units", "plain"), [(None, -4.0), ("ft", -4.0 * 0.3048)])
def test_a_depth_of_a_map_is_in_the_unit_that_its_property_names(tmp_path, units, plain):
    from netsp.exchange.maps import read_site

    features = [({"kind": "base"}, 0.0), ({"Depth (ft)": 10}, 1.0), ({"depth_m": 4}, 2.0),
                ({"DEPTH": 4}, 3.0)]  # fmt: skip
    (tmp_path / "m.geojson").write_text(json.dumps({
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "properties": properties,
             "geometry": {"type": "Point", "coordinates": [9.0 + 1e-5 * x, 57.0]}}
            for properties, x in features
        ],
    }), encoding="utf-8")  # fmt: skip
    problem = read_site(tmp_path / "m.geojson", tether=60.0, units=units)
    assert [g.position[2] for g in problem.goals] == pytest.approx([-3.048, -4.0, plain])


@pytest.mark.parametrize(("crs", "z"), [("EPSG:25832+5715", -3.0), ("EPSG:25832+5703", 3.0)])
def test_heights_of_a_map_are_those_of_its_vertical_system(tmp_path, crs, z):
    pyogrio = pytest.importorskip("pyogrio")
    shapely = pytest.importorskip("shapely")
    from netsp.exchange.maps import read_site

    for layer, point in (("base", (500000, 6400000, 0)), ("goals", (500020, 6400000, 3))):
        pyogrio.raw.write(
            tmp_path / "m.gpkg", np.array([shapely.to_wkb(shapely.Point(point))], dtype=object),
            [np.array(["a"], dtype=object)], ["name"], layer=layer, crs=crs,
            geometry_type="Point Z", driver="GPKG", append=(layer == "goals"),
        )  # fmt: skip
    notes: list[str] = []
    problem = read_site(tmp_path / "m.gpkg", tether=60.0, on_note=notes.append)
    assert problem.goals[0].position[2] == z
    assert any("downwards" in note for note in notes) == (z < 0.0)


@pytest.mark.parametrize("kind", ["las", "csv", "pcd"])
def test_every_point_of_a_cloud_is_used_or_counted_in_a_note(tmp_path, kind):
    rng = np.random.default_rng(len(kind))
    points = rng.uniform(-5.0, 5.0, (60, 3)).round(2)
    classes = rng.choice([0, 2, 6, 7, 18], 60)
    withheld = rng.integers(0, 2, 60)
    file = tmp_path / f"c.{kind}"
    if kind == "las":
        las(file, points, classification=classes, withheld=withheld)
    elif kind == "csv":
        head = "Withheld;z;class;y;x\n"
        file.write_text(head + "\n".join(
            ";".join(map(str, row))
            for row in zip(withheld, points[:, 2], classes, points[:, 1], points[:, 0], strict=True)
        ), encoding="utf-8")  # fmt: skip
    else:
        points[withheld == 1] = np.nan
        head = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 60\nHEIGHT 1\nDATA ascii\n"
        body = "\n".join(" ".join(map(str, p)) for p in points)
        file.write_text(head + body, encoding="utf-8")
    cloud = read_cloud_file(file)
    used, notes = cloud.points, cloud.notes
    left_out = sum(int(note.split()[0]) for note in notes if note.endswith("left out"))
    assert left_out > 0
    assert len(used) + left_out == 60


def test_heights_and_sizes_that_are_not_read_are_named(tmp_path):
    def point(x, **properties):
        geometry = {"type": "Point", "coordinates": [5.5 + x, 58.0]}
        return {"type": "Feature", "properties": properties, "geometry": geometry}

    goals = [
        point(2e-4, kind="goal", elevation=-5), point(3e-4, kind="goal", depth=2),
        point(1e-4, kind="obstacle", radius_ft=10), point(0.0, kind="base"),
    ]  # fmt: skip
    file = tmp_path / "site.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": goals}))
    notes: list[str] = []
    read_site(file, tether=60.0, radius=0.5, on_note=notes.append)
    assert [note for note in notes if "'elevation' is not read" in note]
    assert [note for note in notes if "'radius_ft' is not read" in note]
    assert len(notes) == 2


def test_a_depth_and_another_height_of_one_point_are_told_apart(tmp_path):
    def goal(x, z, depth):
        geometry = {"type": "Point", "coordinates": [5.5 + x, 58.0, z]}
        return {
            "type": "Feature", "geometry": geometry,
            "properties": {"kind": "goal", "name": f"G{depth}", "depth": depth},
        }  # fmt: skip

    base = {
        "type": "Feature", "properties": {"kind": "base"},
        "geometry": {"type": "Point", "coordinates": [5.5, 58.0]},
    }  # fmt: skip
    file = tmp_path / "site.geojson"
    features = [goal(1e-4, -7.0, 2.0), goal(2e-4, -3.0, 3.0), goal(3e-4, 0.0, 4.0), base]
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    notes: list[str] = []
    problem = read_site(file, tether=60.0, on_note=notes.append)
    assert [g.position[2] for g in problem.goals] == [-2.0, -3.0, -4.0]
    (note,) = notes
    assert "(G2.0): its depth of 2 m is taken, and its height of -7 m is not" in note
