"""The proof that is printed on the page about a second checker holds, and its numbers are right."""

import json
import re
from pathlib import Path

import pytest

from netsp_check import Refused, check
from netsp_check.leg_bounds import LegBounds
from netsp_check.proof_check import cover

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs/reference/second-checker.md").read_text(encoding="utf-8")
PROBLEM = (ROOT / "problems/known/triangle.json").read_text(encoding="utf-8")


def printed_proof():
    """Return the proof of the page."""
    return json.loads(re.search(r"```json\n(.*?)```", PAGE, re.S)[1])


def test_the_printed_proof_holds_and_a_higher_target_does_not():
    """The printed proof is accepted; with a target that is a millionth higher it is refused."""
    proof = printed_proof()
    assert check(PROBLEM, json.dumps(proof).encode()).bound == pytest.approx(12.0, rel=1e-6)
    proof["target"] += proof["target"] // 10**6
    with pytest.raises(Refused):
        check(PROBLEM, json.dumps(proof).encode())


def test_the_page_states_the_legs_that_the_checker_finds():
    """Each leg's number in the checker is on the page."""
    tree = cover(PROBLEM, printed_proof())
    legs = LegBounds(tree)
    for u, v in ((0, 1), (0, 2), (1, 2)):
        assert str(legs.bound(u, v, 2)) in PAGE
