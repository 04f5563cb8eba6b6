"""Library of problems: the best known tour of each, and the ranking of solvers."""

from netsp.study.library.records import Library, Record

__all__ = ["Library", "Record"]
