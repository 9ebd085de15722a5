"""The way out among facets changes continuously with depths and residuals."""

import numpy as np
import pytest

from asperity._core.kernels import kernel
from asperity.contact.response.mesh_way_out import fill_way_out
from contact.naive_meshes import brick, engine_of, slab


@kernel
def _way_out(space):
    return fill_way_out(space)


@pytest.fixture(scope="module")
def space():
    return engine_of(brick((1e-3, 1e-3, 1e-3)), slab())._mesh.space


def way_out(space, normals, depths, residuals):
    """Return the way out by some directions [m]."""
    count = len(depths)
    space.directions[:] = np.zeros((), space.directions.dtype)
    space.directions["patches"][:count] = 1
    space.directions["depth"][:count] = depths
    space.directions["normal"][:count] = normals
    space.residuals.value[:count, :count] = residuals
    return _way_out(space)


NORMALS = [
    [0.949238, 0.202924, -0.240353], [0.753680, 0.651635, -0.085660],
    [0.826756, 0.093174, -0.554793],
]  # fmt: skip
RESIDUALS = [[0, 1, 0.0064], [0, 0, 0], [0.4013, 1, 0]]


def test_a_direction_that_begins_to_overlap_changes_nothing(space):
    """A torus on a many-sided solid: the way out leapt by a hundredth there."""
    before = way_out(space, NORMALS, [129e-6, 0.0, 131.4e-6], RESIDUALS)
    for depth in (1e-12, 1e-9):
        after = way_out(space, NORMALS, [129e-6, depth, 131.4e-6], RESIDUALS)
        assert after == pytest.approx(before, abs=2.0 * depth + 1e-12 * before)


def test_derivatives_by_depths_are_those_of_the_way_out(space):
    depths = np.array([129e-6, 2e-6, 131.4e-6])
    s = way_out(space, NORMALS, depths, RESIDUALS)
    rates = space.directions["rate"][:3].copy()
    for i in range(3):
        step = np.zeros(3)
        step[i] = 1e-5 * depths[i]
        ends = [way_out(space, NORMALS, depths + sign * step, RESIDUALS) for sign in (1, -1)]
        assert rates[i] == pytest.approx((ends[0] - ends[1]) / (2 * step[i]), abs=1e-5)
    assert 0.5 * s < 129e-6 < 1.2 * s
