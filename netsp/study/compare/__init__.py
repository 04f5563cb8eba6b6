"""Solvers side by side over random worlds: studies, trials, rows."""
