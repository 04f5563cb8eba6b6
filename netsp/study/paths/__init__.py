"""Measures of paths from any source in the plane of a problem, without roadmap and solver."""

from netsp.study.paths.path_measures import GoalVisit, PathMeasures, PathPolicy, measure_path

__all__ = ["GoalVisit", "PathMeasures", "PathPolicy", "measure_path"]
