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
    """Return the reduced word of some letters.

    Examples
    --------
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
    """Return the reduced word of one path followed by the next.

    Examples
    --------
    >>> concatenate((1, 2), (-2, 3))
    (1, 3)
    """
    return reduce(letter for word in words for letter in word)


def invert(word: Iterable[int]) -> Word:
    """Return the word of the path in the opposite direction.

    Examples
    --------
    >>> invert((1, -2))
    (2, -1)
    """
    return tuple(-letter for letter in reversed(tuple(word)))


def is_looping(word: Word) -> bool:
    """Return whether a signed letter occurs twice in a reduced word.

    If so, the tether passes the same gap twice in the same direction and wraps something.
    ``(1, -2, -1)`` does not loop, ``(1, 2, 1)`` does. This is the non-looping constraint of
    McCammon & Hollinger 2017, section IV-A, in the form of the authors' later code.
    """
    return len(set(word)) < len(word)


def cyclically_reduced(word: Iterable[int]) -> Word:
    """Return the reduced word without letters at its end that cancel letters at its beginning.

    It is the class of a loop that is free to leave its base point.

    Examples
    --------
    >>> cyclically_reduced((1, 2, -1))
    (2,)
    """
    w = reduce(word)
    k = 0
    while k < len(w) - 1 - k and w[k] == -w[-1 - k]:
        k += 1
    return w[k : len(w) - k]


def entangled(word: Iterable[int]) -> tuple[int, ...]:
    """Return the obstacles, numbered from 1, that a closed path of this word is wrapped around.

    These are the obstacles with a winding number other than 0 and, if the rest of the word does not
    cancel without their letters, the obstacles in that rest. There are none exactly if the word is
    empty.

    McCammon & Hollinger 2016, section II-A, define them as the obstacles in the interior of the
    loop. Letters alone do not decide: in ``(1, 2, -1)`` the path crosses the ray of obstacle 1 only
    to get to obstacle 2 and back. Nor do winding numbers: they are 0 for ``(1, 2, -1, -2)``, which
    is entangled with both obstacles.

    Examples
    --------
    >>> entangled((1, 2, -1))
    (2,)
    >>> entangled((1, 2, -1, -2))
    (1, 2)
    """
    w = reduce(word)
    turns: dict[int, int] = {}
    for x in w:
        turns[abs(x)] = turns.get(abs(x), 0) + (1 if x > 0 else -1)
    wound = {k for k, n in turns.items() if n}
    left = cyclically_reduced(x for x in w if abs(x) not in wound)
    return tuple(sorted(wound | {abs(x) for x in left}))


def least_changed(others: Iterable[Word], believed: Iterable[Word]) -> set[Word]:
    """Return the words, of `others`, that differ least from a believed one."""
    known = list(believed)
    distances = {w: min(_edit_distance(w, other) for other in known) for w in others}
    smallest = min(distances.values())
    return {w for w, distance in distances.items() if distance == smallest}


def _edit_distance(a: Word, b: Word) -> int:
    """Return how many letters must be inserted or deleted to make one word of the other."""
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        before, row[0] = row[0], i
        for j, y in enumerate(b, 1):
            before, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, before + 2 * (x != y))
    return row[-1]
