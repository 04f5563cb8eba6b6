"""Bad input gives one clear line that names the field, the value and what was expected."""

import json
import math

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from netsp import Circle, InputError, Polygon, Problem, Solution
from netsp.base.geometry.polygons import (
    counterclockwise,
    polygon_interior_point,
    polygon_signed_distance,
)

GOOD = {
    "schema_version": 1,
    "name": "small",
    "base": [0, 0],
    "goals": [[4, 0], [0, 4, -2], {"name": "p3", "position": [4, 4]}],
    "obstacles": [
        {"center": [2, 0], "radius": 1, "name": "pile"},
        {"polygon": [[1, 2], [3, 2], [3, 3], [1, 3]]},
    ],
    "tether_length": 9,
}


def variant(**changes):
    return {**GOOD, **changes}


def load(data):
    return Problem.from_json(json.dumps(data), source="f.json")


BAD = {
    "not an object": ([1, 2], "expected a JSON object, got list"),
    "old version": (variant(schema_version=2), "schema_version: expected 1, got 2"),
    "version true": (variant(schema_version=True), "schema_version: expected 1, got True"),
    "unknown field": (variant(tether=3), "tether: unknown field"),
    "unknown goal field": (
        variant(goals=[{"position": [1, 1], "depth": 3}]),
        "goals[0].depth: unknown field",
    ),
    "unknown obstacle field": (
        variant(obstacles=[{"center": [2, 0], "radius": 1, "r": 2}]),
        "obstacles[0].r: unknown field",
    ),
    "no base": ({k: v for k, v in GOOD.items() if k != "base"}, "base: missing"),
    "no radius": (variant(obstacles=[{"center": [2, 0]}]), "obstacles[0].radius: missing"),
    "obstacle of no kind": (variant(obstacles=[7]), "obstacles[0]: expected {"),
    "nan": (variant(base=[0, math.nan]), "base: expected a finite number, got nan"),
    "beyond every number": (variant(base=[0, 10**400]), "base: expected a finite number, got 1000"),
    "beyond reason": (variant(base=[0, 1e300]), "base: expected a magnitude of at most 1e+12"),
    "name of two lines": (variant(name="a\nb"), "name: expected a name of at most 200 printable"),
    "infinite": (variant(tether_length=math.inf), "tether_length: expected a finite number"),
    "text for a number": (variant(tether_length="9"), "tether_length: expected a number, got '9'"),
    "bool for a number": (variant(tether_length=True), "tether_length: expected a number, got True"),  # noqa: E501
    "negative radius": (
        variant(obstacles=[{"center": [2, 0], "radius": -1}]),
        "obstacles[0].radius: expected a number > 0, got -1",
    ),
    "zero tether": (variant(tether_length=0), "tether_length: expected a number > 0, got 0"),
    "negative clearance": (variant(clearance=-1), "clearance: expected a number >= 0, got -1"),
    "no goals": (variant(goals=[]), "goals: expected at least 1, got 0"),
    "short point": (variant(base=[0]), "base: expected [x, y] or [x, y, z], got [0]"),
    "text point": (variant(base="00"), "base: expected [x, y] or [x, y, z], got '00'"),
    "same goals": (
        variant(goals=[[4, 0], [4, 0, 0]]),
        "goals[1]: same position (4, 0, 0) as goals[0]; expected distinct goals",
    ),
    "base in a circle": (variant(base=[2, 0.5]), "base: (2, 0.5, 0) lies inside obstacles[0] (pile)"),  # noqa: E501
    "goal in a polygon": (variant(goals=[[2, 2.5]]), "goals[0]: (2, 2.5, 0) lies inside obstacles[1]"),  # noqa: E501
    "goal in the clearance": (
        variant(clearance=1.5),
        "base: (0, 0, 0) lies inside obstacles[0] (pile) grown by the clearance 1.5",
    ),
    "obstacle too wide for the goals": (
        variant(obstacles=[{"center": [1e6, 0], "radius": 999_999}], goals=[[-4, 0]]),
        "obstacles[0]: reaches 2e+06 from the base, and no goal is farther than 4",
    ),
    "radius that underflows": (
        variant(obstacles=[{"center": [2, 0], "radius": 1e-170}]),
        "obstacles[0].radius: expected at least 1e-100",
    ),
    "goal out of bounds": (variant(bounds=[-1, -1, 3, 5]), "goals[0]: (4, 0, 0) is outside bounds"),
    "empty bounds": (variant(bounds=[1, 0, 1, 5]), "bounds: expected xmin < xmax and ymin < ymax"),
    "short bounds": (variant(bounds=[1, 0]), "bounds: expected [xmin, ymin, xmax, ymax], got [1, 0]"),  # noqa: E501
    "polygon crossing itself": (
        variant(obstacles=[{"polygon": [[1, 2], [3, 3], [3, 2], [1, 3]]}]),
        "obstacles[0]: polygon",
    ),
    "flat polygon": (
        variant(obstacles=[{"polygon": [[1, 2], [2, 2], [3, 2]]}]),
        "obstacles[0]: polygon has zero area",
    ),
    "polygon of two points": (
        variant(obstacles=[{"polygon": [[1, 2], [2, 2]]}]),
        "obstacles[0].polygon: expected at least 3, got 2",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_named_in_one_line(case):
    data, expected = BAD[case]
    with pytest.raises(InputError) as caught:
        load(data)
    message = str(caught.value)
    assert message.startswith(f"f.json: {expected}"), message
    assert "\n" not in message
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{", "f: not JSON: Expecting property name"),
        ("", "f: not JSON: Expecting value at line 1, column 1; the text ends too early"),
        (
            '{"base": [0, 0], "goals',
            "f: not JSON: Unterminated string starting at line 1, column 18; the text ends",
        ),
        (
            '{"base": [0, 0]',
            "f: not JSON: Expecting ',' delimiter at line 1, column 16; the text ends",
        ),
        ('{"base": [0, 0], "base": [1, 1]}', "f: field 'base' is given twice"),
        ("[" * 100_000, "f: not JSON"),
        ('{"base": [' + "9" * 5000 + "]}", "f: not JSON that netsp reads: a number has too many"),
    ],
)
def test_broken_json_is_named_in_one_line(text, expected):
    with pytest.raises(InputError) as caught:
        Problem.from_json(text, source="f")
    assert str(caught.value).startswith(expected)
    assert "\n" not in str(caught.value)


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        Problem.load(tmp_path / "none.json")
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file"):
        Problem.load(tmp_path / "binary")
    with pytest.raises(InputError, match="directory"):
        Problem.load(tmp_path)


def test_a_problem_reads_back_equal():
    problem = load(GOOD)
    again = Problem.from_json(problem.to_json())
    assert again == problem
    assert again.sha256 == problem.sha256


def test_the_hash_ignores_names_and_nothing_else():
    problem = load(GOOD)
    renamed = load(variant(name="other", goals=[[4, 0], [0, 4, -2], [4, 4]], units="ft"))
    assert renamed.sha256 == problem.sha256
    for change in ({"tether_length": 9.5}, {"clearance": 0.1}, {"base": [0, 0.5]}):
        assert load(variant(**change)).sha256 != problem.sha256


def test_problems_are_frozen():
    with pytest.raises(ValidationError):
        load(GOOD).tether_length = 3.0


def test_numpy_values_are_welcome():
    problem = Problem(
        base=np.zeros(2),
        goals=np.array([[3.0, 4.0], [1.0, 1.0]]),
        obstacles=[Circle(center=np.array([8, 8]), radius=np.float32(1))],
        tether_length=np.int64(6),
    )
    assert problem.goals[0].position == (3.0, 4.0, 0.0)


def test_a_goal_on_the_boundary_is_in_free_space():
    Problem(
        base=(0, 0), goals=[(1, 0)], obstacles=[Circle(center=(2, 0), radius=1)], tether_length=2
    )


@pytest.mark.parametrize("data", [GOOD, variant(bounds=[-9, -9, 9, 9], clearance=0.5)])
def test_the_schema_accepts_what_netsp_writes(data):
    schema = Problem.model_json_schema()
    problem = load(data)
    jsonschema.validate(json.loads(problem.to_json()), schema)
    jsonschema.validate(data, schema)


@pytest.mark.parametrize("case", ["unknown field", "negative radius", "no goals", "short point"])
def test_the_schema_rejects_what_netsp_rejects(case):
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(BAD[case][0], Problem.model_json_schema())


def test_the_solution_schema_is_published():
    schema = Solution.model_json_schema()
    assert schema["title"] == "netsp solution"
    assert {"tour", "path", "status", "lower_bound"} <= set(schema["properties"])


ring = st.lists(st.tuples(st.floats(0.2, 5.0), st.floats(0.05, 0.95)), min_size=3, max_size=9)


@given(ring)
def test_the_representative_point_lies_inside_any_star_shaped_polygon(spec):
    n = len(spec)
    corners = [
        (r * math.cos(2 * math.pi * (k + t) / n), r * math.sin(2 * math.pi * (k + t) / n))
        for k, (r, t) in enumerate(spec)
    ]
    try:
        polygon = Polygon(polygon=corners)
    except InputError:
        return
    assert polygon.signed_distance(polygon.representative_point) < 0.0


def test_signed_distance_of_a_polygon_is_the_distance_to_its_outline():
    square = Polygon(polygon=[(0, 0), (2, 0), (2, 2), (0, 2)])
    points = [(1, 1), (0.5, 1), (3, 1), (3, 3), (1, -2), (0, 0)]
    expected = [-1, -0.5, 1, math.sqrt(2), 2, 0]
    assert square.signed_distance(points) == pytest.approx(expected)


@given(x=st.floats(0.5, 100.0), y=st.floats(-100.0, 100.0))
def test_a_copy_with_other_values_keeps_nothing_that_was_computed_of_the_old(x, y):
    old = Problem(base=(0, 0), goals=[(4, 0)], tether_length=300.0)
    moved = {"obstacles": (Circle(center=(x + 3.0, y), radius=0.5),)}
    assert old.scale == 4.0
    goals = (old.goals[0].model_copy(update={"position": (1.0, 0.0, 0.0)}),)
    copy = old.model_copy(update=moved | {"goals": goals})
    fresh = Problem(base=(0, 0), goals=[(1, 0)], tether_length=300.0, obstacles=moved["obstacles"])
    assert copy == fresh
    assert copy.scale == fresh.scale


def _star(rng, corners, flatness):
    """A simple polygon of random corners about the origin."""
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
    radius = 1.0 + 0.9 * rng.uniform(-1.0, 1.0, corners)
    return np.column_stack([radius * np.cos(angle), flatness * radius * np.sin(angle)])


@given(st.integers(0, 10_000), st.integers(3, 9), st.floats(0.1, 3.0))
@settings(max_examples=30, deadline=None)
def test_corners_in_the_middle_of_edges_change_no_polygon(seed, corners, flatness):
    rng = np.random.default_rng(seed)
    outline = counterclockwise(_star(rng, corners, flatness))
    pieces = rng.integers(1, 6, len(outline))
    dense = [
        a + (b - a) * k / n
        for a, b, n in zip(outline, np.roll(outline, -1, axis=0), pieces, strict=True)
        for k in range(n)
    ]
    kept = counterclockwise(np.roll(dense, int(rng.integers(len(dense))), axis=0))
    assert {tuple(p) for p in kept} == {tuple(p) for p in outline}


@given(st.integers(0, 10_000), st.integers(3, 150), st.floats(0.1, 3.0))
@settings(max_examples=20, deadline=None)
def test_the_interior_point_is_a_tenth_as_deep_as_any_middle_of_a_chord(seed, corners, flatness):
    """Chords too short to win are not measured; none of them may be the one."""
    outline = _star(np.random.default_rng(seed), corners, flatness)
    own = -polygon_signed_distance(outline, polygon_interior_point(outline))
    low, high = outline[:, 1].min(), outline[:, 1].max()
    for k in range(1, 16):
        height = float(low + (high - low) * k / 16)
        crossings = np.sort([
            a[0] + (height - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True)
            if (a[1] > height) != (b[1] > height)
        ])  # fmt: skip
        middles = np.column_stack([
            (crossings[::2] + crossings[1::2]) / 2, np.full(len(crossings) // 2, height)
        ])  # fmt: skip
        assert own >= 0.1 * np.max(-polygon_signed_distance(outline, middles)) - 1e-12
