"""Tangent graph: all free segments that a taut path may use, with the letters that they write.

Nodes are directed arcs (arc, sense) and points (base, goals). The departures of a directed arc are
in the order in which a robot that slides along the arc meets them. A taut path consists of such
steps only: arrive, slide in the same sense, depart (docs/theory).
"""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from netsp.base.arrays import Bools, Floats, Ints
from netsp.base.clock import Clock
from netsp.base.compiled.dynamic_array import more_rows
from netsp.base.compiled.kernel import kernel
from netsp.base.geometry.kernels import TWO_PI, Blockers, segment_blocked
from netsp.base.time_flags import Flag
from netsp.roadmap.letters import arc_letters, segment_letters
from netsp.roadmap.outline import Outline
from netsp.roadmap.pending_letters import pending_boxes
from netsp.roadmap.roadmap_policy import SightPolicy
from netsp.roadmap.sight import build_targets, empty_horizons, find_horizons, pairs_in_sight

JOINING = "finding tangents between the corners of obstacles"
"""Name of the stage in messages about the time limit."""

WRITING = "finding the rays that tangents cross"
"""Name of the stage in messages about the time limit."""

ANGLE_TOLERANCE = 1e-7
"""Tolerance of contact angles, radians: a departure may precede the arrival by this angle."""


@dataclass(frozen=True)
class TangentGraph:
    """Departures of all nodes in compressed rows.

    Node ``2 a`` is arc a run counter-clockwise, ``2 a + 1`` clockwise, ``2 A + p`` is point p.

    Attributes
    ----------
    start
        (nodes + 1,) row starts into the departures below.
    target
        (e,) node arrived at.
    length
        (e,) length of the segment.
    ends
        (e, 4) x, y of departure and arrival.
    angle
        (e, 2) contact angle at departure and arrival (0 at points).
    first
        (e,) first departure of the target at or after the arrival; -1 if there is none.
    turn
        (e,) angle from the arrival to that departure.
    gap
        (e,) angle from this departure to the next of its node; negative at the end of an arc.
    letters, segment_row, arrival_row, gap_row
        Words of the segment, of the arc from arrival to `first`, and of the arc to the next
        departure, as rows into `letters`.
    radius
        (nodes,) radius of the arc (0 at points).
    rays
        (n, 2) representative points.
    pending
        (2, n, 5) boxes of `netsp.roadmap.pending_letters`.
    """

    arcs: Floats
    full: npt.NDArray[np.bool_]
    points: Floats
    start: Ints
    target: Ints
    length: Floats
    ends: Floats
    angle: Floats
    first: Ints
    turn: Floats
    gap: Floats
    letters: npt.NDArray[np.int32]
    segment_row: Ints
    arrival_row: Ints
    gap_row: Ints
    radius: Floats
    rays: Floats
    pending: Floats

    @cached_property
    def longest_step(self) -> int:
        """Return the maximum number of letters that sliding to a departure, leaving and sliding on
        can write together."""
        rows = (self.segment_row, self.arrival_row, self.gap_row)
        return 1 + sum(int(np.max(row[:, 1] - row[:, 0], initial=0)) for row in rows)

    def point_node(self, p: int) -> int:
        """Return the node of point p."""
        return 2 * len(self.arcs) + p


def build_tangents(
    outline: Outline, reach: float, clock: Clock | None = None, policy: SightPolicy | None = None
) -> TangentGraph:
    """Return all free tangents whose ends lie within `reach` of the base (inf for all).

    A tether touches nothing farther from the base than its length: a leg between two admissible
    goals stays in the ball of that radius, which is convex in the covering space.

    Raises
    ------
    LimitReachedError
        The clock was up before all were found.
    """
    base = outline.points[0]
    if np.isfinite(reach):
        near = np.hypot(*(outline.arcs[:, :2] - base).T) - outline.arcs[:, 2] <= reach
        arcs, full = outline.arcs[near], outline.full[near]
    else:
        arcs, full = outline.arcs, outline.full
    rows = tangent_rows(outline, arcs, full, reach, clock=clock, policy=policy)
    return assemble(outline, arcs, full, rows, clock)


