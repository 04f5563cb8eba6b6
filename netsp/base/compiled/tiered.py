"""Kernels that run interpreted until compiling them pays.

Compiling a kernel takes up to several seconds, and loading it from disk up to a tenth of a second;
small problems are solved sooner without either. Results are the same either way.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from time import thread_time
from typing import Any

from numba import int64, njit
from numba.core import event
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.types import Boolean, Integer, unliteral  # type: ignore[attr-defined]

from netsp.base.compiled import disk_cache
from netsp.base.compiled.arguments import call_within, can_be_interpreted, is_in_pool
from netsp.base.compiled.compile_lock import is_locked, locked
from netsp.base.compiled.compile_policy import compiles, current_policy
from netsp.base.compiled.interpretation import (
    add_interpreted_time,
    called_kernels,
    interpreted_time_s,
    is_in_numpy,
)
from netsp.base.compiled.lazy_library import (
    compiled_for,
    has_machine_code,
    is_for_kernel,
    lazy_libraries,
)
from netsp.base.compiled.overtime import Overtime

OVERRIDDEN = ("compile", "get_call_template", "add_overload")
"""Methods of Numba's dispatcher that `TieredDispatcher` refines."""


class TieredDispatcher(CPUDispatcher):  # type: ignore[misc]
    """Dispatcher that interprets its function until compiling it pays (`CompilePolicy`).

    Numba calls `_compile_for_args` if there is no compiled code for the argument types of a call,
    and passes the arguments to the function that it returns.

    Attributes
    ----------
    interpreted_s : float
        CPU seconds that the function has run interpreted.
    was_on_disk : bool
        Whether compiled code was found on disk. A search takes about a millisecond, so not every
        call searches.
    next_check_s : float
        Value of `interpreted_s` at which the next call searches the disk again.
    has_compiled : bool
        Whether any kernel was compiled and kept on disk by this process; an attribute of the class.
    is_disk_full : bool
        Whether a compiled kernel could not be kept on disk; an attribute of the class.
    """

    interpreted_s = 0.0
    was_on_disk = False
    next_check_s = 0.0
    has_compiled = False
    is_disk_full = False

    _narrow_types: frozenset[tuple[Any, ...]] = frozenset()
    """Argument types with narrow integers for which Numba calls the code for wider ones."""

    def _compile_for_args(self, *args: Any, **kwargs: Any) -> Callable[..., Any]:
        policy = current_policy()
        if policy.is_eager or kwargs:
            return self._compiled(args, kwargs)
        if self.overloads:
            types = tuple(self.typeof_pyval(a) for a in args)
            if self._is_ready(_general(types)):
                return self._entry_for_narrow(types)
        on_disk = self._is_on_disk(args, policy.load_s)
        budget_s = policy.load_s
        if not on_disk:
            share = policy.numpy_share if is_in_numpy(self) else policy.interpreted_share
            budget_s = share * policy.compile_time_s(self.bytecode())
        budget_s -= interpreted_time_s(self) if policy.counts_shared_code else self.interpreted_s
        can_be = can_be_interpreted(args, policy.max_copied_bytes)
        if budget_s <= 0.0 and not on_disk and self._is_locked():
            budget_s = policy.compile_time_s(self.bytecode())  # another process is compiling it
        if budget_s <= 0.0 or not can_be or (on_disk and is_in_pool()):
            return self._compiled(args, kwargs)
        return self._within(budget_s)

    def _entry_for_narrow(self, types: tuple[Any, ...]) -> Callable[..., Any]:
        """Return the compiled code for wider integers, and have Numba call it at once next time."""
        with global_compiler_lock:
            entry = self.overloads[_general(types)].entry_point
            if types != _general(types) and types not in self._narrow_types:
                self._narrow_types |= {types}
                self._insert([kind._code for kind in types], entry, False)
        return entry  # type: ignore[no-any-return]

    def _is_on_disk(self, args: tuple[Any, ...], interval_s: float) -> bool:
        """Return whether compiled code for these arguments is known to be on disk.

        The disk is searched again after each further `interval_s` CPU seconds of interpreted calls.
        """
        if not self.was_on_disk and self.interpreted_s >= self.next_check_s:
            types = _general(self.typeof_pyval(a) for a in args)
            self.was_on_disk = disk_cache.is_on_disk(self, types)
            self.next_check_s = self.interpreted_s + interval_s
        return self.was_on_disk

    def compile(self, sig: Any) -> Any:
        """Compile the kernel for argument types, or load code that another process has compiled.

        Numbers are compiled for their widest type: a kernel that is called with 0, 1 and a number
        of 32 bits is compiled once. Machine code is generated for calls from Python only.
        """
        types = _general(sig) if isinstance(sig, tuple) else sig
        if self._is_ready(types):
            return self.overloads[types].entry_point
        with global_compiler_lock, lazy_libraries():
            if not self._is_ready(types):  # no other thread has compiled it meanwhile
                self._load_or_compile(types)
        return self.overloads[types].entry_point

    def _is_ready(self, types: tuple[Any, ...]) -> bool:
        """Return whether the code in memory is enough for the caller, Python or a kernel."""
        result = self.overloads.get(types)
        return result is not None and (is_for_kernel() or has_machine_code(result))

    def _load_or_compile(self, types: tuple[Any, ...]) -> None:
        if disk_cache.is_on_disk(self, types):
            self._obtain(types)
            return
        file = disk_cache.lock_file(self)
        policy = current_policy()
        max_wait_s = policy.max_wait_ratio * policy.compile_time_s(self.bytecode())
        with locked(file, max_wait_s), _collector_paused():
            try:
                self._obtain(types)
            except OSError:  # the disk is full, but the kernel is compiled in memory
                if not self._is_ready(types):
                    raise
                TieredDispatcher.is_disk_full = True
            else:
                TieredDispatcher.has_compiled |= file is not None

    def _obtain(self, types: tuple[Any, ...]) -> None:
        """Load the kernel from disk or compile it, and generate machine code if Python calls it."""
        if disk_cache.is_on_disk(self, types):
            self.overloads.pop(types, None)  # the version in memory has no machine code
        super().compile(types)
        if self._is_ready(types):
            return
        details = {"dispatcher": self, "args": types, "return_type": None}
        with event.trigger_event("numba:compile", data=details):
            # popped first, so that an interrupt leaves no incomplete library behind
            linked = self.overloads.pop(types)
            self.add_overload(linked.library.wrapped(linked))
        self._cache.save_overload(types, self.overloads[types])

    def add_overload(self, cres: Any) -> None:
        """Add a result of compiling; without machine code, Python does not call it."""
        if has_machine_code(cres):
            super().add_overload(cres)
        else:
            self.overloads[tuple(cres.signature.args)] = cres

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return the template with which Numba compiles a call of this kernel by another one."""
        with compiled_for(is_kernel=True):
            return super().get_call_template(
                _general(args), dict(zip(kws, _general(kws.values()), strict=True))
            )

    @property
    def has_machine_code(self) -> bool:
        """True if Python can call compiled code of the kernel, for any argument types."""
        return any(map(has_machine_code, list(self.overloads.values())))

    def _compiled(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Callable[..., Any]:
        return super()._compile_for_args(*args, **kwargs)  # type: ignore[no-any-return]

    def _within(self, budget_s: float) -> Callable[..., Any]:
        """Return the interpreted function; a call that takes too long is restarted compiled."""

        def run(*args: Any) -> Any:
            begin = thread_time()
            try:
                return call_within(budget_s, self, args)
            except Overtime:
                pass
            finally:
                spent = thread_time() - begin
                self.interpreted_s += spent
                add_interpreted_time(self, spent)
            return self._compiled(args, {})(*args)

        return run

    def bytecode(self) -> int:
        """Return the size of the bytecode, in bytes, of the function and of the kernels that it
        calls, as far as they are not compiled."""
        return sum(len(k.py_func.__code__.co_code) for k in called_kernels(self) if not k.overloads)

    def _is_locked(self) -> bool:
        """Return whether another process compiles the function."""
        return is_locked(disk_cache.lock_file(self))


@contextlib.contextmanager
def _collector_paused() -> Iterator[None]:
    """Pause the garbage collector: of the millions of objects that Numba creates, nearly all live
    until the function is compiled."""
    is_collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if is_collecting:
            gc.enable()


def _general(types: Iterable[Any]) -> tuple[Any, ...]:
    """Return argument types with integers widened to 64 bits and no literal types."""
    return tuple(map(_widest, types))


def _widest(kind: Any) -> Any:
    kind = unliteral(kind)
    is_narrow = isinstance(kind, Integer) and kind.bitwidth < 64  # type: ignore[attr-defined]
    return int64 if is_narrow and not isinstance(kind, Boolean) else kind


@cache
def is_supported() -> bool:
    """Return whether this release of Numba dispatches as `TieredDispatcher` expects.

    Otherwise kernels are compiled at their first call.
    """
    if not compiles() or not disk_cache.is_supported():
        return False

    def probe(x: int) -> int:
        return x + 1

    probed = njit(probe)
    seen: list[Any] = []

    class Probe(CPUDispatcher):  # type: ignore[misc]
        def _compile_for_args(self, *args: Any) -> Callable[[int], int]:
            seen.append(self.typeof_pyval(*args))
            return lambda x: -x

    try:
        probed.__class__ = Probe
        is_called = probed(1) == -1 and len(seen) == 1 and not probed.overloads
        return is_called and all(callable(getattr(Probe, k, None)) for k in OVERRIDDEN)
    except (AttributeError, TypeError):
        return False
