"""Words of paths among any solids: they tell classes of loops apart, and nothing else."""

import functools
import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from netsp.base.errors import InputError
from netsp.hsignature.rays import signature
from netsp.hsignature.words import reduce
from netsp.plan.space.space_signature import SpaceSignature
from netsp.world import Scene

LOW, HIGH, ANCHOR = [-5.0] * 3, [5.0] * 3, [4.0, 0.3, 3.0]


def torus(centre, axis, radius=2.0, tube=0.05):
    return {"torus": {"center": centre, "axis": axis, "major_radius": radius,
                      "minor_radius": tube}}  # fmt: skip


def capsule(a, b, radius=0.15):
    return {"capsule": {"a": list(a), "b": list(b), "radius": radius}}


def field_of(*solids):
    return Scene(solids=list(solids)).field()


def words_of(field, cell=0.25):
    return SpaceSignature.in_box(field, LOW, HIGH, cell, ANCHOR)


def knot():
    t = np.linspace(0.0, 2.0 * np.pi, 61)
    p = np.c_[np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)]
    return [capsule(a, b) for a, b in itertools.pairwise(p.tolist())]


def frame():
    corners = list(itertools.product((-2.0, 2.0), repeat=3))
    return [
        capsule(a, b)
        for a, b in itertools.combinations(corners, 2)
        if sum(x != y for x, y in zip(a, b, strict=True)) == 1
    ]


RINGS = field_of(torus([0, 0, -2], [0, 0, 1]), torus([0, 0, 2], [0, 0, 1]))
LINKED = field_of(torus([0, 0, 0], [0, 0, 1]), torus([2, 0, 0], [0, 1, 0]))
POSTS = np.array([[-2.0, -1.0], [0.5, 1.5], [2.0, -2.0]])
PRISMS = field_of(
    *({"prism": {"polygon": [[x, y - 0.2], [x + 0.1, y], [x, y + 0.1], [x - 0.2, y]], "grow": 0.2}}
      for x, y in POSTS)
)  # fmt: skip
SCENES = {"rings": RINGS, "linked": LINKED, "prisms": PRISMS}


@functools.cache
def words_in(name):
    """Return the words of paths in one of SCENES, built when a test first asks for them."""
    return words_of(SCENES[name])


@pytest.mark.parametrize(
    ("solids", "rank", "free"),
    [
        pytest.param([torus([0, 0, 0], [0, 0, 1])], 1, True, id="ring"),
        pytest.param([torus([0, 0, 0], [0, 0, 1], tube=0.02)], 1, True, id="wire ring"),
        pytest.param(frame(), 5, True, id="frame of a cube"),
        pytest.param([capsule([-20, 0, 0], [20, 0, 0]),
                      {"half_space": {"point": [0, 0, -3], "normal": [0, 0, 1]}}], 1, True,
                     id="pipe above the floor"),
        pytest.param([torus([-1.5, 0, 0], [0, 0, 1], 1.2), torus([0, 0, 0], [0, 1, 0], 1.2),
                      torus([1.5, 0, 0], [0, 0, 1], 1.2)], 3, False, id="chain of three"),
        pytest.param([{"box": {"center": [0, 0, 0], "size": [2, 2, 2]}}], 0, True, id="boulder"),
    ],
)  # fmt: skip
def test_the_group_is_that_of_the_solids(solids, rank, free):
    group = words_of(field_of(*solids)).group
    assert (group.rank, group.free, group.exact) == (rank, free, True)


def test_a_knot_has_one_winding_number_and_says_that_its_words_are_not_exact():
    group = words_of(field_of(*knot()), 0.2).group
    assert len(group.functionals) == 1
    assert not group.exact


def loops(count, seed, field, corners=(3, 8)):
    """Random closed polylines that keep off the solids."""
    rng = np.random.default_rng(seed)
    clear = field.grown(0.05)
    while count:
        points = rng.uniform(-4.7, 4.7, (rng.integers(*corners), 3))
        closed = np.vstack([points, points[:1]])
        if (clear.distance(points) > 0).all() and all(
            clear.line_of_sight(a, b) for a, b in itertools.pairwise(closed)
        ):
            count -= 1
            yield points


def through_disc(points, z, radius=2.0):
    """How often a loop passes through a ring's disc, up minus down: the linking number."""
    total = 0
    for a, b in itertools.pairwise(np.vstack([points, points[:1]])):
        if (a[2] < z) != (b[2] < z):
            at = a + (z - a[2]) / (b[2] - a[2]) * (b - a)
            total += (1 if b[2] > a[2] else -1) * (np.hypot(*at[:2]) < radius)
    return total