def tangent_rows(
    outline: Outline,
    arcs: Floats,
    full: Bools,
    reach: float,
    since: int = 0,
    clock: Clock | None = None,
    policy: SightPolicy | None = None,
) -> Floats:
    """Return rows of `_free_tangents` between arcs and the outline's points.

    Parameters
    ----------
    since
        Number of the first point that an end must be at, or a later one; 0 for all tangents.

    Raises
    ------
    LimitReachedError
        The clock was up before all were found.
    """
    policy, clock = policy or SightPolicy(), clock or Clock()
    blockers = outline.blockers
    place = np.zeros((len(arcs) + len(outline.points), 5))
    place[: len(arcs)] = arcs
    place[len(arcs) :, :2] = outline.points
    total, first = len(place), len(arcs) + since if since else 0

    def tangents_of(pairs: Ints, stop: Flag) -> Floats:
        # most segments are blocked by one of few parts, and the tree finds it
        base = outline.points[0]
        return np.asarray(
            _free_tangents(place, len(arcs), full, base, reach, blockers, pairs, stop)
        )

    if since or total * (total - 1) // 2 < policy.min_pairs:
        j = np.arange(first, total)
        one, other = np.triu_indices(total, 1) if not since else _pairs_with(j)
        pairs = np.column_stack([one, other]).astype(np.int64)
        steps = 4 * len(pairs) * (1 + len(blockers.tree.skip))
        return clock.finish(JOINING, steps, lambda stop: tangents_of(pairs, stop))
    targets = build_targets(place)
    horizons = empty_horizons(place, len(arcs), full, policy)
    pencils = len(horizons.low)
    steps = pencils * policy.sectors * 8

    def in_sight(stop: Flag) -> Floats:
        def horizons_from(begin: int) -> None:
            end = min(begin + policy.block, pencils)
            find_horizons(place, len(arcs), blockers, horizons, begin, end, stop)

        def rows_from(begin: int) -> Floats:
            end = min(begin + policy.block, total)
            pairs = pairs_in_sight(place, len(arcs), targets, horizons, begin, end, stop)
            return tangents_of(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))], stop)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(horizons_from, range(0, pencils, policy.block)))
            return np.concatenate(list(pool.map(rows_from, range(0, total, policy.block))))

    return clock.finish(JOINING, steps, in_sight)


def _pairs_with(numbers: Ints) -> tuple[Ints, Ints]:
    """Return all pairs (i, j), i < j, of which j is one of ascending numbers, ordered by i."""
    other = np.repeat(numbers, numbers)
    one = np.concatenate([np.arange(j) for j in numbers] or [np.zeros(0, dtype=np.int64)])
    order = np.lexsort((other, one))
    return one[order], other[order]


def assemble(
    outline: Outline, arcs: Floats, full: Bools, rows: Floats, clock: Clock | None = None
) -> TangentGraph:
    """Return the graph of rows of `_free_tangents`.

    Raises LimitReachedError when the clock is up before it is complete.
    """
    source, target = rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64)
    key, arrival_key, length = rows[:, 2], rows[:, 3], rows[:, 4]
    ends, angle = np.ascontiguousarray(rows[:, 5:9]), np.ascontiguousarray(rows[:, 9:])
    order = np.lexsort((key, source))
    node_count = 2 * len(arcs) + len(outline.points)
    start = np.searchsorted(source[order], np.arange(node_count + 1)).astype(np.int64)
    target, key, arrival_key = target[order], key[order], arrival_key[order]
    length, ends, angle = length[order], ends[order], angle[order]
    # as `netsp.hsignature.rays`: by x, ties by number
    order_of_rays = np.argsort(outline.rays[:, 0], kind="stable")
    # points as given: a vertex on a ray must not be moved across it
    source = source[order]
    for column, node in ((0, source), (2, target)):
        at_point = node >= 2 * len(arcs)
        ends[at_point, column : column + 2] = outline.places[node[at_point] - 2 * len(arcs)]
    _merge_contacts(source, target, length, ends, angle, len(arcs))
    steps = 3 * len(target) * (4 + len(outline.rays))

    def written(stop: Flag) -> Any:
        return _write_letters(
            arcs,
            full,
            start,
            target,
            key,
            arrival_key,
            ends,
            angle,
            outline.rays,
            order_of_rays,
            stop,
        )

    first, turn, gap, letters, segment_row, arrival_row, gap_row = (clock or Clock()).finish(
        WRITING, steps, written
    )
    blockers = outline.blockers
    radius = np.zeros(node_count)
    radius[: 2 * len(arcs)] = np.repeat(arcs[:, 2], 2)
    return TangentGraph(
        arcs,
        full,
        outline.points,
        start,
        target,
        length,
        ends,
        angle,
        first,
        turn,
        gap,
        letters,
        segment_row,
        arrival_row,
        gap_row,
        radius,
        outline.rays,
        pending_boxes(outline.rays, blockers),
    )


