"""The gate: measures every claim of README and docs on this commit, and fails if one falls short.

python benchmarks/accept.py [PART OF A NAME …]
"""

from __future__ import annotations

import sys
import time

from claims import claims
from table import head, heading, row


def main() -> int:
    """Measure, print, and return 1 if a claim fell."""
    wanted = sys.argv[1:]
    heading("Claims")
    head("claim", "threshold", "measured", "held", "s")
    begin, fallen, count = time.monotonic(), [], 0
    for claim in claims():
        if wanted and not any(word in claim.name for word in wanted):
            continue
        start = time.monotonic()
        try:
            measured, held = claim.measure()
            if claim.timed and not held:
                first = measured
                measured, held = claim.measure()
                measured += f" (at first {first})"
        except Exception as error:  # a claim that cannot be measured has fallen
            measured, held = f"{type(error).__name__}: {error}".splitlines()[0][:200], False
        count += 1
        fallen += [] if held else [claim.name]
        shown = measured.replace("|", "/")
        spent = time.monotonic() - start
        row(claim.name, claim.threshold, shown, "yes" if held else "**NO**", f"{spent:.0f}")
    print(f"\nin {time.monotonic() - begin:.0f} s")
    for name in fallen:
        print(f"fell short: {name}")
    print(f"{count - len(fallen)} passed, {len(fallen)} failed")
    return 1 if fallen or not count else 0


if __name__ == "__main__":
    sys.exit(main())
