"""Ledger of an import: the use of each feature, or the reason to leave it out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from netsp.exchange.maps.feature import Feature, Unread
from netsp.model.import_record import KIND_COLUMNS, MAX_NAMED, LayerRecord, OmittedFeatures, UsedAs

if TYPE_CHECKING:
    import shapely


class Ledger:
    """Ledger with one entry for each feature of a map.

    Parameters
    ----------
    layers : mapping
        Number of features of each layer, as the reader counted them.
    """

    def __init__(self, layers: Mapping[str, int]) -> None:
        self._layers = dict(layers)
        self._layer_of: dict[str, str] = {}
        self._kind: dict[str, UsedAs] = {}
        self._reason: dict[str, str] = {}
        self._shapes: dict[str, shapely.Geometry] = {}

    @property
    def left_out_shapes(self) -> list[shapely.Geometry]:
        """Shapes of the features that are left out."""
        return list(self._shapes.values())

    def use(self, feature: Feature, kind: UsedAs) -> None:
        """Record that a feature is used as a kind; this replaces an earlier entry."""
        self._layer_of[feature.where] = feature.layer
        self._kind[feature.where] = kind
        self._reason.pop(feature.where, None)
        self._shapes.pop(feature.where, None)

    def leave_out(self, feature: Feature | Unread, reason: str) -> None:
        """Record that a feature is left out for a reason; this replaces an earlier entry."""
        self._layer_of[feature.where] = feature.layer
        self._kind.pop(feature.where, None)
        self._reason[feature.where] = reason
        if feature.shape is not None:
            self._shapes[feature.where] = feature.shape

    def add_layer(self, layer: str, size: int) -> str:
        """Add a table given beside the map, and return its name, with a number if the name exists.

        Parameters
        ----------
        size : int
            Number of rows.
        """
        number = 1
        name = layer
        while name in self._layers:
            number += 1
            name = f"{layer} ({number})"
        self._layers[name] = size
        return name

    def is_left_out(self, feature: Feature) -> bool:
        """Return whether a feature is left out so far; False for one that has no entry yet."""
        return feature.where in self._reason

    def records(self) -> tuple[LayerRecord, ...]:
        """Return the record of every layer, in the order of the map.

        Raises
        ------
        ValueError
            A feature has no entry: a defect of the reader.
        """
        out = []
        members: dict[str, list[str]] = {}
        for where, layer_name in self._layer_of.items():
            members.setdefault(layer_name, []).append(where)
        for layer, size in self._layers.items():
            places = members.get(layer, [])
            number = Counter(self._kind[where] for where in places if where in self._kind)
            used = {kind: number[kind] for kind in KIND_COLUMNS if number[kind]}
            groups: dict[str, list[str]] = {}
            for where in places:
                if where in self._reason:
                    groups.setdefault(self._reason[where], []).append(where)
            out.append(
                LayerRecord(layer=layer, features=size, used=used, left_out=tuple(_omitted(groups)))
            )
        return tuple(out)


def _omitted(groups: Mapping[str, list[str]]) -> Iterable[OmittedFeatures]:
    for reason, places in groups.items():
        yield OmittedFeatures(reason=reason, features=len(places), first=tuple(places[:MAX_NAMED]))
