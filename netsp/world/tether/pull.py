"""Pulling a strand taut without letting it through anything: the kernel of the geodesic model.

Invariant. Every node is on a surface or free, and no sample of an edge is deeper than a slip, delta
/ 8, inside a solid; samples are so dense that no point between them is deeper than delta / 4. A
motion either sweeps free water or is no longer than a stride, delta / 5. So no point of the strand
is ever deeper than 0.45 delta, and putting a node back on the surface sweeps no deeper than twice
that. Where distances are 1-Lipschitz, a solid thicker than 1.8 delta therefore keeps the strand on
its side, and the homotopy class never changes. Interpolated fields, as of meshes, may be steeper
(docs/theory/tether): for them this is observed, not proven.

Taut. With its nodes on rulings (`strand.update_frame`) the strand's length is, to first order in
the motions along them, a sum over edges. Its Hessian is tridiagonal. On cylinders and straight
edges, where rulings do not bend, its minimum is one Newton step away.
"""

from __future__ import annotations

import math

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
    is_resting,
    note_motion,
    release,
    remove_node,
    strand_length,
    sweep_is_free,
    to_surface,
    update_frame,
)
from netsp.world.tether.tether_policy import PullSettings
from netsp.world.tether.tips import sidestep_tips


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
    """Move one end to (x, y, z), the robot's if `last`, and pull the strand taut.

    Returns
    -------
    strand : ndarray
        The strand, copied where it had to grow.
    count : int
        Number of its nodes.
    residual : float
        Motion in the last round, metres.
    """
    delta = settings.delta
    stride, slip = settings.stride, settings.slip
    end = count - 1 if last else 0
    left = 2.0
    residual = 0.0
    ox, oy, oz = strand[end, X], strand[end, Y], strand[end, Z]
    path = math.sqrt((x - ox) ** 2 + (y - oy) ** 2 + (z - oz) ** 2)
    # a node moves by at most a stride in each round
    last_rounds = settings.rounds + min(2000, int(path / stride))
    is_standing = path <= 0.1 * stride
    if is_standing:
        last_rounds *= settings.standing_factor
    while left > 0.0:
        end = count - 1 if last else 0
        next_to = end - 1 if last else 1
        ax, ay, az = strand[end, X], strand[end, Y], strand[end, Z]
        dx, dy, dz = x - ax, y - ay, z - az
        motion = math.sqrt(dx * dx + dy * dy + dz * dz)
        cx, cy, cz = strand[next_to, X], strand[next_to, Y], strand[next_to, Z]
        f = 1.0
        while f * motion > 1.001 * stride:
            bx, by, bz = ax + f * dx, ay + f * dy, az + f * dz
            if sweep_is_free(field, cx, cy, cz, ax, ay, az, bx, by, bz, slip):
                break
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
            field,
            strand,
            count,
            settings,
            last_rounds if left == 0.0 else settings.passing_rounds,
            settings.max_extra_rounds if left == 0.0 and settings.spread <= delta else 0,
            settings.max_sidesteps if is_standing else 1,
        )
    return strand, count, residual


