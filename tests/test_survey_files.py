"""Clouds, grids and meshes from files: each point, cell and part is used or left out by name."""

from __future__ import annotations

import base64
import json
import struct

import numpy as np
import pytest

from netsp.base.columns import height_meaning
from netsp.base.errors import InputError
from netsp.world.scene.floor import read_floor
from netsp.world.scene.missing_heights import marks_of_no_height
from netsp.world.scene.pcd import unpack_lzf
from netsp.world.scene.readers import read_cloud_file, read_mesh_file

PILE = np.array([(4.0, -1.0, -10.0), (6.0, 1.0, 0.0), (5.0, 0.5, -3.25), (5.5, -0.25, -7.0)])
X, Y, Z = PILE.T
NOISE, WITHHELD = "of class 7 (low noise)", "marked as withheld"


def table(*columns, separator=" ", decimal="."):
    rows = (
        separator.join(f"{v:g}".replace(".", decimal) for v in row)
        for row in zip(*columns, strict=True)
    )
    return "\n".join(rows) + "\n"


def check(tally, total, left_out=()):
    """Check that the parts used and those left out are all parts of the file."""
    assert tally.total == total
    assert tally.used + sum(n for _, n in tally.left_out) == total
    assert sorted(n for _, n in tally.left_out) == sorted(left_out)


# ------------------------------------------------------------------------------------------ clouds


def packed(data):
    """Pack with LZF: the longest match within the last 8192 bytes, else a run of bytes."""
    out, run, at, seen = bytearray(), bytearray(), 0, {}

    def end_run():
        for k in range(0, len(run), 32):
            out.append(len(run[k : k + 32]) - 1)
            out.extend(run[k : k + 32])
        run.clear()

    while at < len(data):
        back = at - seen.get(data[at : at + 3], at)
        seen[data[at : at + 3]] = at
        length = 0
        while at + length < len(data) and length < 264 and 0 < back <= 8192 and (
            data[at + length] == data[at + length - back]
        ):  # fmt: skip
            length += 1
        if length < 3:
            run.append(data[at])
            at += 1
            continue
        end_run()
        short = min(length - 2, 7)
        out.append(short << 5 | (back - 1) >> 8)
        out.extend([length - 9] if short == 7 else [])
        out.append((back - 1) & 255)
        at += length
    end_run()
    return bytes(out)


def pcd(
    form, fields="x y z", size="4 4 4", kind="F F F", count="1 1 1", width=4, height=1, view=""
):
    points = width * height
    return (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {size}\nTYPE {kind}\nCOUNT {count}\n"
        f"WIDTH {width}\nHEIGHT {height}\n{view}POINTS {points}\nDATA {form}\n"
    ).encode()


def in_columns(points, kind="<f4", before=b"", after=b""):
    plain = before + b"".join(points[:, k].astype(kind).tobytes() for k in range(3)) + after
    data = packed(plain)
    return struct.pack("<II", len(data), len(plain)) + data


def ply(head, body=""):
    lines = "".join(f"property float {name}\n" for name in head.split())
    text = f"ply\nformat ascii 1.0\nelement vertex 4\n{lines}end_header\n{body}"
    return text.encode()


BEAMS = np.vstack([PILE, [(np.nan,) * 3] * 2])

