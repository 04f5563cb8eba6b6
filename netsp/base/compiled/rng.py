"""Random numbers for kernels.

The generator is xorshift64* (Vigna 2016, "An experimental exploration of Marsaglia's xorshift
generators, scrambled"). Its state is an array of one 64-bit integer, seeded from the solver's
generator. The numbers are the same with every version of NumPy and Numba, and ten times faster than
a method call.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from netsp.base.compiled.interpretation import interprets
from netsp.base.compiled.kernel import kernel

UINT64_MASK = 2**64 - 1
"""Format of an unsigned integer of 64 bits: all bits set."""


def seeded(rng: np.random.Generator) -> npt.NDArray[np.uint64]:
    """Return the state (1,) of a generator, seeded from a NumPy generator."""
    return np.array([rng.integers(1, 2**63)], dtype=np.uint64)


@kernel
def uniform(state: npt.NDArray[np.uint64]) -> float:
    """Return a random number in [0, 1)."""
    x = state[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    state[0] = x
    return np.float64((x * np.uint64(2685821657736338717)) >> np.uint64(11)) / 9007199254740992.0


@interprets(uniform)
def _uniform_by_integers(state: npt.NDArray[np.uint64]) -> float:
    """Compute `uniform` with Python's integers, because NumPy warns when a product overflows."""
    x = int(state[0])
    x ^= x >> 12
    x = (x ^ (x << 25)) & UINT64_MASK
    x ^= x >> 27
    state[0] = x
    return ((x * 2685821657736338717 & UINT64_MASK) >> 11) / 9007199254740992.0


@kernel
def below(n: int, state: npt.NDArray[np.uint64]) -> int:
    """Return a random integer from 0 to n - 1."""
    return int(uniform(state) * n)


@kernel
def metropolis(rise: float, theta: float, state: npt.NDArray[np.uint64]) -> bool:
    """Return whether a proposal is accepted: always if the cost falls, else with probability
    exp(-rise / θ).

    Source: McCammon & Hollinger 2017, equation (5); 2016, equation (2).
    """
    return rise <= 0.0 or uniform(state) < math.exp(-rise / theta)
