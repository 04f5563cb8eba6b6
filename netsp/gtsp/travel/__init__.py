"""The seam between geometry and optimisation: travel graphs, the detours beneath, results."""
