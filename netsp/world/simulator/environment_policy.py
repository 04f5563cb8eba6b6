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
        Number of rays of one look. The fan of rays is turned from look to look, so that later rays
        find what stood between earlier ones.
    """

    ray_count: int = 240

    def __post_init__(self) -> None:
        check_positive(self)


@dataclass(frozen=True)
class CoveragePolicy:
    """Policy of the patches that coverage is counted in. All numbers are positive.

    Attributes
    ----------
    max_patches
        Number of large triangles above which a surface is refused as too fine.
    """

    max_patches: int = 200_000

    def __post_init__(self) -> None:
        check_positive(self)
