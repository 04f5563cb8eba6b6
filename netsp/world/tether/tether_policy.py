"""Policy of the tether models: when contacts hold, how far nodes move, and when pulling ends."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import NamedTuple

from netsp.base.number_ranges import check_not_negative

SLIP = 0.125
"""Tolerance for the depth of an edge inside a solid, in units of delta.

`SLIP`, `STRIDE` and `THINNEST` belong together: the proof in `netsp.world.tether.pull` that a
strand keeps its homotopy class holds for these three values.
"""

STRIDE = 0.2
"""Tolerance for the length of a motion whose path is not checked, in units of delta."""

THINNEST = 1.8
"""Tolerance for the thickness of a solid, in units of delta: a strand never passes through a
thicker one."""


@dataclass(frozen=True)
class TetherPolicy:
    """Policy of the geodesic tether model. No number is negative.

    A stride is `STRIDE` times delta, a slip `SLIP` times delta.

    Attributes
    ----------
    min_pressed_share
        Minimum share of the pull of two edges that presses into the surface at a contact. With
        less, the strand leaves the contact, as where it doubles back.
    min_sharp_pressed_share
        The same on a sharp edge.
    min_sharp_sine
        Sine of the angle between the normals on both sides of a contact from which on the contact
        lies on a sharp edge. The default is 30 degrees.
    max_cone_sine
        Sine of the angle by which a pull may leave the cone between the normals of both faces
        before a sharp edge releases the strand.
    sliding_stiffness
        Stiffness of a contact that slides along the strand itself. Such a contact has no stiffness
        of its own and no reason to move.
    min_gain
        Minimum reduction of the length by a step, as a share of the precision. Where all positions
        are nearly as good, smaller steps would only follow rounding errors.
    min_pivot_share
        Minimum share of a contact's stiffness that elimination leaves. Where the length is not
        convex, pivots would vanish and steps become endless.
    max_step_factor
        Maximum factor by which a Newton step is lengthened. Steps fall short where rulings bend.
    max_convex_share
        Maximum share of a contact's stiffness that the curvature of the surface takes away. On a
        sphere all of it is gone where the strand reaches half way round.
    max_halvings
        Maximum number of times that a step is halved if it went too far.
    min_fall
        Reduction of the length in one round that shows that the strand has come off something,
        strides. Such a strand gets up to `max_extra_rounds` more rounds, unless delta is finer than
        the voxels: there it would crumple over them.
    max_extra_rounds
        Maximum number of rounds that are added for a strand that has come off something.
    patience_rounds
        Number of rounds without a shorter length after which pulling ends, in addition to one for
        each `rounds_per_patience` rounds allowed. Over rims, nodes may come and go forever.
    rounds_per_patience
        Number of allowed rounds that add one round of patience.
    standing_factor
        Factor on the number of rounds for a strand whose ends do not move, so that slow slipping
        ends.
    passing_rounds
        Number of rounds after each step of an end that does not stop there.
    max_tip_cosine
        Cosine of the angle between the directions before and after some contacts, below which the
        strand turns sharply there.
    tip_strides
        Maximum distance between neighbouring contacts of one tip, strides.
    max_tip_contacts
        Maximum number of contacts that are taken off a tip together.
    sidestep_strides
        Length of a sidestep off a tip, strides: below one, to leave room for the step back to the
        surface.
    max_sidesteps
        Maximum number of sidesteps for a strand whose ends do not move. Strands that move make one
        at a time, because they soon get another chance.
    corner_depth
        Depth, in slips, from which on an edge is measured as one that cuts a corner of voxels.
    max_mends
        Maximum number of times that nodes are put at the corners that a measured strand cuts. Each
        puts them where edges are deepest, which is not where the strand is shortest.
    max_vain_mends
        Number of such rounds in a row without a shorter length after which measuring ends.
    min_mend_gain
        Share of the length that counts as shorter in such a round.
    max_crumpled_ratio
        Maximum ratio of the length with nodes at all corners to the length without. A larger ratio
        shows a strand that is crumpled over voxels, far from rest; its length is not corrected.
    min_piece
        Minimum length of the pieces of a strand whose directions count for its turning, in units of
        delta. Shorter pieces between contacts not yet at rest may point anywhere.
    hold_friction
        Coefficient of friction with which contacts resist sliding sideways. A contact slides only
        if the pull along its slide direction exceeds this share of what presses it, and a rim
        releases the strand later by the same angle. While tether is paid out or reeled in, contacts
        nevertheless creep sideways (`netsp.world.tether.contact_creep`). 0 is the taut tether
        without friction.
    max_creep_pieces
        Maximum number of steps in which contacts creep in one update. Each step is at most a
        stride; with a longer travel, contacts creep less far than they would.
    """

    min_pressed_share: float = 0.5
    min_sharp_pressed_share: float = 0.2
    min_sharp_sine: float = 0.5
    max_cone_sine: float = 0.03
    sliding_stiffness: float = 0.02
    min_gain: float = 0.4
    min_pivot_share: float = 0.1
    max_step_factor: float = 10.0
    max_convex_share: float = 0.5
    max_halvings: int = 4
    min_fall: float = 0.05
    max_extra_rounds: int = 60
    patience_rounds: int = 8
    rounds_per_patience: int = 20
    standing_factor: int = 40
    passing_rounds: int = 2
    max_tip_cosine: float = 0.95
    tip_strides: float = 8.0
    max_tip_contacts: int = 4
    sidestep_strides: float = 0.7
    max_sidesteps: int = 9
    corner_depth: float = 1.0 / 6.0
    max_mends: int = 8
    max_vain_mends: int = 2
    min_mend_gain: float = 1e-4
    max_crumpled_ratio: float = 1.1
    min_piece: float = 0.3
    hold_friction: float = 0.0
    max_creep_pieces: int = 200

    def __post_init__(self) -> None:
        check_not_negative(self)


class PullSettings(NamedTuple):
    """Settings of a tether model as kernels take them: its parameters, and those of `TetherPolicy`.

    Attributes
    ----------
    delta
        Resolution, metres.
    slip
        Maximum depth of an edge inside a solid, metres: `SLIP` times delta.
    stride
        Maximum length of a motion whose path is not checked, metres: `STRIDE` times delta.
    spread
        Distance from a contact at which the normals before and after it are sampled, metres.
    flat
        Sine of the angle between two normals below which a surface counts as flat.
    rounds
        Rounds in one update.
    precision
        Motion below which a node counts as at rest, metres.
    """

    delta: float
    slip: float
    stride: float
    spread: float
    flat: float
    rounds: int
    precision: float
    min_pressed_share: float
    min_sharp_pressed_share: float
    min_sharp_sine: float
    max_cone_sine: float
    sliding_stiffness: float
    min_gain: float
    min_pivot_share: float
    max_step_factor: float
    max_convex_share: float
    max_halvings: int
    min_fall: float
    max_extra_rounds: int
    patience_rounds: int
    rounds_per_patience: int
    standing_factor: int
    passing_rounds: int
    max_tip_cosine: float
    tip_strides: float
    max_tip_contacts: int
    sidestep_strides: float
    max_sidesteps: int
    corner_depth: float
    max_mends: int
    max_vain_mends: int
    min_mend_gain: float
    max_crumpled_ratio: float
    min_piece: float
    hold_friction: float
    max_creep_pieces: int


def pull_settings(
    policy: TetherPolicy, *, delta: float, spread: float, flat: float, rounds: int, precision: float
) -> PullSettings:
    """Return the settings of a model with a policy, as kernels take them."""
    slip, stride = SLIP * delta, STRIDE * delta
    return PullSettings(delta, slip, stride, spread, flat, rounds, precision, **asdict(policy))
