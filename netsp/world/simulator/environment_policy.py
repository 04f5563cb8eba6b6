"""Policies of the simulated environment: gusts, range sensor, and coverage by a camera."""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.number_ranges import check_positive


@dataclass(frozen=True)
class GustPolicy:
    """Policy of the gusts on top of a current. All numbers are positive.

    Attributes
    ----------
    memory_s
        Correlation time of a gust, s.
    interval_s
        Time between two values of the random process, s.
    """

    memory_s: float = 5.0
    interval_s: float = 0.1

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class RangingPolicy:
    """Policy of a simulated range sensor. All numbers are positive.

    Attributes
    ----------
    ray_count
        Number of rays of one look. Each look turns the fan of rays, so that later rays find solids
        between earlier ones.
    """

    ray_count: int = 240

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class CoveragePolicy:
    """Policy of the patches by which coverage is counted. All numbers are positive.

    Attributes
    ----------
    max_patches
        Maximum number of large triangles of a surface; a finer surface is refused.
    """

    max_patches: int = 200_000

    def __post_init__(self) -> None:
        check_positive(self)
