"""Measures of entanglement against worlds where the answer is seen at a glance."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netsp import Circle, Problem
from netsp.command.main import main
from netsp.hsignature import concatenate, crossings, cyclically_reduced, entangled, invert, reduce
from netsp.hsignature.signature_measures import (
    _cross_rays,
    measure,
    self_crossings,
    winding_numbers,
)
from netsp.plan.space.mission_measures import measure_path
from netsp.world import Scene

PILE = Circle(center=(0, 0), radius=1)
FAR = Circle(center=(10, 0), radius=1)
WORLD = Problem(base=(-4, 0), goals=[(4, 0)], obstacles=[PILE, FAR], tether_length=40)


def to_milli(v):
    return round(v, 3)


letters = st.integers(1, 3).flatmap(lambda k: st.sampled_from([k, -k]))
words = st.lists(letters, max_size=12).map(reduce)


@given(words, words)
def test_entangled_obstacles_do_not_depend_on_how_the_loop_is_approached(word, way):
    moved = concatenate(way, word, invert(way))
    assert entangled(moved) == entangled(word)
    assert sorted(cyclically_reduced(moved)) == sorted(cyclically_reduced(word))


@given(words)
def test_nothing_is_entangled_exactly_when_the_word_is_empty(word):
    assert (entangled(word) == ()) == (word == ())


@given(words)
def test_without_the_entangled_obstacles_the_word_cancels(word):
    held = entangled(word)
    assert reduce(x for x in word if abs(x) not in held) == ()


@pytest.mark.parametrize(
    ("word", "held"),
    [((1, 2, -1), (2,)), ((1, 2, -1, -2), (1, 2)), ((1, 1), (1,)), ((3, 1, 2, -1, -3), (2,))],
)
def test_entangled_obstacles_of_some_words(word, held):
    assert entangled(word) == held


def loop(turns, radius=2.0, n=40):
    angle = np.linspace(0, 2 * np.pi * turns, abs(turns) * n + 1) + np.pi
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.mark.parametrize("turns", [-3, -1, 1, 2])
def test_windings_of_a_circle(turns):
    path = loop(turns)
    assert winding_numbers(path, np.array([[0.0, 0.0], [10.0, 0.0]])) == pytest.approx([turns, 0])
    m = measure(WORLD, path)
    assert m.closed
    assert m.winding == (turns, 0)
    assert m.entangled == (0,)
    assert len(m.signature) == abs(turns)


def test_a_commutator_winds_nowhere_and_entangles_both():
    left, right = loop(1, 2.0), loop(1, 2.0)
    right = np.array([10.0, 0.0]) - right[:, :] * 1.0
    base = np.array([[5.0, -4.0]])

    def around(ring, sense):
        return np.vstack([base, ring[::sense], base])

    path = np.vstack([around(left, 1), around(right, 1), around(left, -1), around(right, -1)])
    m = measure(WORLD, path)
    assert m.winding == (0, 0)
    assert m.entangled == (0, 1)


@pytest.mark.parametrize(
    ("path", "count"),
    [
        ([(0, 0), (4, 0), (4, 4), (2, -2)], 1),
        ([(0, 0), (4, 0), (0, 0)], 0),  # retraced
        ([(0, 0), (2, 0), (4, 0), (4, 2), (2, 2), (2, 0), (2, -2)], 1),  # through a vertex
        ([(0, 0), (2, 0), (4, 0), (4, 2), (2, 2), (2, 0), (3, 2)], 0),  # touches, turns back
        ([(0, 0), (1, 0)], 0),
        ([(0, 0), (4, 4), (4, 0), (0, 4), (-1, 1), (5, 2)], 4),
    ],
)
def test_self_crossings(path, count):
    assert self_crossings(np.array(path, dtype=float)) == count
    assert self_crossings(np.array(path, dtype=float)[::-1]) == count


@pytest.mark.parametrize(
    ("path", "hull", "linear", "sight"),
    [
        # past the pile without bending round it
        ([(-4, 2), (4, 2)], (), (), ()),
        # half round it: the hull holds it, so does the sweep to the anchor; the ends do not see
        # each other past it
        ([(-4, 0), (-1, 1.2), (1, 1.2), (4, 0)], (0,), (0,), ()),
        # a slack bight around it: both legs see each other on the near side
        ([(-4, 0.5), (2, 2), (2, -2), (-4, -0.5)], (0,), (0,), (0,)),
        # touching is not entangled
        ([(-4, 1), (4, 1)], (), (), ()),
    ],
)
def test_the_definitions_of_2024_on_plain_tethers(path, hull, linear, sight):
    m = measure(WORLD, path)
    assert (m.convex_hull, m.linear_homotopy, m.local_visibility) == (hull, linear, sight)
    assert m.entangled is None


def test_the_linear_homotopy_depends_on_the_end_that_is_the_anchor():
    z = np.array([(-2.0, 6.0), (10.0, 6.0), (-2.0, -6.0), (10.0, -6.0)])
    assert measure(WORLD, z).convex_hull == (0, 1)
    assert measure(WORLD, z).linear_homotopy == (0,)
    assert measure(WORLD, z[::-1]).linear_homotopy == (1,)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-6, 14).map(to_milli), st.floats(-6, 6).map(to_milli)),
        min_size=2,
        max_size=7,
        unique=True,
    )
)
def test_a_free_convex_hull_implies_the_other_definitions(path):
    m = measure(WORLD, path)
    assert set(m.linear_homotopy) <= set(m.convex_hull)
    if not m.convex_hull:
        assert m.local_visibility == ()


@given(st.lists(st.tuples(*[st.integers(-3, 9)] * 4), min_size=1, max_size=30))
def test_segments_are_known_to_have_letters_exactly_when_they_have(ends):
    p, q = np.split(np.array(ends, dtype=float), 2, axis=1)
    rays = np.array([[0.0, 0.0], [3.0, 1.0], [6.0, -2.0]])
    expected = [bool(crossings(np.array(pair), rays)) for pair in zip(p, q, strict=True)]
    assert _cross_rays(p, q, rays).tolist() == expected


def test_the_command_prints_measures_of_any_path(tmp_path, capsys):
    problem = tmp_path / "p.json"
    problem.write_text(WORLD.to_json())
    for name, text in (
        ("a.csv", "x,y,z\n-4,0,0\n-1,3,0\n3,0,0\n-1,-3,0\n-4,0,0\n"),
        ("a.json", "[[-4,0],[-1,3],[3,0],[-1,-3],[-4,0]]"),
    ):
        (tmp_path / name).write_text(text)
        assert main(["verify", str(problem), str(tmp_path / name), "--measures"]) == 0
        out = capsys.readouterr().out
        assert "entangled obstacles  1: #0" in out
        assert "winding numbers      #0 -1" in out
    (tmp_path / "bad.csv").write_text("x,y\n1,2\n3\n")
    assert main(["verify", str(problem), str(tmp_path / "bad.csv"), "--measures"]) == 2
    assert "point 1" in capsys.readouterr().err


def test_a_tour_out_and_home_past_the_same_side_does_not_cross_itself():
    from netsp import solve

    p = Problem(
        base=(0, 0),
        goals=[(9, 0), (9, 0.7), (9, -0.4)],
        obstacles=[Circle(center=(4, 0), radius=2)],
        tether_length=14,
    )
    assert measure(p, solve(p, "greedy-2016").path).self_crossings <= 4


def test_a_byte_order_mark_does_not_cost_a_point(tmp_path):
    from netsp.base.polyline_file import read_path

    (tmp_path / "a.csv").write_text("\ufeff0,0\n1,1\n", encoding="utf-8")
    assert len(read_path(tmp_path / "a.csv")) == 2


def test_a_loop_in_a_scene_winds_about_rings_as_often_as_it_goes_through_them(tmp_path, capsys):
    rings = [
        {"torus": {"center": [x, 0, 0], "axis": [0, 0, 1], "major_radius": 1, "minor_radius": 0.1}}
        for x in (-2.0, 2.0)
    ]
    scene, path = tmp_path / "scene.json", tmp_path / "path.json"
    scene.write_text(json.dumps({"schema_version": 1, "solids": rings}))
    once = [[-2, 0, 1.5], [-2, 0, -1.5], [0, 0, -1.5], [0, 0, 1.5]]
    for turns in (0, 1, 2):
        loop = [*(once * turns), [0, 1, 1.5], [0, 2, 1.5], [-2, 0, 1.5]]
        loop = [loop[-1], *loop]
        found = measure_path(Scene.load(scene), loop)
        assert found.closed
        assert sorted(map(abs, found.windings)) == [0, turns]
        assert (found.signature == ()) is (turns == 0)
        path.write_text(json.dumps(loop))
        assert main(["verify", str(scene), str(path), "--measures"]) == 0
        said = capsys.readouterr().out
        assert ("windings  all zero" in said) is (turns == 0)
    path.write_text(json.dumps([[-4, 0, 0], [4, 0, 0]]))
    assert main(["verify", str(scene), str(path), "--measures"]) == 2
    assert "path: no word at" in capsys.readouterr().err
