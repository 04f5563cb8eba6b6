"""Independent verification of solutions."""

from netsp.judge.tour_checks import Check, Verification, checked, verify

__all__ = ["Check", "Verification", "checked", "verify"]
