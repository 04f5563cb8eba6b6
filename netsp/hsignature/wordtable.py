"""Numbered words of a group, for kernels.

A table is a tree of normal forms. Word 0 is the empty word; the parent of any other word is the
word without its last letter, which is a normal form, too. Products of words and letters are cached.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Ints
from netsp.base.compiled.dynamic_array import more_int_rows, write_ints
from netsp.base.compiled.kernel import kernel
from netsp.hsignature.words import Word

ABOVE, LETTER, FIRST, LENGTH = range(4)
"""Columns of a word: its parent, its last letter, its first product, and its length."""

BY, GIVES, NEXT = range(3)
"""Columns of a product: the letter, the resulting word, and the next product of the same word."""


class Rules(NamedTuple):
    """Rewriting rules as flat arrays.

    Attributes
    ----------
    left, right
        Letters of all left and right sides.
    left_at, right_at
        Start of each side (r + 1,), and the end of the last one.
    """

    left: Ints
    left_at: Ints
    right: Ints
    right_at: Ints


class Table(NamedTuple):
    """Known words and products.

    Attributes
    ----------
    words
        (capacity, 4) columns ABOVE … LENGTH.
    products
        (capacity, 3) columns BY … NEXT.
    counts
        (2,) number of words and of products.
    """

    words: Ints
    products: Ints
    counts: Ints


def packed(rules: Sequence[tuple[Word, Word]]) -> Rules:
    """Return the rules of a `netsp.hsignature.groups.Group` as arrays for kernels."""

    def side(k: int) -> tuple[Ints, Ints]:
        flat = np.array([x for r in rules for x in r[k]], dtype=np.int64)
        return flat, np.cumsum([0, *(len(r[k]) for r in rules)], dtype=np.int64)

    return Rules(*side(0), *side(1))


def empty_table() -> Table:
    """Return a table that holds the empty word only."""
    words = np.zeros((256, 4), dtype=np.int64)
    words[0] = -1, 0, -1, 0
    return Table(words, np.zeros((256, 3), dtype=np.int64), np.array([1, 0]))


def word_of(table: Table, number: int) -> Word:
    """Return the letters of a word by its number."""
    out = []
    while number:
        out.append(int(table.words[number, LETTER]))
        number = int(table.words[number, ABOVE])
    return tuple(reversed(out))


def number_of(table: Table, rules: Rules, word: Iterable[int]) -> tuple[int, Table]:
    """Return the number of a word's normal form, and the table, which may be a larger copy."""
    number = 0
    for x in word:
        number, table = times_letter(table, rules, number, x)
    return number, table


@kernel
def _product(table: Table, number: int, letter: int) -> int:
    """Return the cached product of a word and a letter, or -1."""
    at = table.words[number, FIRST]
    while at >= 0:
        if table.products[at, BY] == letter:
            return int(table.products[at, GIVES])
        at = table.products[at, NEXT]
    return -1


@kernel
def _keep(table: Table, number: int, letter: int, gives: int) -> Table:
    words, products, counts = table.words, table.products, table.counts
    row = counts[1]
    if row == len(products):
        products = more_int_rows(products)
    products[row, BY], products[row, GIVES] = letter, gives
    products[row, NEXT] = words[number, FIRST]
    words[number, FIRST] = row
    counts[1] += 1
    return Table(words, products, counts)


@kernel
def _longer_by(table: Table, number: int, letter: int) -> tuple[int, Table]:
    """Append a letter that gives a normal form, and return the longer word and the table."""
    found = _product(table, number, letter)
    if found >= 0:
        return found, table
    words, products, counts = table.words, table.products, table.counts
    row = counts[0]
    if row == len(words):
        words = more_int_rows(words)
    words[row, ABOVE], words[row, LETTER], words[row, FIRST] = number, letter, -1
    words[row, LENGTH] = words[number, LENGTH] + 1
    counts[0] += 1
    return row, _keep(Table(words, products, counts), number, letter, row)


@kernel
def times_letter(table: Table, rules: Rules, number: int, letter: int) -> tuple[int, Table]:
    """Return the product of a word and a letter, and the table."""
    found = _product(table, number, letter)
    if found >= 0:
        return found, table
    if number > 0 and table.words[number, LETTER] == -letter:
        above = table.words[number, ABOVE]
        return above, _keep(table, number, letter, above)
    if len(rules.left_at) == 1:
        return _longer_by(table, number, letter)
    return _rewritten(table, rules, number, letter)


@kernel
def _rewritten(table: Table, rules: Rules, number: int, letter: int) -> tuple[int, Table]:
    """Return the product of a word and a letter by the rules, and the table.

    As in `netsp.hsignature.groups`, rules can only apply at the end of the letters so far.
    """
    n = table.words[number, LENGTH]
    kept = np.empty(n + 64, dtype=np.int64)
    at = number
    for k in range(n - 1, -1, -1):
        kept[k] = table.words[at, LETTER]
        at = table.words[at, ABOVE]
    todo = np.empty(64, dtype=np.int64)
    todo[0], left = letter, 1
    while left > 0:
        left -= 1
        x = todo[left]
        if n > 0 and kept[n - 1] == -x:
            n -= 1
            continue
        if n == len(kept):
            more = np.empty(2 * len(kept), dtype=np.int64)
            write_ints(more, kept, n)
            kept = more
        kept[n] = x
        n += 1
        for r in range(len(rules.left_at) - 1):
            begin, size = rules.left_at[r], rules.left_at[r + 1] - rules.left_at[r]
            if size > n:
                continue
            same = True
            for k in range(size):
                if rules.left[begin + size - 1 - k] != kept[n - 1 - k]:
                    same = False
                    break
            if same:
                n -= size
                begin, size = rules.right_at[r], rules.right_at[r + 1] - rules.right_at[r]
                if left + size > len(todo):
                    more = np.empty(2 * (left + size), dtype=np.int64)
                    write_ints(more, todo, left)
                    todo = more
                for k in range(size):
                    todo[left + k] = rules.right[begin + size - 1 - k]
                left += size
                break
    found = 0
    for k in range(n):
        found, table = _longer_by(table, found, kept[k])
    if _product(table, number, letter) < 0:
        table = _keep(table, number, letter, found)
    return found, table


@kernel
def times(table: Table, rules: Rules, a: int, b: int) -> tuple[int, Table]:
    """Return the product of two words, and the table."""
    n = table.words[b, LENGTH]
    if n == 1:
        return times_letter(table, rules, a, table.words[b, LETTER])
    letters = np.empty(n, dtype=np.int64)
    at = b
    for k in range(n - 1, -1, -1):
        letters[k] = table.words[at, LETTER]
        at = table.words[at, ABOVE]
    for k in range(n):
        a, table = times_letter(table, rules, a, letters[k])
    return a, table


@kernel
def times_inverse(table: Table, rules: Rules, a: int, b: int) -> tuple[int, Table]:
    """Return the product of a word and the inverse of another, and the table."""
    while b > 0:
        a, table = times_letter(table, rules, a, -table.words[b, LETTER])
        b = table.words[b, ABOVE]
    return a, table
