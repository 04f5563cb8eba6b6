"""Words in the free group whose generators are the obstacles.

A word is a tuple of non-zero integers: ``+i`` for crossing the ray of obstacle *i* (numbered from
1) from left to right, ``-i`` from right to left. A *reduced* word has no adjacent inverses; every
word reduces to exactly one, whatever the order of cancellations (free group). Reduced words of the
paths between two points are the homotopy classes of those paths: Bhattacharya et al. 2012;
McCammon & Hollinger 2017, section II-A.
"""

from __future__ import annotations

from collections.abc import Iterable

Word = tuple[int, ...]

EMPTY: Word = ()


def reduce(letters: Iterable[int]) -> Word:
    """Cancel adjacent inverses until none is left.

    >>> reduce([2, -2, 2, 1, 3])
    (2, 1, 3)
    """
    word: list[int] = []
    for letter in letters:
        if word and word[-1] == -letter:
            word.pop()
        else:
            word.append(letter)
    return tuple(word)


def concatenate(*words: Iterable[int]) -> Word:
    """The reduced word of one path followed by the next.

    >>> concatenate((1, 2), (-2, 3))
    (1, 3)
    """
    return reduce(letter for word in words for letter in word)


def invert(word: Iterable[int]) -> Word:
    """The word of the path walked backwards.

    >>> invert((1, -2))
    (2, -1)
    """
    return tuple(-letter for letter in reversed(tuple(word)))


def is_looping(word: Word) -> bool:
    """Whether a signed letter occurs twice in a reduced word: the tether passes the same gap twice
    in the same sense, so it is wound around something. ``(1, -2, -1)`` does not loop, ``(1, 2, 1)``
    does. This is the non-looping constraint of McCammon & Hollinger 2017, section IV-A, in the form
    of the authors' later code.
    """
    return len(set(word)) < len(word)