def _merge_contacts(
    source: Ints, target: Ints, length: Floats, ends: Floats, angle: Floats, arc_count: int
) -> None:
    """Give contacts of one arc that agree within the angle tolerance the same coordinates.

    Their sides of rays would otherwise differ by rounding, and sliding from one to the other would
    write letters that are not there. A point that lies on the arc lends its own coordinates.
    """
    node = np.concatenate([source, target])
    on_arc = np.flatnonzero(node < 2 * arc_count)
    if len(on_arc) == 0:
        return
    edges = len(source)
    theta = np.concatenate([angle[:, 0], angle[:, 1]])[on_arc] % TWO_PI
    arc = node[on_arc] // 2
    other = np.concatenate([target, source])[on_arc]
    given = (other >= 2 * arc_count) & (np.concatenate([length, length])[on_arc] == 0.0)
    order = np.lexsort((theta, arc))
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (np.diff(arc[order]) != 0) | (np.diff(theta[order]) > ANGLE_TOLERANCE)
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.cumsum(fresh) - 1
    # an angle just below a full turn is one just above nothing
    first, last = np.flatnonzero(fresh), np.append(np.flatnonzero(fresh)[1:], len(order)) - 1
    start_of_arc = np.append(True, np.diff(arc[order][first]) != 0)
    opening = np.flatnonzero(start_of_arc)
    closing = np.append(opening[1:] - 1, len(first) - 1)
    turned = theta[order[first[opening]]] + TWO_PI - theta[order[last[closing]]]
    joined = turned <= ANGLE_TOLERANCE
    one = np.arange(len(first))
    one[closing[joined]] = opening[joined]
    group = one[group]
    xy = np.vstack([ends[:, :2], ends[:, 2:]])
    # where a point lies on the arc, the far end of its edge of no length is the point itself
    far = np.vstack([ends[:, 2:], ends[:, :2]])[on_arc]
    chosen = np.empty((int(group.max()) + 1, 2))
    chosen[group[::-1]] = xy[on_arc][::-1]
    chosen[group[given]] = far[given]
    xy[on_arc] = chosen[group]
    ends[:, :2], ends[:, 2:] = xy[:edges], xy[edges:]


@kernel
def _arc_position(theta: float, sense: int, start: float, end: float, full: bool) -> float:
    """Return how far along the directed arc a contact angle lies; NaN if it is not on the arc."""
    span = end - start
    if sense > 0:
        key = (theta - start) % TWO_PI
    else:
        key = (end - theta) % TWO_PI
    if full:
        return key
    if key > span + ANGLE_TOLERANCE:
        key -= TWO_PI
    if key < -ANGLE_TOLERANCE:
        return np.nan
    return key


@kernel
def _reversed_position(key: float, start: float, end: float, full: bool) -> float:
    """Return the position of a contact along its arc in the other sense. It is computed from the
    key, so that rounding never puts a contact on an arc in one sense and off it in the other."""
    if full:
        return (TWO_PI - key) % TWO_PI
    return end - start - key


