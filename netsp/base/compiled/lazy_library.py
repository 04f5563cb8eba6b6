"""Machine code for the kernels that Python calls, and for no others.

Numba wraps each function for calls from Python, generates its machine code, and links it into its
callers, where machine code is generated again. Yet two thirds of the kernels are called by other
kernels only. Here, a function stays in LLVM's optimized intermediate representation, which can be
linked, until Python calls it; only then does it get a wrapper and machine code. That saves a fifth
of the compile time.

This module uses private parts of Numba. The function `is_supported` checks that these exist.
"""

from __future__ import annotations

import contextlib
import copy
import inspect
import threading
from collections.abc import Iterator
from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.environment import Environment, lookup_environment
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys

LINKABLE = "linkable"
"""Kind of a saved library without machine code; Numba's own kinds are `object` and `bitcode`."""

_ENVIRONMENT = "_ZN08NumbaEnv"  # prefix of the variables that hold a function's constants


class _Caller(threading.local):
    """Caller of the function that this thread compiles or loads."""

    is_kernel = False


_caller = _Caller()


class LazyLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code of one function, which gets machine code once Python calls the function.

    Attributes
    ----------
    has_machine_code : bool
        Whether the machine code exists.
    """

    has_machine_code = False

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self._environments: list[Any] = []  # the machine code has pointers to them

    @property
    def codegen(self) -> Any:
        """Numba's code generator; without machine code, setting a variable in it does nothing."""
        return self._codegen if self.has_machine_code else _WithoutVariables(self._codegen)

    def finalize(self) -> None:
        """Link the functions that this one calls, and optimize the whole."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        # Callers optimize the linked code again. Without this first pass, LLVM would vectorize
        # fewer
        # loops, and reduced-cost fixing would take three times as long.
        self._optimize_final_module()
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of a function, or 0 if the library does not define it.

        Numba asks for wrappers, which kernels do not have before they have machine code.
        """
        self._ensure_finalized()
        if not self.has_machine_code:
            if not any(
                f.name == name and not f.is_declaration for f in self._final_module.functions
            ):
                return 0
            self._generate_machine_code()
        return super().get_pointer_to_function(name)  # type: ignore[no-any-return]

    def wrapped(self, result: Any) -> Any:
        """Generate a wrapper and machine code; return a `CompileResult` that Python can call.

        Parameters
        ----------
        result : numba CompileResult
            Compiled function that can only be linked.
        """
        # The wrapper has constants. Processes that load the function inside another one never see
        # them, so they are not added to the constants of the function.
        described = copy.copy(result.fndesc)
        described.env_name += ".wrapper"
        environment = Environment.from_fndesc(described)
        context = result.target_context.subtarget(enable_nrt=True)  # arrays count references
        self._finalized = False
        context.create_cpython_wrapper(self, described, environment, None, release_gil=True)
        self._finalized = True
        self._shared_module = None  # what is saved must name the wrapper
        entry = context.get_executable(self, described, environment)
        context.insert_user_function(entry, described, [self])
        return result._replace(fndesc=described, environment=environment, entry_point=entry)

    def _generate_machine_code(self) -> None:
        self._final_module.verify()
        self._finalize_final_module()
        for variable in self._final_module.global_variables:
            environment = lookup_environment(variable.name)
            if environment is not None and variable.name.startswith(_ENVIRONMENT):
                self._environments.append(environment)
                self._codegen.set_env(variable.name, environment)

    def _finalize_final_module(self) -> None:
        super()._finalize_final_module()
        self.has_machine_code = True

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration:
                passes, builder = self._codegen._function_pass_manager()
                passes.run(function, builder)

    def serialize_using_object_code(self) -> tuple[str, str, Any]:
        """Return what is saved on disk: name, kind and code."""
        self._ensure_finalized()
        if not self.has_machine_code:
            return self.name, LINKABLE, self._get_module_for_linking().as_bitcode()
        return super().serialize_using_object_code()  # type: ignore[no-any-return]

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> Any:
        name, kind, data = state
        if kind != LINKABLE:
            return super()._unserialize(codegen, state)
        library = codegen.create_library(name)
        library.enable_object_caching()
        library._final_module = llvm.parse_bitcode(data)
        library._finalize_dynamic_globals()
        library._finalized = True
        return library


class _WithoutVariables:
    """Numba's code generator for a library without machine code, which has no variables to set."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing."""


@contextlib.contextmanager
def lazy_libraries() -> Iterator[None]:
    """Make Numba create a `LazyLibrary` for each function that the body compiles or loads.

    The caller holds Numba's global lock, so functions that other threads compile are not affected.
    """
    if not is_supported():
        yield
        return
    # Numba begins its runtime with the first function that it compiles. If that is a kernel's, the
    # runtime's own code is lazy, too: its symbols are unknown, and every call goes to address 0.
    rtsys.initialize(cpu_target.target_context)
    codegen = cpu_target.target_context.codegen()
    before = codegen._library_class
    codegen._library_class = LazyLibrary
    try:
        yield
    finally:
        codegen._library_class = before


@contextlib.contextmanager
def compiled_for(is_kernel: bool) -> Iterator[None]:
    """State the caller, a kernel or Python, of the functions that the body compiles or loads."""
    before = _caller.is_kernel
    _caller.is_kernel = is_kernel
    try:
        yield
    finally:
        _caller.is_kernel = before


def is_for_kernel() -> bool:
    """Return whether a kernel calls the function that this thread compiles or loads."""
    return _caller.is_kernel


def is_linkable(reduced: Any) -> bool:
    """Return whether a saved function has no machine code, so that it can only be linked."""
    library = reduced[0]  # see `CompileResult._reduce`
    return isinstance(library, tuple) and library[1] == LINKABLE


def has_machine_code(result: Any) -> bool:
    """Return whether Python can call a compiled function."""
    return getattr(result.library, "has_machine_code", True)


@cache
def is_supported() -> bool:
    """Return whether this release of Numba has the private parts that `LazyLibrary` uses.

    Otherwise each kernel gets machine code, which takes a quarter longer.
    """
    codegen = cpu_target.target_context.codegen()
    methods = {
        "_raise_if_finalized",
        "_ensure_finalized",
        "_get_module_for_linking",
        "_finalize_dynamic_globals",
        "_finalize_final_module",
        "_optimize_final_module",
        "_optimize_functions",
        "_unserialize",
        "enable_object_caching",
        "get_pointer_to_function",
        "serialize_using_object_code",
    }
    fields = {
        "_codegen",
        "_linking_libraries",
        "_final_module",
        "_shared_module",
        "_finalized",
        "_reload_init",
    }
    passes = getattr(codegen, "_function_pass_manager", None)
    return (
        getattr(codegen, "_library_class", None) is JITCodeLibrary
        and methods | fields <= set(dir(codegen.create_library("probe")))
        and callable(getattr(codegen, "set_env", None))
        and hasattr(codegen, "_data_layout")
        and callable(passes)
        and "ll_module" not in inspect.signature(passes).parameters
    )
