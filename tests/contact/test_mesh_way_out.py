"""The way out among facets changes continuously with depths and residuals."""

import math

import numpy as np
import pytest

from asperity._core.kernels import kernel
from asperity.contact.response.mesh_way_out import fill_way_out
from contact.naive_meshes import brick, engine_of, slab

RAISED = 1e-4
"""Height of the textures [m]."""


@kernel
def _way_out(space):
    return fill_way_out(RAISED, space)


@pytest.fixture(scope="module")
def space():
    return engine_of(brick((1e-3, 1e-3, 1e-3)), slab())._mesh.space


def way_out(space, normals, depths, residuals, volumes=1e-8, deepest=0.0):
    """Return the way out by some directions [m]; the smooth bodies overlap by `deepest` [m]."""
    count = len(depths)
    space.region.sums["volume"][:count] = volumes
    space.region.sums["deepest"][:count] = deepest
    space.directions[:] = np.zeros((), space.directions.dtype)
    space.directions["patches"][:count] = 1
    space.directions["presence"][:count] = 1.0
    space.directions["depth"][:count] = space.directions["lowest"][:count] = depths
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


@pytest.mark.parametrize("part", [0.3, 0.7, 2.0])
def test_a_direction_that_another_resolves_adds_nothing(space, part):
    """Where its depth was a fortieth of the other's, the way out was longer by a twentieth."""
    normals, residuals = [[0.0, 0.6, 0.8], [0.0, 0.0, 1.0]], np.array([[0.0, 0.0], [1.0, 0.0]])
    volumes = widths([part, 50.0], 1.7e-3)
    for depth in np.linspace(0.0, 150e-6, 31):
        s = way_out(space, normals, [depth, 1768e-6], residuals, volumes, 1.7e-3)
        assert s == pytest.approx(1768e-6, rel=1e-9)


def widths(of_wide, deepest):
    """Return volumes of regions [m^3] at parts of the width from which a direction counts fully."""
    return 0.03 * np.array(of_wide) * (RAISED + np.asarray(deepest)) ** 3


def test_a_narrow_direction_comes_gradually(space):
    """A wall that the tool begins to touch, 0.4 mm deep at once: the way out leapt fivefold."""
    normals, residuals = np.eye(3)[:2], np.ones((2, 2))
    depths, deepest = [90e-6, 400e-6], np.array([1e-4, 4e-4])
    ways = []
    for part in np.linspace(0.0, 1.2, 200):
        volumes = widths([3.0, part], deepest)
        ways.append(way_out(space, normals, depths, residuals, volumes, deepest))
    assert ways[0] == 90e-6
    assert ways[-1] == pytest.approx(math.hypot(*depths))
    assert 0.0 < np.diff(ways).max() < 0.02 * ways[-1]
    assert np.diff(ways).min() > -1e-3 * ways[-1]


def test_a_narrow_direction_of_no_depth_resolves_nothing(space):
    """Beside an edge that the tool only begins to reach, the way out fell by a fifth."""
    normals, residuals = np.eye(3)[:2], np.array([[0.0, 0.8], [1.0, 0.0]])
    one = way_out(space, normals[:1], [60e-6], [[0.0]])
    for part in (0.0, 1e-9, 0.099):
        two = way_out(space, normals, [60e-6, 0.0], residuals, widths([3.0, part], 0.0))
        assert two == pytest.approx(one, rel=1e-12)


@pytest.mark.parametrize(
    ("of_wide", "depths"),
    [((3.0, 0.5), (90e-6, 400e-6)), ((0.5, 0.3), (90e-6, 300e-6)), ((0.4, 2.0), (400e-6, 90e-6))],
)
def test_derivatives_by_volumes_and_heights_are_those_of_the_way_out(space, of_wide, depths):
    normals, residuals = np.array([[1.0, 0.0, 0.0], [0.1, 0.99, 0.0]]), np.full((2, 2), 0.9)
    deepest = np.array([3.5e-4, 4e-4])
    volumes = widths(of_wide, deepest)

    def at(volumes, deepest):
        return way_out(space, normals, depths, residuals, volumes, deepest)

    s = at(volumes, deepest)
    rates = {name: space.directions[name][:2].copy() for name in ("volume_rate", "height_rate")}
    assert any(np.abs(rates["volume_rate"] * volumes) > 1e-2 * s)
    for i in range(2):
        for name, given in (("volume_rate", volumes), ("height_rate", deepest)):
            step = np.zeros(2)
            step[i] = 1e-5 * given[i]
            change = step if name == "volume_rate" else np.zeros(2)
            ends = [at(volumes + k * change, deepest + k * (step - change)) for k in (1, -1)]
            found = (ends[0] - ends[1]) / (2.0 * step[i])
            assert rates[name][i] * given[i] == pytest.approx(found * given[i], abs=1e-6 * s)