CLOUDS = {
    "columns.csv": ("Depth;Nr;Y;X\n" + table(-Z, X, Y, X, separator=";", decimal=","), 4, ()),
    "gap.csv": ("x,y,z\nnan,nan,nan\n" + table(X, Y, Z, separator=","), 5, (1,)),
    "noise.csv": ("x y z class\n" + table(X, Y, Z, [2, 7, 2, 18]), 4, (1, 1)),
    "marked.xyz": (table(X, Y, [-10, -9999, -3.25, -7]), 4, (1,)),
    "counted.pts": ("4\n" + table(X, Y, Z, X, X, X, X), 4, ()),
    "organised.pcd": (
        pcd("ascii", width=3, height=2) + (table(X, Y, Z) + 2 * "nan nan nan\n").encode(), 6, (2,),
    ),
    "order.pcd": (
        pcd("ascii", "h z x rgb y", "4 4 4 4 4", "F F F U F", "3 1 1 1 1")
        + table(X, X, X, Z, X, [1] * 4, Y).encode(), 4, (),
    ),
    "packed.pcd": (pcd("binary_compressed", width=6) + in_columns(BEAMS), 6, (2,)),
    "padded.pcd": (
        pcd("binary_compressed", "rgb x y z _", "4 8 8 8 1", "U F F F U", "1 1 1 1 4")
        + in_columns(PILE, "<f8", before=bytes(16)), 4, (),
    ),
    "moved.pcd": (
        pcd("ascii", view="VIEWPOINT 1 2 3 1 0 0 0\n") + table(X, Y, Z).encode(), 4, (),
    ),
    "depth.ply": (ply("depth x y scalar_Classification", table(-Z, X, Y, [7, 0, 0, 0])), 4, (1,)),
    "nan.ply": (ply("x y z", "nan nan nan\n" + table(X, Y, Z).split("\n", 1)[1]), 4, (1,)),
}  # fmt: skip


def write(file, data):
    file.write_bytes(data if isinstance(data, bytes) else data.encode())
    return file


@pytest.mark.parametrize("name", CLOUDS)
def test_each_point_of_a_cloud_is_used_or_left_out(tmp_path, name):
    data, total, left_out = CLOUDS[name]
    read = read_cloud_file(write(tmp_path / name, data))
    check(read.tally, total, left_out)
    assert len(read.points) == read.tally.used
    assert all(any(np.allclose(p, q, atol=1e-6) for q in PILE) for p in read.points)
    assert len(read.notes) >= len(left_out)


def test_each_point_of_a_las_file_is_used_or_left_out(tmp_path):
    laspy = pytest.importorskip("laspy")
    data = laspy.LasData(laspy.LasHeader(point_format=1, version="1.2"))
    data.x, data.y, data.z = PILE.T
    data.classification = np.array([7, 2, 2, 2], dtype=np.uint8)
    data.withheld = np.array([1, 1, 0, 0], dtype=np.uint8)
    data.write(str(tmp_path / "c.las"))
    read = read_cloud_file(tmp_path / "c.las")
    check(read.tally, 4, (1, 1))
    assert dict(read.tally.left_out) == {NOISE: 1, WITHHELD: 1}
    whole = (tmp_path / "c.las").read_bytes()
    (tmp_path / "c.las").write_bytes(whole[:-28])  # without the last record
    with pytest.raises(InputError, match="cut short; expected 4 points"):
        read_cloud_file(tmp_path / "c.las")


