"""Policy that decides when kernels are compiled."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

from netsp.errors import InputError


@dataclass(frozen=True)
class CompilePolicy:
    """Policy that decides when a compiled kernel takes over from the interpreted one.

    The rule is that of the ski rental problem (Karlin et al. 1988, "Competitive snoopy caching"):
    a kernel runs interpreted until that has taken as long as compiling it would, and then is
    compiled. However long the work is, this takes at most twice the time of the better choice.

    All seconds are CPU seconds.

    Parameters
    ----------
    numba_s : float
        Seconds that kernels run interpreted before Numba is loaded to look for compiled code on
        disk. The default is about the time that loading Numba takes. Where no compiled code is on
        disk, Numba is loaded once it has to compile. With a smaller number, small problems load
        Numba and hardly use it; with a larger one, large problems begin more slowly.
    load_s : float
        Approximate seconds to load one compiled kernel from the disk. A smaller number loads
        kernels that a small problem hardly needs; with a larger one, large problems begin more
        slowly.
    compile_s : float
        Approximate seconds to compile an empty kernel.
    compile_s_per_byte : float
        Seconds that each byte of bytecode of a kernel, and of the kernels that it calls, adds.
        `load_s`, `compile_s` and `compile_s_per_byte` are estimates: wrong ones cost time, but
        never change a result.
    price_share : float
        Share of its compile time (`price_s`) that a kernel runs interpreted before it is compiled.
        The default wastes least where the length of the work is unknown; a smaller share is better
        where the work is known to be long.
    numpy_share : float
        Share like `price_share`, for kernels that have a form in NumPy, which is not much slower
        than compiled code.
    max_wait_prices : float
        Number of compile times (`price_s`), as wall-clock seconds, that a process waits for another
        one that compiles the same kernel and may have been stopped. With a smaller number, two
        processes compile the same kernel on a machine under load.
    max_copied_bytes : int
        Size of arguments above which a kernel is never interpreted: an interpreted call that takes
        too long is restarted from copies of its arguments.
    min_numpy_items : int
        Number of values, such as points times solids, from which on an interpreted kernel uses
        NumPy instead of a loop. Both give the same result; at the default, both take about as long.
    is_eager : bool
        Whether all kernels are compiled at their first call.
    """

    numba_s: float = 0.5
    load_s: float = 0.02
    compile_s: float = 0.2
    compile_s_per_byte: float = 0.001
    price_share: float = 1.0
    numpy_share: float = 1.0
    max_wait_prices: float = 10.0
    max_copied_bytes: int = 64 * 2**20
    min_numpy_items: int = 16
    is_eager: bool = False

    def __post_init__(self) -> None:
        for field in fields(self):
            if not getattr(self, field.name) >= 0:
                raise InputError(
                    f"{field.name}: expected a number that is not negative, "
                    f"got {getattr(self, field.name)}"
                )

    def price_s(self, bytecode: int) -> float:
        """Return about how many seconds compiling a kernel takes.

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
    """Use another policy in all threads while the body runs.

    Parameters
    ----------
    policy : CompilePolicy
        The policy.
    """
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
def long_work(price_share: float = 0.1, numpy_share: float = 0.2) -> Iterator[None]:
    """Compile kernels early while the body runs, because its work is known to be long.

    Parameters
    ----------
    price_share, numpy_share : float
        Shares of its compile time that a kernel runs interpreted first (`CompilePolicy`).
    """
    with compiled_by(replace(_policy, price_share=price_share, numpy_share=numpy_share)):
        yield


def compiles() -> bool:
    """Return whether anything is compiled at all; with NUMBA_DISABLE_JIT nothing is."""
    from numba import config

    return not config.DISABLE_JIT
