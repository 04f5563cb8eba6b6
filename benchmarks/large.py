"""Large meshes: grids with points near surfaces only, beside full ones.

    python benchmarks/large.py [--site] [--keep]

A site of 100 x 100 x 30 m with 64 piles and braces over an uneven sea floor, at voxels of 5 cm; and
a corner of it, in which a full grid fits, with a tether that is driven through both.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh
from peak import highest
from table import head, heading, row

from netsp.world import Scene
from netsp.world.scene import voxels
from netsp.world.scene.field import DistanceField
from netsp.world.scene.scene_policy import GridPolicy
from netsp.world.tether import TETHERS

VOXEL = 0.05

SPARSE = GridPolicy(max_dense_points=0)
"""Policy of grids that always hold only the points near surfaces."""


def jetties(rows: int) -> trimesh.Trimesh:
    """Rows of piles 11 m apart, with braces between them."""
    parts = []
    for i in range(rows):
        for j in range(rows):
            x, y = 10.0 + 11.0 * i, 10.0 + 11.0 * j
            pile = trimesh.creation.cylinder(0.6, 28.0, sections=48)
            pile.apply_translation([x, y, -14.0])
            parts.append(pile)
            if i + 1 < rows:
                ends = [[x, y, -5.0], [x + 11.0, y, -20.0]]
                parts.append(trimesh.creation.cylinder(0.3, segment=ends, sections=32))
    return trimesh.util.concatenate(parts)


def write_floor(path: Path) -> None:
    """An uneven sea floor of 100 x 100 m in cells of half a metre."""
    n = 200
    x, y = np.meshgrid(0.5 * np.arange(n), 0.5 * np.arange(n))
    z = -28.0 + 1.5 * np.sin(x / 9.0) + np.cos(y / 7.0)
    rows = "\n".join(" ".join(f"{v:.3f}" for v in line) for line in z[::-1])
    path.write_text(
        f"ncols {n}\nnrows {n}\nxllcorner 0\nyllcorner 0\ncellsize 0.5\n"
        f"NODATA_value -9999\n{rows}\n"
    )


def site() -> None:
    """The whole site, by the scene's own ways."""
    print("### 100 x 100 x 30 m\n")
    head("voxel", "surface m²", "blocks", "build s", "CPU s", "memory GiB", "kept GiB",
         name="large-site")  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        mesh = jetties(8)
        mesh.export(Path(folder) / "piles.stl")
        write_floor(Path(folder) / "floor.asc")
        scene = Scene.model_validate({
            "schema_version": 1,
            "mesh": {"file": f"{folder}/piles.stl", "voxel": VOXEL},
            "floor": {"file": f"{folder}/floor.asc", "voxel": VOXEL},
        })  # fmt: skip
        begin, cpu = time.perf_counter(), time.process_time()
        field = scene.field()
        wall, cpu = time.perf_counter() - begin, time.process_time() - cpu
        kept = field.arrays.data.nbytes + field.arrays.grid.nbytes
        blocks = int((field.arrays.grid.size) // 512)
        row(VOXEL, f"{mesh.area + 1e4:,.0f}", f"{blocks:,}", f"{wall:.0f}", f"{cpu:.0f}",
            f"{highest():.2f}", f"{kept / 2**30:.2f}")  # fmt: skip
    print()


def beside() -> None:
    """Nine piles, and a tether that is driven between them, in both kinds of grid."""
    print("### Nine piles\n")
    head("grid", "points", "median us", "99 % us", "longest m", name="large-updates")
    mesh = jetties(3)
    mesh.apply_translation([-21.0, -21.0, 14.0])
    t = np.linspace(0.0, 1.0, 1500)[:, None]
    path = np.hstack([14.0 * np.cos(14.0 * t), 14.0 * np.sin(9.0 * t), 8.0 * np.sin(23.0 * t)])
    fields = []
    for policy in (GridPolicy(), SPARSE):
        grid = voxels.grid_of_triangles(
            mesh.vertices, mesh.faces, voxel=0.1, memory_limit=8.0, policy=policy
        )
        fields.append(DistanceField.build([], [], np.empty((0, 4)), [], grid, 0.0))
    models = [TETHERS["geodesic"](f, 0.2) for f in fields]
    medians: list[list[float]] = [[], []]
    # by turns, so that both see the same machine
    for _ in range(3):
        for k, model in enumerate(models):
            tether = model.start(path[0], path[0])
            spent, lengths = [], []
            for robot in path[1:]:
                begin = time.perf_counter()
                tether = model.drive(tether, robot[None])[0]
                spent.append(1e6 * (time.perf_counter() - begin))
                lengths.append(tether.length)
            medians[k].append(statistics.median(spent))
            if len(medians[k]) == 3:
                row("sparse" if k else "full", f"{fields[k].arrays.grid.size:,}",
                    f"{statistics.median(medians[k]):.0f}", f"{np.quantile(spent, 0.99):.0f}",
                    f"{max(lengths):.2f}")  # fmt: skip
    print()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--site", action="store_true", help="the large site only")
    args = parser.parse_args()
    heading("Large sites")
    # compiled on something small
    small = trimesh.creation.icosphere(subdivisions=1)
    voxels.grid_of_triangles(small.vertices, small.faces, voxel=0.1, policy=SPARSE)
    before = highest()
    site()
    print(f"Python and libraries alone: {before:.2f} GiB; slabs of {SPARSE.slab_size:,} blocks.\n")
    if not args.site:
        beside()


if __name__ == "__main__":
    sys.exit(main())
