"""Study files: paths to compare on a problem, with the lengths that others published."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationError

from netsp.base.errors import InputError
from netsp.base.field_types import Name, NonNegative, Positive
from netsp.base.files import read_text
from netsp.base.validated import Model, explain


class StudyPath(Model):
    """Path of a study."""

    file: Annotated[Name, Field(description="file with the path, relative to the study")]
    label: Annotated[Name, Field(description="in tables; the path's own name if empty")] = ""
    published: Annotated[
        Positive | None, Field(description="length that others published of it, in their units")
    ] = None


class PathStudy(Model):
    """Study of paths that are compared with the planned tour of one problem."""

    schema_version: Annotated[Literal[1], Field(description="version of the file format")] = 1
    name: Annotated[Annotated[Name, Field(min_length=1)], Field(description="name of the study")]
    problem: Annotated[Name, Field(description="problem file, relative to the study")]
    paths: Annotated[
        Annotated[tuple[StudyPath, ...], Field(min_length=1)], Field(description="compared")
    ]
    published_tour: Annotated[
        Positive | None, Field(description="length of the tour that others published")
    ] = None
    radius: Annotated[
        Positive | None,
        Field(description="distance at which a goal counts as visited; null for the default"),
    ] = None
    speed: Annotated[
        Positive | None,
        Field(description="of the tour and of paths without time stamps; null for the default"),
    ] = None
    noise: Annotated[NonNegative, Field(description="error of positions, straightened")] = 0.0

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a study file.

        Raises
        ------
        InputError
            Not a study file; the message is one line.
        """
        text = read_text(path)
        try:
            data = tomllib.loads(text)
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path}: not TOML that netsp reads: {error}"[:300]) from None
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise InputError(f"{path}: {explain(error)}") from None

    def published_percent(self, k: int) -> float | None:
        """Return the percentage by which the published path exceeds the published tour.

        Parameters
        ----------
        k : int
            Index of the path.

        Returns
        -------
        float or None
            Percentage; None if either length is not given.
        """
        published = self.paths[k].published
        if published is None or self.published_tour is None:
            return None
        return 100.0 * (published / self.published_tour - 1.0)
