"""Record of an import, the field `site` of a problem file: what each feature of the map became."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal, Self, cast

from pydantic import Field, model_validator

from netsp.base.errors import counted
from netsp.base.field_types import Name, Number, Positive
from netsp.base.validated import Model

UsedAs = Literal["base", "candidate", "goal", "obstacle", "bounds", "path", "floor"]
"""Uses of a feature of a map."""

MAX_NAMED = 5
"""Format of import records: maximum number of omitted features that are named, not just counted."""


class OmittedFeatures(Model):
    """Features of one layer that were left out for one reason."""

    reason: Annotated[
        str, Field(description="reason why the features were left out", max_length=300)
    ]
    features: Annotated[int, Field(description="number of features", ge=1)]
    first: Annotated[
        tuple[str, ...], Field(description="up to five of these features, by layer and number")
    ] = ()


class LayerRecord(Model):
    """Record of what became of the features of one layer.

    Raises
    ------
    InputError
        Some features are neither used nor left out.
    """

    layer: Annotated[str, Field(description="name of the layer; empty if the format has none")]
    features: Annotated[int, Field(description="number of its features", ge=0)]
    used: Annotated[
        dict[UsedAs, int],
        Field(description="number of features by what they became", default_factory=dict),
    ]
    left_out: Annotated[
        tuple[OmittedFeatures, ...], Field(description="features that were left out, by reason")
    ] = ()

    @model_validator(mode="after")
    def _complete(self) -> Self:
        named = sum(self.used.values()) + sum(group.features for group in self.left_out)
        if named != self.features:
            raise ValueError(
                f"layer {self.layer!r}: expected {self.features} features used or left out, "
                f"got {named}"
            )
        return self

    def without_goals(self, places: Sequence[str], reason: str) -> LayerRecord:
        """Return the record with some goals counted as left out for a reason.

        Parameters
        ----------
        places : sequence of str
            Names of the goals' features, by layer and number.
        reason : str
            Reason.

        Examples
        --------
        >>> layer = LayerRecord(layer="piles", features=2, used={"goal": 2})
        >>> layer.without_goals(["piles[1]"], "out of reach").used
        {'goal': 1}
        """
        if not places:
            return self
        rest = {**self.used, "goal": self.used.get("goal", 0) - len(places)}
        group = OmittedFeatures(
            reason=reason, features=len(places), first=tuple(places[:MAX_NAMED])
        )
        return LayerRecord(
            layer=self.layer,
            features=self.features,
            left_out=(*self.left_out, group),
            used=cast("dict[UsedAs, int]", {k: n for k, n in rest.items() if n}),
        )


class CropCircle(Model):
    """Circle outside of which an import left out obstacles.

    The tether given to the import cannot leave the circle. With a longer tether, obstacles may be
    missing.
    """

    center: Annotated[
        tuple[Number, Number], Field(description="(x, y) of its centre, in the problem's units")
    ]
    radius: Annotated[Positive, Field(description="radius of the circle, in the problem's units")]


class Site(Model):
    """Map that a problem was imported from, and what each of its features became.

    Examples
    --------
    >>> layer = LayerRecord(layer="piles", features=2, used={"obstacle": 2})
    >>> Site(file="harbour.kml", imported=(layer,)).imported[0].used
    {'obstacle': 2}
    """

    file: Annotated[Name, Field(description="name of the map")]
    imported: Annotated[tuple[LayerRecord, ...], Field(description="layers of the map")] = ()
    cropped: Annotated[
        CropCircle | None,
        Field(description="circle outside of which obstacles were left out; null if none were"),
    ] = None
    edited: Annotated[
        bool,
        Field(description="whether goals, obstacles, base or bounds were changed after the import"),
    ] = False

    @property
    def notes(self) -> list[str]:
        """Lines that say how many features of each layer were left out, and why."""
        lines = []
        for layer in self.imported:
            name = f"layer {layer.layer!r}: " if layer.layer else ""
            for group in layer.left_out:
                shown = ", ".join(group.first[:MAX_NAMED])
                more = ", …" if group.features > len(group.first[:MAX_NAMED]) else ""
                lines.append(
                    f"{name}{counted(group.features, 'feature')} left out: {group.reason}"
                    + (f" ({shown}{more})" if shown else "")
                )
        return lines

    def table(self) -> list[tuple[str, ...]]:
        """Return the rows of the table that `netsp import` prints, the head first.

        Columns are the layer, its features, each kind that occurs, and what was left out and why.
        """
        kinds = [k for k in KIND_COLUMNS if any(k in layer.used for layer in self.imported)]
        rows: list[tuple[str, ...]] = [("layer", "features", *kinds, "left out")]
        for layer in self.imported:
            reasons = "; ".join(f"{group.features}: {group.reason}" for group in layer.left_out)
            counts = [str(layer.used.get(kind, "")) for kind in kinds]
            rows.append((layer.layer or "(all)", str(layer.features), *counts, reasons))
        return rows


KIND_COLUMNS: tuple[UsedAs, ...] = (
    "base",
    "candidate",
    "goal",
    "obstacle",
    "bounds",
    "path",
    "floor",
)
"""Order of the columns of `Site.table`."""
