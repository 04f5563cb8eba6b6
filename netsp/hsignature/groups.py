"""Groups by generators and relations, with a normal form of their words.

The classes of loops in a scene form a group, which `netsp.plan.space.triangle_labels` finds as
generators and relations. Generators that a relation expresses by others are eliminated (Tietze
1908). Usually a free group remains, whose elements are the reduced words. Otherwise, each relation
becomes a rule that replaces a word by an equal word that is shorter, or as long and first in
alphabetical order, and the rules are completed (Knuth & Bendix 1970). If the completion ends, each
element has exactly one word to which no rule applies. It may not end; then it is cut off. The rules
still replace words by equal words only, so an empty word means that a loop is contractible, but any
other word proves nothing (`Group.exact`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import product

from netsp.base.bounded_work import end_if_abandoned
from netsp.hsignature.signature_policy import CompletionPolicy
from netsp.hsignature.words import Word, cyclically_reduced, invert, reduce

Endings = dict[int, list[tuple[int, Word, Word]]]
"""Rules by the last letter of their left side, as (length of the left side, left, right)."""


@dataclass(frozen=True)
class Group:
    """Finitely presented group with a normal form of its words.

    Parameters
    ----------
    rank : int
        Number of generators. Letters are the numbers of generators from 1, negative for inverses.
    relators : tuple of Word
        Words that are equal to the empty word.
    rules : tuple of (Word, Word)
        Left sides, and the right sides that replace them. Adjacent inverses cancel without a rule.
    exact : bool
        Whether every element has exactly one normal form.
    """

    rank: int
    relators: tuple[Word, ...] = ()
    rules: tuple[tuple[Word, Word], ...] = field(default=(), repr=False)
    exact: bool = True

    @classmethod
    def presented(
        cls, rank: int, relators: Iterable[Word], policy: CompletionPolicy = CompletionPolicy()
    ) -> Group:
        """Return the group with given generators and relators, with completed rules.

        Examples
        --------
        >>> Group.presented(2, [(1, 2, -1, -2)]).normal((2, 1, -2))
        (1,)
        """
        kept = _distinct(relators)
        if not kept:
            return cls(rank)
        rules, exact = _completed(rank, kept, policy)
        return cls(rank, kept, rules, exact)

    @property
    def free(self) -> bool:
        """True if there are no relations."""
        return not self.relators

    def normal(self, letters: Iterable[int]) -> Word:
        """Return the normal form of a word: the equal word to which no rule applies."""
        return _rewritten(letters, self._endings)

    @cached_property
    def _endings(self) -> Endings:
        return _by_last_letter(self.rules)

    @cached_property
    def functionals(self) -> tuple[tuple[int, ...], ...]:
        """Rows of integer weights of the generators, one row for each winding number.

        Equal words have equal sums of weighted letters. The sums with all rows are the class of a
        word in the abelianisation. This ignores torsion, but the complement of solids in space has
        none (Alexander duality).
        """
        return _annihilators([_exponents(r, self.rank) for r in self.relators], self.rank)

    def windings(self, word: Iterable[int]) -> tuple[int, ...]:
        """Return the winding numbers of a word, one for each row of `functionals`.

        They are its class in the abelianisation.
        """
        e = _exponents(word, self.rank)
        return tuple(sum(f * x for f, x in zip(row, e, strict=True)) for row in self.functionals)


def eliminated(rank: int, relators: Iterable[Word]) -> tuple[list[Word], int, tuple[Word, ...]]:
    """Return a presentation without generators that a relation expresses by others.

    Returns
    -------
    meaning : list of Word
        Each old generator as a word in the new ones.
    rank : int
        Number of new generators.
    relators : tuple of Word
        Remaining relations, in the new generators.
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
    """Return the shortest relator in which some generator occurs once, and the index of its
    letter."""
    for r in sorted(range(len(relators)), key=lambda r: (len(relators[r]), relators[r])):
        seen: dict[int, int] = {}
        for x in relators[r]:
            seen[abs(x)] = seen.get(abs(x), 0) + 1
        alone = [k for k, x in enumerate(relators[r]) if seen[abs(x)] == 1]
        if alone:
            return r, max(alone, key=lambda k: abs(relators[r][k]))
    return None


