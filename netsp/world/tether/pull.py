"""Pull a strand taut without letting it through anything: the kernel of the geodesic model.

Invariant: every node is on a surface or free, and no sample of an edge is deeper than ``slip`` =
delta / 8 inside a solid, the samples so dense that no point between them is deeper than delta / 4.
A motion either sweeps free water, or is no longer than ``stride`` = delta / 5. So no point of the
strand is ever deeper than 0.45 delta, and putting a node back on the surface sweeps no deeper than
twice that. A solid thicker than 1.8 delta therefore keeps the strand on its side: the homotopy
class never changes. (Distances are 1-Lipschitz; that is all the argument needs.)

Taut: with its nodes on rulings (`strand.take_frame`) the strand's length is, to first order in the
motions along them, a sum over edges; its Hessian is tridiagonal and its minimum one Newton step
away on cylinders and straight edges, where the rulings do not bend.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.compiled.kernel import kernel
from netsp.world.scene.sampling import Field, distance
from netsp.world.tether.mend import mend
from netsp.world.tether.strand import (
    CONE,
    CURVE,
    EX,
    EY,
    EZ,
    NX,
    NY,
    NZ,
    PART,
    SHARP,
    STALE,
    STEP,
    X,
    Y,
    Z,
    gap,
    let_go,
    note_motion,
    remove,
    rests,
    strand_length,
    sweep_is_free,
    take_frame,
    to_surface,
)
from netsp.world.tether.tips import MOST_NUDGE, nudge

SLIP, STRIDE = 0.125, 0.2
"""In units of delta; see above."""

HELD, HELD_SHARP = 0.5, 0.2
"""A contact holds the strand when at least this share of the two edges' pull goes into the surface:
else the strand slips off, as where it doubles back."""

LOOSE = 0.03
"""How far, as a sine, a pull may leave the cone of both faces before an edge lets go."""

DAMPING = 0.02
"""Stiffness of a contact that slides along the strand itself: it has none of its own, and no reason
to move."""

WORTH = 0.4
"""A step is not taken unless it shortens the strand by this share of the precision: where all
positions are nearly as good, rounding would keep the strand moving."""


PIVOT = 0.1
"""Least share of a contact's own stiffness that elimination leaves."""

MOST_GAIN = 10.0
"""Newton steps are lengthened by at most this: where rulings bend, they fall short of the minimum
by a factor that shows from one step to the next."""

FALLS, MORE_ROUNDS = 0.05, 60
"""A strand that a round makes shorter by so many strides has come off something: it gets up to so
many rounds more. Not where delta is finer than the voxels: there it crumples over them instead."""

HALVINGS = 4
"""How often a step that went too far is halved."""

PATIENCE, SHARE = 8, 20
"""A strand that has become no shorter for so many rounds, and for one more in so many of all, is as
taut as it gets: over rims and braces its nodes may come and go for ever (91 to 93 of them on a
retreat through a jetty, the length to and fro by 0.02 %)."""

STANDING = 40
"""Times the rounds for a strand whose ends stand still: what is slipping slowly comes to rest."""

PASSING = 2
"""Rounds of a pull on the way, where the end of the strand moves on at once."""

CONVEX = 0.5
"""Most of a contact's stiffness that convexity may take away: on a sphere all of it goes where the
strand reaches half way round."""


class PullSettings(NamedTuple):
    """Of the model: delta (m); spread (m), how far around it a contact's normals are asked; flat,
    the sine between normals that are taken for one; rounds of an update; precision (m), the motion
    below which nothing is done."""

    delta: float
    spread: float
    flat: float
    rounds: int
    precision: float


