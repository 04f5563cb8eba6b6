"""Decorator of compiled functions.

Loading Numba takes a few tenths of a second, and small problems do not need it. Numba is loaded
once kernels have run interpreted for about that time (`CompilePolicy.numba_s`) or, where no
compiled code is on disk, once a kernel has run interpreted for its compile time.
"""

from __future__ import annotations

import functools
import inspect
import operator
import os
import sys
import threading
from collections.abc import Callable, Iterator
from time import thread_time
from typing import Any, TypeVar

from netsp.base.compiled import numba_loading
from netsp.base.compiled.arguments import (
    call_interpreted,
    call_within,
    can_be_interpreted,
    is_in_pool,
)
from netsp.base.compiled.compile_policy import CompilePolicy, current_policy
from netsp.base.compiled.interpretation import (
    add_interpreted_time,
    called_kernels,
    interpreted_time_s,
)
from netsp.base.compiled.kept_code import may_be_on_disk
from netsp.base.compiled.overtime import Overtime

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Return a function that runs interpreted until compiling it pays.

    Arguments are arrays, numbers and tuples of these. Compiled code is saved on disk and releases
    the global interpreter lock. Annotations serve readers and mypy; Numba infers its own types. A
    parameter through which another thread stops the function must be named `stop`.
    """
    if "numba" not in sys.modules and os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0"):
        return Kernel(function)  # type: ignore[return-value]
    return _dispatcher_of(function)  # type: ignore[no-any-return]


def is_on_disk(kernel: Any) -> bool:
    """Return whether compiled code of a kernel is on disk, for any types; loads Numba."""
    from netsp.base.compiled import disk_cache

    return disk_cache.is_supported() and disk_cache.is_any_on_disk(kernel)


def runs_compiled(kernel: Any) -> bool:
    """Return whether a kernel is compiled, or will be at its next call; loads Numba."""
    from netsp.base.compiled.compile_policy import compiles

    if not compiles():
        return False
    compiled = getattr(kernel, "has_machine_code", bool(kernel.overloads))
    return current_policy().is_eager or compiled or is_on_disk(kernel)


def all_kernels() -> list[Any]:
    """Return the dispatchers of all kernels in the modules that are imported; loads Numba."""
    return list({getattr(kernel, "dispatcher", kernel) for kernel in _imported_kernels()})


def functions_to_compile() -> set[Callable[..., Any]]:
    """Return the functions of imported kernels that this process has neither compiled nor
    loaded."""
    return {
        kernel.py_func
        for kernel in _imported_kernels()
        if (isinstance(kernel, Kernel) and kernel._dispatcher is None) or not kernel.overloads
    }


def _imported_kernels() -> Iterator[Any]:
    """Yield all kernels in the modules that are imported."""
    from netsp.base.compiled.tiered import TieredDispatcher

    modules = [m for name, m in list(sys.modules.items()) if name.startswith("netsp.")]
    for value in [v for m in modules for v in list(vars(m).values())]:
        if isinstance(value, Kernel | TieredDispatcher):
            yield value


class Kernel:
    """Kernel that loads Numba only when a call needs it."""

    _total_s = 0.0
    """CPU seconds that all kernels together ran interpreted before Numba was loaded."""

    _lock = threading.RLock()

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._early_s = 0.0
        self._dispatcher: Any = None

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call the function, interpreted or compiled."""
        if not kwargs and "numba" not in sys.modules:
            policy = current_policy()
            budget_s = 0.0 if policy.is_eager else self._budget_s(policy)
            if budget_s > 0.0 and can_be_interpreted(args, policy.max_copied_bytes):
                begin = thread_time()
                try:
                    return call_within(budget_s, self, args)
                except Overtime:
                    pass
                finally:
                    spent = thread_time() - begin
                    self._early_s += spent
                    Kernel._total_s += spent
                    add_interpreted_time(self, spent)
        return self.dispatcher(*args, **kwargs)

    def _budget_s(self, policy: CompilePolicy) -> float:
        """Return the CPU seconds that a call may run interpreted before Numba is loaded for it."""
        if may_be_on_disk():
            return 0.0 if is_in_pool() else policy.numba_s - Kernel._total_s
        bytecode = sum(len(k.py_func.__code__.co_code) for k in called_kernels(self))
        spent = interpreted_time_s(self) if policy.counts_shared_code else self._early_s
        return policy.interpreted_share * policy.compile_time_s(bytecode) - spent

    @property
    def dispatcher(self) -> Any:
        """Numba's dispatcher of the function; reading it loads Numba."""
        if self._dispatcher is None:
            with self._lock:
                if self._dispatcher is None:
                    made = _dispatcher_of(self.py_func)
                    if hasattr(made, "interpreted_s"):
                        made.interpreted_s = self._early_s
                    self._dispatcher = made
                    self.__class__ = _LoadedKernel
        return self._dispatcher

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the dispatcher."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    def __reduce__(self) -> str:
        """Pickle as the name of the function."""
        return self.py_func.__qualname__


class _LoadedKernel(Kernel):
    """Kernel that has loaded Numba: calls go straight to the dispatcher."""

    __call__ = property(operator.attrgetter("_dispatcher"))  # type: ignore[assignment]


class UncompiledKernel:
    """Kernel that always runs interpreted, because `NUMBA_DISABLE_JIT` turns compiling off.

    It rounds as compiled code does, except for arrays of single precision; the bare function would
    not (`netsp.base.compiled.interpretation`).
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call the function as plain Python or NumPy."""
        if kwargs:
            args = inspect.signature(self.py_func).bind(*args, **kwargs).args
        return call_interpreted(self, args)

    def __reduce__(self) -> str:
        """Pickle as the name of the function."""
        return self.py_func.__qualname__


def _dispatcher_of(function: Callable[..., Any]) -> Any:
    """Return Numba's dispatcher of a function, or its interpreted form if nothing is compiled."""
    from netsp.base.compiled.compile_policy import compiles

    if not compiles():
        return UncompiledKernel(function)
    _register()
    from netsp.base.compiled import disk_cache, lazy_library, tiered

    is_kept_on_disk = disk_cache.is_supported()
    is_tiered = is_kept_on_disk and tiered.is_supported()
    is_lazy = is_tiered and lazy_library.is_supported()
    compiled = disk_cache.cached(function, has_wrapper=not is_lazy)
    if is_kept_on_disk:
        disk_cache.keep_on_disk(compiled, function)
    if is_tiered:
        compiled.__class__ = tiered.TieredDispatcher
    return compiled


@functools.cache
def _register() -> None:
    """Make Numba treat a `Kernel` in a kernel's globals as its dispatcher."""
    from numba.core.types import Dispatcher
    from numba.extending import typeof_impl

    @typeof_impl.register(Kernel)  # type: ignore[untyped-decorator]
    def _type_of(value: Kernel, context: Any) -> Any:
        return Dispatcher(value.dispatcher)

    numba_loading.on_numba_loaded()
