"""A post and a ring in space."""

import math

import numpy as np

from netsp.world import Scene

POST = Scene(solids=[{"post": {"center": [0, 0], "radius": 0.5}}], bounds=(-4, -4, -1, 4, 4, 1))


def ring(turns, radius=1.2, steps=16):
    angle = math.pi + np.arange(1, int(turns * steps) + 1) * 2 * math.pi / steps
    return [(radius * math.cos(a), radius * math.sin(a), 0.0) for a in angle]
