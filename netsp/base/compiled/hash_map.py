"""Hash table for kernels: open addressing with linear probing in two arrays."""

from __future__ import annotations

import numpy as np

from netsp.base.arrays import Floats, Ints
from netsp.base.compiled.kernel import kernel


@kernel
def rehashed(key: Ints, value: Floats) -> tuple[Ints, Floats]:
    """Return keys (slots,), -1 for an empty slot, and values (slots,) of a table twice as large."""
    n = 2 * len(key)
    key2 = np.full(n, -1, dtype=np.int64)
    value2 = np.empty(n)
    for i in range(len(key)):
        if key[i] >= 0:
            slot = (key[i] * 0x9E3779B1) % n
            while key2[slot] >= 0:
                slot += 1
                if slot == n:
                    slot = 0
            key2[slot] = key[i]
            value2[slot] = value[i]
    return key2, value2