@kernel
def pull(
    field: Field,
    strand: Floats,
    count: int,
    settings: PullSettings,
    rounds: int,
    extra: int,
    steps: int,
) -> tuple[Floats, int, float]:
    """Pull a strand taut in rounds, until no node moves by more than the precision.

    A round puts back edges that are too deep, drops nodes that hold nothing, and slides the others
    to where the strand is shortest. Returns as `pull_end` does.

    Parameters
    ----------
    rounds : int
        Maximum number of rounds.
    extra : int
        Maximum number of rounds added for a strand that has come off something.
    steps : int
        Maximum number of sidesteps off the tips of corners.
    """
    delta, precision = settings.delta, settings.precision
    slip, stride = settings.slip, settings.stride
    min_gain = settings.min_gain * precision
    residual, damping, gain = 0.0, 1.0, 1.0
    room = count + 64 + int(0.5 * strand_length(strand, count) / slip)
    for i in range(count):
        strand[i, STEP] = 0.0  # steps for other positions of the ends do not apply
    done, is_thorough, length = 0, rounds > settings.passing_rounds, math.inf
    shortest, vain_rounds = math.inf, 0
    # an end that has moved far allows many rounds, in case all of them are needed
    patience = rounds
    if extra > 0 and rounds > 2 * settings.patience_rounds:
        patience = settings.patience_rounds + rounds // settings.rounds_per_patience
    while done < rounds:
        done += 1
        before, length_before = count, strand_length(strand, count)
        strand, count = mend(field, strand, count, settings, room, slip)
        is_changed = count != before
        residual = refresh_frames(field, strand, count, settings, delta)
        before = count
        count, lifted = drop_free_nodes(field, strand, count, settings)
        is_changed = is_changed or lifted > 0.0 or count != before
        unmoved = strand_length(strand, count)
        ahead, gain = slide_contacts(field, strand, count, settings, damping, gain)
        residual = max(residual, ahead)
        # shorten steps where the full one overshoots
        is_longer = strand_length(strand, count) > unmoved + 1e-3 * precision
        damping = max(0.1, 0.5 * damping) if is_longer else min(1.0, 1.5 * damping)
        is_still = not is_changed and residual <= precision
        new_length = strand_length(strand, count)
        fall = length_before - new_length
        vain_rounds = vain_rounds + 1 if new_length > shortest - min_gain else 0
        shortest = min(shortest, new_length)
        is_exhausted = vain_rounds >= patience and done < rounds
        if is_thorough and (
            is_still or ((done == rounds or is_exhausted) and fall <= settings.min_fall * stride)
        ):
            strand, count = mend(field, strand, count, settings, room, slip)
            # sidesteps again only if the last ones have shortened the strand
            last_length, length = length, strand_length(strand, count)
            came_off = False
            if length < last_length - min_gain:
                strand, count, came_off = sidestep_tips(
                    field, strand, count, settings, room, steps, is_still
                )
            if came_off:
                rounds, vain_rounds = max(rounds, done + 2), 0
                continue
        if is_still or is_exhausted:
            break
        # pull on for as long as a strand that has come off something becomes shorter
        if done == rounds and fall > settings.min_fall * stride and extra > 0:
            extra -= 1
            rounds += 1
    strand, count = mend(field, strand, count, settings, room, slip)
    refresh_frames(field, strand, count, settings, 1e30)  # new nodes only
    return strand, count, residual


@kernel
def refresh_frames(
    field: Field, strand: Floats, count: int, settings: PullSettings, reach: float
) -> float:
    """Update the frames of contacts that have moved by more than 0.15 of `reach`.

    Returns the largest correction of a position.
    """
    largest = 0.0
    for i in range(1, count - 1):
        # a released node stays in the air until it lands; then STALE is infinite
        if strand[i, STALE] > 0.15 * reach and (
            is_resting(strand, i) or strand[i, STALE] == math.inf
        ):
            motion = update_frame(field, strand, i, settings)
            note_motion(strand, count, i, motion)
            strand[i, STALE] = 0.0
            largest = max(largest, motion)
    return largest


@kernel
def drop_free_nodes(
    field: Field, strand: Floats, count: int, settings: PullSettings
) -> tuple[int, float]:
    """Drop nodes that hold nothing: those on a line, and those that the strand leaves.

    A node that cannot move freely to the line between its neighbours is brought nearer to it.
    Returns the number of nodes and the largest motion.
    """
    slip, stride = settings.slip, settings.stride
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
        holds = is_held(strand, i, la, lb, settings)
        if h <= (0.125 * slip if holds else stride):
            count = remove_node(strand, count, i)
            lifted = max(lifted, h)
            # short motions are checked in the next round, because two in a row would add up
            i = max(1, i - 1) if holds else i + 1
            continue
        if not holds:
            f = free_part(field, strand, i, hx, hy, hz, settings)
            lifted = max(lifted, f * h)
            if f == 1.0:
                count = remove_node(strand, count, i)
                i = max(1, i - 1)
                continue
            px, py, pz = px + f * hx, py + f * hy, pz + f * hz
            d = distance(field, px, py, pz)
            release(strand, i)
            note_motion(strand, count, i, f * h)
            if d < 0.0:
                px, py, pz = to_surface(field, px, py, pz, 1e-3 * stride)
                note_motion(strand, count, i, math.inf)
            strand[i, X], strand[i, Y], strand[i, Z] = px, py, pz
        i += 1
    return count, lifted


