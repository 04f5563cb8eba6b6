"""Lattices on which distance fields of meshes are built (`netsp.world.scene.lattice`)."""

from __future__ import annotations

import numpy as np
import pytest

from netsp.world.scene.lattice import Dense
from netsp.world.scene.sites import triangle_sites


@pytest.mark.parametrize("seed", range(5))
def test_distances_below_others_are_the_same_as_without_a_limit(seed):
    rng = np.random.default_rng(seed)
    far, near = rng.uniform(1.0, 5.0, (2, 3, 3, 3))
    lattice = Dense(np.zeros(3), 0.3, (21, 21, 21))
    others = lattice.closest(triangle_sites(far))[0] + np.float32(0.2)
    whole = lattice.closest(triangle_sites(near))[0]
    found = lattice.closest(triangle_sites(near), below=others)[0]
    is_below = whole < others
    assert is_below.any()
    assert np.array_equal(found[is_below], whole[is_below])
    assert (found[~is_below] >= others[~is_below]).all()
