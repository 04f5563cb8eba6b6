"""Viewpoints: what is planned is seen, and no choice among them is much smaller."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp.base.clock import Clock
from netsp.base.errors import InputError
from netsp.command.main import main
from netsp.plan.cover import cover
from netsp.plan.cover.choose import (
    choose,
    choose_greedily,
    counting_bound,
    merge_patches,
    prune,
    solve_program,
)
from netsp.plan.cover.cover_policy import CoverPolicy
from netsp.plan.cover.viewpoints import Viewer, coarsen, spread_out
from netsp.world import Scene
from netsp.world.mission.equipment import Camera
from netsp.world.mission.mission import Mission
from netsp.world.simulator.coverage import Coverage, surface_patches
from netsp.world.simulator.mission_run import simulate

RING = Scene(name="ring", solids=[{"torus": {
    "center": [0, 0, -4], "axis": [0, 1, 0], "major_radius": 1.5, "minor_radius": 0.3,
}}], bounds=[-5, -4, -9, 5, 4, 0])  # fmt: skip
CAMERA = Camera(range=2.5, patch=0.25)
ANCHOR = (-3.0, -3.0, -0.5)
FEWEST = {"anchor": ANCHOR, "camera": CAMERA, "standoff": 1.2, "objective": "viewpoints"}


@pytest.fixture(scope="module")
def covered():
    return cover(RING, **FEWEST, time_limit=None)


def test_what_is_planned_is_what_a_camera_sees_there(covered):
    look = Coverage(covered.patches, RING.field(), CAMERA)
    for place, heading in zip(covered.viewpoints.places, covered.viewpoints.headings, strict=True):
        look.look(place, float(heading))
    assert look.share >= covered.seen - 1e-9
    assert covered.seen >= 0.99 * covered.visible - 1e-9
    assert covered.visible > 0.99


def test_few_waypoints_do_and_how_few_is_known(covered):
    count = len(covered.mission.waypoints)
    assert count == len(covered.viewpoints) < covered.candidates
    assert covered.bound <= count <= 1.15 * covered.bound


def test_waypoints_keep_off_within_bounds_and_within_the_tether(covered):
    field, mission = RING.field(), covered.mission
    assert field.distance(mission.places).min() >= mission.clearance - 1e-3
    assert (mission.places >= [-5, -4, -9]).all()
    assert (mission.places <= [5, 4, 0]).all()
    short = cover(RING, **FEWEST, tether_length=5.0)
    assert np.linalg.norm(short.mission.places - ANCHOR, axis=1).max() <= 5.0
    assert short.visible < covered.visible


def test_flown_it_is_seen(covered):
    run = simulate(covered.mission, scene=RING)
    assert run.summary["visited"] == len(covered.mission.waypoints)
    assert run.summary["exceedance_s"] == 0.0
    assert run.summary["coverage"] >= 0.985 * covered.visible


def test_the_same_seed_gives_the_same_waypoints(covered):
    again = cover(RING, **FEWEST, time_limit=None)
    assert again.mission == covered.mission


def test_less_of_the_surface_needs_fewer_waypoints(covered):
    half = cover(RING, **FEWEST, share=0.5)
    assert len(half.viewpoints) < len(covered.viewpoints)
    assert half.seen >= 0.5 * half.visible


def test_a_wall_hides_what_is_behind_it():
    """A sphere in a box that is open towards the robot only."""
    walls = [
        {"box": {"center": [0, y, 0], "size": [4, 0.2, 4]}} for y in (-1.2, 1.2)
    ] + [
        {"box": {"center": [0, 0, z], "size": [4, 2.6, 0.2]}} for z in (-1.2, 1.2)
    ] + [{"box": {"center": [2, 0, 0], "size": [0.2, 2.6, 2.6]}}]  # fmt: skip
    ball = {"name": "ball", "sphere": {"center": [0.6, 0, 0], "radius": 0.5}}
    scene = Scene(name="niche", solids=[*walls, ball], bounds=[-6, -4, -4, 4, 4, 4])
    found = cover(
        scene, anchor=(-5, 0, 0), camera=CAMERA, standoff=1.0, clearance=0.45, inspect=("ball",),
        objective="viewpoints",
    )  # fmt: skip
    assert 0.2 < found.visible < 0.9
    assert (found.mission.places[:, 0] < 0.6).all()


def test_lines_of_sight_keep_to_their_limits():
    field = RING.field()
    patches = coarsen(surface_patches(RING, field, 0.25, np.array([ANCHOR])), 0.25)
    place = np.array([2.9, 0.1, -4.0])
    seen = {}
    for incidence, farthest in ((80.0, 2.5), (40.0, 2.5), (80.0, 1.3)):
        viewer = Viewer(
            field, patches, CAMERA, 1.2, 0.3, np.radians(incidence), farthest, len, CoverPolicy()
        )
        seen[incidence, farthest] = viewer.seen_from(place, np.pi)
        there = np.flatnonzero(seen[incidence, farthest])
        sight = place - patches.centres[there]
        far = np.linalg.norm(sight, axis=1)
        assert far.max() <= farthest
        square = np.einsum("ij,ij->i", sight, patches.normals[there]) / far
        assert np.degrees(np.arccos(square)).max() <= incidence + 1e-6
    assert seen[40.0, 2.5].sum() < seen[80.0, 2.5].sum()
    assert seen[80.0, 1.3].sum() < seen[80.0, 2.5].sum()


def test_coarser_patches_have_the_same_area():
    fine = surface_patches(RING, RING.field(), 0.2, np.array([ANCHOR]))
    coarse = coarsen(fine, 0.25)
    assert len(coarse.areas) < 0.5 * len(fine.areas)
    assert coarse.areas.sum() == pytest.approx(fine.areas.sum())
    assert coarse.areas.sum() == pytest.approx(4 * np.pi**2 * 1.5 * 0.3, rel=0.03)


SEES = st.lists(st.lists(st.booleans(), min_size=6, max_size=6), min_size=1, max_size=7)
AREAS = st.lists(st.integers(1, 5).map(float), min_size=6, max_size=6)


def fewest(sees, areas, needed):
    for count in range(len(sees) + 1):
        for chosen in itertools.combinations(range(len(sees)), count):
            if areas[sees[list(chosen)].any(axis=0)].sum() >= needed - 1e-9:
                return count
    raise AssertionError


@settings(deadline=None, max_examples=150)
@given(SEES, AREAS, st.sampled_from([0.5, 0.8, 0.99, 1.0]))
def test_no_choice_is_smaller_than_the_bound_and_the_best_is_found(rows, areas, share):
    sees, areas = np.array(rows), np.array(areas)
    total = areas[sees.any(axis=0)].sum()
    best = fewest(sees, areas, share * total)
    found = choose(sees, areas, share, Clock())
    assert areas[sees[found.chosen].any(axis=0)].sum() >= share * total - 1e-9
    assert found.bound <= best
    assert len(found.chosen) == best
    if total:
        matrix, weights = merge_patches(sees, areas)
        assert weights.sum() == pytest.approx(total)
        assert counting_bound(matrix, weights, share * total) <= best
        assert solve_program(matrix, weights, share * total, Clock())[1] <= best
        first = choose_greedily(matrix, weights, share * total)
        assert best <= len(prune(matrix, weights, first, share * total)) <= len(first)


@pytest.mark.parametrize("seed", range(30))
def test_each_greedy_choice_shows_most_and_each_drop_loses_least(seed):
    rng = np.random.default_rng(seed)
    sees, areas = rng.random((20, 40)) < 0.2, rng.uniform(0.5, 2.0, 40)
    needed = rng.uniform(0.0, 1.0) * areas[sees.any(axis=0)].sum()
    chosen = choose_greedily(sees, areas, needed)
    unseen, seen_area = np.ones(40, dtype=bool), 0.0
    for k in chosen:
        gains = (sees & unseen) @ areas
        assert gains[k] == pytest.approx(gains.max())
        assert seen_area < needed
        seen_area += gains[k]
        unseen &= ~sees[k]
    assert seen_area >= needed - 1e-9
    left = list(chosen)
    while left:
        rests = [areas[sees[[k for k in left if k != gone]].any(axis=0)].sum() for gone in left]
        if max(rests) < needed - 1e-9:
            break
        left.pop(int(np.argmax(rests)))
    assert sorted(prune(sees, areas, chosen, needed)) == sorted(left)


@given(st.lists(st.tuples(*[st.floats(-5, 5)] * 3), min_size=1, max_size=30), st.floats(0.1, 4.0))
def test_points_spread_apart_are_near_to_all(points, apart):
    points = np.array(points)
    taken = points[spread_out(points, apart)]
    assert np.linalg.norm(points[:, None] - taken[None], axis=2).min(axis=1).max() <= apart
    gaps = np.linalg.norm(taken[:, None] - taken[None], axis=2)[~np.eye(len(taken), dtype=bool)]
    assert gaps.size == 0 or gaps.min() > apart


def test_a_mission_is_written_that_can_be_solved(tmp_path, capsys):
    (tmp_path / "s").mkdir()
    scene, out = tmp_path / "s" / "ring.json", tmp_path / "mission.json"
    scene.write_text(RING.model_dump_json(exclude_none=True))
    plot = tmp_path / "cover.png"
    call = ["cover", str(scene), "--anchor=-3,-3,-0.5", "--camera", "2.5,70", "--standoff", "1.2"]
    call += ["--patch", "0.4"]
    assert main([*call, "-o", str(out), "--plot", str(plot), "--share", "0.3"]) == 0
    said = capsys.readouterr()
    assert said.out == ""
    for word in ("seen ", "waypoints ", "tour ", "tether ", "netsp solve"):
        assert word in said.err
    assert plot.read_bytes().startswith(b"\x89PNG")
    mission = Mission.load(out)
    assert mission.load_scene().name == "ring"
    assert all(w.heading is not None for w in mission.waypoints)
    assert "for a short time" in said.err
    few = tmp_path / "few.json"
    again = ["--fewest", "--speed", "0.4", "--share", "0.3", "-o", str(few), "--json"]
    assert main([*call, *again]) == 0
    said = capsys.readouterr()
    assert "the fewest" in said.err
    told = json.loads(said.out)
    assert told["objective"] == "viewpoints"
    assert told["waypoints"] <= len(mission.waypoints)
    assert Mission.load(few).speed == 0.4
    assert told["tour_s"] > told["tour_length"] / 0.4


BAD = {
    "an anchor in the ring": (["--anchor=1.5,0,-4"], "anchor"),
    "an anchor that is none": (["--anchor=1,2"], "--anchor: expected three numbers"),
    "a camera that is none": (["--camera", "far"], "--camera: expected RANGE"),
    "a field of view of 200": (
        ["--camera", "2,200"],
        "field_of_view: input should be less than 180",
    ),
    "a share above 1": (["--share", "1.5"], "share: expected a share up to 1"),
    "a right angle": (["--incidence", "90"], "incidence: expected less than 90"),
    "too near": (["--standoff", "0.1"], "standoff: 0.1 is nearer than the clearance"),
    "too far": (["--standoff", "5"], "standoff: 5 is farther than the camera sees"),
    "a solid that is not there": (["--inspect", "wreck"], "inspect: expected names of solids"),
    "a tether that is too short": (["--tether", "0.5"], "no part of the surface can be seen"),
    "another picture": (["--plot", "x.bmp"], "x.bmp"),
}


@pytest.mark.parametrize(("flags", "expected"), BAD.values(), ids=BAD)
def test_bad_input_is_told_in_one_line(flags, expected, tmp_path, capsys):
    scene, out = tmp_path / "ring.json", tmp_path / "out.json"
    scene.write_text(RING.model_dump_json(exclude_none=True))
    call = ["cover", str(scene), "-o", str(out), "--quiet"]
    if not any(f.startswith("--anchor") for f in flags):
        call.append("--anchor=-3,-3,-0.5")
    assert main([*call, *flags]) == 2
    said = capsys.readouterr().err
    assert expected in said
    assert said.count("\n") == 1
    assert not out.exists()


def test_what_is_not_a_scene_is_told(tmp_path, capsys):
    file = Path(tmp_path / "x.json")
    file.write_text("{}")
    assert main(["cover", str(file), "--anchor=0,0,0"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_arguments_are_checked():
    with pytest.raises(InputError, match="farthest: expected more than 0"):
        cover(RING, anchor=ANCHOR, farthest=0.0)
    with pytest.raises(InputError, match="objective: expected 'time' or 'viewpoints', got 'few'"):
        cover(RING, anchor=ANCHOR, objective="few")
    with pytest.raises(InputError, match="speed: expected more than 0"):
        cover(RING, anchor=ANCHOR, speed=0.0)
    with pytest.raises(InputError, match="tether_length"):
        cover(RING, anchor=ANCHOR, tether_length=-1.0)
