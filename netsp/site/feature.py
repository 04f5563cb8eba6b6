"""What a map holds, whatever its format was."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import shapely


@dataclass(frozen=True)
class Feature:
    """One thing on a map.

    Attributes
    ----------
    where
        What messages call it: layer and number, as ``features[3]`` or ``turbines[0]``.
    layer
        Its layer, folder or object class; empty where the format has none.
    identity
        What the file itself calls it, if it has more than a number.
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
        """The first of some properties, whatever their case, that has a value.

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
            if value is not None and value == value and value != "":  # GDAL's empty numbers are NaN
                return value
        return None


@dataclass(frozen=True)
class Map:
    """A map.

    Attributes
    ----------
    features
        In the order of the file.
    geographic
        Whether shapes are in degrees.
    layers
        Their names, with the number of features of each.
    complaints
        What cannot be read of it, one line each.
    notes
        What was left out, one line each.
    """

    features: tuple[Feature, ...]
    geographic: bool
    layers: Mapping[str, int]
    complaints: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())
