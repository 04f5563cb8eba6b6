"""Error of a position that no fixes correct.

A filter without fixes integrates the errors of its accelerometers and of its vehicle model, so its
error grows with the square of the time. ArduSub 4.7 with the GPS switched off was off
by 0.25 m after 3 s, 0.54 m after 5 s, 0.99 m after 7.1 s and 3.6 m after 13 s: half of 0.04 m/s² by
the time squared.
"""

from __future__ import annotations

from dataclasses import dataclass

from netsp.base.errors import InputError


@dataclass(frozen=True)
class DeadReckoning:
    """Growth of a position's error without fixes.

    Attributes
    ----------
    acceleration
        Twice the error divided by the square of the time, m/s²; measured in flights with the GPS
        switched off. 0 or more.
    notice_s
        Time from the loss until it is noticed, s; the error grows meanwhile. 0 or more.
    max_error
        Largest error, m; the class is unknown by then. Positive.
    settle_s
        Time for which the error still counts after fixes return, s; the filter resets its estimate
        meanwhile. 0 or more.
    growth
        Factor of growth after which the classes are computed again. More than 1.
    """

    acceleration: float = 0.04
    notice_s: float = 2.0
    max_error: float = 10.0
    settle_s: float = 2.0
    growth: float = 1.1

    def __post_init__(self) -> None:
        for name, is_good, expected in (
            ("acceleration", self.acceleration >= 0.0, "0 or more"),
            ("notice_s", self.notice_s >= 0.0, "0 or more"),
            ("max_error", self.max_error > 0.0, "more than 0"),
            ("settle_s", self.settle_s >= 0.0, "0 or more"),
            ("growth", self.growth > 1.0, "more than 1"),
        ):
            if not is_good:
                raise InputError(f"{name}: expected {expected}, got {getattr(self, name)!r}")

    def error(self, seconds: float) -> float:
        """Return the error some seconds after the loss was noticed, m.

        Examples
        --------
        >>> [round(DeadReckoning().error(t), 2) for t in (0, 3, 5, 11)]
        [0.08, 0.5, 0.98, 3.38]
        """
        lasted = self.notice_s + max(seconds, 0.0)
        return min(0.5 * self.acceleration * lasted**2, self.max_error)
