"""Report of a guard after an update."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from netsp.base.arrays import ComparesArrays, Floats
from netsp.base.field_types import Point3
from netsp.hsignature import Word
from netsp.online.guard.alarms import Alarm


@dataclass(frozen=True, eq=False)
class ClassReport(ComparesArrays):
    """Class that the tether may be in.

    Attributes
    ----------
    word
        h-signature of the class.
    likely
        Share among the classes believed.
    passes
        Path of the tether by the names of obstacles.
    taut
        Length of the taut tether, in the site's units.
    slack
        Length of the tether that is left.
    turning
        Sum of the angles by which the tether turns, rad.
    path
        Taut tether from the base on, shape (n, 3); back along it is the shortest path home in
        this
        class.
    """

    word: Word
    likely: float
    passes: str
    taut: float
    slack: float
    turning: float
    path: Floats

    def as_row(self) -> dict[str, Any]:
        """Return the class as a JSON object."""
        return {
            "word": list(self.word),
            "likely": round(self.likely, 4),
            "passes": self.passes,
            "taut": round(self.taut, 4),
            "slack": round(self.slack, 4),
            "turning_deg": round(self.turning * 57.29577951308232, 1),
            "path": [[round(float(v), 3) for v in p] for p in self.path],
        }


@dataclass(frozen=True)
class Report:
    """State of the tether and of the vehicle.

    Attributes
    ----------
    time
        Time, s.
    position
        Position of the robot, smoothed, outside of obstacles; None before the first estimate.
    heading
        Heading, degrees.
    speed
        Speed over ground, units per second.
    armed
        Whether the motors may turn.
    mode
        Mode of the vehicle.
    claims
        Whether the guard claims anything; not while the position is lost.
    classes
        Classes that the tether may be in, the likeliest first.
    home_s
        Time home along the likeliest tether at full speed, s.
    loop_s
        Time until the present motion closes a loop, s.
    loop_around
        Obstacles that the loop would be around.
    short_s
        Time until the present motion needs more tether than there is, s.
    loops
        Obstacles that each closed loop is around.
    alarms
        Active alarms, the gravest first.
    raised
        Alarms that were raised in this update.
    paid_out
        Length of tether that the winch has let out.
    as_planned
        Whether the likeliest class is the planned one; None if the robot is at no visit of a
        tour.
    drift
        Standard deviation of the position's error, m: larger while the position is frozen or no
        fixes correct it.
    """

    time: float
    position: Point3 | None
    heading: float | None
    speed: float
    armed: bool | None
    mode: str | None
    claims: bool
    classes: tuple[ClassReport, ...]
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
        """Return the report as a JSON object of finite numbers, for JSON lines and the page."""

        def brief(value: float | None) -> float | None:
            return None if value is None else round(value, 3)

        home = None
        if self.home_s is not None:
            home = {"length": round(self.classes[0].taut, 3), "seconds": brief(self.home_s)}
        return {
            "t": round(self.time, 3),
            "position": None if self.position is None else [round(v, 3) for v in self.position],
            "heading": brief(self.heading),
            "speed": brief(self.speed),
            "armed": self.armed,
            "mode": self.mode,
            "claims": self.claims,
            "classes": [c.as_row() for c in self.classes],
            "home": home,
            "loop_s": brief(self.loop_s),
            "loop_around": list(self.loop_around),
            "short_s": brief(self.short_s),
            "loops": [list(names) for names in self.loops],
            "paid_out": brief(self.paid_out),
            "as_planned": self.as_planned,
            "drift": brief(self.drift),
            "alarms": [
                {"kind": a.kind, "level": a.level.name.lower(), "text": a.text} for a in self.alarms
            ],
            "raised": [a.kind for a in self.raised],
        }
