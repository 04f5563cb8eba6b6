"""Scenes in space, distance fields and the model of the taut tether."""