def test_all_points_left_out_are_named(tmp_path):
    (tmp_path / "c.csv").write_text("x,y,z,class\n1,2,3,7\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"got none \(1 of class 7 \(low noise\)\)"):
        read_cloud_file(tmp_path / "c.csv")


@pytest.mark.parametrize("size", [0, 1, 40, 5000])
def test_lzf_unpacks_what_was_packed(size):
    rng = np.random.default_rng(size)
    for letters in (2, 200):
        plain = rng.integers(0, letters, size).astype(np.uint8).tobytes()
        assert unpack_lzf(packed(plain), size) == plain


def test_damaged_packed_data_are_refused_in_one_line(tmp_path):
    head, body = pcd("binary_compressed"), in_columns(PILE)
    changed = body[:8] + b"\xff\xff\xff" + body[11:]
    wrong_size = body[:4] + struct.pack("<I", 47) + body[8:]
    for data, message in (
        (body[:5], "cut short"), (body[:-3], "cut short"), (changed, "damaged packed data"),
        (wrong_size, "expected 48 bytes"),
    ):  # fmt: skip
        (tmp_path / "c.pcd").write_bytes(head + data)
        with pytest.raises(InputError, match=message) as error:
            read_cloud_file(tmp_path / "c.pcd")
        assert "\n" not in str(error.value)


def test_a_height_that_marks_no_height_is_far_from_all_others():
    assert marks_of_no_height(np.array([-10000.0, -9999.0, -9998.0])) == []
    ((value, where),) = marks_of_no_height(np.array([-3.0, 1e20, np.nan, -4.0]))
    assert (value, where.tolist()) == (1e20, [False, True, False, False])


# ------------------------------------------------------------------------------------------- grids

SLOPE = np.tile(np.linspace(-20.0, -12.0, 6), (4, 1)) + np.arange(4)[:, None]
CELLS = [(x + 0.5, 3.5 - y, SLOPE[y, x]) for y in range(4) for x in range(6)]


def cells(rows, separator=" ", sign=1.0):
    return table(*zip(*((x, y, sign * z) for x, y, z in rows), strict=True), separator=separator)


def height_at(read, x, y):
    top = read.vertices[: len(read.vertices) // 2]
    return top[np.argmin(np.hypot(top[:, 0] - x, top[:, 1] - y)), 2]


GRIDS = {
    "rows.xyz": (cells(CELLS), ()),
    "shuffled.xyz": (cells(CELLS[::-1]), ()),
    "columns.xyz": (cells(sorted(CELLS)), ()),
    "depth.csv": ("easting,northing,depth\n" + cells(CELLS, ",", -1.0), ()),
    "gap.txt": ("x y z\n" + cells(CELLS[:9] + CELLS[10:]), (1,)),
    "marked.asc": (cells([*CELLS[:9], (*CELLS[9][:2], -9999.0), *CELLS[10:]]), (1,)),
}


@pytest.mark.parametrize("name", GRIDS)
def test_each_cell_of_a_table_is_used_or_left_out(tmp_path, name):
    text, left_out = GRIDS[name]
    (tmp_path / name).write_text(text, encoding="utf-8")
    read = read_floor(tmp_path / name)
    check(read.tally, 24, left_out)
    assert height_at(read, 0.5, 0.5) == pytest.approx(-17.0)
    assert height_at(read, 5.5, 3.5) == pytest.approx(-12.0)


def test_points_that_are_no_grid_are_refused(tmp_path):
    (tmp_path / "a.xyz").write_text("0 0 1\n1 1.37 1\n2.2 2 1\n", encoding="utf-8")
    with pytest.raises(InputError, match="no grid of equal steps"):
        read_floor(tmp_path / "a.xyz")
    (tmp_path / "a.xyz").write_text("0 0 1\n1 1 1\n1 1 2\n", encoding="utf-8")
    with pytest.raises(InputError, match="two rows for one cell"):
        read_floor(tmp_path / "a.xyz")


def grid(file, z=SLOPE, transform=(1.0, 0.0, 0.0, 0.0, -1.0, 4.0), tags=None, **settings):
    rasterio = pytest.importorskip("rasterio")
    bands = z.reshape(-1, *SLOPE.shape)
    with rasterio.open(
        file, "w", driver="GTiff", height=4, width=6, count=len(bands), dtype=z.dtype,
        crs="EPSG:25832", transform=rasterio.Affine(*transform),
    ) as out:  # fmt: skip
        out.write(bands)
        for name, value in settings.items():
            setattr(out, name, value)
        out.update_tags(1, **(tags or {}))
    return read_floor(file)


@pytest.mark.parametrize(
    ("z", "settings"),
    [
        (-SLOPE, {"descriptions": ("Depth",)}), (-SLOPE, {"tags": {"positive": "down"}}),
        (-SLOPE / 0.3048, {"descriptions": ("depth_ft",)}),
        (SLOPE, {"descriptions": ("depth",)}), (SLOPE[::-1], {"transform": (1, 0, 0, 0, 1, 1e-3)}),
        (np.array([0 * SLOPE, SLOPE]), {"descriptions": ("uncertainty", "elevation")}),
    ],
)  # fmt: skip
def test_a_band_is_as_deep_as_it_is_called(tmp_path, z, settings):
    read = grid(tmp_path / "z.tif", z.copy(), **settings)
    check(read.tally, 24)
    assert height_at(read, 0.5, 0.5) == pytest.approx(-17.0)
    assert height_at(read, 5.5, 3.5) == pytest.approx(-12.0)


def test_names_of_heights_say_where_they_point():
    assert height_meaning(["Band 1"]) is None
    assert height_meaning(["", "sea_floor_depth_below_geoid"]).factor == -1.0
    assert height_meaning(["height_above_mean_sea_level"]).factor == 1.0


def test_whole_numbers_at_the_end_of_their_range_are_no_heights(tmp_path):
    z = np.round(SLOPE + 50).astype("uint8")
    z[1, 2] = 255
    read = grid(tmp_path / "z.tif", z, offsets=(-50.0,))
    check(read.tally, 24, (1,))
    assert read.vertices[:, 2].max() < 0.0


def test_a_grid_without_a_place_is_refused(tmp_path):
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("rasterio")
    image.fromarray(SLOPE.astype("float32")).save(tmp_path / "z.tif")
    with pytest.raises(InputError, match="no place on the map"):
        read_floor(tmp_path / "z.tif")


def test_an_ascii_grid_may_begin_with_a_mark(tmp_path):
    pytest.importorskip("rasterio")
    head = "\ufeffncols 6\nnrows 4\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -1\n"
    (tmp_path / "z.asc").write_text(head + table(*SLOPE.T), encoding="utf-8")
    assert height_at(read_floor(tmp_path / "z.asc"), 0.5, 0.5) == pytest.approx(-17.0)


# ------------------------------------------------------------------------------------------ meshes

CORNERS = np.array([(x, y, z) for x in (4, 6) for y in (-1, 1) for z in (-10, 0)], dtype=float)
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = np.array([t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))])
BOX = [[4, -1, -10], [6, 1, 0]]


