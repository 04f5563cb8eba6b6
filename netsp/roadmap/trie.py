"""Trie of the words that paths write."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel

PARENT, LETTER, CHILD, SIBLING, CORE = range(5)
"""Columns of a node. SIBLING chains the children of one parent."""


@dataclass
class Trie:
    """Words as a tree whose node 0 is the empty word. Arrays have spare capacity.

    Attributes
    ----------
    nodes
        (capacity, 5) columns PARENT … CORE.
    limit
        (capacity,) longest path allowed at or below each node.
    size
        Number of nodes.
    """

    nodes: Ints
    limit: Floats
    size: int = 1
    words: dict[int, tuple[int, ...]] = field(default_factory=dict)

    @classmethod
    def root(cls, limit: float, capacity: int = 256) -> Trie:
        """Return the trie that holds the empty word only."""
        trie = cls(np.full((capacity, 5), -1, dtype=np.int64), np.zeros(capacity))
        trie.nodes[0] = (-1, 0, -1, -1, 1)
        trie.limit[0] = limit
        return trie

    @classmethod
    def from_word(cls, word: tuple[int, ...], limit: float) -> Trie:
        """Return the trie of one word and its prefixes; node k is the prefix of length k."""
        trie = cls.root(limit, capacity=max(256, 2 * len(word) + 2))
        for k, letter in enumerate(word):
            trie.nodes[k, CHILD] = k + 1
            trie.nodes[k + 1] = (k, letter, -1, -1, 1)
            trie.limit[k + 1] = limit
        trie.size = len(word) + 1
        return trie

    @classmethod
    def from_words(cls, words: Sequence[tuple[int, ...]], limit: float) -> tuple[Trie, list[int]]:
        """Return the trie of words and their prefixes, and the node of each word."""
        rows, last, child_of = [[-1, 0, -1, -1, 1]], [], dict[tuple[int, int], int]()
        for word in words:
            node = 0
            for letter in word:
                child = child_of.setdefault((node, letter), len(rows))
                if child == len(rows):
                    rows.append([node, letter, -1, rows[node][CHILD], 1])
                    rows[node][CHILD] = child
                node = child
            last.append(node)
        trie = cls.root(limit, capacity=max(256, 2 * len(rows)))
        trie.nodes[: len(rows)] = rows
        trie.limit[:] = limit
        trie.size = len(rows)
        return trie, last

    def word(self, node: int) -> tuple[int, ...]:
        """Return the word of a node."""
        above = [node]
        while above[-1] and above[-1] not in self.words:
            above.append(int(self.nodes[above[-1], PARENT]))
        self.words.setdefault(0, ())
        for parent, child in pairwise(above[::-1]):
            self.words[child] = (*self.words[parent], int(self.nodes[child, LETTER]))
        return self.words[node]


@kernel
def trie_child(node: int, a: int, trie: Ints) -> int:
    """Return the child of a node along letter a; -1 if there is none."""
    c = trie[node, CHILD]
    while c >= 0 and trie[c, LETTER] != a:
        c = trie[c, SIBLING]
    return int(c)


@kernel
def add_child(node: int, a: int, core: int, size: int, trie: Ints) -> None:
    """Add the child of a node along letter a in row `size`."""
    trie[size, PARENT], trie[size, LETTER], trie[size, CORE] = node, a, core
    trie[size, CHILD] = -1
    trie[size, SIBLING] = trie[node, CHILD]
    trie[node, CHILD] = size