@kernel
def pull_end(
    field: Field,
    strand: Floats,
    count: int,
    last: bool,
    x: float,
    y: float,
    z: float,
    settings: PullSettings,
) -> tuple[Floats, int, float]:
    """Move one end (the robot's if `last`) to (x, y, z) and pull taut. Returns (strand, count,
    residual): the strand may have been copied to grow; residual is the last round's motion."""
    delta = settings.delta
    stride, slip = STRIDE * delta, SLIP * delta
    end = count - 1 if last else 0
    left = 2.0
    residual = 0.0
    ox, oy, oz = strand[end, X], strand[end, Y], strand[end, Z]
    path = math.sqrt((x - ox) ** 2 + (y - oy) ** 2 + (z - oz) ** 2)
    # the last round's count grows with the path: a node moves by at most a stride in each
    last_rounds = settings.rounds + min(2000, int(path / stride))
    standing = path <= 0.1 * stride
    if standing:
        last_rounds *= STANDING
    while left > 0.0:
        end = count - 1 if last else 0
        next_to = end - 1 if last else 1
        ax, ay, az = strand[end, X], strand[end, Y], strand[end, Z]
        dx, dy, dz = x - ax, y - ay, z - az
        motion = math.sqrt(dx * dx + dy * dy + dz * dz)
        f = 1.0
        while f * motion > 1.001 * stride and not sweep_is_free(
            field,
            strand[next_to, X], strand[next_to, Y], strand[next_to, Z],
            ax, ay, az, ax + f * dx, ay + f * dy, az + f * dz,
            slip,
        ):  # fmt: skip
            f = max(0.5 * f, stride / motion)
        left = 1.0 - f
        if f == 1.0:
            strand[end, X], strand[end, Y], strand[end, Z] = x, y, z
        else:
            strand[end, X] += f * dx
            strand[end, Y] += f * dy
            strand[end, Z] += f * dz
        note_motion(strand, count, end, f * motion)
        strand, count, residual = pull(
            field, strand, count, settings, last_rounds if left == 0.0 else PASSING,
            MORE_ROUNDS if left == 0.0 and settings.spread <= delta else 0,
            MOST_NUDGE if standing else 1,
        )  # fmt: skip
    return strand, count, residual


@kernel
def pull(
    field: Field,
    strand: Floats,
    count: int,
    settings: PullSettings,
    rounds: int,
    more: int,
    steps: int,
) -> tuple[Floats, int, float]:
    """Rounds of: put edges back that went too deep, drop nodes that hold nothing, slide the others
    to where the strand is shortest; until no node moves by more than the precision. Up to `more`
    rounds are added for a strand that has come off something; what hangs is taken sideways in up to
    so many steps."""
    delta, precision = settings.delta, settings.precision
    slip, stride = SLIP * delta, STRIDE * delta
    most, damping, gain = 0.0, 1.0, 1.0
    room = count + 64 + int(0.5 * strand_length(strand, count) / slip)
    for i in range(count):
        strand[i, STEP] = 0.0  # steps of another position of the ends say nothing about this one
    done, thorough, length = 0, rounds > PASSING, math.inf
    shortest, in_vain = math.inf, 0
    # an end that has come far asks for many rounds, in case all of them are needed
    patience = PATIENCE + rounds // SHARE if more > 0 and rounds > 2 * PATIENCE else rounds
    while done < rounds:
        done += 1
        before, began = count, strand_length(strand, count)
        strand, count = mend(field, strand, count, slip, room, slip)
        changed = count != before
        most = refresh(field, strand, count, settings, delta)
        before = count
        count, lifted = lift(field, strand, count, slip, stride)
        changed = changed or lifted > 0.0 or count != before
        was = strand_length(strand, count)
        ahead, gain = slide(field, strand, count, stride, precision, damping, gain)
        most = max(most, ahead)
        # shorter steps where the full one overshoots
        longer = strand_length(strand, count) > was + 1e-3 * precision
        damping = max(0.1, 0.5 * damping) if longer else min(1.0, 1.5 * damping)
        still = not changed and most <= precision
        now = strand_length(strand, count)
        fell = began - now
        in_vain = in_vain + 1 if now > shortest - WORTH * precision else 0
        shortest = min(shortest, now)
        tired = in_vain >= patience and done < rounds
        if thorough and (still or ((done == rounds or tired) and fell <= FALLS * stride)):
            worth = WORTH * precision
            strand, count = mend(field, strand, count, slip, room, slip)
            # once more only if the last time has come to something
            least, length = length, strand_length(strand, count)
            came_off = False
            if length < least - worth:
                strand, count, came_off = nudge(
                    field, strand, count, slip, stride, room, worth, steps
                )
            if came_off:
                rounds, in_vain = max(rounds, done + 2), 0
                continue
        if still or tired:
            break
        # what has slipped off is followed, as long as that shortens the strand
        if done == rounds and fell > FALLS * stride and more > 0:
            more -= 1
            rounds += 1
    strand, count = mend(field, strand, count, slip, room, slip)
    refresh(field, strand, count, settings, 1e30)  # new nodes only
    return strand, count, most


