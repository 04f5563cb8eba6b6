"""Beside the vehicle: what its tether does, while somebody else is driving it."""
