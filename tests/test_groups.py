"""Groups given by generators and relations: one word for each element, where that can be had."""

import functools

from hypothesis import example, given, settings
from hypothesis import strategies as st

from netsp.hsignature.groups import Group, eliminated
from netsp.hsignature.words import invert
from netsp.hsignature.wordtable import empty_table, number_of, packed, times, times_inverse, word_of

COMMUTING = (1, 2, -1, -2)
TREFOIL = (1, 2, 1, -2, -1, -2)
PLANE = Group.presented(2, [COMMUTING])
CHAIN = Group.presented(3, [COMMUTING, (2, 3, -2, -3)])


@functools.cache
def trefoil():
    """Return the group of a knot, whose completion does not end and takes a while."""
    return Group.presented(2, [TREFOIL])


two = st.lists(st.sampled_from([1, -1, 2, -2]), max_size=12).map(tuple)
three = st.lists(st.sampled_from([1, -1, 2, -2, 3, -3]), max_size=10).map(tuple)


def exponents(word, rank):
    return [word.count(g) - word.count(-g) for g in range(1, rank + 1)]


def test_linked_rings_and_chains_are_completed():
    assert PLANE.exact
    assert CHAIN.exact
    assert Group.presented(4, []).exact


@given(two, two)
def test_two_words_of_commuting_letters_are_equal_exactly_when_their_exponents_are(a, b):
    assert (PLANE.normal(a) == PLANE.normal(b)) == (exponents(a, 2) == exponents(b, 2))


@given(three, three)
def test_in_a_chain_the_middle_ring_commutes_and_the_others_are_free(a, b):
    def apart(word):
        free = Group.presented(2, []).normal(1 if x == 1 else -1 if x == -1 else 2 if x == 3 else -2
                                      for x in word if abs(x) != 2)  # fmt: skip
        return free, exponents(word, 3)[1]

    assert (CHAIN.normal(a) == CHAIN.normal(b)) == (apart(a) == apart(b))


@given(three, three)
def test_a_normal_form_is_its_own_and_that_of_its_parts(a, b):
    assert CHAIN.normal(CHAIN.normal(a) + CHAIN.normal(b)) == CHAIN.normal(a + b)
    assert CHAIN.normal(a + invert(a)) == ()


def permuted(word):
    """The trefoil's group maps onto the symmetric group of three by a -> (0 1), b -> (1 2)."""
    swaps = {1: (1, 0, 2), 2: (0, 2, 1)}
    at = (0, 1, 2)
    for x in word:
        at = tuple(swaps[abs(x)][k] for k in at)
    return at


@given(two, two)
@example((2, 1, 1, 1, -2), (2, 1, 1, 1, -2))
def test_where_a_completion_does_not_end_forms_of_parts_stand_for_the_same_element(a, b):
    knot = trefoil()
    # there may be several of one element, of which only images can be compared
    parts, whole = knot.normal(knot.normal(a) + knot.normal(b)), knot.normal(a + b)
    assert permuted(parts) == permuted(whole) == permuted(a + b)
    assert knot.windings(parts) == knot.windings(whole) == knot.windings(a + b)
    assert knot.normal(a + invert(a)) == ()


@given(two)
def test_even_where_a_completion_does_not_end_an_empty_word_is_contractible(a):
    knot = trefoil()
    if knot.normal(a) == ():
        assert permuted(a) == (0, 1, 2)
        assert sum(exponents(a, 2)) == 0
    assert knot.windings(a) == (sum(exponents(a, 2)),)


def test_conjugates_of_relators_are_empty():
    for group, relator in ((PLANE, COMMUTING), (trefoil(), TREFOIL)):
        for by in ((), (1,), (-2, 1), (2, 2, -1)):
            assert group.normal(by + relator + invert(by)) == ()


@given(st.lists(three, max_size=4))
@settings(max_examples=30, deadline=None)
def test_elimination_leaves_the_group_what_it_is(relators):
    meaning, rank, left = eliminated(3, relators)

    def translated(word):
        return tuple(y for x in word
                     for y in (meaning[x - 1] if x > 0 else invert(meaning[-x - 1])))  # fmt: skip

    group = Group.presented(rank, left)
    assert all(group.normal(translated(r)) == () for r in relators if group.exact)
    assert len(group.functionals) == len(Group(3, tuple(relators)).functionals)


@given(three, three)
@settings(deadline=None)
def test_words_as_numbers_are_the_same_words(a, b):
    for group in (CHAIN, Group.presented(3, [])):
        rules, table = packed(group.rules), empty_table()
        m, table = number_of(table, rules, a)
        n, table = number_of(table, rules, b)
        product, table = times(table, rules, m, n)
        ratio, table = times_inverse(table, rules, m, n)
        assert word_of(table, product) == group.normal(a + b)
        assert word_of(table, ratio) == group.normal(a + invert(b))
        assert (product == m) == (group.normal(b) == ())
