"""Limits of a run of a solver, with its random generator, warm start and listener."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from netsp.base.clock import TimeLimit
from netsp.gtsp.travel.result import OnProgress


@dataclass(frozen=True)
class Limits:
    """Limits and inputs of a run.

    Parameters
    ----------
    time : float or Clock, optional
        Seconds, or the clock of the run that this one is a part of; None for no limit.
    iterations : int, optional
        Maximum number of iterations; each solver defines what one is.
    rng : numpy.random.Generator
        Random generator.
    warm_start : sequence of int, optional
        Tour to start from, as vertices from 0.
    on_progress : callable, optional
        Called with a `netsp.gtsp.travel.result.Progress` from time to time.
    cutoff : float
        Length of a tour known from elsewhere, inf for none; the run ends once no tour is shorter.
    """

    time: TimeLimit = None
    iterations: int | None = None
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    warm_start: Sequence[int] | None = None
    on_progress: OnProgress | None = None
    cutoff: float = math.inf
