"""What the guard says after every update."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from netsp.base.arrays import ComparesArrays, Floats
from netsp.base.field_types import Point3
from netsp.hsignature import Word
from netsp.online.guard.alarms import Alarm


@dataclass(frozen=True, eq=False)
class ClassNow(ComparesArrays):
    """A class that the tether may be in.

    Parameters
    ----------
    word : Word
        Its h-signature.
    likely : float
        Its share among those believed.
    passes : str
        How the tether runs, by the names of obstacles.
    taut : float
        Length of the taut tether, in the site's units.
    slack : float
        What is left of the tether.
    turning : float
        Radians that it turns by in the plan, all in all.
    path : ndarray, shape (n, 3)
        The taut tether from the base on; back along it is the shortest path home in this class.
    """

    word: Word
    likely: float
    passes: str
    taut: float
    slack: float
    turning: float
    path: Floats

    def as_row(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "word": list(self.word), "likely": round(self.likely, 4), "passes": self.passes,
            "taut": round(self.taut, 4), "slack": round(self.slack, 4),
            "turning_deg": round(self.turning * 57.29577951308232, 1),
            "path": [[round(float(v), 3) for v in p] for p in self.path],
        }  # fmt: skip


@dataclass(frozen=True)
class Report:
    """The state of the tether.

    Parameters
    ----------
    time : float
        Seconds.
    position : (x, y, z) or None
        Of the robot, smoothed, out of obstacles; None before the first estimate.
    heading : float or None
        Degrees.
    speed : float
        Over ground, units per second.
    armed : bool or None
        Whether the motors may turn.
    mode : str or None
        Of the vehicle.
    claims : bool
        Whether anything is claimed: not while the position is lost.
    classes : tuple of ClassNow
        The likeliest first.
    home_s : float or None
        Seconds home along the likeliest tether at full speed.
    loop_s : float or None
        Seconds until the present motion closes a loop.
    loop_around : tuple of str
        What it would be around.
    short_s : float or None
        Seconds until the present motion needs more tether than there is.
    loops : tuple of tuple of str
        What the tether is wound around once or more by now.
    alarms : tuple of Alarm
        That are on, the most urgent first.
    raised : tuple of Alarm
        That were raised just now.
    paid_out : float or None
        By the winch.
    as_planned : bool or None
        Whether the likeliest class is the one that the tour means it to be in; None where the robot
        is at none of its stops, or there is no tour.
    drift : float or None
        Standard deviation of the position's error, metres: as given, and more while the position is
        frozen or no fixes correct it.
    """

    time: float
    position: Point3 | None
    heading: float | None
    speed: float
    armed: bool | None
    mode: str | None
    claims: bool
    classes: tuple[ClassNow, ...]
    home_s: float | None
    loop_s: float | None
    loop_around: tuple[str, ...]
    short_s: float | None
    loops: tuple[tuple[str, ...], ...]
    alarms: tuple[Alarm, ...]
    raised: tuple[Alarm, ...]
    paid_out: float | None = None
    as_planned: bool | None = None
    drift: float | None = None

    def as_row(self) -> dict[str, Any]:
        """For JSON lines and the page; no number is infinite or not one."""

        def brief(value: float | None) -> float | None:
            return None if value is None else round(value, 3)

        return {
            "t": round(self.time, 3),
            "position": None if self.position is None else [round(v, 3) for v in self.position],
            "heading": brief(self.heading), "speed": brief(self.speed),
            "armed": self.armed, "mode": self.mode, "claims": self.claims,
            "classes": [c.as_row() for c in self.classes],
            "home": None if self.home_s is None else {
                "length": round(self.classes[0].taut, 3), "seconds": brief(self.home_s),
            },
            "loop_s": brief(self.loop_s), "loop_around": list(self.loop_around),
            "short_s": brief(self.short_s), "loops": [list(names) for names in self.loops],
            "paid_out": brief(self.paid_out), "as_planned": self.as_planned,
            "drift": brief(self.drift),
            "alarms": [
                {"kind": a.kind, "level": a.level.name.lower(), "text": a.text}
                for a in self.alarms
            ],
            "raised": [a.kind for a in self.raised],
        }  # fmt: skip
