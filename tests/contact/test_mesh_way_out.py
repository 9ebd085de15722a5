"""The way out among facets changes continuously with depths and residuals."""

import math

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
    space.directions["presence"][:count] = 1.0
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


def test_a_direction_without_depth_does_not_resolve_the_rest_of_another(space):
    """A many-sided solid on another: leaving by two directions, one of no depth, was shorter."""
    normals = [[0.878, -0.456, -0.146], [0.450, -0.891, -0.064], [-0.254, -0.689, 0.679]]
    normals = np.array([*normals, [-0.1555, -0.8139, -0.5598]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    residuals = [[0, 0, 1, 1], [0, 0, 0.945, 1], [0, 0.045, 0, 0.045], [0, 0, 0, 0]]
    depths = np.array([297.3e-6, 270.9e-6, 430.5e-6])
    before = way_out(space, normals[:3], depths, np.array(residuals)[:3, :3])
    after = way_out(space, normals, [*depths, 7e-8], residuals)
    assert after == pytest.approx(before, rel=1e-5)


def test_a_resolved_direction_does_not_bar_the_way(space):
    """A direction that leaves no residual may come and go: the way out leapt by a hundredth."""
    normals = np.array([[1.0, 0.0, 0.0], [-0.5, math.sqrt(0.75), 0.0]])
    one = way_out(space, normals[:1], [100e-6], [[0.0]])
    two = way_out(space, normals, [100e-6, 300e-6], [[0.0, 1.0], [0.0, 0.0]])
    assert two == pytest.approx(one, rel=1e-12)


def test_derivatives_by_residuals_of_a_direction_without_depth(space):
    depths, residuals = (
        [65.0e-6, 0.0, 65.1e-6],
        np.array([[0, 1, 0.01], [0.12, 0, 0.94], [0.3, 0.4, 0]]),
    )
    normals = np.array([[0.83, 0.241, 0.502], [0.635, 0.612, 0.471], [0.719, 0.274, 0.638]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    way_out(space, normals, depths, residuals)
    rates = space.residuals.rate[:3, :3].copy()
    for i, j in [(0, 2), (1, 0), (1, 2), (2, 0), (2, 1)]:
        step = np.zeros((3, 3))
        step[i, j] = 1e-6
        ends = [way_out(space, normals, depths, residuals + sign * step) for sign in (1, -1)]
        assert rates[i, j] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-9)


def test_derivatives_are_finite_whatever_the_directions(space):
    rng = np.random.default_rng(3)
    for _ in range(2000):
        count = rng.integers(2, 7)
        normals = rng.normal(size=(count, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        depths = rng.uniform(3e-5, 1e-4, count)
        small = rng.random(count)
        depths[small < 0.3] = 10.0 ** rng.uniform(-12, -5)
        depths[small < 0.15] = 0.0
        residuals = np.clip(rng.uniform(-0.7, 1.7, (count, count)), 0.0, 1.0)
        np.fill_diagonal(residuals, 0.0)
        s = way_out(space, normals, depths, residuals)
        assert 0.0 <= s < 1e-3
        assert np.isfinite(space.directions["rate"]).all()
        assert np.isfinite(space.directions["turn"]).all()
        assert np.isfinite(space.residuals.rate).all()
