"""No bound in space is above a path or tour that was found without netsp (a sample of
`python benchmarks/space_law.py`)."""

import itertools
import sys
from pathlib import Path

import numpy as np
import pytest

from netsp.plan.space.path_bound import LegBounds
from netsp.plan.space.places import Places
from netsp.world import Scene

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from one_corner_paths import compare
from random_scenes import KINDS, random_scene
from solid_distances import rooms_at, water_of
from tethered_tours import shortest_order


def test_distances_written_anew_are_those_of_the_field():
    rng = np.random.default_rng(0)

    def at():
        return rng.uniform(-3, 3, 3).tolist()

    arc = {"center": at(), "major_radius": 1.5, "minor_radius": 0.2}
    solids = [
        {"sphere": {"center": at(), "radius": 0.5}},
        {"capsule": {"a": at(), "b": at(), "radius": 0.3}},
        {"cylinder": {"a": at(), "b": at(), "radius": 0.4}},
        {"box": {"center": at(), "size": [0.5, 1.5, 2.5], "rotation": [20, -50, 130]}},
        {"torus": {**arc, "axis": at()}},
        {"torus": {**arc, "axis": [0, 0, 1], "start": [1, 1, 0], "angle": 200.0}},
        {"post": {"center": at()[:2], "radius": 0.5}},
        {"prism": {"polygon": [[0, 0], [2, 0], [2, 1], [1, 0.4], [0, 1]], "grow": 0.1}},
        {"half_space": {"point": at(), "normal": at()}},
    ]
    points = rng.uniform(-5, 5, (100, 3))
    for scene in (*(Scene(solids=[s]) for s in solids), Scene(solids=solids, tether_radius=0.02)):
        ours, theirs = scene.field().distance(points), rooms_at(water_of(scene), points)
        assert theirs == pytest.approx(ours, abs=1e-6)


def test_the_shortest_order_is_that_of_all_permutations():
    rng = np.random.default_rng(1)
    places, cluster = rng.uniform(size=(6, 2)), np.array([0, 1, 2, 2, 3, 4])
    costs = np.linalg.norm(places[:, None] - places[None], axis=2)
    least = min(
        sum(costs[u, v] for u, v in itertools.pairwise((0, *order, 0)))
        for choice in ([1, 2, 4, 5], [1, 3, 4, 5])
        for order in itertools.permutations(choice)
    )
    length, order = shortest_order(costs, cluster)
    assert length == pytest.approx(least)
    assert sum(costs[u, v] for u, v in itertools.pairwise((0, *order, 0))) == pytest.approx(least)
    assert sorted(cluster[order].tolist()) == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("kind", "seed"),
    [("posts", 1), ("end near the surface", 2), ("uprights and more", 1), ("walls with slots", 3),
     ("rings", 1), ("boulders", 2)],
)  # fmt: skip
def test_no_bound_is_above_paths_with_one_corner_and_tours_along_them(kind, seed, tmp_path):
    compared = compare(kind, seed, tmp_path)
    assert compared is not None
    assert compared.legs >= 1
    assert compared.bound is not None
    assert compared.above == 0


def test_a_bound_that_takes_the_robot_for_wider_than_it_is_is_above_a_path(tmp_path, monkeypatch):
    region = LegBounds._region

    def wider(self, u, v):
        found = region(self, u, v)
        return found._replace(room=found.room + 0.1)

    monkeypatch.setattr(LegBounds, "_region", wider)
    compared = compare("walls with slots", 3, tmp_path)
    assert compared is not None
    assert compared.above > 0


def test_each_kind_makes_scenes_with_missions(tmp_path):
    for kind in set(KINDS) - {"meshes"}:
        drawn = random_scene(kind, 3, tmp_path)
        assert len(drawn.mission.waypoints) >= 4
        field = drawn.scene.field()
        places = Places.for_mission(drawn.mission, field)
        assert (field.distance(places.points) > 0.0).all()
