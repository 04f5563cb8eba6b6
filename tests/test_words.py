"""Words are a free group."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from netsp.hsignature import concatenate, invert, is_looping, reduce

letters = st.integers(-4, 4).filter(lambda k: k != 0)
words = st.lists(letters, max_size=12).map(tuple)


@given(words)
def test_reducing_twice_changes_nothing(w):
    assert reduce(reduce(w)) == reduce(w)


@given(words)
def test_a_reduced_word_has_no_adjacent_inverses(w):
    r = reduce(w)
    assert all(a != -b for a, b in pairwise(r))


@given(words)
def test_a_word_and_its_inverse_cancel(w):
    assert concatenate(w, invert(w)) == ()
    assert concatenate(invert(w), w) == ()


@given(words, words, words)
def test_concatenation_is_associative(a, b, c):
    assert concatenate(concatenate(a, b), c) == concatenate(a, concatenate(b, c))


@given(words, words)
def test_the_inverse_of_a_product_is_the_product_of_inverses_backwards(a, b):
    assert invert(concatenate(a, b)) == concatenate(invert(b), invert(a))


@given(words, st.integers(0, 12), letters)
def test_inserting_a_cancelling_pair_changes_nothing(w, place, a):
    k = min(place, len(w))
    assert reduce((*w[:k], a, -a, *w[k:])) == reduce(w)


def test_a_signed_letter_twice_is_looping_and_its_inverse_is_another_letter():
    assert is_looping((1, 2, 1))
    assert not is_looping((1, -2, -1))
    assert not is_looping(())
