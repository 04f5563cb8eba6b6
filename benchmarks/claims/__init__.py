"""What README and docs claim, in a quick form: one entry a claim, measured by the benchmarks' code.

A claim has a name, a threshold as it is published, and a function that measures it and says whether
it held. Correctness has no allowance. A claim about time counts CPU seconds, with an allowance of
three (none for first uses), and is measured once more before it falls: the machine may be busy.
"""

from __future__ import annotations

from collections.abc import Iterator

from claims import command, first_use, guard, offline, online, page, sites, space
from claims.claim import Claim


def claims() -> Iterator[Claim]:
    """All of them; names are told apart. The pages' commands take longest, so they come first: in
    the end no process waits for one."""
    yield from command.starting()
    yield from first_use.claims()
    yield from command.running()
    yield from offline.claims()
    yield from online.claims()
    yield from sites.claims()
    yield from page.claims()
    yield from space.claims()
    yield from guard.claims()
