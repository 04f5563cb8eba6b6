"""The gate: measures every claim of README and docs on this commit, and fails if one falls short.

    python benchmarks/accept.py [PART OF A NAME …]

Most claims about time are measured first, one at a time; the others two at a time, the next one by
whichever process is free.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from claims import claims
from claims.claim import Claim
from table import head, heading, row

PROCESSES = 2


@functools.cache
def _by_name() -> dict[str, Claim]:
    return {claim.name: claim for claim in claims()}


def measured(name: str) -> tuple[str, bool, float]:
    """What was measured of a claim, whether it held, and the seconds that took."""
    claim = _by_name()[name]
    begin = time.monotonic()
    try:
        found, held = claim.measure()
        if claim.timed and not held and not claim.beside:
            first = found
            found, held = claim.measure()
            found += f" (at first {first})"
    except Exception as error:  # a claim that cannot be measured has fallen
        found, held = f"{type(error).__name__}: {error}".splitlines()[0][:200], False
    return found, held, time.monotonic() - begin


def outcomes(wanted: list[Claim]) -> Iterator[tuple[Claim, tuple[str, bool, float]]]:
    """Claims with what came of them."""
    alone = [claim for claim in wanted if claim.timed and not claim.beside]
    others = [claim for claim in wanted if not claim.timed or claim.beside]
    again = []
    yield from ((claim, measured(claim.name)) for claim in alone)
    with ProcessPoolExecutor(PROCESSES, mp_context=get_context("spawn")) as pool:
        found = pool.map(measured, [c.name for c in others])
        for claim, (shown, held, spent) in zip(others, found, strict=True):
            if claim.timed and not held:
                again.append((claim, shown))
            else:
                yield claim, (shown, held, spent)
    for claim, first in again:
        shown, held, spent = measured(claim.name)
        yield claim, (f"{shown} (at first {first})", held, spent)


def main() -> int:
    """Measure, print, and return 1 if a claim fell."""
    words = sys.argv[1:]
    wanted = [c for c in _by_name().values() if not words or any(w in c.name for w in words)]
    heading("Claims")
    head("claim", "threshold", "measured", "held", "s")
    begin, fallen = time.monotonic(), []
    for claim, (found, held, spent) in outcomes(wanted):
        fallen += [] if held else [claim.name]
        shown = found.replace("|", "/")
        row(claim.name, claim.threshold, shown, "yes" if held else "**NO**", f"{spent:.0f}")
    print(f"\nin {time.monotonic() - begin:.0f} s")
    for name in fallen:
        print(f"fell short: {name}")
    print(f"{len(wanted) - len(fallen)} passed, {len(fallen)} failed")
    return 1 if fallen or not wanted else 0


if __name__ == "__main__":
    sys.exit(main())
