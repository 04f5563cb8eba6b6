"""Planar geometry: kernels, polygons."""
