"""Kernels of walks: their labels, layer by layer.

A walk leaves the base, makes n visits to goals and returns. Its cost is that of its legs less a
price for each visit. A *label* at (k, v) is a walk that makes its k-th visit at vertex v: its cost
and its memory. Vertices are grouped by goal: those of goal g are start[g] to start[g + 1] - 1.

Costs are symmetric, so a walk read backwards is a walk: bounds on the first k visits hold for the
last k, too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.compiled.dynamic_array import order_of, write_floats
from netsp.base.compiled.interpretation import interprets
from netsp.base.compiled.kernel import kernel
from netsp.gtsp.dp.ng_sets import BITS_PER_TABLE

TABLE_MASK = (1 << BITS_PER_TABLE) - 1


class Graph(NamedTuple):
    """Costs of legs (V, V), goal of each vertex (V,), and where the vertices of each goal begin."""

    costs: Floats
    goal: Ints
    start: Ints


class Labels(NamedTuple):
    """Labels of a layer: those of vertex v are pointer[v] to pointer[v + 1] - 1, cheapest first."""

    pointer: Ints
    cost: Floats
    memory: npt.NDArray[np.int32]


class Bounds(NamedTuple):
    """Limits of labels: onward (n + 1, V), minimum cost of the visits still to make; limit
    (V,), maximum cost of a label before its price is taken off; cut, maximum cost of a walk."""

    onward: Floats
    limit: Floats
    cut: float


@kernel
def completions(
    graph: Graph, prices: Floats, alive: Bools, lowest: Floats, onward: Floats, stop: Ints
) -> None:
    """Fill bounds on the completion of labels: walks that remember only the goal before the last.

    Parameters
    ----------
    lowest
        (n + 1, V) minimum cost of k visits that end at v.
    onward
        (n + 1, n + 1, V) minimum cost of k visits, the last to goal h, and of the leg from there to
        vertex v, whose goal is not that of the visit before.
    stop
        Flag of a clock; the tables are incomplete once it is set.
    """
    costs, goal, start = graph.costs, graph.goal, graph.start
    count = len(goal)
    n = len(start) - 2
    second = np.full((n + 1, count), np.inf)
    before = np.full((n + 1, count), -1, dtype=np.int64)
    lowest[:] = np.inf
    onward[:] = np.inf
    for v in range(1, count):
        if alive[1, v]:
            lowest[1, v] = costs[0, v] - prices[goal[v]]
    for k in range(1, n + 1):
        for v in range(1, count):
            best = lowest[k, v]
            if best == np.inf:
                continue
            if stop[0] != 0:
                return
            h = goal[v]
            row = onward[k, h]
            for g in range(n + 1):
                if g == h:
                    continue
                cost = second[k, v] if g == before[k, v] else best
                if cost == np.inf:
                    continue
                for u in range(start[g], start[g + 1]):
                    d = cost + costs[v, u]
                    row[u] = d if d < row[u] else row[u]
        if k == n:
            break
        for u in range(1, count):
            if not alive[k + 1, u]:
                continue
            a, b, last = np.inf, np.inf, -1
            for h in range(1, n + 1):
                d = onward[k, h, u]
                if d < a:
                    a, b, last = d, a, h
                elif d < b:
                    b = d
            lowest[k + 1, u] = a - prices[goal[u]]
            second[k + 1, u] = b - prices[goal[u]]
            before[k + 1, u] = last


@interprets(completions)
def _completions_in_numpy(
    graph: Graph, prices: Floats, alive: Bools, lowest: Floats, onward: Floats, stop: Ints
) -> None:
    """Vectorise `completions` over the vertices of a goal."""
    costs, goal, start = graph
    n = len(start) - 2
    second = np.full(lowest.shape, np.inf)
    before = np.full(lowest.shape, -1, dtype=np.int64)
    lowest[:] = np.inf
    onward[:] = np.inf
    first = np.where(alive[1], costs[0] - prices[goal], np.inf)
    lowest[1, 1:] = first[1:]
    for k in range(1, n + 1):
        for h in range(1, n + 1):
            if stop[0] != 0:
                return
            members = slice(start[h], start[h + 1])
            is_return = before[k, members, None] == goal
            cost = np.where(is_return, second[k, members, None], lowest[k, members, None])
            onward[k, h] = np.fmin.reduce(cost + costs[members], axis=0, initial=np.inf)
            onward[k, h, members] = np.inf
        if k == n:
            break
        by_goal = onward[k, 1:]
        last, ascending = by_goal.argmin(axis=0) + 1, np.sort(by_goal, axis=0)
        best, second_best = ascending[0], ascending[1] if n > 1 else np.full(len(goal), np.inf)
        is_alive = alive[k + 1].copy()
        is_alive[0] = False
        lowest[k + 1, is_alive] = (best - prices[goal])[is_alive]
        second[k + 1, is_alive] = (second_best - prices[goal])[is_alive]
        before[k + 1, is_alive] = np.where(best < np.inf, last, -1)[is_alive]


@kernel
def translate(tables: npt.NDArray[np.int32], g: int, h: int, memory: int) -> int:
    """Return the memory at goal h of a walk that comes from goal g; negative if h is forbidden."""
    mask: int = (
        tables[g, h, 0, memory & TABLE_MASK]
        | tables[g, h, 1, (memory >> BITS_PER_TABLE) & TABLE_MASK]
        | tables[g, h, 2, memory >> (2 * BITS_PER_TABLE)]
    )
    return mask


@kernel
def extend(
    graph: Graph,
    first: int,
    last: int,
    bits: Ints,
    tables: npt.NDArray[np.int32],
    labels: Labels,
    bounds: Bounds,
    prices: Floats,
    stop: Ints,
) -> tuple[Ints, Floats, npt.NDArray[np.int32]]:
    """Return the labels of the next layer at goals first to last - 1.

    A label is dropped if a cheaper label of its vertex remembers a subset of its goals. Some labels
    are missing once the clock's flag `stop` is set. The tables of `translate` are an argument of
    their own: within a tuple, each call would count references, which takes a twelfth of the time.
    """
    costs, start = graph.costs, graph.start
    pointer, cost, memory = labels.pointer, labels.cost, labels.memory
    onward, limit, cut = bounds.onward, bounds.limit, bounds.cut
    n = len(start) - 2
    room, used_up = 1024, 0
    out_cost, out_memory = np.empty(room), np.empty(room, dtype=np.int32)
    out_pointer = np.zeros(start[last] - start[first] + 1, dtype=np.int64)
    max_bits = 0
    for h in range(first, last):
        max_bits = max(max_bits, bits[h])
    slot = np.full(1 << max_bits, -1, dtype=np.int32)
    seen = np.empty(1 << max_bits, dtype=np.int32)
    found_cost, found_memory = np.empty(1 << max_bits), np.empty(1 << max_bits, dtype=np.int32)
    table_room = 1 << 14
    table = np.empty(table_room)
    for h in range(first, last):
        begin = start[h]
        size = start[h + 1] - begin
        if size == 0:
            continue
        slots = 0
        for g in range(1, n + 1):
            if g == h:
                continue
            if stop[0] != 0:
                break
            for u in range(start[g], start[g + 1]):
                max_cost = cut - onward[h, u]
                leg = costs[u, begin : begin + size]
                for label in range(pointer[u], pointer[u + 1]):
                    d = cost[label]
                    if d > max_cost:
                        break
                    m = translate(tables, g, h, memory[label])
                    if m < 0:
                        continue
                    s = slot[m]
                    if s < 0:
                        s = slots
                        slot[m], seen[s] = s, m
                        slots += 1
                        if slots * size > table_room:
                            new_table = np.empty(2 * slots * size)
                            write_floats(new_table, table, table_room)
                            table, table_room = new_table, len(new_table)
                        table[s * size : slots * size] = np.inf
                    row = table[s * size : (s + 1) * size]
                    for j in range(size):
                        c = d + leg[j]
                        row[j] = c if c < row[j] else row[j]
        for j in range(size):
            v = begin + j
            out_pointer[v - start[first]] = used_up
            found = 0
            for s in range(slots):
                c = table[s * size + j]
                if c <= limit[v] and c < np.inf:
                    found_cost[found], found_memory[found] = c, seen[s]
                    found += 1
            if found == 0:
                continue
            first_kept = used_up
            for i in order_of(found_cost[:found]):
                m = found_memory[i]
                dominated = False
                for label in range(first_kept, used_up):
                    if out_memory[label] & m == out_memory[label]:
                        dominated = True
                        break
                if dominated:
                    continue
                if used_up == room:
                    more_cost, more_memory = np.empty(2 * room), np.empty(2 * room, dtype=np.int32)
                    write_floats(more_cost, out_cost, room)
                    for k in range(room):
                        more_memory[k] = out_memory[k]
                    out_cost, out_memory, room = more_cost, more_memory, 2 * room
                out_cost[used_up], out_memory[used_up] = found_cost[i] - prices[h], m
                used_up += 1
        for s in range(slots):
            slot[seen[s]] = -1
    out_pointer[-1] = used_up
    return out_pointer, out_cost[:used_up], out_memory[:used_up]


@interprets(extend)
def _extend_in_numpy(
    graph: Graph,
    first: int,
    last: int,
    bits: Ints,
    tables: npt.NDArray[np.int32],
    labels: Labels,
    bounds: Bounds,
    prices: Floats,
    stop: Ints,
) -> tuple[Ints, Floats, npt.NDArray[np.int32]]:
    """Vectorise `extend` over all labels that are extended to a goal."""
    costs, goal, start = graph
    pointer, cost, memory = labels
    vertex = np.repeat(np.arange(len(pointer) - 1), np.diff(pointer))
    from_goal = goal[vertex]
    slot = np.empty(1 << int(bits[first:last].max(initial=0)), dtype=np.int64)
    out_pointer, out_cost, out_memory = [0], [np.zeros(0)], [np.zeros(0, dtype=np.int32)]
    for h in range(first, last):
        members = slice(start[h], start[h + 1])
        is_too_costly = cost > (bounds.cut - bounds.onward[h])[vertex]
        at = np.flatnonzero(~is_too_costly & (from_goal != h))
        if stop[0] != 0:
            at = at[:0]
        masks = _translated(tables, from_goal[at], h, memory[at])
        at, masks = at[masks >= 0], masks[masks >= 0]
        if not len(at) or members.start == members.stop:
            out_pointer += [out_pointer[-1]] * (members.stop - members.start)
            continue
        # distinct memories, in the order in which `extend` finds them, which breaks ties
        place = np.arange(len(at))
        slot[masks[::-1]] = place[::-1]
        seen = masks[slot[masks] == place]
        slot[seen] = place[: len(seen)]
        kind = slot[masks]
        by_kind = np.argsort(kind, kind="stable")
        begin = np.searchsorted(kind[by_kind], place[: len(seen)])
        at = at[by_kind]
        table = np.minimum.reduceat(cost[at, None] + costs[vertex[at], members], begin, axis=0)
        table[~((table <= bounds.limit[members]) & (table < np.inf))] = np.inf
        # for each vertex of the goal, indices into `seen`, cheapest first
        count = np.count_nonzero(table < np.inf, axis=0)
        order = np.argsort(table.T, axis=1, kind="stable")[:, : count.max()]
        kept = _undominated(seen, order) & (np.arange(order.shape[1]) < count[:, None])
        vertices, places = np.nonzero(kept)
        labels_of = order[vertices, places]
        out_pointer += (np.cumsum(np.count_nonzero(kept, axis=1)) + out_pointer[-1]).tolist()
        out_cost.append(table[labels_of, vertices] - prices[h])
        out_memory.append(seen[labels_of])
    return np.array(out_pointer), np.concatenate(out_cost), np.concatenate(out_memory)


def _translated(
    tables: npt.NDArray[np.int32], goals: Ints, h: int, memory: npt.NDArray[np.int32]
) -> npt.NDArray[np.int32]:
    """Vectorise `translate` over memories and the goals that they come from."""
    masks: npt.NDArray[np.int32] = tables[goals, h, 0, memory & TABLE_MASK]
    masks |= tables[goals, h, 1, (memory >> BITS_PER_TABLE) & TABLE_MASK]
    masks |= tables[goals, h, 2, memory >> (2 * BITS_PER_TABLE)]
    return masks


def _undominated(
    memory: npt.NDArray[np.int32], order: Ints, max_sets_per_memory: int = 64
) -> Bools:
    """Return, for each row of an order, which memories have no subset earlier in the row.

    Where the memories are a large part of all sets of their goals, the first place of a subset is
    found for all sets together, by a minimum over one goal after another (Yates 1937, "The design
    and analysis of factorial experiments"). With more than `max_sets_per_memory` sets for each
    memory they are compared pairwise; at about the default both take the same time.
    """
    used = int(np.bitwise_or.reduce(memory)) & ~int(np.bitwise_and.reduce(memory))
    goals = [k for k in range(used.bit_length()) if used >> k & 1]
    if 1 << len(goals) > max_sets_per_memory * len(memory):
        return np.array([_undominated_of(memory[row]) for row in order])
    sets = np.zeros(len(memory), dtype=np.int64)
    for place, k in enumerate(goals):
        sets |= (memory >> k & 1) << place
    rows, places = np.arange(len(order))[:, None], np.arange(order.shape[1], dtype=np.int32)
    first = np.full((1 << len(goals), len(order)), len(memory), dtype=np.int32)
    first[sets[order], rows] = places
    for place in range(len(goals)):
        by_goal = first.reshape(-1, 2, len(order) << place)
        np.minimum(by_goal[:, 1], by_goal[:, 0], out=by_goal[:, 1])
    return np.asarray(first[sets[order], rows] == places)


def _undominated_of(memory: npt.NDArray[np.int32], block_size: int = 32) -> Bools:
    """Return which memories have no subset among the earlier memories.

    Blocks of `block_size` memories are compared with all others at once; smaller and larger ones
    are a little slower.
    """
    kept, left = np.zeros(len(memory), dtype=bool), np.arange(len(memory))
    while len(left):
        block, left = left[:block_size], left[block_size:]
        masks = memory[block, None]
        block = block[~np.triu((masks & masks.T) == masks, 1).any(axis=0)]
        kept[block] = True
        left = left[~((memory[left, None] & memory[block]) == memory[block]).any(axis=1)]
    return kept


@kernel
def join(goal: Ints, prices: Floats, a: Labels, b: Labels) -> Floats:
    """Return the cost (V,) of the best walk through each vertex v.

    It joins a walk that ends at v with one read backwards; the two may remember no goal in common
    except that of v.
    """
    a_pointer, a_cost, a_memory = a.pointer, a.cost, a.memory
    b_pointer, b_cost, b_memory = b.pointer, b.cost, b.memory
    count = len(goal)
    out = np.full(count, np.inf)
    for v in range(1, count):
        best = np.inf
        low, high = b_pointer[v], b_pointer[v + 1]
        for i in range(a_pointer[v], a_pointer[v + 1]):
            if low == high or a_cost[i] + b_cost[low] >= best:
                break
            for j in range(low, high):
                if a_cost[i] + b_cost[j] >= best:
                    break
                if a_memory[i] & b_memory[j] == 1:
                    best = a_cost[i] + b_cost[j]
                    break
        out[v] = best + prices[goal[v]]
    return out


@interprets(join)
def _join_in_lists(goal: Ints, prices: Floats, a: Labels, b: Labels) -> Floats:
    """Compute `join` over lists, which the interpreter reads faster than arrays."""
    a_pointer, a_cost, a_memory = (x.tolist() for x in a)
    b_pointer, b_cost, b_memory = (x.tolist() for x in b)
    out = np.full(len(goal), np.inf)
    for v in range(1, len(goal)):
        best = np.inf
        low, high = b_pointer[v], b_pointer[v + 1]
        if low == high:
            continue
        second_parts = list(zip(b_cost[low:high], b_memory[low:high], strict=True))
        labels_at_v = slice(a_pointer[v], a_pointer[v + 1])
        for cost, memory in zip(a_cost[labels_at_v], a_memory[labels_at_v], strict=True):
            if cost + b_cost[low] >= best:
                break
            for second_cost, second_memory in second_parts:
                if cost + second_cost >= best:
                    break
                if memory & second_memory == 1:
                    best = cost + second_cost
                    break
        out[v] = best + prices[goal[v]]
    return out


@kernel
def step_back(
    graph: Graph,
    prices: Floats,
    tables: npt.NDArray[np.int32],
    v: int,
    at_cost: float,
    at_memory: int,
    labels: Labels,
) -> tuple[int, int]:
    """Return the vertex and label, in the layer before, that a label at v came from."""
    costs, goal = graph.costs, graph.goal
    pointer, cost, memory = labels.pointer, labels.cost, labels.memory
    min_error, from_vertex, from_label = np.inf, -1, -1
    h = goal[v]
    for u in range(1, len(goal)):
        g = goal[u]
        if g == h:
            continue
        for label in range(pointer[u], pointer[u + 1]):
            m = translate(tables, g, h, memory[label])
            if m >= 0 and m & at_memory == m:
                error = abs(cost[label] + costs[u, v] - prices[h] - at_cost)
                if error < min_error:
                    min_error, from_vertex, from_label = error, u, label
    return from_vertex, from_label


@interprets(step_back)
def _step_back_in_numpy(
    graph: Graph,
    prices: Floats,
    tables: npt.NDArray[np.int32],
    v: int,
    at_cost: float,
    at_memory: int,
    labels: Labels,
) -> tuple[int, int]:
    """Vectorise `step_back` over all labels."""
    costs, goal, _ = graph
    pointer, cost, memory = labels
    h = goal[v]
    vertex = np.repeat(np.arange(len(pointer) - 1), np.diff(pointer))
    masks = _translated(tables, goal[vertex], h, memory)
    fits = (goal[vertex] != h) & (masks >= 0) & ((masks & at_memory) == masks)
    error = np.abs(cost + costs[vertex, v] - prices[h] - at_cost)
    error = np.where(fits & (error < np.inf), error, np.inf)
    if not (error < np.inf).any():
        return -1, -1
    label = int(error.argmin())
    return int(vertex[label]), label
