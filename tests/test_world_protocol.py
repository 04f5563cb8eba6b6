"""Both worlds answer alike about the same posts, in the plane and in space."""

import numpy as np
import pytest

from netsp import Circle, Problem
from netsp.base.errors import InputError
from netsp.plan.space.space_world import SpaceWorld
from netsp.roadmap.plane_world import PlaneWorld
from netsp.world.mission.mission import Mission
from netsp.world.scene.scene import Scene

POSTS = Problem(
    base=(0, 0),
    goals=[(8, 0)],
    tether_length=12,
    obstacles=[Circle(center=(4, 0), radius=1, name="A"), Circle(center=(4, 4), radius=0.5)],
)
BEFORE, AFTER = np.array([0.5, 0.0, 0.0]), np.array([7.5, 0.0, 0.0])


def in_plane():
    return PlaneWorld(POSTS)


def in_space():
    mission = Mission.model_validate(
        {
            "schema_version": 1,
            "scene": "-",
            "anchor": [0, 0, 0],
            "start": [0, 0, 0],
            "tether_length": 12,
            "waypoints": [[8, 0, 0]],
        }
    )
    return SpaceWorld(mission, Scene.from_problem(POSTS))


@pytest.fixture(params=[in_plane, in_space], scope="module")
def world(request):
    return request.param()


def test_a_tether_begins_straight_and_has_the_empty_word(world):
    assert world.present_tether.length == pytest.approx(0.0, abs=1e-9)
    assert world.start_word() == world.word_of(world.present_tether.nodes) == ()
    assert world.turning(np.array([BEFORE, AFTER])) == 0.0


def test_taut_tethers_of_a_class_are_as_long_as_their_paths(world):
    paths = world.paths_between(world.anchor, AFTER, 11.0)[:2]
    exact = PlaneWorld(POSTS).paths_between(world.anchor, AFTER, 11.0)[:2]
    for (word, length), (_, shortest) in zip(paths, exact, strict=True):
        assert length == pytest.approx(shortest, rel=0.02)
        tether = world.recover_tether(word, AFTER, ())
        assert tether.length == pytest.approx(shortest, rel=0.005)
        assert world.word_of(tether.nodes) == word


def test_obstacles_have_names_and_sides(world):
    assert (world.name_of(0), world.nearest((1, 0), AFTER)) == ("A", 0)
    assert (world.side_of(0, BEFORE), world.side_of(0, AFTER)) == ("−x", "+x")
    found = world.classes_on_side([()], AFTER, "north", "A")
    assert len(found) == 1
    (tether,) = found.values()
    assert world.passes_on_side(tether.nodes, "north", "A")
    assert not world.passes_on_side(tether.nodes, "south", "A")
    assert "+y of A (rests on it)" in world.describe_path(tether.nodes, next(iter(found)))
    with pytest.raises(InputError, match="obstacle"):
        world.passes_on_side(tether.nodes, "north", "nowhere")


def test_letters_tell_steps_apart_and_free_places_from_others(world):
    over = np.array([[2.0, 2.0, 0.0], [6.0, 2.0, 0.0]])
    under = over * [1.0, -1.0, 1.0]
    (there,) = world.letters.words_of_steps(over[:1], over[1:])
    (back,) = world.letters.words_of_steps(under[1:], under[:1])
    begins, ends = np.stack([over[1], under[0]]), np.stack([under[1], over[0]])
    down, up = world.letters.words_of_steps(begins, ends)
    loop = there
    for word in (down, back, up):
        loop = world.letters.join(loop, word)
    assert len(loop) == 1
    assert world.letters.join(loop, world.letters.inverse(loop)) == ()
    depth = world.letters.depth(np.array([[4.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    assert depth == pytest.approx([1.0, 0.0])
    assert world.letters.is_near(AFTER[None], 3.0)
    with pytest.raises(InputError):
        world.check_word((9,))
