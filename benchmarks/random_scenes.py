"""Random scenes of many kinds with a mission in each, for laws that hold in all of them.

The kinds are hard for bounds: gaps narrower than a cell, bodies with free ends, solids that end at
the surface, waypoints close to solids or twice in the mission, waypoints with alternatives, starts
away from the anchor, tethers that only just reach.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene

HALF, DEEP = 4.0, -5.0
"""Half width of the water along x and y, and its floor, metres; the surface is at 0."""

Solids = list[dict[str, Any]]


@dataclass
class Draft:
    """Scene in the making.

    Attributes
    ----------
    rng
        Source of chance.
    clearance, delta
        Clearance and resolution of the mission, metres.
    solids
        Solids so far.
    hints
        Places in passages that are known by construction, metres.
    pairs
        Pairs of places on both sides of a passage, which is far shorter than the path around.
    mesh, cloud
        Shapes that become a mesh, or a cloud of points.
    """

    rng: np.random.Generator
    clearance: float
    delta: float
    solids: Solids = field(default_factory=list)
    hints: list[Any] = field(default_factory=list)
    pairs: list[Any] = field(default_factory=list)
    mesh: Solids = field(default_factory=list)
    cloud: Solids = field(default_factory=list)

    def u(self, low: float, high: float) -> float:
        """Return a random number."""
        return float(self.rng.uniform(low, high))

    def at(self, margin: float = 1.0) -> list[float]:
        """Return a random place in the water."""
        low, high = [-HALF + margin] * 2 + [DEEP + margin], [HALF - margin] * 2 + [-margin]
        return self.rng.uniform(low, high).tolist()

    def bar(self, a: Any, b: Any, radius: float) -> None:
        """Add a bar with round ends."""
        self.solids.append({"capsule": {"a": list(map(float, a)), "b": list(map(float, b)),
                                        "radius": radius}})  # fmt: skip

    def box(self, centre: Any, size: Any, turn: Any = (0, 0, 0)) -> dict[str, Any]:
        """Add a box."""
        solid = {"box": {"center": [float(v) for v in centre], "size": [float(v) for v in size],
                         "rotation": [float(v) for v in turn]}}  # fmt: skip
        self.solids.append(solid)
        return solid

    def gap(self) -> float:
        """Return the width of a gap: just passable by the judge's tolerance, just above the
        clearance on both sides, or wider. Most gaps are narrower than a cell."""
        narrowest, clear = max(0.0, self.clearance - 0.25 * self.delta) + 0.004, self.clearance
        ranges = ((narrowest, narrowest + 0.02), (clear, clear + 0.03), (clear, clear + 0.3))
        return 2.0 * self.u(*ranges[self.rng.integers(3)])


def posts(d: Draft) -> None:
    """Posts of any size through all depths, thin ones among them."""
    for _ in range(d.rng.integers(2, 8)):
        radius = d.u(0.04, 0.15) if d.rng.random() < 0.3 else d.u(0.15, 1.0)
        d.solids.append({"post": {"center": d.at()[:2], "radius": radius}})


def prisms(d: Draft) -> None:
    """Prisms, hollow ones among them, that may overlap."""
    for _ in range(d.rng.integers(2, 6)):
        turn, size = d.u(0.0, 2 * math.pi), d.u(0.3, 1.2)
        radii = size * d.rng.uniform(0.25, 1.0, 7)
        angles = turn + np.linspace(0.0, 2 * math.pi, 8)[:-1]
        corners = np.array(d.at()[:2]) + np.c_[radii * np.cos(angles), radii * np.sin(angles)]
        grow = d.u(0.0, 0.2) if d.rng.random() < 0.3 else 0.0
        d.solids.append({"prism": {"polygon": corners.tolist(), "grow": grow}})


def piers(d: Draft, above: tuple[float, float] = (0.3, 2.0)) -> None:
    """Boxes, cylinders and capsules that exceed the water at both ends by some height."""
    for _ in range(d.rng.integers(2, 7)):
        x, y, _ = d.at()
        low, high = DEEP - d.u(*above), d.u(*above)
        kind = d.rng.integers(3)
        if kind == 0:
            size = [d.u(0.2, 1.5), d.u(0.2, 1.5), high - low]
            d.box((x, y, 0.5 * (low + high)), size, (0, 0, d.u(0, 90)))
        elif kind == 1:
            d.solids.append({"cylinder": {"a": [x, y, low], "b": [x, y, high],
                                          "radius": d.u(0.1, 0.8)}})  # fmt: skip
        else:
            radius = d.u(0.1, 0.6)
            d.bar((x, y, low), (x, y, high), radius)


def at_the_surface(d: Draft) -> None:
    """Piers that end exactly at the surface and the floor."""
    piers(d, (0.0, 0.0))


def near_the_surface(d: Draft) -> None:
    """Piers that end a little beyond the water, by less or more than the proof asks for."""
    piers(d, (0.0, 4.0 * 0.3 * d.delta))


def below_the_surface(d: Draft) -> None:
    """Piers on the floor that end a little below the surface: a tether slips over them."""
    for _ in range(d.rng.integers(2, 6)):
        x, y, _ = d.at()
        top = -d.u(0.05, 1.5)
        d.box((x, y, 0.5 * (top + DEEP - 1)), (d.u(0.3, 1.5), d.u(0.3, 1.5), top - DEEP + 1))


def uprights_and_more(d: Draft) -> None:
    """Posts and piers beside a body that does not stand through the water."""
    (posts, piers)[d.rng.integers(2)](d)
    (ring, boulders, on_the_floor, pipes)[d.rng.integers(4)](d)


def quays(d: Draft) -> None:
    """Walls without end beside posts."""
    turn = d.u(0.0, 2 * math.pi)
    far = HALF - d.u(0.5, 1.5)
    normal = [-math.cos(turn), -math.sin(turn), 0.0]
    d.solids.append({"half_space": {"point": [-far * normal[0], -far * normal[1], -1.0],
                                    "normal": normal}})  # fmt: skip
    posts(d)


def leaning(d: Draft) -> None:
    """Poles that lean every way, from the floor to above the surface."""
    for _ in range(d.rng.integers(3, 8)):
        foot, lean = d.at(), d.u(0.0, 1.5) if d.rng.random() < 0.8 else d.u(0.0, 0.004)
        turn = d.u(0.0, 2 * math.pi)
        head = (foot[0] + lean * math.cos(turn), foot[1] + lean * math.sin(turn), 1.5)
        d.bar((foot[0], foot[1], DEEP - 1.5), head, d.u(0.1, 0.4))


def ring(d: Draft) -> None:
    """One or two rings, open ones among them."""
    for _ in range(d.rng.integers(1, 3)):
        torus = {"center": d.at(2.0), "axis": d.rng.normal(size=3).tolist(),
                 "major_radius": d.u(0.8, 1.7), "minor_radius": d.u(0.06, 0.35)}  # fmt: skip
        if d.rng.random() < 0.25:
            axis = np.array(torus["axis"])
            torus["start"] = np.cross(axis, d.rng.normal(size=3)).tolist()
            torus["angle"] = d.u(180, 345)
        d.solids.append({"torus": torus})
        d.hints.append(torus["center"])
        way = np.array(torus["axis"]) / np.linalg.norm(torus["axis"]) * d.u(0.4, 1.0)
        d.pairs.append([np.array(torus["center"]) - way, np.array(torus["center"]) + way])


def linked_rings(d: Draft) -> None:
    """Two rings through one another."""
    a, radius = np.array([d.u(-1, 1), d.u(-1, 1), 0.5 * DEEP]), d.u(1.2, 1.8)
    for k, axis in enumerate(((0, 1, 0), (0, 0, 1))):
        centre = [float(a[0]) + k * radius, float(a[1]), float(a[2])]
        d.solids.append({"torus": {"center": centre, "axis": axis, "major_radius": radius,
                                   "minor_radius": d.u(0.08, 0.3)}})  # fmt: skip


def cube(d: Draft) -> None:
    """Frame of a cube."""
    half, centre, radius = d.u(1.0, 1.8), np.array([d.u(-1, 1), d.u(-1, 1), -2.5]), d.u(0.05, 0.2)
    corners = [np.array([x, y, z]) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    for i, a in enumerate(corners):
        for b in corners[:i]:
            if np.abs(a - b).sum() == 2:
                d.bar(centre + half * a, centre + half * b, radius)


def jacket(d: Draft) -> None:
    """Frames of bars, some of which end in open water."""
    joints = [np.array(d.at()) for _ in range(6)]
    for _ in range(d.rng.integers(5, 11)):
        a = joints[d.rng.integers(len(joints))]
        if d.rng.random() < 0.5:
            b = joints[d.rng.integers(len(joints))]
        else:
            b = a + d.rng.normal(size=3) * [1.2, 1.2, 0.8]
        if np.linalg.norm(b - a) > 0.3:
            d.bar(a, b, d.u(0.06, 0.25))


def pipes(d: Draft) -> None:
    """Pipes above a floor, at heights down to a gap just above the clearance."""
    d.solids.append({"half_space": {"point": [0, 0, DEEP], "normal": [0, 0, 1]}})
    for _ in range(d.rng.integers(1, 4)):
        turn, radius = d.u(0, math.pi), d.u(0.15, 0.5)
        height = DEEP + radius + (d.gap() if d.rng.random() < 0.5 else d.u(0.4, 2.5))
        long = d.u(1.5, 12.0)
        centre = np.array([*d.at(1.5)[:2], height])
        way = 0.5 * long * np.array([math.cos(turn), math.sin(turn), 0.0])
        d.bar(centre - way, centre + way, radius)
        below = 0.5 * (DEEP + height - radius)
        for share in (-0.5, 0.0, 0.5):
            d.hints.append([*(centre + share * way)[:2], below])
        across = (radius + d.u(0.3, 1.0)) * np.array([-math.sin(turn), math.cos(turn), 0.0])
        d.pairs.append([(*(centre - across)[:2], below), (*(centre + across)[:2], below)])


def wall(d: Draft, x: float = 0.0) -> None:
    """A wall with one or two slots, upright or level, that ends in the water or not."""
    thick, turn = d.u(0.1, 0.6), d.u(-25, 25) if d.rng.random() < 0.5 else 0.0
    end = HALF + 1.0 if d.rng.random() < 0.4 else d.u(2.0, 3.5)
    level = d.rng.random() < 0.3
    low, high = (-end, end) if not level else (DEEP - 1.0, 1.0)
    cuts = sorted(d.u(0.7 * low, 0.7 * high) for _ in range(d.rng.integers(1, 3)))
    pieces, begin = [], low
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    for cut in cuts:
        width = d.gap()
        if cut - 0.5 * width <= begin + 0.1:
            continue
        pieces.append((begin, cut - 0.5 * width))
        begin = cut + 0.5 * width
        for u in (-1, 0, 1):
            off = u * (0.5 * thick + d.clearance)
            for v in (-2.5, -1.0, 0.0, 1.0, 2.5):
                y, z = (v, cut) if level else (cut, v + 0.5 * DEEP)
                d.hints.append([x + c * off - s * y, s * off + c * y, z])
        y, z = (d.u(-1.5, 1.5), cut) if level else (cut, 0.5 * DEEP + d.u(-1.5, 1.5))
        off = 0.5 * thick + d.clearance + d.u(0.1, 0.7)
        d.pairs.append([(x + c * o - s * y, s * o + c * y, z) for o in (-off, off)])
    pieces.append((begin, high))
    for a, b in pieces:
        middle, long = 0.5 * (a + b), b - a
        if level:
            d.box((x, 0, middle), (thick, 2 * end, long), (0, 0, turn))
        else:
            d.box((x - s * middle, c * middle, 0.5 * DEEP), (thick, long, -DEEP + 2), (0, 0, turn))


def two_walls(d: Draft) -> None:
    """Two walls with slots."""
    wall(d, -d.u(0.8, 1.5))
    wall(d, d.u(0.8, 1.5))


def on_the_floor(d: Draft) -> None:
    """Boxes on the floor."""
    d.solids.append({"half_space": {"point": [0, 0, DEEP], "normal": [0, 0, 1]}})
    for _ in range(d.rng.integers(1, 5)):
        x, y, _ = d.at()
        tall = d.u(0.5, 4.5)
        d.box((x, y, DEEP + 0.5 * tall), (d.u(0.4, 2.5), d.u(0.4, 2.5), tall), (0, 0, d.u(0, 90)))


def comb(d: Draft) -> None:
    """Plates in a row, with gaps of any width."""
    x = -2.5
    while x < 2.5:
        thick = d.u(0.1, 0.4)
        size = (thick, d.u(2.0, 5.0), d.u(2.0, 3.5))
        centre = (x + 0.5 * thick, d.u(-0.5, 0.5), -2.5 + d.u(-0.4, 0.4))
        d.box(centre, size)
        width = d.gap() if d.rng.random() < 0.5 else d.u(0.5, 1.2)
        d.hints += [[x + thick + 0.5 * width, y, z] for y in (-1.0, 0.0, 1.0) for z in (-3, -2)]
        half = 0.5 * size[1] + d.clearance + d.u(0.05, 0.3)
        d.pairs.append([(x + thick + 0.5 * width, y, -2.5) for y in (-half, half)])
        x += thick + width


def boulders(d: Draft) -> None:
    """Balls, some on the floor, some in open water, some into one another."""
    for _ in range(d.rng.integers(2, 7)):
        d.solids.append({"sphere": {"center": d.at(0.5), "radius": d.u(0.3, 1.3)}})


def tunnel(d: Draft) -> None:
    """A culvert, open at one end or at both, with room just above the clearance or more."""
    room, thick, long = max(d.gap(), 0.5) if d.rng.random() < 0.5 else d.u(0.8, 1.6), 0.3, d.u(2, 5)
    y, z = d.u(-1, 1), -2.5
    for sign in (-1, 1):
        d.box((0, y + sign * 0.5 * (room + thick), z), (long, thick, room + 2 * thick))
        d.box((0, y, z + sign * 0.5 * (room + thick)), (long, room + 2 * thick, thick))
    if d.rng.random() < 0.5:
        d.box((0.5 * long + 0.5 * thick, y, z), (thick, room + 2 * thick, room + 2 * thick))
    d.hints += [[x, y, z] for x in np.linspace(-0.5 * long - 0.3, 0.5 * long + 0.3, 7)]
    d.pairs.append([(x, y, z) for x in (-0.5 * long - d.clearance - 0.2, 0.3 * long)])


def as_mesh(d: Draft) -> None:
    """Boxes, pipes and balls as a mesh."""
    (boulders, jacket, cube, on_the_floor, wall)[d.rng.integers(5)](d)
    d.mesh = [s for s in d.solids if "half_space" not in s]
    d.solids = [s for s in d.solids if "half_space" in s]


def as_cloud(d: Draft) -> None:
    """Boxes, pipes and balls as points on their surfaces."""
    (boulders, cube, on_the_floor)[d.rng.integers(3)](d)
    d.cloud = [s for s in d.solids if "half_space" not in s]
    d.solids = [s for s in d.solids if "half_space" in s]


KINDS: dict[str, Callable[[Draft], None]] = {
    "posts": posts, "prisms": prisms, "piers": piers, "end at the surface": at_the_surface,
    "end near the surface": near_the_surface, "end below the surface": below_the_surface,
    "uprights and more": uprights_and_more, "quays": quays, "leaning poles": leaning, "rings": ring,
    "linked rings": linked_rings, "cube frames": cube, "jackets": jacket, "pipes": pipes,
    "walls with slots": wall, "two walls with slots": two_walls, "boxes on the floor": on_the_floor,
    "combs": comb, "boulders": boulders, "tunnels": tunnel, "meshes": as_mesh, "clouds": as_cloud,
}  # fmt: skip
"""Kinds of scenes."""


@dataclass(frozen=True)
class RandomScene:
    """Scene with a mission.

    Attributes
    ----------
    kind
        Kind in `KINDS`.
    scene, mission
        Scene and mission. The tether of the mission is as long as `tether_length` says, which the
        caller replaces once it knows how far the waypoints are.
    hints
        (k, 3) places in known passages, metres.
    tether_ratio
        Length of the tether as a multiple of the longest path to a waypoint.
    """

    kind: str
    scene: Scene
    mission: Mission
    hints: Floats
    tether_ratio: float


def random_scene(kind: str, seed: int, folder: Path) -> RandomScene:
    """Return a random scene of a kind with a mission.

    Parameters
    ----------
    folder : Path
        Folder for files of meshes and clouds.
    """
    rng = np.random.default_rng([list(KINDS).index(kind), seed])
    while True:
        clearance = float(rng.choice([0.0, 0.1, 0.2, 0.3]) + rng.uniform(0.0, 0.05))
        draft = Draft(rng, clearance, float(rng.choice([0.05, 0.1, 0.1, 0.2])))
        KINDS[kind](draft)
        bounds = [-HALF, -HALF, DEEP, HALF, HALF, 0.0] if rng.random() < 0.75 else None
        scene = _scene(draft, bounds, folder, f"{kind.replace(' ', '-')}-{seed}")
        places = _places(draft, scene)
        if places is not None:
            break
    anchor, start, waypoints = places
    mission = Mission(
        scene=f"{kind.replace(' ', '-')}-{seed}.scene.json", anchor=anchor, start=start,
        waypoints=waypoints, tether_length=100.0, clearance=clearance, delta=draft.delta,
        reach=float(rng.choice([1e-3, 0.1, 0.3])), cell=None if rng.random() < 0.7 else 0.3,
    )  # fmt: skip
    ratio = float(rng.choice([rng.uniform(1.03, 1.3), rng.uniform(1.3, 2.0), 4.0]))
    return RandomScene(kind, scene, mission, np.array(draft.hints).reshape(-1, 3), ratio)


def _scene(d: Draft, bounds: list[float] | None, folder: Path, name: str) -> Scene:
    """Return the scene of a draft; write its mesh or cloud."""
    radius = 0.02 if d.rng.random() < 0.1 else 0.0
    data: dict[str, Any] = {"solids": d.solids, "tether_radius": radius, "schema_version": 1}
    if bounds is not None:
        data["bounds"] = bounds
    if d.mesh:
        file = folder / f"{name}.stl"
        _mesh(d.mesh).export(file)
        data["mesh"] = {"file": file.name, "voxel": 0.05}
    if d.cloud:
        file = folder / f"{name}.npy"
        from trimesh.sample import sample_surface_even

        seed = int(d.rng.integers(1 << 30))
        points, _ = sample_surface_even(_mesh(d.cloud), 20_000, seed=seed)
        np.save(file, np.asarray(points, dtype=float))
        data["cloud"] = {"file": file.name, "voxel": 0.1}
    file = folder / f"{name}.scene.json"
    file.write_text(Scene.model_validate(data).model_dump_json(exclude_none=True, indent=1))
    return Scene.load(file)


def _mesh(solids: Solids) -> Any:
    """Return solids as one mesh."""
    import trimesh
    from scipy.spatial.transform import Rotation

    parts = []
    for s in solids:
        if "sphere" in s:
            part = trimesh.creation.icosphere(3, s["sphere"]["radius"])
            part.apply_translation(s["sphere"]["center"])
        elif "capsule" in s:
            c = s["capsule"]
            part = trimesh.creation.cylinder(c["radius"], segment=[c["a"], c["b"]], sections=16)
        else:
            b = s["box"]
            place = np.eye(4)
            place[:3, :3] = Rotation.from_euler("xyz", b["rotation"], degrees=True).as_matrix()
            place[:3, 3] = b["center"]
            part = trimesh.creation.box(b["size"], place)
        parts.append(part)
    return trimesh.util.concatenate(parts)


def _places(d: Draft, scene: Scene) -> tuple[Any, Any, list[Any]] | None:
    """Return an anchor, a start and waypoints in the water; None if the draft has too little."""
    rng, distance = d.rng, scene.field().distance
    low, high = np.array([-HALF, -HALF, DEEP]) + 0.05, np.array([HALF, HALF, 0.0]) - 0.05
    points = rng.uniform(low, high, (3000, 3))
    if rng.random() < 0.3:  # all at one depth, as among the tours of the plane
        points[:, 2] = points[0, 2]
    room = distance(points)
    open_ = points[room > d.clearance + 0.02]
    close = points[(room > 0.15 * d.delta + 0.005) & (room < d.clearance + 0.02)]
    if len(open_) < 200:
        return None
    count = int(rng.integers(4, 13))
    chosen = list(open_[: count + 2])
    for k in range(count):
        if len(close) and rng.random() < 0.15:
            chosen[k] = close[rng.integers(len(close))]
    if len(d.hints) and rng.random() < 0.5:  # some in a passage
        hint = np.array(d.hints[rng.integers(len(d.hints))], dtype=float)
        if (
            distance(hint[None])[0] > 0.15 * d.delta + 0.005
            and (hint > low).all()
            and (hint < high).all()
        ):
            chosen[0] = hint
    free_pairs = [
        pair for pair in np.array(d.pairs, dtype=float).reshape(-1, 2, 3)
        if (pair > low).all() and (pair < high).all()
        and (distance(pair) > 0.15 * d.delta + 0.005).all()
    ]  # fmt: skip
    if free_pairs and rng.random() < 0.8:
        chosen[2:4] = free_pairs[rng.integers(len(free_pairs))]
    if rng.random() < 0.2:
        chosen[1] = chosen[0].copy()
    waypoints: list[Any] = [p.tolist() for p in chosen[:count]]
    if rng.random() < 0.15:
        for k in range(0, count, 3):
            other = open_[-1 - k].tolist()
            waypoints[k] = {"position": waypoints[k], "alternatives": [{"position": other}]}
    anchor = chosen[count].tolist()
    start = chosen[count + 1].tolist() if rng.random() < 0.5 else anchor
    return anchor, start, waypoints
