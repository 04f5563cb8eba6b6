"""Sea floors, LAS clouds and GLB meshes come in as they are: heights where they were surveyed."""

import json

import numpy as np
import pytest

from netsp import InputError
from netsp.command.main import main
from netsp.world import GeodesicTether, Scene
from netsp.world.scene.floor import load_floor
from netsp.world.scene.readers import read_cloud_file, read_mesh_file
from netsp.world.scene.voxels import grid_of_triangles

rasterio = pytest.importorskip("rasterio", reason="rasterio (extra geo) is not installed")


def write_asc(path, z, cell=1.0, corner=(0.0, 0.0), nodata=-9999):
    rows, columns = z.shape
    head = (
        f"ncols {columns}\nnrows {rows}\nxllcorner {corner[0]}\nyllcorner {corner[1]}\n"
        f"cellsize {cell}\nNODATA_value {nodata}\n"
    )
    path.write_text(head + "\n".join(" ".join(f"{v:g}" for v in row) for row in z) + "\n")
    return path


def write_tiff(path, z, cell=1.0, corner=(0.0, 0.0), crs="EPSG:32632"):
    top = corner[1] + z.shape[0] * cell
    with rasterio.open(
        path, "w", driver="GTiff", height=z.shape[0], width=z.shape[1], count=1, dtype="float32",
        crs=crs, transform=rasterio.Affine(cell, 0, corner[0], 0, -cell, top), compress="deflate",
    ) as grid:  # fmt: skip
        grid.write(z.astype("float32"), 1)
    return path


def hill(rows=24, columns=30):
    """Depth 8 m, and a ridge 3 m high in the middle that runs north."""
    x = np.arange(columns) + 0.5
    return np.tile(-8.0 + 3.0 * np.exp(-(((x - 15.0) / 3.0) ** 2)), (rows, 1))


@pytest.mark.parametrize("write", [write_asc, write_tiff])
def test_the_floor_is_where_the_grid_says(write, tmp_path):
    file = write(tmp_path / ("z.asc" if write is write_asc else "z.tif"), hill())
    field = Scene(floor={"file": str(file), "voxel": 0.25}).field()
    x, y = np.meshgrid(np.arange(4, 27) + 0.5, np.arange(4, 20) + 0.5)
    z = -8.0 + 3.0 * np.exp(-(((x - 15.0) / 3.0) ** 2))
    on = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    assert np.abs(field.distance(on)).max() < 0.05
    assert (field.distance(np.add(on, (0, 0, 1.0))) > 0.5).all()
    assert (field.distance(on - [0, 0, 0.4]) < 0.0).all()


def test_rows_from_north_to_south_and_the_origin_are_heeded(tmp_path):
    z = np.array([[-1.0, -1.0, -1.0], [-5.0, -5.0, -5.0], [-9.0, -9.0, -9.0]])
    file = write_asc(tmp_path / "z.asc", z, cell=2.0, corner=(500_000.0, 6_200_000.0))
    vertices, *_ = load_floor(file, origin=(500_000.0, 6_200_000.0))
    top = vertices[: z.size]
    assert top[top[:, 1] == 5.0][:, 2] == pytest.approx(-1.0)  # the first row is the northernmost
    assert top[top[:, 1] == 1.0][:, 2] == pytest.approx(-9.0)
    deep, *_ = load_floor(file, origin=(500_000.0, 6_200_000.0), depths=True)
    assert deep[: z.size, 2] == pytest.approx(-top[:, 2])


@pytest.mark.parametrize("depths", [None, True, False])
def test_the_depths_of_a_table_are_turned_once(depths, tmp_path):
    """A column named `depth` counts downwards; setting `depths` says the same or the opposite."""
    file = tmp_path / "d.csv"
    file.write_text("x,y,depth\n0,0,4\n1,0,5\n0,1,6\n1,1,7\n")
    vertices, _, notes = load_floor(file, depths=depths)
    turned = [4.0, 5.0, 6.0, 7.0] if depths is False else [-4.0, -5.0, -6.0, -7.0]
    assert vertices[:4, 2].tolist() == turned
    assert ("heights count downwards: converted to z upwards" in notes) == (depths is None)