@kernel
def _free_tangents(
    place: Floats,
    a_count: int,
    full: Bools,
    base: Floats,
    reach: float,
    blockers: Blockers,
    pairs: Ints,
    stop: Ints,
) -> Floats:
    """Return the free directed segments between pairs of arcs and points, unsorted: rows of source,
    target, key, arrival key, length, ends (4), angles (2).

    Parameters
    ----------
    place
        Arcs, then points as arcs of radius 0.
    pairs
        (n, 2) places i < j.
    """
    eps = blockers.eps
    out = np.empty((256, 11))
    n = 0
    for pair in range(len(pairs)):
        if stop[0] != 0:
            break
        i, j = pairs[pair, 0], pairs[pair, 1]
        xi, yi, ri, si, ei = place[i, 0], place[i, 1], place[i, 2], place[i, 3], place[i, 4]
        xj, yj, rj, sj, ej = place[j, 0], place[j, 1], place[j, 2], place[j, 3], place[j, 4]
        dx, dy = xj - xi, yj - yi
        distance = math.hypot(dx, dy)
        heading = math.atan2(dy, dx)
        for ti in range(1 if i >= a_count else 2):
            for tj in range(1 if j >= a_count else 2):
                sense_i = 1 - 2 * ti
                sense_j = 1 - 2 * tj
                k = sense_j * rj - sense_i * ri
                gap = distance - abs(k)
                if gap < -eps or (distance == 0.0 and i < a_count):
                    continue
                # a point on a disk, or disks that touch from inside: the tangent has no length.
                # Its true length, a root of rounding, would blur angles and lengths to 1e-8
                length = 0.0 if gap <= eps else math.sqrt(gap * (distance + abs(k)))
                direction = heading - math.atan2(k, length)
                ux, uy = math.cos(direction), math.sin(direction)
                theta_i = direction - sense_i * 0.5 * math.pi
                theta_j = direction - sense_j * 0.5 * math.pi
                key_i, key_j = 0.0, 0.0
                back_i, back_j = 0.0, 0.0
                if i < a_count:
                    key_i = _arc_position(theta_i, sense_i, si, ei, full[i])
                    back_i = _reversed_position(key_i, si, ei, full[i])
                    if math.isnan(key_i):
                        continue
                if j < a_count:
                    key_j = _arc_position(theta_j, sense_j, sj, ej, full[j])
                    back_j = _reversed_position(key_j, sj, ej, full[j])
                    if math.isnan(key_j):
                        continue
                ax, ay = xi + sense_i * ri * uy, yi - sense_i * ri * ux
                bx, by = xj + sense_j * rj * uy, yj - sense_j * rj * ux
                if (
                    math.hypot(ax - base[0], ay - base[1]) > reach
                    or math.hypot(bx - base[0], by - base[1]) > reach
                ):
                    continue
                if segment_blocked(ax, ay, bx, by, blockers):
                    continue
                node_i = 2 * i + ti if i < a_count else a_count + i
                node_j = 2 * j + tj if j < a_count else a_count + j
                rev_i = node_i ^ 1 if i < a_count else node_i
                rev_j = node_j ^ 1 if j < a_count else node_j
                if n + 2 > len(out):
                    out = more_rows(out)
                out[n, 0], out[n, 1], out[n, 2], out[n, 3] = node_i, node_j, key_i, key_j
                out[n, 4], out[n, 5], out[n, 6] = length, ax, ay
                out[n, 7], out[n, 8], out[n, 9], out[n, 10] = bx, by, theta_i, theta_j
                n += 1
                out[n, 0], out[n, 1], out[n, 2], out[n, 3] = rev_j, rev_i, back_j, back_i
                out[n, 4], out[n, 5], out[n, 6] = length, bx, by
                out[n, 7], out[n, 8], out[n, 9], out[n, 10] = ax, ay, theta_j, theta_i
                n += 1
    return out[:n]


