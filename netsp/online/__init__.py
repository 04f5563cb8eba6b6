"""Beside the vehicle: tours executed and repaired, flown, and watched by a guard."""

from netsp.base.deprecated import deprecated_names

__getattr__ = deprecated_names(
    globals(),
    Contact="netsp.world:Contact",
    DistanceField="netsp.world:DistanceField",
    GeodesicTether="netsp.world:GeodesicTether",
    ReactTether="netsp.world:ReactTether",
    Scene="netsp.world:Scene",
    Tether="netsp.world:Tether",
)
