"""Solvers of a generalised TSP: runs, limits, options, costs, searches, walks and files."""