@kernel
def is_held(strand: Floats, i: int, before: float, after: float, settings: PullSettings) -> bool:
    """Return whether the surface holds node i, whose edges have the given lengths."""
    if before <= 0.0 or after <= 0.0:
        return False
    px, py, pz = strand[i, X], strand[i, Y], strand[i, Z]
    ax, ay, az = strand[i - 1, X], strand[i - 1, Y], strand[i - 1, Z]
    fx = (strand[i + 1, X] - px) / after - (px - ax) / before
    fy = (strand[i + 1, Y] - py) / after - (py - ay) / before
    fz = (strand[i + 1, Z] - pz) / after - (pz - az) / before
    pressed = -(fx * strand[i, NX] + fy * strand[i, NY] + fz * strand[i, NZ])
    force = math.sqrt(fx * fx + fy * fy + fz * fz)
    along = fx * strand[i, EX] + fy * strand[i, EY] + fz * strand[i, EZ]
    sine, friction = settings.max_cone_sine, settings.hold_friction
    if strand[i, SHARP] == 1.0:
        across = math.sqrt(max(force * force - along * along, 0.0))
        is_pressed = pressed > settings.min_sharp_pressed_share * force
        # friction widens the cone by its angle
        cosine = strand[i, CONE] - friction * math.sqrt(max(1.0 - strand[i, CONE] ** 2, 0.0))
        cosine /= math.sqrt(1.0 + friction * friction)
        return bool(is_pressed and pressed > (cosine - sine) * across)
    if not pressed > settings.min_pressed_share * force:
        return False
    if strand[i, CONE] == 0.0:
        return True
    pull_off = strand[i, CONE] * along - friction * pressed
    return bool(pull_off <= (-sine if strand[i, PART] >= 0.0 else sine) * force)


@kernel
def free_part(
    field: Field, strand: Floats, i: int, hx: float, hy: float, hz: float, settings: PullSettings
) -> float:
    """Return the part of a motion (hx, hy, hz) of node i that sweeps free water or is a stride."""
    slip, stride = settings.slip, settings.stride
    px, py, pz = strand[i, X], strand[i, Y], strand[i, Z]
    ax, ay, az = strand[i - 1, X], strand[i - 1, Y], strand[i - 1, Z]
    bx, by, bz = strand[i + 1, X], strand[i + 1, Y], strand[i + 1, Z]
    h = math.sqrt(hx * hx + hy * hy + hz * hz)
    f = 1.0
    while f * h > 1.001 * stride:
        qx, qy, qz = px + f * hx, py + f * hy, pz + f * hz
        is_free = sweep_is_free(field, ax, ay, az, px, py, pz, qx, qy, qz, slip)
        if is_free and sweep_is_free(field, bx, by, bz, px, py, pz, qx, qy, qz, slip):
            break
        f = max(0.5 * f, stride / h)
    return f


@kernel
def slide_contacts(
    field: Field, strand: Floats, count: int, settings: PullSettings, damping: float, gain: float
) -> tuple[float, float]:
    """Take one Newton step of the length in the motions of the contacts along their directions.

    `gain` is the factor on the step before. Returns the largest distance still to go, and the
    factor.
    """
    stride, precision = settings.stride, settings.precision
    n = count - 2
    if n < 1:
        return 0.0, 1.0
    slope, diagonal, beside, pressing, around = length_derivatives(strand, count, settings)
    if settings.hold_friction > 0.0:
        resist_sliding(slope, diagonal, beside, pressing, settings.hold_friction)
    pull_along = slope.copy()
    eliminate(slope, diagonal, beside, settings.min_pivot_share)
    ahead = 0.0
    for k in range(n - 1, -1, -1):
        right = slope[k]
        if k < n - 1:
            right -= beside[k] * slope[k + 1]
        slope[k] = right / diagonal[k]
        # no node has farther to go than past its neighbours
        ahead = max(ahead, min(abs(slope[k]), around[k]))
    gain = step_factor(strand, slope, gain, settings.max_step_factor)
    saved = 0.0
    for k in range(n):
        saved += 0.5 * gain * pull_along[k] * slope[k]
    if saved <= settings.min_gain * precision:
        return 0.0, gain
    f = damping * gain
    before = strand[1 : count - 1, X : Z + 1].copy()
    for k in range(n):
        step = min(max(-f * slope[k], -stride), stride)
        if abs(step) <= 0.1 * precision:
            continue
        i = k + 1
        strand[i, X] += step * strand[i, EX]
        strand[i, Y] += step * strand[i, EY]
        strand[i, Z] += step * strand[i, EZ]
        if strand[i, SHARP] == 0.0:  # rulings bend, edges do not
            strand[i, X], strand[i, Y], strand[i, Z] = to_surface(
                field, strand[i, X], strand[i, Y], strand[i, Z], 1e-3 * stride
            )
        note_motion(strand, count, i, abs(step))
    undo_lengthening_steps(strand, before, settings.max_halvings)
    return max(gain, f) * ahead, max(f, 1e-3)


