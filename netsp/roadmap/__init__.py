"""Roadmaps: from the geometry of a problem to its travel graph."""
