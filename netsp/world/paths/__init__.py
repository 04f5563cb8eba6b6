"""Paths about obstacles in space: shortest trees, sampling planners, refinement."""
