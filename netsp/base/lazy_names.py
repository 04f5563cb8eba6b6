"""Names of a package that are imported when first used: importing it is instant."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any


def lazy_names(
    package: dict[str, Any], places: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package.

    Parameters
    ----------
    package : dict
        The package's `globals()`.
    places : mapping
        Each public name and the module that defines it.

    Examples
    --------
    >>> __getattr__, __dir__ = lazy_names(globals(), {"sleep": "time"})
    """
    name_of_package = package["__name__"]

    def find(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {name_of_package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(places[name]), name)
        package[name] = value
        return value

    def names() -> list[str]:
        return sorted({*package, *places})

    return find, names
