"""Choi & Tan's laws against their formulas, and the god object on the textured surface."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize

from asperity.errors import AsperityError
from asperity.scene.scene import scene_of
from asperity.studies.baselines.choi_tan import FIXED, GOD_OBJECT, NORMAL
from asperity.studies.comparison import stimuli

A, Q, K = stimuli.AMPLITUDE, 2.0 * math.pi / stimuli.WAVELENGTH, stimuli.STIFFNESS
RADIUS = 1.5e-3
LOWEST = -A * math.cos(math.pi / 64.0)
"""The lowest of 64 samples a wave, half a pixel beside the trough [m]."""


def height(x):
    return A * np.cos(Q * x)


def slope(x):
    return -A * Q * np.sin(Q * x)


def pose_at(scene, x, z):
    """Return the pose at which the ball's lowest point is at (x, 0, z)."""
    pose = scene.start.copy()
    pose[0], pose[2] = x, z + RADIUS
    return pose


def points(count=40):
    """Return places x over two waves and depths below the relief [m]."""
    rng = np.random.default_rng(3)
    return np.linspace(-2e-3, 2e-3, count), rng.uniform(5e-6, 1.5e-4, count)


def test_both_penalties_follow_their_formulas():
    scene = stimuli.ball_on_plate()
    fixed, normal = FIXED.prepare(scene), NORMAL.prepare(scene)
    for x, d in zip(*points(), strict=True):
        pose = pose_at(scene, x, height(x) - d)
        s = slope(x)
        one, two = fixed.wrench(pose), normal.wrench(pose)
        assert one.depth == pytest.approx(d, rel=1e-3, abs=1e-9)
        assert one.force == pytest.approx([0.0, 0.0, K * d], rel=1e-3, abs=1e-5)
        expected = K * d * np.array([-s, 0.0, 1.0]) / math.hypot(s, 1.0)
        assert two.force == pytest.approx(expected, rel=1e-3, abs=1e-5)


def test_over_the_relief_nothing_is_felt_also_below_the_crests():
    scene = stimuli.ball_on_plate()
    for method in (FIXED, NORMAL, GOD_OBJECT):
        renderer = method.prepare(scene)
        for x in np.linspace(-1e-3, 1e-3, 21):
            assert renderer.wrench(pose_at(scene, x, height(x) + 2e-6)).contacts == 0
            assert renderer.wrench(pose_at(scene, x, height(x) - 2e-6)).contacts == 1


def nearest(x, z, start):
    """Return the place of the wave nearest to (x, z), descending from `start`."""

    def away(u):
        return (u[0] - x) ** 2 * 1e8 + (height(u[0]) - z) ** 2 * 1e8

    found = optimize.minimize(away, [start], method="Nelder-Mead",
                              options={"xatol": 1e-11, "fatol": 1e-16})  # fmt: skip
    return float(found.x[0])


def test_the_god_object_is_the_nearest_place_of_the_surface():
    scene = stimuli.ball_on_plate()
    renderer = GOD_OBJECT.prepare(scene)
    for x, d in zip(*points(), strict=True):
        z = height(x) - d
        renderer.reset()
        felt = renderer.wrench(pose_at(scene, x, z))
        g = renderer.god_object
        assert g[2] == pytest.approx(height(g[0]), abs=1e-9)
        assert g[0] == pytest.approx(nearest(x, z, x), abs=1e-7)
        # Perpendicular to the surface.
        pull = g - [x, 0.0, z]
        assert abs(pull @ [1.0, 0.0, slope(g[0])]) < 1e-5 * np.linalg.norm(pull)
        assert felt.force == pytest.approx(K * pull, rel=1e-9, abs=1e-9)
        exact = K * np.array([nearest(x, z, x) - x, 0.0, height(nearest(x, z, x)) - z])
        assert felt.force == pytest.approx(exact, rel=1e-3, abs=1e-3 * np.linalg.norm(exact))


