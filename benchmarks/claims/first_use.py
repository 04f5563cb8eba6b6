"""Claims about first uses: CPU seconds of all processes when nothing is compiled yet.

On a machine slower than the reference machine, limits are extended in proportion
(`machine_speed.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from claims.claim import Claim

if TYPE_CHECKING:
    from cold import FirstUse

WORLDS_PER_GOAL_COUNT = 2
"""Random worlds for each number of goals in `make accept`; `cold.py` measures five by default."""


def within(use: FirstUse) -> tuple[str, bool]:
    """Measure one run, and the speed of the machine before and after it."""
    from machine_speed import slowness

    before = slowness()
    spent = use.cpu_s()
    factor = max(before, slowness())
    shown = f"{spent:.1f} s CPU (limit × {factor:.2f} on this machine)"
    return shown, spent <= use.max_cpu_s * factor


def claims() -> Iterator[Claim]:
    """Yield a claim for each first use."""
    import cold

    for use in cold.first_uses(WORLDS_PER_GOAL_COUNT):
        yield Claim(
            f"first use: {use.name}", f"{use.max_cpu_s:g} s CPU", partial(within, use),
            timed=True, beside=True,
        )  # fmt: skip
