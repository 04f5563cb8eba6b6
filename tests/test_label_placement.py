"""Names in pictures: none covers a goal or another name."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from netsp import Problem
from netsp.view.pictures.label_placement import place_labels
from netsp.view.pictures.picture_layout import LabelLayout
from netsp.view.pictures.problem_picture import draw_map


@given(seed=st.integers(0, 10**6), n=st.integers(1, 30), span=st.floats(1.0, 400.0))
def test_no_label_covers_a_marker_or_another_label(seed, n, span):
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, span, (n, 2))
    texts = ["x" * int(k) for k in rng.integers(0, 9, n)]
    taken = rng.uniform(0.0, span, (1, 2))
    found = place_labels(places, texts, marker_radius=5.0, taken=taken)
    assert all(label is None for label, text in zip(found, texts, strict=True) if not text)
    boxes = [(place, np.array([5.0, 5.0])) for place in (*places, *taken)]
    labels = []
    for place, text, label in zip(places, texts, found, strict=True):
        if label is not None:
            half = 3.0 * np.array([LabelLayout.letter_width * len(text), LabelLayout.line_height])
            shift = {"left": half[0], "center": 0.0, "right": -half[0]}[label.align]
            labels.append((place + label.offset + (shift, 0.0), half))
    pairs = [*itertools.product(labels, boxes), *itertools.combinations(labels, 2)]
    for (middle, half), (other, its_half) in pairs:
        assert (abs(middle - other) >= half + its_half - 1e-9).any()


def test_a_shared_height_stands_in_the_title_where_labels_have_no_room():
    def drawn(places):
        goals = [{"name": f"Pier {k}", "position": place} for k, place in enumerate(places)]
        data = {"base": (0, 0), "goals": goals, "obstacles": [], "tether_length": 90.0}
        ax = draw_map(Problem.model_validate(data))
        return {text.get_text() for text in ax.texts} - {""}, ax.get_title(loc="left")

    wide, title = drawn([(9, 0, -3.0), (0, 9, -3.0)])
    assert wide == {"Pier 0 z -3", "Pier 1 z -3"}
    assert "goals at" not in title
    narrow, title = drawn([(40, 0, -3.0), *((k % 6, 1 + k // 6, -3.0) for k in range(30))])
    assert narrow <= {f"Pier {k}" for k in range(31)}
    assert len(narrow) > 3
    assert title.endswith("; goals at z -3")