@kernel
def length_derivatives(
    strand: Floats, count: int, settings: PullSettings
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return the derivatives of the length in the motions of inner nodes along their directions.

    Returns
    -------
    slope, diagonal, beside : ndarray, shape (n,)
        Gradient, diagonal and upper diagonal of the Hessian, which is tridiagonal.
    pressing : ndarray, shape (n,)
        Force that presses each node onto its surface, per unit of tension.
    around : ndarray, shape (n,)
        Sum of the lengths of both edges of each node, metres.
    """
    n = count - 2
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
            diagonal[k - 1] += (1.0 - a * a + settings.sliding_stiffness * a**16) / length
            pressing[k - 1] -= ux * strand[k, NX] + uy * strand[k, NY] + uz * strand[k, NZ]
        if k < n:
            pressing[k] += ux * strand[k + 1, NX] + uy * strand[k + 1, NY] + uz * strand[k + 1, NZ]
            slope[k] += b
            diagonal[k] += (1.0 - b * b + settings.sliding_stiffness * b**16) / length
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
        diagonal[k] -= min(bend, settings.max_convex_share * diagonal[k])
        # a contact that is met head on cannot slide: a small weight keeps the system regular
        diagonal[k] = diagonal[k] * (1.0 + 1e-9) + 1e-9
    return slope, diagonal, beside, pressing, around


@kernel
def resist_sliding(
    slope: Floats, diagonal: Floats, beside: Floats, pressing: Floats, friction: float
) -> None:
    """Reduce the pull along the slide directions by friction, in place.

    A contact that friction holds gets no pull, and no neighbour moves it.
    """
    for k in range(len(slope)):
        resistance = friction * max(pressing[k], 0.0)
        if abs(slope[k]) > resistance:
            slope[k] -= math.copysign(resistance, slope[k])
            continue
        slope[k], diagonal[k] = 0.0, 1.0
        if k > 0:
            beside[k - 1] = 0.0
        if k < len(beside):
            beside[k] = 0.0


@kernel
def eliminate(slope: Floats, diagonal: Floats, beside: Floats, min_pivot_share: float) -> None:
    """Eliminate below the diagonal of a tridiagonal symmetric system, in place; no pivot becomes
    less than a share of what it was."""
    stiffness = diagonal.copy()
    for k in range(1, len(slope)):
        w = beside[k - 1] / diagonal[k - 1]
        diagonal[k] = max(diagonal[k] - w * beside[k - 1], min_pivot_share * stiffness[k])
        slope[k] -= w * slope[k - 1]


@kernel
def step_factor(strand: Floats, steps: Floats, before: float, max_factor: float) -> float:
    """Return the factor on Newton steps that would have made the last one exact, and note the new
    steps.

    The distance to go, e, shrinks by ``before * s`` when a step s = c e is taken ``before`` times.
    Two steps in a row give c, and the next step is taken 1 / c times.
    """
    both, last = 0.0, 0.0
    for k in range(len(steps)):
        both += steps[k] * strand[k + 1, STEP]
        last += strand[k + 1, STEP] ** 2
        strand[k + 1, STEP] = steps[k]
    share = (1.0 - both / last) / before if last > 0.0 else 1.0
    return 1.0 / min(1.0, max(share, 1.0 / max_factor))


@kernel
def undo_lengthening_steps(strand: Floats, before: Floats, max_halvings: int) -> None:
    """Put back each contact whose step made the strand longer, or let it take a shorter step.

    Where solids meet in creases, or contacts are nearer to one another than their steps, a Newton
    step need not shorten the strand, and edges that it folds would be mended by ever more nodes.
    `before` (n, 3) holds the positions before the step.
    """
    undone, step = np.zeros(len(before), dtype=np.bool_), np.empty((len(before), 3))
    for k in range(len(before)):
        i = k + 1
        length = gap(strand, i - 1, i) + gap(strand, i, i + 1)
        x, y, z = strand[i, X], strand[i, Y], strand[i, Z]
        strand[i, X], strand[i, Y], strand[i, Z] = before[k, 0], before[k, 1], before[k, 2]
        if length <= gap(strand, i - 1, i) + gap(strand, i, i + 1):
            strand[i, X], strand[i, Y], strand[i, Z] = x, y, z
        else:
            undone[k] = True
            step[k, 0], step[k, 1], step[k, 2] = (
                x - before[k, 0],
                y - before[k, 1],
                z - before[k, 2],
            )
    for k in range(len(before)):
        i, share = k + 1, 1.0
        if not undone[k] or strand[i, PART] < 0.0:
            continue  # the normals of voxels are too rough for parts of steps
        length = gap(strand, i - 1, i) + gap(strand, i, i + 1)
        for _ in range(max_halvings):
            share *= 0.5
            strand[i, X] = before[k, 0] + share * step[k, 0]
            strand[i, Y] = before[k, 1] + share * step[k, 1]
            strand[i, Z] = before[k, 2] + share * step[k, 2]
            if gap(strand, i - 1, i) + gap(strand, i, i + 1) < length:
                undone[k] = False
                break
        if undone[k]:
            strand[i, X], strand[i, Y], strand[i, Z] = before[k, 0], before[k, 1], before[k, 2]
