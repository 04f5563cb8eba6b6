"""Registries of named things, netsp's and other packages': the plug-in doors of netsp.

A package adds to a registry by an entry point in its `pyproject.toml`. The name then works wherever
netsp's own names do, in study files and on the command line too:

    [project.entry-points."netsp.solvers"] my-solver = "my_package:solve"

Without a package, ``module:attribute`` itself is a name.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import os
import re
import sys
from collections.abc import Callable, Iterator, MutableMapping
from contextlib import contextmanager
from functools import cached_property
from typing import Any, Generic, TypeVar

from netsp.base.errors import InputError, NetspError, PluginError

R = TypeVar("R")


_WHERE = re.compile(r"[\w.]+:[\w.]+")
"""Pattern of ``module:attribute``."""


class Registry(MutableMapping[str, R], Generic[R]):
    """Records by name, netsp's first, in order.

    Parameters
    ----------
    kind : str
        Term for a record in messages.
    group : str
        Name of the entry points of other packages.
    builtin : dict
        netsp's records by name.
    record : callable
        Function that makes the record of another package's entry point from its name and
        ``module:attribute``.
    """

    def __init__(
        self, kind: str, group: str, builtin: dict[str, R], record: Callable[[str, str], R]
    ) -> None:
        self.kind, self.group, self._builtin, self._record = kind, group, builtin, record

    @cached_property
    def _foreign(self) -> dict[str, R]:
        """Records of other packages, which cannot replace netsp's."""
        found = importlib.metadata.entry_points(group=self.group)
        return {e.name: self._record(e.name, e.value) for e in found if e.name not in self._builtin}

    def __getitem__(self, name: str) -> R:
        if name in self._builtin:
            return self._builtin[name]
        return self._foreign[name]

    def __setitem__(self, name: str, record: R) -> None:
        self._builtin[name] = record

    def __delitem__(self, name: str) -> None:
        del self._builtin[name]

    def __iter__(self) -> Iterator[str]:
        return iter({**self._builtin, **self._foreign})

    def __len__(self) -> int:
        return len({**self._builtin, **self._foreign})

    def named(self, name: object) -> R:
        """Return the record of a name.

        Raises
        ------
        InputError
            No record has that name; the message lists the choices.
        """
        if isinstance(name, str) and name not in self and _WHERE.fullmatch(name):
            self._check_there(name)
            return self._record(name, name)
        if not isinstance(name, str) or name not in self:
            raise InputError(
                f"{self.kind}: unknown {name!r}; expected one of {', '.join(self)}, or "
                "module:attribute of yours"
            )
        return self[name]

    def _check_there(self, where: str) -> None:
        """Raise InputError unless ``module:attribute`` can be imported.

        The current folder is searched, too, where an installed command does not look for modules.
        """
        module, _, attribute = where.partition(":")
        if (folder := os.getcwd()) not in sys.path and "" not in sys.path:
            sys.path.append(folder)
        with foreign(f"{self.kind}: {where}: cannot be loaded"):
            try:
                _found(module, attribute)
            except (ImportError, AttributeError) as error:
                raise InputError(f"{self.kind}: {where}: cannot be loaded: {error}") from None


def later(name: str, where: str) -> Callable[..., Any]:
    """Return a record that is a callable, loaded from ``module:attribute`` at its first call."""
    del name
    return lambda *args, **more: load(where)(*args, **more)


def load(where: str) -> Any:
    """Return the attribute that ``module:attribute`` names.

    Raises
    ------
    InputError
        It belongs to another package, and does not exist.
    PluginError
        It belongs to another package, which fails on import.
    """
    module, _, attribute = where.partition(":")
    if module.split(".")[0] == "netsp":
        return _found(module, attribute)
    with foreign(f"{where}: cannot be loaded"):
        try:
            return _found(module, attribute)
        except (ImportError, AttributeError) as error:
            raise InputError(f"{where}: cannot be loaded: {error}") from error


def _found(module: str, attribute: str) -> Any:
    out: Any = importlib.import_module(module)
    for part in attribute.split("."):
        out = getattr(out, part)
    return out


@contextmanager
def foreign(what: str) -> Iterator[None]:
    """Turn errors of another package's code into PluginError; errors of netsp, and Ctrl-C, pass.

    Parameters
    ----------
    what : str
        Beginning of the message.

    Yields
    ------
    None
        Control, once, for the call.

    Raises
    ------
    PluginError
        Any other error was raised, also an exit; the error itself is the cause.
    """
    try:
        yield
    except (NetspError, MemoryError, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise PluginError(f"{what}: {type(error).__name__}: {_text(error)}") from error


def _text(error: BaseException) -> str:
    try:
        return str(error)
    except Exception:
        return "it cannot be shown"
