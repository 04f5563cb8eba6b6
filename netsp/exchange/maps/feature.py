"""Features of a map, whatever its format is."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from netsp.base.errors import counted
from netsp.model.import_record import MAX_NAMED

if TYPE_CHECKING:
    import shapely

TAG_PROPERTIES = ("tags", "@tags", "other_tags", "all_tags")
"""Properties that hold the tags of OpenStreetMap: of osmtogeojson, of Overpass and of GDAL."""

HSTORE_PAIR = re.compile(r'"((?:[^"\\]|\\.)*)"=>"((?:[^"\\]|\\.)*)"')
"""Key and value in PostgreSQL's hstore text."""

NO_NAMES = ("", "<null>", "null", "none", "nan", "n/a", "unnamed")
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
    folders
        Names of the folders or layers that it lies in, the nearest first, where these are more
        than its layer: the first that the contract knows decides its kind.
    marker
        Place that a symbol of a drawing marks, or places of an array of symbols: a goal drawn as a
        circle or a block is there.
    is_above_floor
        Whether z counts from the sea floor, which the map does not have.
    kind
        What the format itself says that it is, as ``path`` of a recorded track; empty for most.
    """

    where: str
    layer: str
    identity: str
    properties: Mapping[str, Any]
    shape: shapely.Geometry
    folders: tuple[str, ...] = ()
    marker: shapely.Geometry | None = None
    is_above_floor: bool = False
    kind: str = ""

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
            if value is None or value != value:  # GDAL's empty numbers are NaN
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
class Change:
    """Assumption about a feature, or change of it.

    Attributes
    ----------
    where
        What messages call the feature.
    layer
        Its layer.
    text
        Text of the note, as "a ring is not closed: closed by its first corner".
    """

    where: str
    layer: str
    text: str


def change_notes(changes: Iterable[Change]) -> list[str]:
    """Return one line for each layer and change, with the first features.

    Parameters
    ----------
    changes : iterable of Change
        In the order of the map.

    Returns
    -------
    list of str
        Notes.

    Examples
    --------
    >>> change_notes([Change("piles[0]", "piles", "closed"), Change("piles[2]", "piles", "closed")])
    ["layer 'piles': 2 features: closed (piles[0], piles[2])"]
    """
    groups: dict[tuple[str, str], list[str]] = {}
    for change in changes:
        groups.setdefault((change.layer, change.text), []).append(change.where)
    lines = []
    for (layer, text), places in groups.items():
        distinct = list(dict.fromkeys(places))
        shown = ", ".join(distinct[:MAX_NAMED]) + (", …" if len(distinct) > MAX_NAMED else "")
        lines.append(
            f"{f'layer {layer!r}: ' if layer else ''}{counted(len(distinct), 'feature')}: {text} "
            f"({shown})"
        )
    return lines


def with_tags(properties: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return properties with the tags of OpenStreetMap that programs put into one of them.

    Parameters
    ----------
    properties : mapping
        As a file has them: Overpass has ``tags`` or ``@tags`` (an object), GDAL ``other_tags``
        (text as ``"key"=>"value"``).

    Returns
    -------
    mapping
        With the tags beside the others; a property of the same name stays.

    Examples
    --------
    >>> with_tags({"other_tags": '"man_made"=>"pier","name"=>"A"', "name": "B"})["man_made"]
    'pier'
    """
    more: dict[str, Any] = {}
    for key in TAG_PROPERTIES:
        value = properties.get(key)
        if isinstance(value, str) and "=>" in value:
            value = {k: _unescaped(v) for k, v in HSTORE_PAIR.findall(value)}
        if isinstance(value, Mapping):
            more |= {k: v for k, v in value.items() if properties.get(k) in (None, "")}
    return {**properties, **more} if more else properties


def _unescaped(text: str) -> str:
    return re.sub(r"\\(.)", r"\1", text)


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
    metres
        Metres per unit of its plane as the file states it, if it does.
    is_chart
        Whether it is an S-57 chart, whose object classes decide kinds.
    """

    features: tuple[Feature, ...]
    geographic: bool
    layers: Mapping[str, int]
    complaints: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())
    unread: tuple[Unread, ...] = ()
    metres: float | None = None
    is_chart: bool = False

    @property
    def layer_names(self) -> set[str]:
        """Names of layers and of folders, lower case, that a user may give a kind."""
        names = {name.lower() for name in self.layers}
        return names | {folder.lower() for f in self.features for folder in f.folders}
