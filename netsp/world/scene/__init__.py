"""Scenes: solids, meshes and clouds as distance fields."""
