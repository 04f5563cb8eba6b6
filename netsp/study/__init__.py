"""Studies: solvers compared over many worlds, the library of problems, figures of paths."""
