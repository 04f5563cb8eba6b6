"""Features of a map of any format."""

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
"""Texts, in lower case, that programs write for a missing value."""


@dataclass(frozen=True)
class Feature:
    """Feature of a map.

    Attributes
    ----------
    where
        Name in messages: layer and number, such as ``features[3]`` or ``turbines[0]``.
    layer
        Its layer, folder or object class; empty if the format has none.
    identity
        Identifier in the file, if it has more than a number.
    shape
        Longitudes and latitudes in degrees, or metres if the map has no place on the earth; z in
        the file's units.
    folders
        Names of the folders or layers around it, the innermost first, if it has more than its
        layer; the first that the contract knows decides its kind.
    marker
        Place that a symbol of a drawing marks, or places of an array of symbols: the position of a
        goal that is drawn as a circle or a block.
    is_above_floor
        Whether z counts from the sea floor, which the map does not have.
    kind
        Kind that the format itself implies, such as ``path`` for a recorded track; empty for most.
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
        """Return the value of the first of some properties that has one; None if none has.

        Parameters
        ----------
        *names : str
            Names in lower case; the case of the feature's own names does not matter.
        """
        values = {str(k).lower(): v for k, v in self.properties.items()}
        for name in names:
            value = values.get(name)
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
        Name in messages, as of a `Feature`.
    reason
        Reason such as "has no geometry".
    shape
        Known part of its shape, for the picture.
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
        Name of the feature in messages.
    text
        Text of the note, such as "a ring is not closed: closed by its first corner".
    """

    where: str
    layer: str
    text: str


def change_notes(changes: Iterable[Change]) -> list[str]:
    """Return one line for each layer and change, with the first features.

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

    Overpass writes ``tags`` or ``@tags`` (an object), GDAL ``other_tags`` (text
    ``"key"=>"value"``). A property of the same name as a tag stays.

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
    """Map: features that were read, and features that could not be read.

    Attributes
    ----------
    features
        Features in the order of the file.
    is_geographic
        Whether shapes are in degrees.
    layers
        Number of features of each layer, read or not.
    complaints
        Reasons to refuse the map, one line each.
    notes
        Assumptions and changes, one line each.
    unread
        Features that cannot be used.
    metres
        Metres per unit of its plane, if the file states the unit.
    is_chart
        Whether it is an S-57 chart, whose object classes decide kinds.
    """

    features: tuple[Feature, ...]
    is_geographic: bool
    layers: Mapping[str, int]
    complaints: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())
    unread: tuple[Unread, ...] = ()
    metres: float | None = None
    is_chart: bool = False

    @property
    def layer_names(self) -> set[str]:
        """Names of layers and of folders, in lower case, to which a user may give a kind."""
        names = {name.lower() for name in self.layers}
        return names | {folder.lower() for f in self.features for folder in f.folders}