@kernel
def _write_letters(
    arcs: Floats,
    full: Bools,
    start: Ints,
    target: Ints,
    key: Floats,
    arrival_key: Floats,
    ends: Floats,
    angle: Floats,
    rays: Floats,
    order: Ints,
    stop: Ints,
) -> tuple[Ints, Floats, Floats, npt.NDArray[np.int32], Ints, Ints, Ints]:
    """Return the words of segments and of the arc pieces between arrivals and departures. Some are
    missing when the flag of a clock is set."""
    e_count = len(target)
    arc_nodes = 2 * len(arcs)
    first = np.full(e_count, -1, dtype=np.int64)
    turn = np.zeros(e_count)
    gap = np.full(e_count, -1.0)
    segment_row = np.zeros((e_count, 2), dtype=np.int64)
    arrival_row = np.zeros((e_count, 2), dtype=np.int64)
    gap_row = np.zeros((e_count, 2), dtype=np.int64)
    pool = np.empty(1024 + 8 * e_count, dtype=np.int32)
    n = int(np.int64(0))  # no literal: callees are compiled once
    room = 16 * (len(rays) + 1)
    for node in range(len(start) - 1):
        for e in range(start[node], start[node + 1]):
            if stop[0] != 0:
                break
            if n + 3 * room > len(pool):
                bigger = np.empty(2 * len(pool) + 3 * room, dtype=np.int32)
                for k in range(n):
                    bigger[k] = pool[k]
                pool = bigger
            segment_row[e, 0] = n
            n = segment_letters(
                ends[e, 0], ends[e, 1], ends[e, 2], ends[e, 3], rays, order, pool, n
            )
            segment_row[e, 1] = n
            if node < arc_nodes:
                a = node // 2
                cx, cy, r = arcs[a, 0], arcs[a, 1], arcs[a, 2]
                sense = 1.0 if node % 2 == 0 else -1.0
                nxt = e + 1
                step = -1.0
                if nxt < start[node + 1]:
                    step = key[nxt] - key[e]
                elif full[node // 2]:
                    nxt = start[node]
                    step = key[nxt] + TWO_PI - key[e]
                gap[e] = step
                if step >= 0.0:
                    gap_row[e, 0] = n
                    n = arc_letters(
                        cx,
                        cy,
                        r,
                        ends[e, 0],
                        ends[nxt, 0],
                        angle[e, 0],
                        sense * step,
                        rays,
                        order,
                        pool,
                        n,
                    )
                    gap_row[e, 1] = n
            else:
                gap[e] = 0.0 if e + 1 < start[node + 1] else -1.0
            goal = target[e]
            if goal < arc_nodes:
                a = goal // 2
                cx, cy, r = arcs[a, 0], arcs[a, 1], arcs[a, 2]
                sense = 1.0 if goal % 2 == 0 else -1.0
                lo, hi = start[goal], start[goal + 1]
                f = lo
                while f < hi and key[f] < arrival_key[e] - ANGLE_TOLERANCE:
                    f += 1
                wrap = 0.0
                if f == hi and full[goal // 2] and hi > lo:
                    f = lo
                    wrap = TWO_PI
                if f < hi:
                    # departures just before the cut of a whole circle, arrival just after it
                    if full[goal // 2] and wrap == 0.0 and f == lo:
                        earlier = hi - 1
                        while (
                            earlier > lo
                            and key[earlier] - TWO_PI >= arrival_key[e] - ANGLE_TOLERANCE
                        ):
                            f, wrap = earlier, -TWO_PI
                            earlier -= 1
                    first[e] = f
                    turn[e] = key[f] + wrap - arrival_key[e]
                    arrival_row[e, 0] = n
                    n = arc_letters(
                        cx,
                        cy,
                        r,
                        ends[e, 2],
                        ends[f, 0],
                        angle[e, 1],
                        sense * turn[e],
                        rays,
                        order,
                        pool,
                        n,
                    )
                    arrival_row[e, 1] = n
    return first, turn, gap, pool[:n].copy(), segment_row, arrival_row, gap_row