def test_windings_around_rings_are_linking_numbers():
    found = {}
    for points in loops(300, 1, RINGS):
        linked = tuple(through_disc(points, z) for z in (-2.0, 2.0))
        found.setdefault(linked, set()).add(
            words_in("rings").windings(words_in("rings").word(points, closed=True))
        )
    assert len(found) > 6
    assert all(len(w) == 1 for w in found.values())
    assert len({next(iter(w)) for w in found.values()}) == len(found)
    assert found[0, 0] == {(0, 0)}


def test_among_prisms_words_tell_the_same_loops_apart_as_rays():
    pairs = []
    for points in loops(300, 2, PRISMS):
        moored = np.vstack([ANCHOR, points, points[:1], ANCHOR])
        if all(PRISMS.grown(0.05).line_of_sight(a, b) for a, b in itertools.pairwise(moored)):
            pairs.append((words_in("prisms").word(moored), signature(moored, POSTS)))
    assert len(pairs) > 60
    for (a, x), (b, y) in itertools.pairwise(sorted(pairs, key=lambda p: p[1])):
        assert (a == b) == (x == y)
        # and so of loops one after the other
        assert (words_in("prisms").product(a, b) == ()) == (reduce(x + y) == ())
    assert all((a == ()) == (x == ()) for a, x in pairs)


def test_words_do_not_depend_on_the_size_of_cells():
    finer = words_of(LINKED, 0.2)
    seen = {}
    for points in loops(150, 3, LINKED):
        a, b = words_in("linked").word(points, closed=True), finer.word(points, closed=True)
        assert (a == ()) == (b == ())
        assert seen.setdefault(words_in("linked").windings(a), finer.windings(b)) == finer.windings(
            b
        )


def test_a_commutator_of_two_rings_winds_around_nothing_and_is_not_contractible():
    def around(z, sign):
        return [[4, 0.3, z + sign], [0.5, 0.3, z + sign], [0.5, 0.3, z - sign], [4, 0.3, z - sign]]

    a, b = np.array(around(2, 1)), np.array(around(-2, 1))
    path = np.vstack([ANCHOR, a, ANCHOR, b, ANCHOR, a[::-1], ANCHOR, b[::-1], ANCHOR])
    word = words_in("rings").word(path)
    assert word != ()
    assert words_in("rings").windings(word) == (0, 0)
    # rings that are linked let it go
    c = np.array([[4.5, 2, 1], [1.5, 2, 1], [1, 0, 1], [1, 0, -1], [4.5, 2, -1]])
    d = np.array([[3, -1, 0], [3, 1, 0], [4.8, 1, 0], [4.8, -1, 0], [3, -1, 0]])
    for loop in (c, d):
        assert words_in("linked").windings(words_in("linked").word(loop, closed=True)) != (0, 0)
    home = np.array([4.5, 2, 1])
    both = np.vstack([c, home, d, home, c[::-1], home, d[::-1], home])
    assert words_in("linked").word(both) == ()


@given(st.integers(0, 10_000), st.integers(1, 6))
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
def test_what_can_be_deformed_keeps_its_word(seed, cuts):
    rng = np.random.default_rng(seed)
    name = ("rings", "linked", "prisms")[seed % 3]
    field, words = SCENES[name], words_in(name)
    points = next(loops(1, seed, field))
    closed = np.vstack([points, points[:1]])
    finer = [closed[0]]
    for a, b in itertools.pairwise(closed):
        for share in np.sort(rng.random(cuts)):
            p = a + share * (b - a)
            # a spike out and back, within the ball that is free around it
            room = min(0.9 * float(field.distance(p)), 4.99 - np.abs(p).max())
            away = rng.normal(size=3)
            finer += [p, p + room * away / np.linalg.norm(away), p]
        finer.append(b)
    assert words.word(closed) == words.word(np.array(finer))
    assert words.word(closed[::-1]) == words.inverse(words.word(closed))
    k = len(finer) // 2
    parts = words.word(finer[: k + 1]), words.word(finer[k:])
    assert words.product(*parts) == words.word(closed)


def test_a_path_through_a_solid_has_no_word_and_is_told_where():
    with pytest.raises(InputError, match=r"path: no word at \(-?2\.\d+, "):
        words_in("prisms").word([[-4, -1, 0], [4, -1, 0]])


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match="anchor: no free cell"):
        SpaceSignature.in_box(PRISMS, LOW, HIGH, 0.25, [-2, -1, 0])
    with pytest.raises(InputError, match=r"cell: 0\.01 makes .* GiB; expected"):
        SpaceSignature.in_box(PRISMS, LOW, HIGH, 0.01, ANCHOR)
    with pytest.raises(InputError, match="bounds: expected a box"):
        SpaceSignature.in_box(PRISMS, HIGH, LOW, 0.25, ANCHOR)
