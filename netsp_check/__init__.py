"""Check proofs that no tour of a problem is shorter than a bound; see docs/reference/proofs.md.

The package needs the standard library only, and nothing of netsp. Run it as
`python -m netsp_check PROBLEM TOUR PROOF`.
"""

from netsp_check.problem_file import Refused
from netsp_check.proof_check import Checked, check

__all__ = ["Checked", "Refused", "check"]
