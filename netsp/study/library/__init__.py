"""The library of problems: what is known of each, and how solvers rank on it."""

from netsp.study.library.records import Library, Record

__all__ = ["Library", "Record"]