def test_the_mesh_of_a_floor_is_closed_and_points_outwards(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    vertices, faces, _ = load_floor(write_asc(tmp_path / "z.asc", hill()))
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.0


def test_cells_without_a_value_take_the_nearest(tmp_path):
    z = hill()
    z[3:6, 4:9] = -9999
    vertices, *_ = load_floor(write_asc(tmp_path / "z.asc", z))
    assert vertices[: z.size, 2].min() > -8.01
    assert vertices[: z.size, 2].max() < -4.9


def test_a_tether_lies_over_a_ridge(tmp_path):
    """Anchor and robot near the bottom on both sides: two spans and the crest between."""
    file = write_asc(tmp_path / "z.asc", hill())
    field = Scene(floor={"file": str(file), "voxel": 0.2}).field()
    model = GeodesicTether(field, 0.4)
    tether = model.lay([(6, 12, -6.5), (15, 12, -4.5), (24, 12, -6.5)])
    straight = 18.0
    over = 2 * np.hypot(9.0, 1.5)
    assert straight < tether.length < over + 0.2
    assert tether.nodes[:, 2].max() == pytest.approx(-5.0, abs=0.15)


def test_a_floor_and_a_mesh_make_one_scene(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((2, 2, 6))
    box.apply_translation((22, 12, -6))
    box.export(tmp_path / "box.stl")
    write_asc(tmp_path / "z.asc", hill())
    (tmp_path / "s.json").write_text(
        json.dumps(
            {
                "schema_version": 1,
                "name": "site",
                "mesh": {"file": "box.stl", "voxel": 0.25},
                "floor": {"file": "z.asc"},
            }
        )
    )
    field = Scene.load(tmp_path / "s.json").field()
    inside, above, below = (22, 12, -4), (22, 12, -2), (8, 12, -8.5)
    assert field.distance(np.array([inside, above, below])) == pytest.approx(
        [-1.0, 1.0, -0.5], abs=0.1
    )
    assert main(["plot", str(tmp_path / "s.json"), "-o", str(tmp_path / "s.png")]) == 0


def test_a_scene_that_is_nothing_but_a_floor_is_drawn(tmp_path):
    write_asc(tmp_path / "z.asc", hill())
    scene = {"schema_version": 1, "name": "sea bed", "floor": {"file": "z.asc"}}
    (tmp_path / "s.json").write_text(json.dumps(scene))
    assert main(["plot", str(tmp_path / "s.json"), "-o", str(tmp_path / "s.png")]) == 0
    assert (tmp_path / "s.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: write_tiff(p / "z", hill(), crs="EPSG:4326"), "in degrees"),
        (lambda p: write_asc(p / "z", np.full((3, 3), -9999.0)), "expected heights"),
        (lambda p: write_asc(p / "z", np.zeros((1, 5))), "at least 2 x 2"),
        (lambda p: (p / "z").write_text("ncols three"), "cannot be read as a grid"),
        (lambda p: None, "no such file"),
    ],
)
def test_bad_grids_are_told_in_one_line(make, message, tmp_path):
    make(tmp_path)
    with pytest.raises(InputError, match=message) as told:
        load_floor(tmp_path / "z")
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("kind", ["las", "laz"])
def test_clouds_are_read_from_las(kind, tmp_path):
    laspy = pytest.importorskip("laspy", reason="laspy (extra online) is not installed")
    points = np.random.default_rng(1).uniform(-5, 5, (400, 3))
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales = [1e-3] * 3
    data = laspy.LasData(header)
    data.x, data.y, data.z = points.T
    data.write(str(tmp_path / f"cloud.{kind}"))
    assert read_cloud_file(tmp_path / f"cloud.{kind}").points == pytest.approx(points, abs=1e-3)


def test_meshes_are_read_from_glb(tmp_path):
    """Of several parts, each with its place."""
    trimesh = pytest.importorskip("trimesh")
    parts = trimesh.Scene([trimesh.creation.icosphere(radius=1.0)])
    parts.add_geometry(
        trimesh.creation.box((1, 1, 1)),
        transform=trimesh.transformations.translation_matrix((4, 0, 0)),
    )
    parts.export(tmp_path / "parts.glb")
    parts = read_mesh_file(tmp_path / "parts.glb")
    grid = grid_of_triangles(parts.vertices, parts.faces, voxel=0.1)
    field = Scene(mesh={"file": str(tmp_path / "parts.glb"), "voxel": 0.1}).field()
    assert grid.size == 0.1
    at = np.array([(0, 0, 2), (4, 0, 1.5), (4, 0, 0), (0, 0, 0)], dtype=float)
    assert field.distance(at) == pytest.approx([1.0, 1.0, -0.5, -1.0], abs=0.05)
