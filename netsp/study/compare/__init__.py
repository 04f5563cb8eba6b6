"""Comparison of solvers over random worlds: studies, trials, rows."""
