"""Binary trees of bounding boxes over a sequence of items, for queries that concern few of them.

Nodes are numbered in preorder: the left child of node k is k + 1, its right child is
``skip[k + 1]``, and ``skip[k]`` is the first node after its subtree. A query needs no stack: it
continues at k + 1 if it meets the box of node k, else at skip[k]. It visits leaves in the order of
the items.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats, Ints


class BoxTree(NamedTuple):
    """Nodes of a tree in preorder.

    Attributes
    ----------
    box
        Bounding boxes (nodes, 4) of the items below each node: xmin, ymin, xmax, ymax.
    skip
        First node (nodes,) after the subtree; node + 1 at a leaf.
    first, stop
        Range (nodes,) of the items below each node: first to stop - 1.
    """

    box: Floats
    skip: Ints
    first: Ints
    stop: Ints


def build_box_tree(boxes: Floats, leaf_items: int = 4) -> BoxTree:
    """Return the tree over items with boxes (n, 4); it keeps their order.

    Parameters
    ----------
    leaf_items : int
        Number of items in a leaf. Fewer make more nodes; more make more tests that find nothing.
    """
    n = len(boxes)
    leaves = -(-n // leaf_items)
    nodes = max(2 * leaves - 1, 0)
    box = np.empty((nodes, 4))
    skip, first, stop = (np.empty(nodes, dtype=np.int64) for _ in range(3))
    node, low, count = (np.array([v] if n else [], dtype=np.int64) for v in (0, 0, leaves))
    levels = []
    while len(node):
        skip[node] = node + 2 * count - 1
        first[node] = low * leaf_items
        stop[node] = np.minimum((low + count) * leaf_items, n)
        split = count > 1
        leaf = node[~split]
        bounds = np.array([first[leaf], stop[leaf]]).T
        for column, extreme in enumerate((np.minimum, np.minimum, np.maximum, np.maximum)):
            values = boxes[:, column]
            at = extreme(values[bounds[:, 0]], values[bounds[:, 1] - 1])
            for k in range(1, leaf_items - 1):
                at = extreme(at, values[np.minimum(bounds[:, 0] + k, bounds[:, 1] - 1)])
            box[leaf, column] = at
        node, low, count = node[split], low[split], count[split]
        left = (count + 1) // 2
        levels.append((node, node + 1, node + 2 * left))
        node = np.concatenate([node + 1, node + 2 * left])
        low, count = np.concatenate([low, low + left]), np.concatenate([left, count - left])
    for parent, one, other in reversed(levels):
        box[parent, :2] = np.minimum(box[one, :2], box[other, :2])
        box[parent, 2:] = np.maximum(box[one, 2:], box[other, 2:])
    return BoxTree(box, skip, first, stop)


def spatial_order(boxes: Floats, bits: int = 16) -> Ints:
    """Return the order of boxes (n, 4) along a Z-order curve (Morton 1966) of their centres.

    Parameters
    ----------
    bits : int
        Number of bits for each coordinate, at most 31; with 16, a cell is 1/65536 of the extent.
    """
    if len(boxes) == 0:
        return np.zeros(0, dtype=np.int64)
    centre = 0.5 * (boxes[:, :2] + boxes[:, 2:])
    low = centre.min(axis=0)
    extent = max(float(np.ptp(centre, axis=0).max()), np.finfo(float).tiny)
    cell = ((centre - low) / extent * (2**bits - 1)).astype(np.int64)
    code = np.zeros(len(boxes), dtype=np.int64)
    for bit in range(bits):
        code |= ((cell[:, 0] >> bit) & 1) << (2 * bit) | ((cell[:, 1] >> bit) & 1) << (2 * bit + 1)
    return np.argsort(code, kind="stable")
