"""Checking of a proof file against a problem file."""

from __future__ import annotations

import json
import math
import zlib
from dataclasses import dataclass
from typing import Any

from netsp_check.covering_tree import CoveringTree
from netsp_check.dual_bound import Bound
from netsp_check.leg_bounds import LegBounds
from netsp_check.problem_file import Problem, Refused, read_problem
from netsp_check.triangulation import Triangulation

MAX_NODES = 2_000_000
"""Format limit: triangles of the cover within reach, so that a check ends."""


@dataclass(frozen=True)
class Checked:
    """What a proof has shown: no tour of the problem is shorter than `bound`.

    Attributes
    ----------
    bound : float
        Length in the problem's units; inf if there is no tour.
    margin, slack : float
        Length by which obstacles are grown, and share of the tether that is kept in reserve.
    vertices, legs, leaves : int
        Classes of the tether at all places, legs that were measured, and leaves of the tree.
    closed_gaps : int
        Number of gaps between obstacles, narrower than a billionth of the size, that are closed.
    left_out : tuple of str
        Rules of the problem that only shorten the bound.
    """

    bound: float
    margin: float
    slack: float
    vertices: int
    legs: int
    leaves: int
    closed_gaps: int
    left_out: tuple[str, ...]


def read_proof(data: bytes) -> dict[str, Any]:
    """Return a proof from the bytes of a file, deflated or not."""
    if data[:1] == b"x":
        data = zlib.decompress(data)
    proof = json.loads(data)
    if not isinstance(proof, dict) or proof.get("format") != "netsp-proof 1":
        raise Refused('proof: expected "format": "netsp-proof 1"')
    return proof


def cover(problem_text: str, proof: dict[str, Any]) -> tuple[Problem, CoveringTree]:
    """Return the problem, and the part of its cover that tours shorter than the target use."""
    margin, slack = float(proof.get("margin", 0.0)), float(proof.get("slack", 0.0))
    if not (margin >= 0.0 and slack >= 0.0):
        raise Refused("proof: expected a margin and a slack of at least 0")
    problem = read_problem(problem_text, int(proof["grid"]), margin, slack)
    flat, corners = proof["points"], proof["triangles"]
    if not all(isinstance(v, int) for v in [*flat, *corners]):
        raise Refused("proof: expected whole numbers for points and triangles")
    points = list(zip(flat[::2], flat[1::2], strict=True))
    triangles = list(zip(corners[::3], corners[1::3], corners[2::3], strict=True))
    if corners and not 0 <= min(corners) <= max(corners) < len(points):
        raise Refused("proof: a triangle has a corner that is no point")
    bridges = [((a, b), (c, d)) for a, b, c, d in proof.get("bridges", ())]
    triangulation = Triangulation(problem, points, triangles, proof.get("box"), bridges)
    # a tour to a class is at least twice as long as the tether there (Lemma 12)
    reach = float(problem.tether)
    if proof["target"] is not None:
        reach = min(reach, proof["target"] / 2.0)
    return problem, CoveringTree(triangulation, reach + 1.0, MAX_NODES)


def check(problem_text: str, proof_data: bytes) -> Checked:
    """Return what a proof shows about a problem.

    Raises
    ------
    Refused
        The proof does not hold, or the problem is of a kind that proofs do not cover.
    """
    try:
        return _check(problem_text, read_proof(proof_data))
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, zlib.error) as error:
        raise Refused(f"the file is damaged: {type(error).__name__}: {error}") from None


def _check(problem_text: str, proof: dict[str, Any]) -> Checked:
    problem, tree = cover(problem_text, proof)
    if proof["classes"] != [len(tree.vertices), tree.digest()]:
        raise Refused("classes: the proof is about others; it belongs to another problem")
    legs = LegBounds(tree)
    target = proof["target"]
    bound = Bound(tree, legs, None if target is None else int(target))
    bound.check(proof["tree"], proof.get("cuts", []))
    return Checked(
        bound=math.inf if target is None else target * 2.0**-problem.grid,
        margin=float(proof.get("margin", 0.0)),
        slack=float(proof.get("slack", 0.0)),
        vertices=len(tree.vertices),
        legs=len(legs.known),
        leaves=bound.leaves,
        closed_gaps=len(proof.get("bridges", ())),
        left_out=problem.left_out,
    )
