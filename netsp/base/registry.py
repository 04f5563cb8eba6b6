"""Registries of solvers, roadmaps and other parts by name, netsp's own and those of plug-ins.

A package registers a part by an entry point in its `pyproject.toml`. The name then works wherever
netsp's own names do, also in study files and on the command line:

    [project.entry-points."netsp.solvers"] my-solver = "my_package:solve"

An object reference, ``module:attribute``, is a name, too; it needs no package.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from contextlib import contextmanager, nullcontext
from functools import cached_property, wraps
from typing import Any, Generic, TypeVar, cast

from netsp.base.errors import InputError, NetspError, PluginError

R = TypeVar("R")
F = TypeVar("F", bound=Callable[..., Any])


_REFERENCE = re.compile(r"[\w.]+:[\w.]+")
"""Pattern of an object reference, ``module:attribute``."""


class Registry(MutableMapping[str, R], Generic[R]):
    """Mapping from names to records; netsp's own come first.

    Parameters
    ----------
    kind : str
        Noun for a record in messages, such as "solver".
    group : str
        Name of the entry points of other packages.
    builtin : dict
        netsp's records by name.
    record : callable
        Function that makes a record from the name and the object reference of an entry point.
    """

    def __init__(
        self, kind: str, group: str, builtin: dict[str, R], record: Callable[[str, str], R]
    ) -> None:
        self.kind, self.group, self._builtin, self._record = kind, group, builtin, record

    @cached_property
    def _foreign(self) -> dict[str, R]:
        """Records of plug-ins; an entry point with the name of a record of netsp is ignored."""
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
        """Return the record with a name, or of an object reference.

        Raises
        ------
        InputError
            No record has that name; the message lists the choices.
        """
        if isinstance(name, str) and name not in self and _REFERENCE.fullmatch(name):
            self._check_loads(name)
            return self._record(name, name)
        if not isinstance(name, str) or name not in self:
            raise InputError(
                f"{self.kind}: unknown {name!r}; expected one of {', '.join(self)}, or "
                "module:attribute of yours"
            )
        return self[name]

    def is_foreign(self, name: str) -> bool:
        """Return whether a name is that of a part of another package, or an object reference."""
        return name not in self._builtin

    def _check_loads(self, reference: str) -> None:
        """Raise InputError unless an object reference can be imported.

        The current folder is added to the search path: an installed command does not search it.
        """
        module, _, attribute = reference.partition(":")
        if (folder := os.getcwd()) not in sys.path and "" not in sys.path:
            sys.path.append(folder)
        with foreign(f"{self.kind}: {reference}: cannot be loaded"):
            try:
                _found(module, attribute)
            except (ImportError, AttributeError) as error:
                raise InputError(f"{self.kind}: {reference}: cannot be loaded: {error}") from None


class Later:
    """Function that imports an object reference when called, and calls the object."""

    def __init__(self, name: str, reference: str) -> None:
        self.name, self.reference = name, reference

    @property
    def is_ours(self) -> bool:
        """True if the object is netsp's own."""
        return re.split("[.:]", self.reference)[0] == "netsp"

    def __call__(self, *args: Any, **options: Any) -> Any:
        """Return what the object returns."""
        return load(self.reference)(*args, **options)


def later(name: str, reference: str) -> Callable[..., Any]:
    """Return a function that imports an object reference when called, and calls the object."""
    return Later(name, reference)


def load_target(factory: Callable[..., Any]) -> Any:
    """Return the object that `later` calls; other callables as they are."""
    return load(factory.reference) if isinstance(factory, Later) else factory


def make_part(
    kind: str, factory: Callable[..., Any], arguments: Mapping[str, Any], methods: Sequence[str]
) -> Any:
    """Return what the factory of a part makes, such as a planner.

    Parameters
    ----------
    arguments : mapping
        Arguments by the names that a message has for them; they are passed by position.
    methods : sequence of str
        Methods that the part must have.

    Raises
    ------
    InputError
        The factory cannot be called with these arguments, or the part lacks a method.
    PluginError
        The factory is named by an object reference of another package, and raises an error.
    """
    named = factory if isinstance(factory, Later) else None
    what = f"{kind} {named.name if named else getattr(factory, '__name__', factory)!r}"
    with foreign(f"{what} failed") if named and not named.is_ours else nullcontext():
        build = load_target(factory)
        check_callable(what, build, [*arguments])
        made = build(*arguments.values())
        missing = [m for m in methods if not callable(getattr(made, m, None))]
        if missing:
            raise InputError(f"{what}: has no method {missing[0]!r}; expected {', '.join(methods)}")
        return made


def blame_plugins(**registries: Registry[Any]) -> Callable[[F], F]:
    """Return a decorator that turns errors of a call into PluginErrors if other packages have parts
    in it.

    Parameters
    ----------
    **registries : Registry
        Registry of each parameter that names a part. Only names count, as those of the command
        line; the errors of callables reach the caller as they are.
    """

    def decorate(call: F) -> F:
        signature = inspect.signature(call)

        @wraps(call)
        def guarded(*args: Any, **options: Any) -> Any:
            given = signature.bind(*args, **options).arguments
            parts = [
                f"{kind} {given[kind]!r}"
                for kind, registry in registries.items()
                if isinstance(given.get(kind), str) and registry.is_foreign(given[kind])
            ]
            with foreign(f"{', '.join(parts)} failed") if parts else nullcontext():
                return call(*args, **options)

        return cast(F, guarded)

    return decorate


def check_callable(
    what: str, function: Any, arguments: Sequence[str], options: Mapping[str, Any] | None = None
) -> None:
    """Raise InputError unless an object can be called with some arguments.

    Parameters
    ----------
    what : str
        Beginning of the message.
    arguments : sequence of str
        Names for the arguments that are passed by position, for the message.
    options : mapping, optional
        Arguments that are passed by name.
    """
    expected = f"expected a callable with the arguments ({', '.join(arguments)})"
    if not callable(function):
        raise InputError(f"{what}: a {type(function).__name__} cannot be called; {expected}")
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # compiled: it has no signature
        return
    try:
        signature.bind(*arguments, **(options or {}))
    except TypeError as error:
        raise InputError(f"{what}: {error}; {expected}") from None


def load(reference: str) -> Any:
    """Return the object of a reference, ``module:attribute``.

    Raises
    ------
    InputError
        A plug-in does not have the object.
    PluginError
        A plug-in raises an error on import.
    """
    module, _, attribute = reference.partition(":")
    if module.split(".")[0] == "netsp":
        return _found(module, attribute)
    with foreign(f"{reference}: cannot be loaded"):
        try:
            return _found(module, attribute)
        except (ImportError, AttributeError) as error:
            raise InputError(f"{reference}: cannot be loaded: {error}") from error


def _found(module: str, attribute: str) -> Any:
    out: Any = importlib.import_module(module)
    for part in attribute.split("."):
        out = getattr(out, part)
    return out


@contextmanager
def foreign(what: str) -> Iterator[None]:
    """Turn errors of a plug-in into PluginError; let errors of netsp and Ctrl-C through.

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
        The body raised another error, or called `exit`; that error is the cause.
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
