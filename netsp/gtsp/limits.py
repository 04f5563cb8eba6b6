"""What a run of a solver is given besides its graph and its options."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from netsp.base.clock import TimeLimit
from netsp.gtsp.travel.result import OnProgress


@dataclass(frozen=True)
class Limits:
    """How long a solver may work, where it starts, and who listens.

    Parameters
    ----------
    time : float or Clock, optional
        Seconds, or the clock of the run that the work belongs to; None for no limit.
    iterations : int, optional
        Iterations of the solver, which says what one is; None for no limit.
    rng : numpy.random.Generator
        Of all that is random.
    warm_start : sequence of int, optional
        A tour to start from, as vertices from 0 on.
    on_progress : callable, optional
        Called with a `netsp.gtsp.travel.result.Progress` now and then.
    cutoff : float
        Length of a tour that is known from elsewhere: a proof that none is shorter is enough; inf
        for none.
    """

    time: TimeLimit = None
    iterations: int | None = None
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    warm_start: Sequence[int] | None = None
    on_progress: OnProgress | None = None
    cutoff: float = math.inf