@kernel
def refresh(
    field: Field,
    strand: Floats,
    count: int,
    settings: PullSettings,
    reach: float,
) -> float:
    """Take the frames of contacts that have moved by more than a part of `reach`; the largest
    correction of a position."""
    most = 0.0
    for i in range(1, count - 1):
        # a node that was let go stays in the air until it lands (STALE is infinite then)
        if strand[i, STALE] > 0.15 * reach and (rests(strand, i) or strand[i, STALE] == math.inf):
            by = take_frame(
                field, strand, i, settings.spread, settings.flat, STRIDE * settings.delta
            )
            note_motion(strand, count, i, by)
            strand[i, STALE] = 0.0
            most = max(most, by)
    return most


@kernel
def lift(field: Field, strand: Floats, count: int, slip: float, stride: float) -> tuple[int, float]:
    """Drop nodes that hold nothing: those that the strand would leave, and those on a line. A node
    that cannot reach the line between its neighbours freely is only brought nearer."""
    lifted = 0.0
    i = 1
    while i < count - 1:
        px, py, pz = strand[i, X], strand[i, Y], strand[i, Z]
        ax, ay, az = strand[i - 1, X], strand[i - 1, Y], strand[i - 1, Z]
        bx, by, bz = strand[i + 1, X] - ax, strand[i + 1, Y] - ay, strand[i + 1, Z] - az
        bb = bx * bx + by * by + bz * bz
        t = 0.0
        if bb > 0.0:
            t = min(1.0, max(0.0, ((px - ax) * bx + (py - ay) * by + (pz - az) * bz) / bb))
        # from the node to the line
        hx, hy, hz = ax + t * bx - px, ay + t * by - py, az + t * bz - pz
        h = math.sqrt(hx * hx + hy * hy + hz * hz)
        la, lb = gap(strand, i - 1, i), gap(strand, i, i + 1)
        held = False
        if la > 0.0 and lb > 0.0:
            fx = (strand[i + 1, X] - px) / lb - (px - ax) / la
            fy = (strand[i + 1, Y] - py) / lb - (py - ay) / la
            fz = (strand[i + 1, Z] - pz) / lb - (pz - az) / la
            pressed = -(fx * strand[i, NX] + fy * strand[i, NY] + fz * strand[i, NZ])
            force = math.sqrt(fx * fx + fy * fy + fz * fz)
            along = fx * strand[i, EX] + fy * strand[i, EY] + fz * strand[i, EZ]
            if strand[i, SHARP] == 1.0:
                across = math.sqrt(max(force * force - along * along, 0.0))
                held = pressed > HELD_SHARP * force and pressed > (strand[i, CONE] - LOOSE) * across
            else:
                held = pressed > HELD * force and (
                    strand[i, CONE] == 0.0
                    or strand[i, CONE] * along
                    <= (-LOOSE if strand[i, PART] >= 0.0 else LOOSE) * force
                )
        if h <= (0.125 * slip if held else stride):
            count = remove(strand, count, i)
            lifted = max(lifted, h)
            # short paths are not looked at before the next round: two in a row would add up
            i = max(1, i - 1) if held else i + 1
            continue
        if not held:
            f = 1.0
            while f * h > 1.001 * stride and not (
                sweep_is_free(
                    field, ax, ay, az, px, py, pz, px + f * hx, py + f * hy, pz + f * hz, slip
                )
                and sweep_is_free(
                    field, strand[i + 1, X], strand[i + 1, Y], strand[i + 1, Z],
                    px, py, pz, px + f * hx, py + f * hy, pz + f * hz, slip,
                )
            ):  # fmt: skip
                f = max(0.5 * f, stride / h)
            lifted = max(lifted, f * h)
            if f == 1.0:
                count = remove(strand, count, i)
                i = max(1, i - 1)
                continue
            px, py, pz = px + f * hx, py + f * hy, pz + f * hz
            d = distance(field, px, py, pz)
            let_go(strand, i)
            note_motion(strand, count, i, f * h)
            if d < 0.0:
                px, py, pz = to_surface(field, px, py, pz, 1e-3 * stride)
                note_motion(strand, count, i, math.inf)
            strand[i, X], strand[i, Y], strand[i, Z] = px, py, pz
        i += 1
    return count, lifted


