"""Data of solvers: given costs, distances by parity, results and their bounds."""
