"""Check a proof and say what it shows of a tour: `python -m netsp_check PROBLEM TOUR PROOF`.

PROBLEM is a problem file in the long form (`netsp verify PROBLEM --problem-output FILE` writes it),
TOUR its solution file, or - for none, and PROOF the file that `netsp solve --proof` wrote.
Exit codes: 0 the proof holds, 5 it does not or contradicts the tour, 2 a file cannot be read,
130 interrupted.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

from netsp_check import Checked, Refused, check

TOLERANCE = 1e-6  # excess of a shortest tour over the bound, as a share of its length


def sentences(problem: dict[str, Any], shown: Checked) -> list[str]:
    """Return what a proof shows, in plain sentences."""
    unit = problem.get("units", "m")
    tours = f"non-entangling tour with a tether of {problem['tether_length']:g} {unit}"
    bounded = f"no {tours} is shorter than {shown.bound:.9g} {unit}"
    out = [f"The proof holds: {f'there is no {tours}' if math.isinf(shown.bound) else bounded}."]
    if shown.margin or shown.slack:
        out.append(f"Obstacles are grown by {shown.margin:g} {unit}; slack {shown.slack:g}.")
    if n := shown.closed_gaps:
        out.append(f"Gaps narrower than two billionths of the size that count as closed: {n}.")
    return out


def compared(tour: dict[str, Any], shown: Checked) -> str:
    """Return what a proof shows of a tour; raise Refused if they contradict each other."""
    for name, proven in (("margin", shown.margin), ("slack", shown.slack)):
        if (planned := tour.get(name) or 0.0) != proven:
            raise Refused(f"it has {name} {proven:g}, but the tour has {planned:g}")
    if tour.get("length") is None:
        return "The solution file states no length, so the proof shows nothing of its tour."
    if shown.bound > (length := float(tour["length"])) * (1.0 + TOLERANCE):
        raise Refused(f"its bound is {shown.bound:.9g}, but the tour states {length:.9g}")
    says = f"If netsp verify accepts this tour of {length:.9g}, then it is "
    if length - shown.bound <= TOLERANCE * length:
        return says + "certified shortest, up to a millionth of its length."
    return f"{says}{length - shown.bound:.6g} above this bound: it is not certified shortest."


def main(words: list[str]) -> int:
    """Check the files that are named, print what was found, and return the exit code."""
    if words in (["-h"], ["--help"]):
        print(__doc__, end="")
        return 0
    if len(words) != 3:
        print(__doc__, end="", file=sys.stderr)
        return 2
    files: list[bytes] = []
    for name in words:
        try:
            files.append(b"{}" if name == "-" else Path(name).read_bytes())
            objects = [dict(json.loads(data.decode("utf-8-sig"))) for data in files[:2]]
        except (OSError, ValueError, TypeError, RecursionError) as error:
            print(f"netsp_check: {name}: cannot be read: {error}", file=sys.stderr)
            return 2
    try:
        shown = check(json.dumps(objects[0]), files[2])
        tours = [tour for tour in objects[1:] if tour]
        lines = sentences(objects[0], shown) + [compared(tour, shown) for tour in tours]
    except (Refused, KeyError, TypeError, ValueError) as error:
        print(f"NOT PROVEN: the proof is refused: {error}")
        return 5
    print("\n".join(lines))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        print("netsp_check: interrupted", file=sys.stderr)
        sys.exit(130)