def _shortened(relators: Sequence[Word]) -> tuple[int, Word, list[Word]] | None:
    """Return a Nielsen move that lowers the total length of the relators, or None.

    It consists of a generator, the product that replaces it, and the new relators.
    """
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
    parts = {generator: means, -generator: invert(means)}
    return reduce(y for x in word for y in parts.get(x, (x,)))


def _distinct(relators: Iterable[Word]) -> tuple[Word, ...]:
    """Return distinct relators, each as the first rotation, in order, of itself or its inverse."""
    out: dict[Word, None] = {}
    for word in relators:
        w = cyclically_reduced(word)
        if w:
            rotations = [v[k:] + v[:k] for v in (w, invert(w)) for k in range(len(w))]
            out[min(rotations, key=_order)] = None
    return tuple(sorted(out, key=_order))


def _order(word: Word) -> tuple[int, list[tuple[int, bool]]]:
    """Return the key that orders words by length, then by letters 1, -1, 2, -2, …"""
    return len(word), [(abs(x), x < 0) for x in word]


def _by_last_letter(rules: Iterable[tuple[Word, Word]]) -> Endings:
    """Return rules by the last letter of their left sides, in the order of the rules."""
    endings: Endings = {}
    for a, b in rules:
        endings.setdefault(a[-1], []).append((len(a), a, b))
    return endings


def _rewritten(letters: Iterable[int], endings: Endings) -> Word:
    """Return the normal form of a word.

    No rule applies to the letters kept so far, so after each letter only rules that end with it are
    tried, at the end of the word.
    """
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


def _completed(
    rank: int, relators: Sequence[Word], policy: CompletionPolicy
) -> tuple[tuple[tuple[Word, Word], ...], bool]:
    """Return the rules of a group, and whether they are complete."""
    inverses: list[tuple[Word, Word]] = [((x, -x), ()) for g in range(1, rank + 1) for x in (g, -g)]
    rank_of = _generator_order(rank, relators)

    def order(word: Word) -> tuple[int, list[tuple[int, bool]]]:
        return len(word), [(rank_of[abs(x)], x < 0) for x in word]

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
            larger, smaller = (a, b) if order(a) > order(b) else (b, a)
            if len(larger) > policy.max_side or len(rules) >= policy.max_rules:
                exact = False
                continue
            # rules that the new one rewrites become equations again
            reopened = [r for r in rules if _contains(r[0], larger)]
            done -= sum(rules.index(r) < done for r in reopened)
            every = _by_last_letter([*rules, (larger, smaller)])
            rules = [(x, _rewritten(y, every)) for x, y in rules if not _contains(x, larger)]
            equations.extend(reopened)
            rules.append((larger, smaller))
            endings = _by_last_letter(rules)
        if done >= len(rules) or pairs > policy.max_overlaps:
            break
        new = rules[done]
        done += 1
        for one, other in product([new], [*rules[:done], *inverses]):
            for first, second in {(one, other), (other, one)}:
                pairs += 1
                equations.extend(_overlaps(first, second))
    exact = exact and pairs <= policy.max_overlaps
    return tuple(sorted(rules, key=lambda r: _order(r[0]))), exact


def _generator_order(rank: int, relators: Sequence[Word]) -> dict[int, int]:
    """Return the place of each generator in the alphabet; generators in many relators come first.

    Rules then move generators that commute with others to the front, and the completion of Z x F_n
    ends.
    """
    count = {g: sum(g in map(abs, r) for r in relators) for g in range(1, rank + 1)}
    return {g: k for k, g in enumerate(sorted(count, key=lambda g: (-count[g], g)))}


def _contains(word: Word, part: Word) -> bool:
    return any(word[k : k + len(part)] == part for k in range(len(word) - len(part) + 1))


def _overlaps(first: tuple[Word, Word], second: tuple[Word, Word]) -> Iterable[tuple[Word, Word]]:
    """Yield, for each overlap of two left sides, what the overlapping word becomes by either
    rule."""
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
    """Return an integer basis of the vectors orthogonal to some rows, by Gauss's elimination."""
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
            scale = math.lcm(scale, x.denominator)
        out.append(tuple(int(x * scale) for x in vector))
    return tuple(out)
