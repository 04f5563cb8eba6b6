"""Rows of a result as a pandas DataFrame; pandas is imported only when a frame is asked for."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from netsp.base.errors import InputError

if TYPE_CHECKING:
    import pandas


def frame_of(rows: Iterable[Any]) -> pandas.DataFrame:
    """Return rows (dataclasses or mappings of one kind) as a DataFrame with a column per field.

    None becomes a missing value.

    Raises
    ------
    InputError
        pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise InputError("to_frame: pandas is missing: pip install pandas") from None
    return pandas.DataFrame([dict(_fields(row)) for row in rows])


def _fields(row: Any) -> Mapping[str, Any]:
    if isinstance(row, Mapping):
        return row
    return {f.name: getattr(row, f.name) for f in dataclasses.fields(row)}
