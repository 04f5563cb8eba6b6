"""Features of a map, whatever its format is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import shapely

NO_NAMES = ("<null>", "null", "none", "nan", "n/a", "unnamed")
"""Texts, in lower case, that programs write where there is no value."""


@dataclass(frozen=True)
class Feature:
    """Feature of a map.

    Attributes
    ----------
    where
        What messages call it: layer and number, as ``features[3]`` or ``turbines[0]``.
    layer
        Its layer, folder or object class; empty where the format has none.
    identity
        Identifier in the file, if it has more than a number.
    properties
        Name to value.
    shape
        Longitudes and latitudes in degrees, or metres where the map has no place on the earth; z in
        the file's units.
    """

    where: str
    layer: str
    identity: str
    properties: Mapping[str, Any]
    shape: shapely.Geometry

    def get(self, *names: str) -> Any:
        """Return the first of some properties, whatever their case, that has a value.

        Parameters
        ----------
        *names : str
            Lower case.

        Returns
        -------
        object
            Its value, None without one.
        """
        own = {str(k).lower(): v for k, v in self.properties.items()}
        for name in names:
            value = own.get(name)
            if value is None or value != value or value == "":  # GDAL's empty numbers are NaN
                continue
            if isinstance(value, str) and value.strip().lower() in NO_NAMES:
                continue
            return value
        return None


@dataclass(frozen=True)
class Unread:
    """Feature of a map that cannot be used, with the reason.

    Attributes
    ----------
    where
        What messages call it, as of a `Feature`.
    layer
        Its layer.
    reason
        Why it cannot be used, as "has no geometry".
    shape
        What is known of its shape, for the picture.
    """

    where: str
    layer: str
    reason: str
    shape: shapely.Geometry | None = None


@dataclass(frozen=True)
class Map:
    """Map: features, and those that could not be read.

    Attributes
    ----------
    features
        In the order of the file.
    geographic
        Whether shapes are in degrees.
    layers
        Their names, with the number of features of each, read or not.
    complaints
        Reasons not to go on, one line each.
    notes
        What was assumed or changed, one line each.
    unread
        Features that cannot be used.
    unit
        Name of the unit of its plane as the file states it (`netsp.axes.UNITS`), if it
        does.
    """

    features: tuple[Feature, ...]
    geographic: bool
    layers: Mapping[str, int]
    complaints: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())
    unread: tuple[Unread, ...] = ()
    unit: str | None = None
