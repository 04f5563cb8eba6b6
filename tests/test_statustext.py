"""Words on a ground station."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from netsp.online.link.link_policy import LinkPolicy
from netsp.online.link.statustext import CHUNK_BYTES, status_texts, to_ascii

PLAIN = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=300)


@given(text=PLAIN, number=st.integers(0, 200_000))
@example(text="x" * CHUNK_BYTES, number=0)
@example(text="x" * 2 * CHUNK_BYTES, number=0xFFFF)
@example(text="", number=0)
def test_a_text_is_what_its_chunks_put_together_say(text, number):
    parts = status_texts(4, text, number)
    packed = [p.text for p in parts]
    assert "".join(packed) == text[: LinkPolicy.max_text_bytes]
    assert [p.chunk_seq for p in parts] == list(range(len(parts)))
    if len(parts) == 1:
        assert parts[0].id == 0
    else:  # all but the last are full, and the last is not
        assert {p.id for p in parts} == {1 + number % 0xFFFF}
        assert all(len(p) == CHUNK_BYTES for p in packed[:-1])
        assert len(packed[-1]) < CHUNK_BYTES


def test_two_long_texts_in_a_row_are_not_taken_for_one():
    first, second = (status_texts(4, "x" * 60, n)[0].id for n in (7, 8))
    assert first != second


@pytest.mark.parametrize(
    ("text", "plain"),
    [("keep −x +y of red 3", b"keep -x +y of red 3"), ("Jetée Nº 2", b"Jetee No 2"),
     ("Øst", b"?st")],
)  # fmt: skip
def test_letters_lose_their_accents_and_signs_stay_signs(text, plain):
    assert to_ascii(text) == plain
