"""Groups that are given by generators and relations, and the one word of each of their elements.

The classes of loops in a scene make a group, which `netsp.plan.space.triangle_labels` finds as
generators and relations. Generators that a relation expresses by others are eliminated (Tietze
1908). What is left is mostly a free group, where a reduced word is an element. If relations are
left, rules that turn the later of two equal words (in order of length, then letters) into the
earlier are completed (Knuth & Bendix 1970): where that ends, every element has exactly one word
that no rule applies to. It need not end. Capped, the rules still only join words that are equal: an
empty word means contractible then, and a word that is not empty means nothing certain;
`Group.exact` says which.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import product

from netsp.base.clock import end_if_abandoned
from netsp.hsignature.words import Word, cyclically_reduced, invert, reduce

MOST_RULES = 100
"""Of a completion; beyond them it is given up."""

LONGEST_SIDE = 16
"""Letters of a rule's longer side; longer ones are left out, and the group is no longer exact."""

MOST_PAIRS = 5_000
"""Overlaps that a completion looks at."""

Endings = dict[int, list[tuple[int, Word, Word]]]
"""Rules by the last letter of their left side: its length, the left side, the right side."""


@dataclass(frozen=True)
class Group:
    """A finitely presented group with a normal form of its words.

    Parameters
    ----------
    rank : int
        Number of generators; letters are their numbers from 1, negative for inverses.
    relators : tuple of Word
        Words that are equal to the empty word.
    rules : tuple of (Word, Word)
        Left sides are replaced by right sides; the cancellation of inverses is not among them.
    exact : bool
        Whether every element has exactly one normal form.
    """

    rank: int
    relators: tuple[Word, ...] = ()
    rules: tuple[tuple[Word, Word], ...] = field(default=(), repr=False)
    exact: bool = True

    @classmethod
    def of(cls, rank: int, relators: Iterable[Word]) -> Group:
        """The group of a presentation, completed.

        Parameters
        ----------
        rank : int
            Number of generators.
        relators : iterable of Word
            Words that are equal to the empty word.

        Returns
        -------
        Group
            The group, on the same generators.

        Examples
        --------
        >>> Group.of(2, [(1, 2, -1, -2)]).normal((2, 1, -2))
        (1,)
        """
        kept = _distinct(relators)
        if not kept:
            return cls(rank)
        rules, exact = _completed(rank, kept)
        return cls(rank, kept, rules, exact)

    @property
    def free(self) -> bool:
        """Whether there are no relations."""
        return not self.relators

    def normal(self, letters: Iterable[int]) -> Word:
        """The word of an element to which no rule applies.

        Parameters
        ----------
        letters : iterable of int
            A word.

        Returns
        -------
        Word
            Equal to it.
        """
        return _rewritten(letters, self._endings)

    @cached_property
    def _endings(self) -> Endings:
        return _by_last_letter(self.rules)

    @cached_property
    def functionals(self) -> tuple[tuple[int, ...], ...]:
        """Rows of whole numbers, one for each generator: sums of a word's letters weighted with a
        row depend on the element alone, and all together are its class in the abelianisation (but
        for torsion, of which the complement of solids in space has none: Alexander duality)."""
        return _annihilators([_exponents(r, self.rank) for r in self.relators], self.rank)

    def windings(self, word: Iterable[int]) -> tuple[int, ...]:
        """The element in the abelianisation: how often a path winds, counted with signs.

        Parameters
        ----------
        word : iterable of int
            A word of it.

        Returns
        -------
        tuple of int
            One number for each of `functionals`.
        """
        e = _exponents(word, self.rank)
        return tuple(sum(f * x for f, x in zip(row, e, strict=True)) for row in self.functionals)


