"""Claims about first uses: CPU seconds of all processes, where nothing was compiled before."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from claims.claim import Claim

if TYPE_CHECKING:
    from cold import FirstUse

WORLDS = 2
"""Random worlds of each number of goals in the gate; `cold.py` measures five."""


def within(use: FirstUse) -> tuple[str, bool]:
    """Measure one run; no allowance, because the limits are what users were promised."""
    spent = use.cpu_s()
    return f"{spent:.1f} s CPU", spent <= use.asked_s


def claims() -> Iterator[Claim]:
    """All of these."""
    import cold

    for use in cold.first_tours(WORLDS):
        yield Claim(
            f"first use: {use.name}", f"{use.asked_s:g} s CPU", partial(within, use),
            timed=True, beside=True,
        )  # fmt: skip
