"""Tethers among random meshes, against their own refinement and an independent string.

    python benchmarks/strings.py [--meshes 200] [--drives 100] [--jobs 2] [--keep]

Each mesh is a union of tilted boxes, some of them thin. A robot wanders between them; after every
drive it stays for three updates, and the tether's length is compared with two others in its class:

- the same model's, at half the delta, pulled to rest;
- a string of beads in the same distance field (where the tether is far above it, in one of voxels a
  quarter as large): each bead goes to where its neighbours pull it and
  is put back on the surface if that is inside (projected successive over-relaxation), with ever
  more beads where the string turns.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
import trimesh
from table import head, heading, row
from tether import wander

from netsp.base.compiled.kernel import kernel
from netsp.base.geometry import polylines
from netsp.world import GeodesicTether
from netsp.world.scene.field import DistanceField, pushed_out
from netsp.world.scene.sampling import Field, sample
from netsp.world.scene.voxels import grid_of_triangles
from netsp.world.tether import Tether

DELTA, VOXEL, THINNEST = 0.1, 0.05, 0.25

LEAST, MOST = -0.0005, 0.005
"""What a tether may be below and above the others."""

BOUNDS = np.array([[-4.5] * 3, [4.5] * 3])
MOST_BEADS = 1500
PRECISION = 5e-3 * DELTA
"""Metres from taut at which a tether says that it is at rest: the model's default."""

LEGS = 10
"""Steps of a drive."""

ROUNDS, MORE, AT_REST = 300, 60, 2e-4
"""Of pulling at half the delta, and how many more may change the length by no more than that share
of it: at delta / 2, which is the voxels' size here, some tethers crumple in the creases between
solids for ever. Those are counted, and are no reference."""

MOST_DOUBTS = 3
"""Stops of a mesh, besides those at which strings are pulled anyway, at which one is because the
tether is not as long as its refinement."""


def boxes(seed: int) -> trimesh.Trimesh:
    """A union of tilted boxes, a third of them plates."""
    rng = np.random.default_rng(seed)
    parts = []
    for _ in range(rng.integers(3, 9)):
        size = rng.uniform(0.4, 3.0, 3)
        if rng.random() < 1 / 3:
            size[rng.integers(3)] = THINNEST
        part = trimesh.creation.box(size)
        part.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        part.apply_translation(rng.uniform(-2.5, 2.5, 3))
        parts.append(part)
    return trimesh.util.concatenate(parts)


@kernel
def beads_pulled(field: Field, beads: np.ndarray, rounds: int, omega: float, most: float) -> float:
    """Pull a string of beads (n, 3) in place; how far any bead moved in the last round."""
    n = len(beads)
    spans = np.empty(n - 1)
    for i in range(n - 1):
        spans[i] = max(np.sqrt(((beads[i + 1] - beads[i]) ** 2).sum()), 1e-9)
    moved = 0.0
    for _ in range(rounds):
        moved = 0.0
        for i in range(1, n - 1):
            a, b = 1.0 / spans[i - 1], 1.0 / spans[i]
            new, square = np.empty(3), 0.0
            for k in range(3):
                goal = (a * beads[i - 1, k] + b * beads[i + 1, k]) / (a + b)
                new[k] = omega * (goal - beads[i, k])
                square += new[k] ** 2
            scale = min(1.0, most / max(np.sqrt(square), 1e-12))
            x, y, z = (
                beads[i, 0] + scale * new[0],
                beads[i, 1] + scale * new[1],
                beads[i, 2] + scale * new[2],
            )
            for _push in range(3):
                d, gx, gy, gz, _ = sample(field, x, y, z)
                if d >= 0.0:
                    break
                x, y, z = x - d * gx, y - d * gy, z - d * gz
            moved = max(
                moved,
                np.sqrt((x - beads[i, 0]) ** 2 + (y - beads[i, 1]) ** 2 + (z - beads[i, 2]) ** 2),
            )
            beads[i, 0], beads[i, 1], beads[i, 2] = x, y, z
    return moved


def string_length(field: DistanceField, nodes: np.ndarray) -> float:
    """Length of the string of beads that begins where the tether lies. No span may cut a corner by
    more than a millimetre: a string would creep over an edge by the chords between its beads. Not a
    number where it takes too many of them, as in a crease."""
    beads = polylines.points_along(nodes, 0.1)
    for _ in range(600):
        for _again in range(8):
            middles = 0.5 * (beads[:-1] + beads[1:])
            # in a crease, out of one solid is into the other: no beads without end
            apart = np.linalg.norm(np.diff(beads, axis=0), axis=1) > 4e-3
            inside = np.flatnonzero(apart & (field.distance(middles) < -1e-3))
            if not len(inside):
                break
            added = pushed_out(field, middles[inside], 0.0)
            beads = np.insert(beads, inside + 1, added, axis=0)
            if len(beads) > MOST_BEADS:
                return np.nan
        if beads_pulled(field.arrays, beads, 25, 1.5, 0.002) < 2e-6:
            break
    return polylines.length(beads)


