"""Libraries of compiled functions that get machine code only where Python calls them.

Numba optimises each kernel, generates its machine code, and wraps it for Python and for C; then it
links the kernel into its callers, where all of this happens again. With these libraries, only a
kernel that Python calls becomes machine code, together with all kernels that it calls; the others
are kept as LLVM's intermediate representation, to be linked. That nearly halves the time of
compiling.

This file relies on parts of Numba that are not public; `is_supported` checks that they are there.
"""

from __future__ import annotations

import contextlib
import gc
import inspect
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Flags
from numba.core.dispatcher import Dispatcher
from numba.core.environment import lookup_environment
from numba.core.registry import cpu_target
from numba.core.targetconfig import TargetConfig

from netsp.compiled.disk_cache import cached

LINKED_OPTIONS = {"nogil": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of Numba for kernels that are linked into others."""

ENTRY_OPTIONS = {"nogil": True, "no_cfunc_wrapper": True}
"""Options of Numba for functions that Python calls."""

_WRAPPER = "_ZN7cpython"  # how the names of wrappers for Python begin
_ENVIRONMENT = "_ZN08NumbaEnv"  # how the names of the variables of environments begin
_KIND = "linked"  # name of this kind of file


class LinkedLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Library of one function, which has machine code only where Python calls the function."""

    _is_linked_only = False

    @property
    def codegen(self) -> Any:
        """Numba's code generator; without machine code there is no variable to set."""
        return _WithoutVariables(self._codegen) if self._is_linked_only else self._codegen

    def finalize(self) -> None:
        """Generate machine code if Python can call the function; otherwise link it only."""
        if any(not f.is_declaration and f.name.startswith(_WRAPPER) for f in self._own_functions()):
            super().finalize()
            for variable in self._final_module.global_variables:
                environment = lookup_environment(variable.name)
                if environment is not None and variable.name.startswith(_ENVIRONMENT):
                    self._codegen.set_env(variable.name, environment)
            return
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._is_linked_only = self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of a function, 0 if there is none; generate machine code if needed."""
        self._ensure_finalized()
        if self._is_linked_only:
            if not any(f.name == name and not f.is_declaration for f in self._own_functions()):
                return 0
            self._is_linked_only = self._finalized = False
            self._optimize_final_module()
            self._finalize_final_module()
        return super().get_pointer_to_function(name)  # type: ignore[no-any-return]

    def serialize_using_object_code(self) -> tuple[str, str, Any]:
        """Return the library in the form that is kept on disk."""
        self._ensure_finalized()
        if self._is_linked_only:
            return self.name, _KIND, self._get_module_for_linking().as_bitcode()
        return super().serialize_using_object_code()  # type: ignore[no-any-return]

    def _own_functions(self) -> Any:
        return self._final_module.functions

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration:
                passes, builder = self._codegen._function_pass_manager()
                passes.run(function, builder)

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> Any:
        name, kind, data = state
        if kind != _KIND:
            return super()._unserialize(codegen, state)
        library = codegen.create_library(name)
        library._final_module = llvm.parse_bitcode(data)
        library._is_linked_only = library._finalized = True
        return library


class _WithoutVariables:
    """Numba's code generator for a library that has no machine code."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing: the caller of this library sets the variable once it has machine code."""


@contextlib.contextmanager
def linked_libraries() -> Iterator[None]:
    """Make Numba create a `LinkedLibrary` for each function that is compiled while the body runs.

    Python's garbage collector pauses meanwhile: Numba creates millions of objects that live as long
    as the function is being compiled.
    """
    codegen = cpu_target.target_context.codegen()
    before, is_collecting = codegen._library_class, gc.isenabled()
    if before is LinkedLibrary:
        yield
        return
    codegen._library_class = LinkedLibrary
    Flags.__eq__, Flags.__hash__ = _are_equal, _hash_of  # type: ignore[method-assign,assignment]
    gc.disable()
    try:
        yield
    finally:
        codegen._library_class = before
        del Flags.__eq__, Flags.__hash__
        if is_collecting:
            gc.enable()


def _are_equal(flags: Any, others: Any) -> Any:
    """Return whether two sets of flags are equal. Numba compares flags millions of times and looks
    up each of them; this gives the same answer sooner."""
    if isinstance(others, Flags) and flags._values == others._values:
        return True
    return TargetConfig.__eq__(flags, others)


@cache
def _hash_of_names() -> int:
    return int(TargetConfig.__hash__(Flags()))


def _hash_of(flags: Any) -> int:
    """Return the hash of a set of flags; Numba's depends on the names of all flags alone."""
    return _hash_of_names()


def is_linked_only(result: Any) -> bool:
    """Return whether Numba's result of compiling a function has no machine code."""
    return getattr(result.library, "_is_linked_only", False)


def entry_of(kernel: Any, function: Callable[..., Any]) -> Any:
    """Return Numba's dispatcher of a function that Python calls, and that calls a kernel.

    Parameters
    ----------
    kernel : dispatcher
        The kernel, with the options `LINKED_OPTIONS`.
    function : callable
        The kernel's function.
    """
    code = function.__code__
    listed = ", ".join(code.co_varnames[: code.co_argcount])
    scope: dict[str, Any] = {"__name__": function.__module__, "kernel_": kernel}
    text = f"def {function.__name__}({listed}):\n    return kernel_({listed})\n"
    exec(compile(text, code.co_filename, "exec"), scope)
    entry = scope[function.__name__]
    entry.__code__ = entry.__code__.replace(co_firstlineno=code.co_firstlineno)
    entry.__qualname__ = f"{function.__qualname__}.entry"
    return cached(entry, ENTRY_OPTIONS)


@cache
def is_supported() -> bool:
    """Return whether this release of Numba has all that `LinkedLibrary` relies on.

    Otherwise each kernel gets machine code of its own, which takes nearly twice the time.
    """
    codegen = cpu_target.target_context.codegen()
    library = codegen.create_library("probe")
    passes = getattr(codegen, "_function_pass_manager", None)
    flags, others = Flags(), Flags()
    others.nrt = True
    return (
        getattr(codegen, "_library_class", None) is JITCodeLibrary
        and all(hasattr(library, name) for name in _NEEDED_OF_LIBRARIES)
        and callable(getattr(codegen, "set_env", None))
        and callable(getattr(Dispatcher, "add_overload", None))
        and callable(getattr(Dispatcher, "_insert", None))
        and callable(passes)
        and "ll_module" not in inspect.signature(passes).parameters
        and not {"__eq__", "__hash__"} & set(vars(Flags))
        and TargetConfig.__hash__(flags) == TargetConfig.__hash__(others)
        and hasattr(flags, "_values")
    )


_NEEDED_OF_LIBRARIES = (
    "_codegen", "_linking_libraries", "_final_module", "_finalized", "_reload_init",
    "_raise_if_finalized", "_ensure_finalized", "_get_module_for_linking",
    "_finalize_dynamic_globals", "_finalize_final_module", "_optimize_final_module",
    "_optimize_functions", "_unserialize", "serialize_using_object_code",
)  # fmt: skip