@kernel
def slide(
    field: Field,
    strand: Floats,
    count: int,
    stride: float,
    precision: float,
    damping: float,
    gain: float,
) -> tuple[float, float]:
    """One Newton step of the length in the motions of the contacts along their directions. `gain`
    is what the step before was multiplied by. Returns (largest distance still to go, gain)."""
    n = count - 2
    if n < 1:
        return 0.0, 1.0
    slope, diagonal, beside = np.zeros(n), np.zeros(n), np.zeros(n)
    pressing, around = np.zeros(n), np.zeros(n)
    for k in range(count - 1):
        length = gap(strand, k, k + 1)
        if k > 0:
            around[k - 1] += length
        if k < n:
            around[k] += length
        if length < 1e-12:
            continue
        ux = (strand[k + 1, X] - strand[k, X]) / length
        uy = (strand[k + 1, Y] - strand[k, Y]) / length
        uz = (strand[k + 1, Z] - strand[k, Z]) / length
        # motions of both ends perpendicular to the edge
        a = strand[k, EX] * ux + strand[k, EY] * uy + strand[k, EZ] * uz
        b = strand[k + 1, EX] * ux + strand[k + 1, EY] * uy + strand[k + 1, EZ] * uz
        if k > 0:
            slope[k - 1] -= a
            diagonal[k - 1] += (1.0 - a * a + DAMPING * a**16) / length
            pressing[k - 1] -= ux * strand[k, NX] + uy * strand[k, NY] + uz * strand[k, NZ]
        if k < n:
            pressing[k] += ux * strand[k + 1, NX] + uy * strand[k + 1, NY] + uz * strand[k + 1, NZ]
            slope[k] += b
            diagonal[k] += (1.0 - b * b + DAMPING * b**16) / length
        if 0 < k < n:
            ee = (
                strand[k, EX] * strand[k + 1, EX]
                + strand[k, EY] * strand[k + 1, EY]
                + strand[k, EZ] * strand[k + 1, EZ]
            )
            beside[k - 1] = -(ee - a * b) / length
    for k in range(n):
        # sliding by t takes a contact t^2 curvature / 2 off its tangent plane, where it is pressed
        bend = max(pressing[k], 0.0) * strand[k + 1, CURVE]
        diagonal[k] -= min(bend, CONVEX * diagonal[k])
        # a contact that is met head on cannot slide: a small weight keeps the system regular
        diagonal[k] = diagonal[k] * (1.0 + 1e-9) + 1e-9
    pull_along = slope.copy()
    stiffness = diagonal.copy()
    for k in range(1, n):
        w = beside[k - 1] / diagonal[k - 1]
        # where the strand is not convex, a pivot would vanish and the step know no end
        diagonal[k] = max(diagonal[k] - w * beside[k - 1], PIVOT * stiffness[k])
        slope[k] -= w * slope[k - 1]
    most = 0.0
    for k in range(n - 1, -1, -1):
        right = slope[k]
        if k < n - 1:
            right -= beside[k] * slope[k + 1]
        slope[k] = right / diagonal[k]
        # nothing has farther to go than past its neighbours
        most = max(most, min(abs(slope[k]), around[k]))
    # e, the distance to go, shrinks by gain * s when a step s = c e was taken gain times: c follows
    # from two steps, and the next is taken 1 / c times
    both, last = 0.0, 0.0
    for k in range(n):
        both += slope[k] * strand[k + 1, STEP]
        last += strand[k + 1, STEP] ** 2
        strand[k + 1, STEP] = slope[k]
    share = (1.0 - both / last) / gain if last > 0.0 else 1.0
    gain = 1.0 / min(1.0, max(share, 1.0 / MOST_GAIN))
    saved = 0.0
    for k in range(n):
        saved += 0.5 * gain * pull_along[k] * slope[k]
    if saved <= WORTH * precision:
        return 0.0, gain
    f = damping * gain
    was = strand[1 : count - 1, X : Z + 1].copy()
    for k in range(n):
        by = min(max(-f * slope[k], -stride), stride)
        if abs(by) <= 0.1 * precision:
            continue
        i = k + 1
        strand[i, X] += by * strand[i, EX]
        strand[i, Y] += by * strand[i, EY]
        strand[i, Z] += by * strand[i, EZ]
        if strand[i, SHARP] == 0.0:  # rulings bend, edges do not
            strand[i, X], strand[i, Y], strand[i, Z] = to_surface(
                field, strand[i, X], strand[i, Y], strand[i, Z], 1e-3 * stride
            )
        note_motion(strand, count, i, abs(by))
    put_back(strand, was)
    return max(gain, f) * most, max(f, 1e-3)


