"""Old names that work for one more release, with a DeprecationWarning."""

from __future__ import annotations

import functools
import importlib
import warnings
from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


def warn_renamed(old: str, new: str, stack_level: int = 3) -> None:
    """Warn that a name has changed.

    Parameters
    ----------
    stack_level : int
        Frames above this function at which the warning points.
    """
    warnings.warn(f"{old} is now {new}", DeprecationWarning, stacklevel=stack_level)


def deprecated_names(names: dict[str, Any], **renamed: str) -> Callable[[str], Any]:
    """Return a module's `__getattr__` that finds renamed names under their old ones.

    Parameters
    ----------
    names : dict
        The module's `globals()`.
    **renamed : str
        Old names, and their new names in the same module, or `module:name` in another one.

    Examples
    --------
    At the end of a module whose function `ways` is now `paths`:

    >>> __getattr__ = deprecated_names(globals(), ways="paths")
    """
    module = names["__name__"]

    def find(name: str) -> Any:
        if name in renamed:
            place, _, new = renamed[name].rpartition(":")
            warn_renamed(f"{module}.{name}", f"{place or module}.{new}")
            return getattr(importlib.import_module(place), new) if place else names[new]
        raise AttributeError(f"module {module!r} has no attribute {name!r}")

    return find


class deprecated_method:
    """Attribute, property or method of a class under its old name.

    Parameters
    ----------
    old, new : str
        The old name, to which this is assigned, and the new one.

    Examples
    --------
    >>> class Track:
    ...     def update(self): ...
    ...     take = deprecated_method("take", "update")
    """

    def __init__(self, old: str, new: str) -> None:
        self.old, self.new = old, new

    def __get__(self, instance: object, owner: type) -> Any:
        warn_renamed(f"{owner.__name__}.{self.old}", f"{owner.__name__}.{self.new}")
        return getattr(owner if instance is None else instance, self.new)


def renamed_parameters(**renamed: str) -> Callable[[Function], Function]:
    """Return a decorator for a function that accepts old names of keyword parameters.

    Examples
    --------
    >>> @renamed_parameters(told="on_progress")
    ... def search(on_progress=None): ...
    """

    def decorate(function: Function) -> Function:
        @functools.wraps(function)
        def call(*args: Any, **kwargs: Any) -> Any:
            for old, new in renamed.items():
                if old in kwargs:
                    if new in kwargs:
                        raise TypeError(f"{function.__name__}() got both {new!r} and {old!r}")
                    warn_renamed(f"parameter {old} of {function.__name__}", new)
                    kwargs[new] = kwargs.pop(old)
            return function(*args, **kwargs)

        return call  # type: ignore[return-value]

    return decorate
