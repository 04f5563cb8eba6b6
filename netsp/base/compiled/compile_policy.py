"""Policy that decides when kernels are compiled."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

from netsp.base.number_ranges import check_not_negative


@dataclass(frozen=True)
class CompilePolicy:
    """Policy that decides when a compiled kernel takes over from the interpreted one.

    The rule is that of the ski rental problem (Karlin et al. 1988, "Competitive snoopy caching"):
    a kernel runs interpreted for as long as compiling it would take, and then is compiled. However
    long the work turns out to be, this takes at most twice the time of the better choice.

    All seconds are CPU seconds, unless they are called wall-clock seconds.

    Parameters
    ----------
    numba_s : float
        Seconds that kernels run interpreted before Numba is loaded to search for compiled code on
        disk. The default is about the time that loading Numba takes. Where no compiled code is on
        disk, Numba is loaded only to compile. With a smaller value, small problems load Numba and
        hardly use it; with a larger one, large problems begin more slowly.
    load_s : float
        Approximate seconds to load one compiled kernel from disk. With a smaller value, small
        problems load kernels that they hardly need; with a larger one, large problems begin more
        slowly.
    compile_s : float
        Approximate seconds to compile an empty kernel.
    compile_s_per_byte : float
        Approximate seconds added by each byte of bytecode of a kernel and of the kernels that it
        calls. `load_s`, `compile_s` and `compile_s_per_byte` are estimates: poor ones cost time,
        but never change a result.
    interpreted_share : float
        Share of its compile time (`compile_time_s`) that a kernel runs interpreted before it is
        compiled. The default is best where the length of the work is unknown, a smaller share where
        the work is known to be long.
    numpy_share : float
        Same share for kernels that have a vectorised form in NumPy, which is not much slower than
        compiled code.
    max_wait_ratio : float
        Maximum wall-clock time that a process waits while another process compiles the same kernel,
        as a multiple of `compile_time_s`. The other process may have been stopped. With a smaller
        ratio, two processes compile the same kernel on a machine under load.
    max_copied_bytes : int
        Maximum size of the arguments of an interpreted call, bytes. The arguments are copied, so
        that a call that takes too long can start again compiled.
    min_numpy_items : int
        Minimum number of values, such as points times solids, for which an interpreted kernel uses
        NumPy instead of a loop. Results are the same; at the default, so is the time.
    numpy_chunk_items : int
        Number of points that the vectorised forms of scene kernels compute at a time: few enough
        that their arrays fit in the processor's cache. Results are the same.
    check_interval_s : float
        Wall-clock seconds between two checks of the interpreted calls that run. A shorter interval
        ends calls more punctually and takes more CPU.
    max_idle_checks : int
        Number of checks without an interpreted call after which the checking thread sleeps until
        the next call. With a smaller number, more calls have to wake it; with a larger one, it
        takes CPU for longer.
    lock_interval_s : float
        Wall-clock seconds between two attempts to take the lock of a kernel that another process
        compiles; a small part of a compile time. A shorter interval waits more punctually and takes
        more CPU.
    counts_shared_code : bool
        Whether interpreted time counts for every kernel that shares code with the one that ran, in
        proportion to the size of the shared code. Compiling a kernel also compiles the code that it
        shares with others.
    is_eager : bool
        Whether all kernels are compiled at their first call.
    """

    numba_s: float = 0.5
    load_s: float = 0.02
    compile_s: float = 0.2
    compile_s_per_byte: float = 0.001
    interpreted_share: float = 1.0
    numpy_share: float = 1.0
    max_wait_ratio: float = 10.0
    max_copied_bytes: int = 64 * 2**20
    min_numpy_items: int = 16
    numpy_chunk_items: int = 32_768
    check_interval_s: float = 0.005
    max_idle_checks: int = 20
    lock_interval_s: float = 0.02
    counts_shared_code: bool = False
    is_eager: bool = False

    def __post_init__(self) -> None:
        check_not_negative(self)

    def compile_time_s(self, bytecode: int) -> float:
        """Return the approximate CPU seconds to compile a kernel.

        Parameters
        ----------
        bytecode : int
            Size of the bytecode of the kernel and of the kernels that it calls, bytes.
        """
        return self.compile_s + self.compile_s_per_byte * bytecode


_policy = CompilePolicy()


def current_policy() -> CompilePolicy:
    """Return the policy of this process."""
    return _policy


@contextlib.contextmanager
def compiled_by(policy: CompilePolicy) -> Iterator[None]:
    """Use another policy in all threads while the body runs."""
    global _policy
    before, _policy = _policy, policy
    try:
        yield
    finally:
        _policy = before


@contextlib.contextmanager
def everything_compiled() -> Iterator[None]:
    """Compile every kernel at its first call while the body runs."""
    with compiled_by(replace(_policy, is_eager=True)):
        yield


@contextlib.contextmanager
def long_work(interpreted_share: float = 0.1, numpy_share: float = 0.2) -> Iterator[None]:
    """Compile kernels early while the body runs, because its work is known to be long, and count
    their time by the code that they share.

    Parameters
    ----------
    interpreted_share, numpy_share : float
        Shares of the compile time that kernels run interpreted first (`CompilePolicy`).
    """
    policy = replace(
        _policy,
        interpreted_share=interpreted_share,
        numpy_share=numpy_share,
        counts_shared_code=True,
    )
    with compiled_by(policy):
        yield


def compiles() -> bool:
    """Return whether kernels are compiled at all; not with `NUMBA_DISABLE_JIT=1`."""
    from numba import config

    return not config.DISABLE_JIT
