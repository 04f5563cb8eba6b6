"""Measures of any path in the plane of a problem, whoever made it. No roadmap and no solver."""

from netsp.study.paths.path_measures import GoalVisit, PathMeasures, PathPolicy, measure_path

__all__ = ["GoalVisit", "PathMeasures", "PathPolicy", "measure_path"]
