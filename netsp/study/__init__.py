"""Studies: solvers over many worlds, the library of problems, measures of paths."""