def obj(faces):
    return "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in CORNERS) + faces


def relative_obj():
    """Write each side directly after its corners, with indices that count back."""
    return "".join(
        "".join("v {:g} {:g} {:g}\n".format(*CORNERS[k]) for k in side) + "f -4 -3 -2 -1\n"
        for side in SIDES
    )


QUADS = "".join("f " + " ".join(str(k + 1) for k in side) + "\n" for side in SIDES)


def polygons(form, sides, cut=0):
    """Write a PLY file with faces of any number of corners."""
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[form]
    head = (
        f"ply\nformat {form} 1.0\nelement vertex 8\nproperty double x\nproperty double y\n"
        f"property double z\nelement face {len(sides)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode()
    if not order:
        rows = [" ".join(f"{c:g}" for c in p) for p in CORNERS]
        rows += [f"{len(s)} " + " ".join(map(str, s)) for s in sides]
        return head + "\n".join(rows[: len(rows) - cut]).encode() + b"\n"
    body = CORNERS.astype(f"{order}f8").tobytes()
    body += b"".join(struct.pack(f"{order}B{len(s)}i", len(s), *s) for s in sides)
    return head + body[: len(body) - cut]


MIXED = [*TRIANGLES[:2].tolist(), *SIDES[1:]]


def stl(count=12, head=b"solid"):
    records = (struct.pack("<12fH", 0, 0, 1, *CORNERS[t].ravel(), 0) for t in TRIANGLES)
    return head.ljust(80) + struct.pack("<I", count) + b"".join(records)


def gltf(nodes, scenes=((0,),), mode=4, kind=5126, **more):
    up = CORNERS[:, [0, 2, 1]] * [1, 1, -1]
    data = up.astype("<f4").tobytes() + TRIANGLES.astype("<u2").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    part = {"attributes": {"POSITION": 0}, "indices": 1}
    parts = [part] if mode == 4 else [part, {**part, "mode": mode}]
    page = {
        "asset": {"version": "2.0"}, "nodes": nodes, "meshes": [{"primitives": parts}],
        "scenes": [{"nodes": list(s)} for s in scenes], "scene": 0,
        "accessors": [
            {"bufferView": 0, "componentType": kind, "count": 8, "type": "VEC3",
             "min": up.min(0).tolist(), "max": up.max(0).tolist(), **more.pop("accessor", {})},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 96},
                        {"buffer": 0, "byteOffset": 96, "byteLength": 72}],
        "buffers": [{"byteLength": len(data), "uri": uri}], **more,
    }  # fmt: skip
    return json.dumps(page)


