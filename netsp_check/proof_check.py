"""Checking of a proof file against a problem file."""

from __future__ import annotations

import math
import zlib
from typing import Any, NamedTuple

from netsp_check.covering_tree import CoveringTree
from netsp_check.dual_bound import Bound
from netsp_check.leg_bounds import LegBounds
from netsp_check.problem_file import Refused, read_json, read_problem
from netsp_check.triangulation import Triangulation

MAX_NODES = 500_000
"""Format limit: triangles of the cover within reach."""

MAX_BYTES = 1 << 26
"""Format limit: bytes of a proof before it is deflated."""


class Checked(NamedTuple):
    """Claim that a proof shows: no tour is shorter than `bound`, which is inf if there is no tour.

    The tour keeps `margin` more clearance than the problem asks for, and a share `slack` of its
    tether's length in reserve. Of the gaps between obstacles, `closed_gaps` that are narrower than
    two billionths of the problem's size count as closed. `vertices`, `legs` and `leaves` count
    classes of the tether, legs that were measured, and leaves of the branching tree.
    """

    bound: float
    margin: float
    slack: float
    vertices: int
    legs: int
    leaves: int
    closed_gaps: int


def read_proof(data: bytes) -> dict[str, Any]:
    """Return a proof from the bytes of a file, deflated or not."""
    if data[:1] == b"x":
        data = zlib.decompressobj().decompress(data, MAX_BYTES)
    proof = read_json(data)
    if proof.get("format") != "netsp-proof 1":
        raise Refused('proof: expected "format": "netsp-proof 1"')
    target, margin, slack = proof["target"], proof.get("margin", 0.0), proof.get("slack", 0.0)
    if target is not None and type(target) is not int:
        raise Refused(f"target: expected a whole number or null, got {target!r}")
    if not (0.0 <= margin < math.inf and 0.0 <= slack <= 1.0):
        raise Refused("proof: expected a margin of at least 0, and a slack from 0 to 1")
    return proof


def cover(problem_text: str, proof: dict[str, Any]) -> CoveringTree:
    """Return the part of a problem's cover that tours shorter than the target use."""
    problem = read_problem(problem_text, proof.get("margin", 0.0), proof.get("slack", 0.0))
    flat, corners, box = proof["points"], proof["triangles"], proof.get("box")
    bridges = [((a, b), (c, d)) for a, b, c, d in proof.get("bridges", ())]
    ends = [v for bridge in bridges for p in bridge for v in p]
    if any(type(v) is not int for v in (*flat, *corners, *(box or ()), *ends)):
        raise Refused("proof: expected whole numbers for points, triangles, box and bridges")
    points = list(zip(flat[::2], flat[1::2], strict=True))
    triangles = list(zip(corners[::3], corners[1::3], corners[2::3], strict=True))
    if not 0 <= min(corners) <= max(corners) < len(points) or (box and len(box) != 4):
        raise Refused("proof: expected corners among the points, and a box of four numbers")
    triangulation = Triangulation(problem, points, triangles, box, bridges)
    reach = float(problem.tether)
    if proof["target"] is not None:
        # a tour to a class is at least twice as long as the tether there (Lemma 12)
        reach = min(reach, proof["target"] / 2.0)
    return CoveringTree(triangulation, reach + 1.0, MAX_NODES)


def check(problem_text: str, proof_data: bytes) -> Checked:
    """Return what a proof shows about a problem.

    Raises
    ------
    Refused
        The proof does not hold, or the problem is of a kind that proofs do not cover.
    """
    try:
        proof = read_proof(proof_data)
        tree, target = cover(problem_text, proof), proof["target"]
        if proof["classes"] != [len(tree.vertices), tree.digest()]:
            raise Refused("classes: differ; the proof belongs to another problem")
        legs = LegBounds(tree)
        bound = Bound(tree, legs, target)
        bound.check(proof["tree"], proof.get("cuts", []))
    except Refused:
        raise
    except KeyError as error:
        raise Refused(f"a file is damaged: {error} is missing") from None
    except ValueError as error:
        raise Refused(f"a file is damaged: {error}") from None
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:
        raise Refused(f"a file is damaged: {type(error).__name__}: {error}") from None
    except (MemoryError, RecursionError, zlib.error) as error:
        raise Refused(f"the proof cannot be read: {type(error).__name__}") from None
    unit = 2.0**-tree.triangulation.problem.grid
    return Checked(
        bound=math.inf if target is None else target * unit,
        margin=proof.get("margin", 0.0),
        slack=proof.get("slack", 0.0),
        vertices=len(tree.vertices),
        legs=len(legs.known),
        leaves=bound.leaves,
        closed_gaps=len(proof.get("bridges", ())),
    )
