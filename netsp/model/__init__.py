"""Validated input and output: problems, goals, solutions, random worlds."""