MESH = {"mesh": 0}
MESHES = {
    "quads.obj": (obj(QUADS), 6, ()),
    "counted-back.obj": (relative_obj(), 6, ()),
    "lines.obj": (obj(QUADS + "l 1 2\np 3\nf 1 2\n"), 9, (2, 1)),
    "quads.ply": (polygons("ascii", SIDES), 6, ()),
    "mixed.ply": (polygons("binary_little_endian", MIXED), 7, ()),
    "big.ply": (polygons("binary_big_endian", SIDES), 6, ()),
    "short.ply": (polygons("ascii", [*SIDES, (0, 1)]), 7, (1,)),
    "solid.stl": (stl(), 12, ()),
    "longer.stl": (stl() + b"made by CAD", 12, ()),
    "plain.gltf": (gltf([MESH]), 1, ()),
    "marked.gltf": (gltf([MESH], mode=1), 2, (1,)),
    "scenes.gltf": (gltf([MESH, {**MESH, "translation": [9, 0, 0]}], ((0,), (1,))), 2, (1,)),
    "unused.gltf": (gltf([MESH, {**MESH, "translation": [9, 0, 0]}]), 2, (1,)),
}


@pytest.mark.parametrize("name", MESHES)
def test_each_part_of_a_mesh_is_used_or_left_out(tmp_path, name):
    pytest.importorskip("trimesh")
    data, total, left_out = MESHES[name]
    read = read_mesh_file(write(tmp_path / name, data))
    check(read.tally, total, left_out)
    assert len(read.faces) == 12
    box = read.vertices[np.unique(read.faces)]
    assert np.round([box.min(0), box.max(0)], 6).tolist() == BOX
    assert sum("left out" in note for note in read.notes) == len(left_out)


REFUSED = {
    "draco.gltf": (gltf([MESH], extensionsRequired=["KHR_draco_mesh_compression"]), "KHR_draco"),
    "unknown.gltf": (gltf([MESH], extensionsRequired=["ACME_shapes"]), "ACME_shapes"),
    "instances.gltf": (gltf([{**MESH, "extensions": {"EXT_mesh_gpu_instancing": {}}}]), "instanc"),
    "bent.gltf": (gltf([{**MESH, "skin": 0}]), "skeleton"),
    "morphed.gltf": (gltf([{**MESH, "weights": [1.0]}]), "morphed"),
    "fan.gltf": (gltf([MESH], mode=6), "fans"),
    "packed.gltf": (gltf([MESH], accessor={"normalized": True}), "normalized"),
    "none.gltf": (gltf([MESH], ()), "expected a scene"),
    "cut.stl": (stl(13), "cut short"),
    "cut.ply": (polygons("ascii", SIDES, cut=2), "face 4 of 6"),
    "bytes.ply": (polygons("binary_little_endian", SIDES, cut=2), "cut short"),
    "corner.ply": (polygons("ascii", [(0, 1, 8)]), "none of the 8"),
    "nan.obj": (obj("v nan 0 0\n" + QUADS + "f 1 2 9\n"), "finite"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_mesh_that_would_stand_elsewhere_is_refused_in_one_line(tmp_path, name):
    pytest.importorskip("trimesh")
    data, message = REFUSED[name]
    write(tmp_path / name, data)
    with pytest.raises(InputError, match=message) as error:
        read_mesh_file(tmp_path / name)
    assert "\n" not in str(error.value)


def test_the_scene_says_how_much_of_a_file_is_used(tmp_path):
    from netsp.world.scene.scene import Scene

    (tmp_path / "c.csv").write_text("x,y,z,class\n" + table(X, Y, Z, [7, 1, 1, 1], separator=","))
    (tmp_path / "s.json").write_text('{"schema_version": 1, "cloud": {"file": "c.csv"}}')
    notes = Scene.load(tmp_path / "s.json").reading_notes()
    assert [note.split(": ", 1)[1] for note in notes] == [
        "1 point of class 7 (low noise) left out", "3 of 4 points used",
    ]  # fmt: skip