def eliminated(rank: int, relators: Iterable[Word]) -> tuple[list[Word], int, tuple[Word, ...]]:
    """A presentation without generators that a relation expresses by others.

    Parameters
    ----------
    rank : int
        Number of generators.
    relators : iterable of Word
        Words that are equal to the empty word.

    Returns
    -------
    meaning : list of Word
        Each old generator as a word in the new ones.
    rank : int
        Number of new generators.
    relators : tuple of Word
        What is left of the relations, in the new generators.
    """
    left = list(_distinct(relators))
    meaning: dict[int, Word] = {g: (g,) for g in range(1, rank + 1)}
    while True:
        end_if_abandoned()
        found = _lone_letter(left)
        if found is None:
            shorter = _shortened(left)
            if shorter is None:
                break
            generator, means, left = shorter
            meaning = {g: _substituted(w, generator, means) for g, w in meaning.items()}
            continue
        r, at = found
        word = left.pop(r)
        letter = word[at]
        # word = u x v = 1, so x = u^-1 v^-1, the inverse of v u
        means = invert((*word[at + 1 :], *word[:at]))
        if letter < 0:
            means = invert(means)
        gone = abs(letter)
        left = list(_distinct(_substituted(w, gone, means) for w in left))
        meaning = {g: _substituted(w, gone, means) for g, w in meaning.items()}
    used = sorted({abs(x) for w in meaning.values() for x in w})
    number = {g: k for k, g in enumerate(used, 1)}

    def renumbered(word: Word) -> Word:
        return tuple(number[x] if x > 0 else -number[-x] for x in word)

    return (
        [renumbered(meaning[g]) for g in range(1, rank + 1)],
        len(used),
        tuple(renumbered(w) for w in left),
    )


def _lone_letter(relators: Sequence[Word]) -> tuple[int, int] | None:
    """(relator, place) of a generator that occurs once in it, in the shortest such relator."""
    for r in sorted(range(len(relators)), key=lambda r: (len(relators[r]), relators[r])):
        seen: dict[int, int] = {}
        for x in relators[r]:
            seen[abs(x)] = seen.get(abs(x), 0) + 1
        alone = [k for k, x in enumerate(relators[r]) if seen[abs(x)] == 1]
        if alone:
            return r, max(alone, key=lambda k: abs(relators[r][k]))
    return None


def _shortened(relators: Sequence[Word]) -> tuple[int, Word, list[Word]] | None:
    """A generator, a product of it with another to put in its place (Nielsen's moves), and the
    relators that get shorter by that, taken together; None where there is no such."""
    used = sorted({abs(x) for w in relators for x in w})
    now = sum(map(len, relators))
    for g, h in product(used, used):
        end_if_abandoned()
        if g == h:
            continue
        for means in ((h, g), (-h, g), (g, h), (g, -h)):
            new = list(_distinct(_substituted(w, g, means) for w in relators))
            if sum(map(len, new)) < now:
                return g, means, new
    return None


def _substituted(word: Word, generator: int, means: Word) -> Word:
    back = invert(means)
    return reduce(
        y for x in word for y in (means if x == generator else back if x == -generator else (x,))
    )


def _distinct(relators: Iterable[Word]) -> tuple[Word, ...]:
    """Relators that say different things: each cyclically reduced, in the first of its rotations
    and those of its inverse."""
    out: dict[Word, None] = {}
    for word in relators:
        w = cyclically_reduced(word)
        if w:
            turns = [v[k:] + v[:k] for v in (w, invert(w)) for k in range(len(w))]
            out[min(turns, key=_order)] = None
    return tuple(sorted(out, key=_order))


def _order(word: Word) -> tuple[int, list[tuple[int, bool]]]:
    """By length, then letter by letter: 1, -1, 2, -2, …"""
    return len(word), [(abs(x), x < 0) for x in word]


def _by_last_letter(rules: Iterable[tuple[Word, Word]]) -> Endings:
    """Return rules by the last letter of their left sides, in the order of the rules."""
    endings: Endings = {}
    for a, b in rules:
        endings.setdefault(a[-1], []).append((len(a), a, b))
    return endings


def _rewritten(letters: Iterable[int], endings: Endings) -> Word:
    """No rule applies to what is kept, so only its end need be looked at after a letter."""
    todo, kept = list(letters)[::-1], list[int]()
    while todo:
        x = todo.pop()
        if kept and kept[-1] == -x:
            kept.pop()
            continue
        kept.append(x)
        for n, a, b in endings.get(x, ()):
            if len(kept) >= n and tuple(kept[-n:]) == a:
                del kept[-n:]
                todo.extend(reversed(b))
                break
    return tuple(kept)


