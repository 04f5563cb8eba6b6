"""Units of length, angle, time and speed by their names."""

from __future__ import annotations

import math

UNITS = {
    "m": 1.0, "km": 1e3, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "us-ft": 1200.0 / 3937.0,
    "in": 0.0254, "yd": 0.9144, "fathom": 1.8288, "nmi": 1852.0,
}  # fmt: skip
"""Metres per unit of length."""

_LENGTH_NAMES = {
    "m": ("metre", "meter", "metres", "meters", "mtr"),
    "km": ("kilometre", "kilometer", "kilometres", "kilometers"),
    "cm": ("centimetre", "centimeter", "centimetres", "centimeters"),
    "mm": ("millimetre", "millimeter", "millimetres", "millimeters"),
    "ft": ("foot", "feet", "international foot", "'"),
    "us-ft": ("us survey foot", "us survey feet", "us_survey_foot", "foot_us", "us foot", "us feet",
              "us_ft", "usft", "ftus", "ft-us", "ftus", "us ft", "survey foot", "survey feet"),
    "in": ("inch", "inches"),
    "yd": ("yard", "yards"),
    "fathom": ("fathoms", "fm", "ftm"),
    "nmi": ("nautical mile", "nautical miles"),
}  # fmt: skip

ANGLES = {
    "deg": 1.0, "degs": 1.0, "degree": 1.0, "degrees": 1.0, "°": 1.0, "dd": 1.0, "e7": 1e-7,
    "dege7": 1e-7, "rad": math.degrees(1.0), "rads": math.degrees(1.0),
    "radian": math.degrees(1.0), "radians": math.degrees(1.0),
}  # fmt: skip
"""Degrees per unit of angle."""

DURATIONS = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3,
    "milliseconds": 1e-3, "us": 1e-6, "usec": 1e-6, "µs": 1e-6, "microseconds": 1e-6, "ns": 1e-9,
    "nsec": 1e-9, "nanoseconds": 1e-9, "min": 60.0, "minutes": 60.0, "h": 3600.0, "hours": 3600.0,
}  # fmt: skip
"""Seconds per unit of time."""

SPEEDS = {
    "m/s": 1.0, "mps": 1.0, "m_s": 1.0, "ms": 1.0, "ms-1": 1.0, "m s-1": 1.0, "cm/s": 0.01,
    "mm/s": 1e-3, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0, "kt": 1852.0 / 3600.0,
    "kts": 1852.0 / 3600.0, "knots": 1852.0 / 3600.0, "ft/s": 0.3048,
}  # fmt: skip
"""Metres per second per unit of speed."""


def metres_per_unit(name: str) -> float | None:
    """Return the metres in a unit of length by any of its names; None for an unknown one.

    Examples
    --------
    >>> metres_per_unit("Feet"), metres_per_unit("US survey foot") == 1200 / 3937
    (0.3048, True)
    """
    text = " ".join(name.strip().lower().strip(".").split())
    if text in UNITS:
        return UNITS[text]
    return next((UNITS[unit] for unit, names in _LENGTH_NAMES.items() if text in names), None)


def metres_per_unit_code(code: int) -> float | None:
    """Return the metres in a unit of length by its EPSG code, as in GeoTIFF keys; None for unknown
    codes.

    Examples
    --------
    >>> metres_per_unit_code(9002)
    0.3048
    """
    known = {9001: 1.0, 9002: UNITS["ft"], 9003: UNITS["us-ft"]}
    if code in known:
        return known[code]
    try:
        from pyproj.database import get_units_map
    except ImportError:
        return None
    units = get_units_map(auth_name="EPSG", category="linear", allow_deprecated=True)
    return next((float(u.conv_factor) for u in units.values() if u.code == str(code)), None)
