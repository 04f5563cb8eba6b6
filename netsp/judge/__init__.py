"""Independent verification of solutions."""

from netsp.judge.checks import Check, Verification, verify

__all__ = ["Check", "Verification", "verify"]