def field_of(seed: int, voxel: float) -> DistanceField:
    """A mesh in voxels of so many metres."""
    mesh = boxes(seed)
    voxels = grid_of_triangles(mesh.vertices, mesh.faces, voxel=voxel)
    return DistanceField.build([], [], np.empty((0, 4)), [], voxels, 0.0)


def stops(seed: int, drives: int) -> Iterator[tuple[DistanceField, Tether]]:
    """The field of a mesh, and the tether after each drive and three still updates."""
    field = field_of(seed, VOXEL)
    model = GeodesicTether(field, DELTA)
    rng = np.random.default_rng([seed, 1])
    start = BOUNDS[0]
    path = wander(rng, field, start, drives * LEGS, 0.5, *BOUNDS, flat=1.0)
    tether = model.start(start, start)
    for k in range(drives):
        tether, _ = model.drive(tether, path[LEGS * k : LEGS * (k + 1)])
        for _ in range(3):
            tether = model.update(tether, tether.robot)
        yield field, tether


def refined(field: DistanceField, tether: Tether) -> float:
    """Its length at half the delta; not a number where it does not come to rest."""
    model = GeodesicTether(field, 0.5 * DELTA)
    once = model.relaxed(tether.nodes, ROUNDS)
    again = model.relaxed(once.nodes, MORE)
    return again.length if abs(again.length - once.length) < AT_REST * once.length else np.nan


def compared(seed: int, drives: int, every: int) -> tuple[list[float], list[float], list[bool]]:
    """Shares by which the tether is above its refinement, and above the string: at every so many
    stops, and wherever it is not what it may be beside its refinement (said on stderr); and at
    which stops the tether itself says that it is at rest."""
    finer: list[float] = []
    string: list[float] = []
    still: list[bool] = []
    doubts = 0
    for k, (field, tether) in enumerate(stops(seed, drives)):
        finer.append(tether.length / refined(field, tether) - 1.0)
        still.append(tether.residual <= PRECISION)
        doubtful = np.isfinite(finer[-1]) and not LEAST < finer[-1] < MOST
        looked = doubtful and doubts < MOST_DOUBTS
        doubts += looked
        if k % every == every - 1 or looked:
            string.append(tether.length / string_length(field, tether.nodes) - 1.0)
            if string[-1] > MOST:  # the mesh itself may hold a tether where coarse voxels do not
                fine = field_of(seed, 0.25 * VOXEL)
                string[-1] = tether.length / string_length(fine, tether.nodes) - 1.0
        if doubtful:
            beside = f", {100 * string[-1]:.3f} % above the string" if looked else ""
            print(f"mesh {seed}, drive {k}: {100 * finer[-1]:.3f} % above its refinement{beside}",
                  file=sys.stderr, flush=True)  # fmt: skip
    return finer, string, still


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--meshes", type=int, default=200)
    parser.add_argument("--drives", type=int, default=100)
    parser.add_argument("--every", type=int, default=20, help="drives between two strings")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    args = parser.parse_args()
    heading("Tethers among random meshes")
    begin = time.perf_counter()
    finer: list[float] = []
    string: list[float] = []
    still: list[bool] = []
    seeds = range(args.first, args.first + args.meshes)
    one = partial(compared, drives=args.drives, every=args.every)
    with ProcessPoolExecutor(args.jobs) as pool:
        for done, (a, b, c) in enumerate(pool.map(one, seeds), 1):
            finer += a
            string += b
            still += c
            if done % 10 == 0:
                print(f"{done} meshes", file=sys.stderr, flush=True)
    print()
    head("against", "stops", "it comes to no rest", "median %", "worst above %",
         "above 0.5 %", "worst below %", "below 0.05 %", name="tether-strings")  # fmt: skip
    at_rest = [v for v, rests in zip(finer, still, strict=True) if rests]
    moving = [v for v, rests in zip(finer, still, strict=True) if not rests]
    for name, found in (
        ("its refinement", finer), ("where it says it is at rest", at_rest),
        ("where it says it is not", moving), ("a string of beads", string),
    ):  # fmt: skip
        s = 100.0 * np.array([v for v in found if np.isfinite(v)])
        row(name, len(found), len(found) - len(s), f"{np.median(s):.4f}", f"{s.max():.3f}",
            int((s > 100.0 * MOST).sum()), f"{s.min():.3f}",
            int((s < 100.0 * LEAST).sum()))  # fmt: skip
    print(f"\n{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
