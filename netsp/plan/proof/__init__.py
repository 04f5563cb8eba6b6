"""Proofs of lower bounds, for `netsp_check` to check."""
