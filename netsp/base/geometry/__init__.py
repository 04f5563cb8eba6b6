"""Planar geometry: kernels, polygons, polylines, trees of boxes."""