def test_the_god_objects_force_is_the_gradient_of_an_energy_and_the_fixed_one_is_not():
    scene = stimuli.ball_on_plate()
    circle = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    x, z = 0.5e-3 + 1e-4 * np.cos(circle), -1.2e-4 + 5e-5 * np.sin(circle)
    step = np.stack([np.roll(x, -1) - np.roll(x, 1), np.roll(z, -1) - np.roll(z, 1)], axis=1) / 2
    work = {}
    for method in (FIXED, GOD_OBJECT):
        renderer = method.prepare(scene)
        force = np.array(
            [renderer.wrench(pose_at(scene, *at)).force for at in zip(x, z, strict=True)]
        )
        work[method.law] = float(np.sum(force[:, [0, 2]] * step))
    # Green: the integral of -dFz/dx = -K h' over the ellipse.
    area = np.pi * 1e-4 * 5e-5
    assert abs(work["fixed"]) == pytest.approx(K * abs(slope(0.5e-3)) * area, rel=0.02)
    assert abs(work["god-object"]) < 1e-3 * abs(work["fixed"])


def test_pushed_through_a_ridge_the_god_object_stays_on_its_side():
    scene = stimuli.ball_on_plate()
    renderer = GOD_OBJECT.prepare(scene)
    # Below the centre of the crest's curvature two places are nearest, one on each side.
    deep = height(0.0) - 1.3 / (A * Q**2)
    for z in np.linspace(height(0.3e-3) - 1e-5, deep, 60):
        renderer.wrench(pose_at(scene, 0.3e-3, z))
    for x in np.linspace(0.3e-3, -0.02e-3, 60):
        renderer.wrench(pose_at(scene, x, deep))
    assert renderer.god_object[0] > 0.2e-3
    assert renderer.god_object[2] == pytest.approx(height(renderer.god_object[0]), abs=1e-9)
    renderer.reset()
    renderer.wrench(pose_at(scene, -0.02e-3, deep))
    assert renderer.god_object[0] < -0.2e-3


def test_detected_at_the_wall_the_force_begins_with_a_step():
    scene = stimuli.ball_on_plate()
    for method in (FIXED, NORMAL):
        wall, relief = replace(method, boundary="plane").prepare(scene), method.prepare(scene)
        for x in (0.0, 0.4e-3, 0.8e-3):
            before, after = (wall.wrench(pose_at(scene, x, LOWEST + off)) for off in (1e-8, -1e-8))
            assert before.contacts == 0
            assert np.linalg.norm(after.force) == pytest.approx(K * (height(x) - LOWEST), rel=1e-3)
            # Above its foot, the relief is felt at once, and then both are the same.
            touched = relief.wrench(pose_at(scene, x, height(x) - 1e-8))
            assert 0.0 < np.linalg.norm(touched.force) < 1e-3
            same = relief.wrench(pose_at(scene, x, LOWEST - 1e-8)).force
            assert after.force == pytest.approx(same)


def test_a_turned_and_moved_plate_turns_and_moves_the_force():
    scene = stimuli.ball_on_plate()
    turn = np.array([math.cos(0.4), 0.0, math.sin(0.4), 0.0])  # about y
    xml = scene.xml.replace('name="plate" pos="0 0 -0.001"',
                            f'name="plate" pos="{-1e-3 * math.sin(0.8)} 0 {-1e-3 * math.cos(0.8)}" '
                            f'quat="{turn[0]} 0 {turn[2]} 0"')  # fmt: skip
    assert xml != scene.xml
    turned = scene_of(xml, scene.document, name="turned")
    c, s = math.cos(0.8), math.sin(0.8)
    rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    for method in (FIXED, NORMAL, GOD_OBJECT):
        level, tilted = method.prepare(scene), method.prepare(turned)
        for x, d in zip(*points(8), strict=True):
            pose = pose_at(scene, x, height(x) - d)
            there = pose.copy()
            there[:3] = rotation @ pose[:3]
            a, b = level.wrench(pose), tilted.wrench(there)
            assert b.force == pytest.approx(rotation @ a.force, rel=1e-6, abs=1e-6)


def test_unknown_laws_and_boundaries_are_refused():
    with pytest.raises(AsperityError, match="law"):
        replace(FIXED, law="god")
    with pytest.raises(AsperityError, match="boundary"):
        replace(FIXED, boundary="wall")
