"""Solvers and roadmaps by name; from a problem to its solution."""
