"""Local minimum distances of shapes whose minima are known, and the repulsion they give."""

import numpy as np
import pytest

from asperity.geometry.bodies import Body, Geom
from asperity.studies.baselines.displaced_surfaces import displaced_surface
from asperity.studies.baselines.local_minimum_distances import LmdRenderer
from asperity.studies.baselines.normal_cones import local_minima, tree_of
from asperity.studies.baselines.placement import Standing
from asperity.texture.patterns.patterns import sinusoid

K = 400.0


def ball(radius, spacing=None):
    body = Body("ball", [Geom("sphere", [radius])])
    return tree_of(displaced_surface(body, spacing or radius / 10, smooth=True))


def wavy_plate(amplitude, wave, spacing):
    texture = sinusoid(wavelength=wave, amplitude=amplitude)
    body = Body("plate", [Geom("box", [6e-3, 2e-3, 1e-3])], texture)
    return tree_of(displaced_surface(body, spacing))


def renderer(tool, other, stand_off, merged=1e-4):
    there = Standing(None, np.eye(3), np.zeros(3))
    return LmdRenderer(
        tool, [(other, there)], np.zeros(3), stiffness=K, stand_off=stand_off, merged=merged
    )


def pose(x, y, z):
    return np.array([x, y, z, 1.0, 0.0, 0.0, 0.0])


def test_two_balls_have_one():
    pair = renderer(ball(2e-3), ball(3e-3), 2e-3)
    for way in np.random.default_rng(0).standard_normal((4, 3)):
        n = way / np.linalg.norm(way)
        points, distances = pair.minima(pose(*(6e-3 * n)))
        assert len(distances) == 1
        # Facets lie within the balls, by no more than their sagitta.
        assert 1e-3 <= distances[0] < 1.05e-3
        assert points[0, 0] == pytest.approx(4e-3 * n, abs=4e-4)
        assert points[0, 2] @ n > 0.99


def test_force_grows_from_nothing_and_never_jumps():
    pair = renderer(ball(2e-3), ball(3e-3), 1e-3)
    n = np.array([0.36, 0.48, 0.8])
    distances = np.linspace(7e-3, 5.05e-3, 80)
    forces = np.array([pair.wrench(pose(*(d * n))).force for d in distances])
    size = np.linalg.norm(forces, axis=1)
    expected = K * np.maximum(1e-3 - (distances - 5e-3), 0.0)
    assert size[distances > 6.06e-3].max() == 0.0
    assert size == pytest.approx(expected, abs=K * 0.06e-3)
    step = K * (distances[0] - distances[1])
    assert np.linalg.norm(np.diff(forces, axis=0), axis=1).max() < 1.5 * step


def minima_over(c, amplitude, wave, radius, stand_off):
    """Return how many places of the wave are locally nearest to a ball's middle c, in range."""
    x = np.linspace(-5e-3, 5e-3, 200_001)
    h = 1e-3 + amplitude * np.sin(2 * np.pi * x / wave)
    away = np.hypot(x - c[0], h - c[1])
    least = (away[1:-1] < away[:-2]) & (away[1:-1] < away[2:])
    found = away[1:-1][least] - radius
    return np.sort(found[found < stand_off])


@pytest.mark.parametrize("x", [0.0, 0.4e-3, 1.0e-3])
@pytest.mark.parametrize("z", [2.1e-3, 2.8e-3])
def test_a_ball_over_waves_has_one_for_each_bump_that_faces_it(x, z):
    amplitude, wave, radius, stand_off = 0.2e-3, 1.5e-3, 0.8e-3, 1.2e-3
    plate = wavy_plate(amplitude, wave, 0.05e-3)
    # The map's phase is the plate's own: asked of the surface, not assumed.
    phase = crest_of(plate, wave)
    pair = renderer(ball(radius, 0.06e-3), plate, stand_off, merged=0.25e-3)
    _, distances = pair.minima(pose(x, 0.0, z))
    expected = minima_over((x - phase + 0.25 * wave, z), amplitude, wave, radius, stand_off)
    assert len(distances) == len(expected)
    assert np.sort(distances) == pytest.approx(expected, abs=0.02e-3)


def crest_of(tree, wave):
    """Return where a crest of the top lies [m]."""
    corners = tree.triangles.reshape(-1, 3)
    top = corners[corners[:, 2] > corners[:, 2].max() - 1e-6]
    turns = np.exp(2j * np.pi * top[:, 0] / wave)
    return float(np.angle(turns.mean()) / (2 * np.pi) * wave)


def test_cones_lose_nothing_and_save_much():
    one, other = ball(1e-3, 0.15e-3), wavy_plate(0.15e-3, 2e-3, 0.25e-3)
    blind = [tree._replace(angles=np.full_like(tree.angles, np.pi)) for tree in (one, other)]
    rng = np.random.default_rng(1)
    looked = {True: np.zeros(2, np.int64), False: np.zeros(2, np.int64)}
    for _ in range(2):
        shift = np.array([*rng.uniform(-1e-3, 1e-3, 2), rng.uniform(2.3e-3, 2.6e-3)])
        found = {}
        for with_cones, (a, b) in ((True, (one, other)), (False, blind)):
            points, distances = np.empty((512, 3, 3)), np.empty(512)
            n = local_minima(a, b, np.eye(3), shift, 0.8e-3, points, distances, looked[with_cones])
            found[with_cones] = np.sort(distances[:n])
        assert found[True] == pytest.approx(found[False])
        assert len(found[True]) > 0
    assert 5 * looked[True][1] < looked[False][1]


def test_surfaces_that_cross_push_with_all_their_stand_off():
    pair = renderer(ball(1e-3, 0.1e-3), wavy_plate(1e-6, 2e-3, 0.15e-3), 0.5e-3, merged=3e-3)
    felt = pair.wrench(pose(0.0, 0.0, 1.9e-3))
    assert felt.force[2] == pytest.approx(K * 0.5e-3, rel=0.02)
    # Just before they touch it is nearly as much.
    before = pair.wrench(pose(0.0, 0.0, 2.01e-3))
    assert before.force[2] == pytest.approx(K * 0.49e-3, rel=0.05)