def _completed(rank: int, relators: Sequence[Word]) -> tuple[tuple[tuple[Word, Word], ...], bool]:
    """Rules of a group, and whether they are complete."""
    inverses: list[tuple[Word, Word]] = [((x, -x), ()) for g in range(1, rank + 1) for x in (g, -g)]
    place = _places(rank, relators)

    def order(word: Word) -> tuple[int, list[tuple[int, bool]]]:
        return len(word), [(place[abs(x)], x < 0) for x in word]

    rules: list[tuple[Word, Word]] = []
    endings: Endings = {}
    equations: list[tuple[Word, Word]] = [(r, ()) for w in relators for r in (w, invert(w))]
    pairs, exact, done = 0, True, 0
    while True:
        while equations:
            end_if_abandoned()
            a, b = (_rewritten(w, endings) for w in equations.pop())
            if a == b:
                continue
            big, small = (a, b) if order(a) > order(b) else (b, a)
            if len(big) > LONGEST_SIDE or len(rules) >= MOST_RULES:
                exact = False
                continue
            # what the new rule applies to is said again
            again = [r for r in rules if _within(big, r[0])]
            done -= sum(rules.index(r) < done for r in again)
            every = _by_last_letter([*rules, (big, small)])
            rules = [(x, _rewritten(y, every)) for x, y in rules if not _within(big, x)]
            equations.extend(again)
            rules.append((big, small))
            endings = _by_last_letter(rules)
        if done >= len(rules) or pairs > MOST_PAIRS:
            break
        new = rules[done]
        done += 1
        for one, other in product([new], [*rules[:done], *inverses]):
            for first, second in {(one, other), (other, one)}:
                pairs += 1
                equations.extend(_overlaps(first, second))
    exact = exact and pairs <= MOST_PAIRS
    return tuple(sorted(rules, key=lambda r: _order(r[0]))), exact


def _places(rank: int, relators: Sequence[Word]) -> dict[int, int]:
    """Which generator comes first in the order of words: what is in most relations. What commutes
    with others is then collected in front, and the completion of Z x F_n ends."""
    many = {g: sum(g in map(abs, r) for r in relators) for g in range(1, rank + 1)}
    return {g: k for k, g in enumerate(sorted(many, key=lambda g: (-many[g], g)))}


def _within(part: Word, word: Word) -> bool:
    return any(word[k : k + len(part)] == part for k in range(len(word) - len(part) + 1))


def _overlaps(first: tuple[Word, Word], second: tuple[Word, Word]) -> Iterable[tuple[Word, Word]]:
    """What a word becomes by either of two rules, where the end of one's left side is the beginning
    of the other's."""
    (a, b), (c, d) = first, second
    for k in range(1, min(len(a), len(c))):
        if a[-k:] == c[:k]:
            yield (*b, *c[k:]), (*a[:-k], *d)


def _exponents(word: Iterable[int], rank: int) -> list[int]:
    e = [0] * rank
    for x in word:
        e[abs(x) - 1] += 1 if x > 0 else -1
    return e


def _annihilators(rows: Sequence[Sequence[int]], n: int) -> tuple[tuple[int, ...], ...]:
    """Whole-numbered basis of what is orthogonal to some rows: by Gauss's elimination."""
    table = [[Fraction(x) for x in row] for row in rows]
    pivots: list[int] = []
    for column in range(n):
        r = len(pivots)
        pick = next((k for k in range(r, len(table)) if table[k][column]), None)
        if pick is None:
            continue
        table[r], table[pick] = table[pick], table[r]
        lead = table[r][column]
        table[r] = [x / lead for x in table[r]]
        end_if_abandoned()
        for k in range(len(table)):
            if k != r and table[k][column]:
                factor = table[k][column]
                table[k] = [x - factor * y for x, y in zip(table[k], table[r], strict=True)]
        pivots.append(column)
    out = []
    for free in (c for c in range(n) if c not in pivots):
        vector = [Fraction(0)] * n
        vector[free] = Fraction(1)
        for r, column in enumerate(pivots):
            vector[column] = -table[r][free]
        scale = 1
        for x in vector:
            scale = scale * x.denominator // _gcd(scale, x.denominator)
        out.append(tuple(int(x * scale) for x in vector))
    return tuple(out)


def _gcd(a: int, b: int) -> int:
    while b:
        a, b = b, a % b
    return a
