"""Minsky, Ho et al., Siira & Pai: each force against its formula on a wave that is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from asperity.errors import AsperityError
from asperity.scene.builtin import load_scene
from asperity.studies.baselines import METHODS
from asperity.studies.baselines.point_methods import HO, MINSKY, SIIRA_PAI, rms_slope
from asperity.studies.comparison import stimuli

A, Q, K = stimuli.AMPLITUDE, 2.0 * math.pi / stimuli.WAVELENGTH, stimuli.STIFFNESS
ROWS = ("minsky", "ho", "siira-pai", "choi-tan-fixed", "choi-tan-normal", "choi-tan-god-object")
DT = 1e-3
LOWEST = -A * math.cos(math.pi / 64.0)
"""The lowest of 64 samples a wave, half a pixel beside the trough [m]."""


def plate(friction=0.0, **force):
    return stimuli.ball_on_plate().changed(force={"friction": friction, **force})


def path(scene, depth, speed=0.05, angle=0.0, count=96):
    """Return poses whose lowest point slides at a depth below the smooth plate, and its places."""
    along = speed * DT * (np.arange(count) - 0.5 * count)
    poses = np.tile(scene.start, (count, 1))
    poses[:, 0], poses[:, 1] = along * math.cos(angle), along * math.sin(angle)
    poses[:, 2] = 1.5e-3 - depth
    return poses, poses[:, 0].copy()


def forces(method, scene, poses):
    renderer = method.prepare(scene, dt=DT)
    return np.array([renderer.wrench(pose).force for pose in poses])


def height(x):
    return A * np.cos(Q * x)


def slope(x):
    return -A * Q * np.sin(Q * x)


def close(one, other):
    """Equal to 1e-4 of the largest force."""
    assert one == pytest.approx(np.asarray(other), abs=1e-4 * np.abs(other).max())


@pytest.mark.parametrize("depth", [2e-5, 1.5e-4])
def test_minsky_pulls_down_the_slope_whatever_the_depth(depth):
    scene = plate()
    poses, x = path(scene, depth)
    felt = forces(replace(MINSKY, gain=0.7), scene, poses)
    close(felt[:, 0], -0.7 * slope(x))
    close(felt[:, 2], np.full(len(x), K * depth))
    assert np.abs(felt[:, 1]).max() < 1e-9


def test_minskys_damper_resists_the_lateral_motion():
    scene = plate()
    poses, x = path(scene, 1e-4, speed=0.05)
    felt = forces(replace(MINSKY, gain=0.7, damping=2.0), scene, poses)
    close(felt[1:, 0], -0.7 * slope(x[1:]) - 2.0 * 0.05)
    # Without a tick before it there is no velocity.
    assert felt[0, 0] == pytest.approx(-0.7 * slope(x[0]), abs=1e-4)


@pytest.mark.parametrize("gain", [0.6, 1.0, 3.0])
def test_ho_perturbs_the_normal_in_both_cases(gain):
    scene, depth = plate(ho_gain=gain), 1e-4
    poses, x = path(scene, depth)
    h, s = gain * (height(x) - LOWEST), slope(x)
    share = np.minimum(h / depth, 1.0)
    assert share.min() < 0.5  # both cases occur
    assert share.max() == 1.0
    length = np.sqrt(1.0 + s**2)
    felt = forces(HO, scene, poses)
    close(felt[:, 0], K * depth * share * -s / length)
    close(felt[:, 2], K * depth * (1.0 - share + share / length))


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_hos_god_object_trails_by_friction_when_sliding(angle):
    scene, depth, mu = plate(friction=0.4), 1e-4, 0.4
    poses, _ = path(scene, depth, angle=angle)
    smooth = forces(HO, plate(), poses)
    renderer = HO.prepare(scene, dt=DT)
    ahead = np.array([math.cos(angle), math.sin(angle), 0.0])
    for i, pose in enumerate(poses):
        force = renderer.wrench(pose).force
        drag = force - smooth[i]
        # The ideal point stays on the smooth surface.
        assert renderer.ideal.place[2] == pytest.approx(0.0, abs=1e-12)
        trails = pose[:2] - renderer.ideal.place[:2]
        if i * 0.05 * DT < mu * depth:
            assert np.linalg.norm(trails) == pytest.approx(i * 0.05 * DT, abs=1e-12)
        else:
            assert np.linalg.norm(trails) == pytest.approx(mu * depth, rel=1e-9)
            assert drag == pytest.approx(-mu * K * depth * ahead, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", ["ho", "siira-pai"])
def test_on_a_flat_plate_friction_is_mu_times_the_normal_force_and_none_without(name):
    for mu in (0.0, 0.3):
        scene = plate(friction=mu).smooth()
        poses, _ = path(scene, 1e-4)
        felt = forces(METHODS[name], scene, poses)[20:]
        assert felt[:, 0] == pytest.approx(np.full(len(felt), -mu * K * 1e-4), rel=1e-9)
        assert felt[:, 2] == pytest.approx(np.full(len(felt), K * 1e-4), rel=1e-9)


@pytest.mark.parametrize("name", ROWS)
def test_flat_contact_is_a_spring(name):
    for scene in (stimuli.ball_on_plate().smooth(), stimuli.foot_on_plate().smooth(),
                  load_scene("probe-plate").smooth()):  # fmt: skip
        renderer = METHODS[name].prepare(scene)
        poses = np.tile(scene.start, (3, 1))
        poses[:, 2] -= [0.0, 4e-4, 5e-4]
        above, one, two = (renderer.wrench(at) for at in poses)
        assert above.contacts == 0
        rise = (two.force - one.force) / (two.depth - one.depth)
        assert two.depth - one.depth == pytest.approx(1e-4)
        assert rise == pytest.approx([0.0, 0.0, scene.force.stiffness], abs=1e-6)
        assert one.force[2] == pytest.approx(scene.force.stiffness * one.depth, rel=1e-9)


@pytest.mark.parametrize("name", ROWS)
def test_each_renders_the_built_in_plate_and_the_stimuli(name):
    scenes = [load_scene("probe-plate"), stimuli.ball_on_plate(), stimuli.ball_on_plate(boxes=4),
              stimuli.foot_on_plate()]  # fmt: skip
    for scene in scenes:
        assert METHODS[name].can(scene) is None
        renderer = METHODS[name].prepare(scene)
        poses, _ = path(scene, 0.0, count=24)
        poses += scene.start * [1, 1, 0, 0, 0, 0, 0]
        poses[:, 2] = scene.start[2] - 3e-4
        felt = np.array([renderer.wrench(pose).force for pose in poses])
        assert felt[:, 2].min() > 0.0
        change = np.ptp(felt, axis=0).max()
        assert change > 0.01 * felt[:, 2].mean()


@pytest.mark.parametrize("name", ROWS)
def test_the_force_acts_at_the_point(name):
    scene = load_scene("probe-plate")
    pose = scene.start.copy()
    pose[2] -= 3e-4
    pose[0] += 3e-4
    felt = METHODS[name].prepare(scene).wrench(pose)
    centre = scene.model.body_ipos[scene.model.body("probe").id]
    arm = np.array([0.0, 0.0, -1.5e-3]) - centre
    assert felt.torque == pytest.approx(np.cross(arm, felt.force), abs=1e-9)


@pytest.mark.parametrize("name", ROWS)
def test_a_mesh_is_refused_in_one_line(name):
    reason = METHODS[name].can(load_scene("hammer-blocks"))
    assert reason is not None
    assert "is a mesh" in reason
    assert "\n" not in reason
    with pytest.raises(AsperityError, match="cannot render scene 'hammer-blocks'"):
        METHODS[name].prepare(load_scene("hammer-blocks"))


@pytest.fixture(scope="module")
def noise():
    """Forces over the smooth part, in deviations, of 100 seeds: (seeds, ticks, 2)."""
    depth, mu = 1e-4, 0.3
    scene = plate(friction=mu)
    poses, _ = path(scene, depth, speed=0.02, count=280)
    renderer = SIIRA_PAI.prepare(scene, dt=DT)
    _, body = scene.bodies if scene.bodies[0].name == "probe" else scene.bodies[::-1]
    sigma = rms_slope(body) * K * depth
    drawn = []
    for seed in range(100):
        renderer.seed = seed
        renderer.reset()
        felt = np.array([renderer.wrench(pose).force for pose in poses])[24:]
        assert np.abs(felt[:, 1]).max() < 1e-9
        drawn.append((felt[:, [0, 2]] - [-mu * K * depth, K * depth]) / sigma)
    return np.array(drawn)


def test_siira_and_pais_forces_are_normal_along_and_across(noise):
    for axis in (0, 1):
        each = [stats.kstest(row[:, axis], "norm").pvalue for row in noise]
        # Of a true hypothesis, p-values are uniform.
        assert stats.kstest(each, "uniform").pvalue > 0.01
        assert stats.kstest(noise[:, :, axis].ravel(), "norm").pvalue > 0.01
    assert abs(np.corrcoef(noise[:, :, 0].ravel(), noise[:, :, 1].ravel())[0, 1]) < 0.02
    assert np.abs(noise).max() < 6.0


def test_siira_and_pais_forces_are_white(noise):
    power = (np.abs(np.fft.rfft(noise, axis=1)) ** 2).mean(axis=0)[1:-1] / noise.shape[1]
    # The size is that of the distribution; here only whether all frequencies share it. The sum of
    # 100 periodograms is distributed as chi squared with 200 degrees of freedom.
    assert power.mean(axis=0) == pytest.approx(1.0, rel=0.03)
    power /= power.mean(axis=0)
    assert stats.kstest(200.0 * power.ravel(), "chi2", args=(200,)).pvalue > 0.01
    for band in np.array_split(power, 4):
        assert band.mean(axis=0) == pytest.approx(1.0, rel=0.05)


def test_siira_and_pais_deviation_is_that_of_the_surface_and_needs_sliding():
    body = next(body for body in plate().bodies if body.texture is not None)
    assert rms_slope(body) == pytest.approx(A * Q / math.sqrt(2.0), rel=2e-3)
    rougher = replace(SIIRA_PAI, roughness=2.0 * rms_slope(body))
    scene = plate()
    poses, _ = path(scene, 1e-4)
    one, two = forces(SIIRA_PAI, scene, poses), forces(rougher, scene, poses)
    assert two[:, 0] == pytest.approx(2.0 * one[:, 0], rel=1e-9)
    still = forces(SIIRA_PAI, scene, np.repeat(poses[:1], 20, axis=0))
    assert np.ptp(still, axis=0).max() == 0.0
    assert rms_slope(scene.smooth().bodies[0]) == 0.0


def test_siira_and_pais_contact_never_pulls():
    scene = plate()
    poses, _ = path(scene, 1e-4)
    felt = forces(replace(SIIRA_PAI, roughness=2.0), scene, poses)
    assert felt[:, 2].min() == 0.0


def test_other_maps_than_planar_are_refused_in_one_line():
    scene = plate()
    bodies = tuple(
        replace(body, mapping="triplanar") if body.texture is not None else body
        for body in scene.bodies
    )
    assert METHODS["ho"].can(replace(scene, bodies=bodies)) == (
        "made for planar maps, and that of plate is triplanar"
    )