@kernel
def put_back(strand: Floats, was: Floats) -> None:
    """Descent: each contact that now makes the strand longer than it would where it was goes back
    there, and then a part of its step if that alone makes the strand shorter. Where solids meet in
    creases, or contacts are nearer to one another than they step, a Newton step need not shorten
    anything, and what it folds would be mended by more and more nodes."""
    back, step = np.zeros(len(was), dtype=np.bool_), np.empty((len(was), 3))
    for k in range(len(was)):
        i = k + 1
        here = gap(strand, i - 1, i) + gap(strand, i, i + 1)
        x, y, z = strand[i, X], strand[i, Y], strand[i, Z]
        strand[i, X], strand[i, Y], strand[i, Z] = was[k, 0], was[k, 1], was[k, 2]
        if here <= gap(strand, i - 1, i) + gap(strand, i, i + 1):
            strand[i, X], strand[i, Y], strand[i, Z] = x, y, z
        else:
            back[k] = True
            step[k, 0], step[k, 1], step[k, 2] = x - was[k, 0], y - was[k, 1], z - was[k, 2]
    for k in range(len(was)):
        i, share = k + 1, 1.0
        if not back[k] or strand[i, PART] < 0.0:
            continue  # normals of voxels are too rough for it
        there = gap(strand, i - 1, i) + gap(strand, i, i + 1)
        for _ in range(HALVINGS):
            share *= 0.5
            strand[i, X] = was[k, 0] + share * step[k, 0]
            strand[i, Y] = was[k, 1] + share * step[k, 1]
            strand[i, Z] = was[k, 2] + share * step[k, 2]
            if gap(strand, i - 1, i) + gap(strand, i, i + 1) < there:
                back[k] = False
                break
        if back[k]:
            strand[i, X], strand[i, Y], strand[i, Z] = was[k, 0], was[k, 1], was[k, 2]
