"""Independent verification of solutions."""

from netsp.verify.judge import Check, Verification, verify

__all__ = ["Check", "Verification", "verify"]
