"""Vibration over a smooth surface: its size by force and speed, its direction, and silence."""

import numpy as np
import pytest

from asperity.scene.builtin import load_scene
from asperity.studies.baselines.recorded_vibration import (
    RECORDED_HARMONIC,
    RECORDED_VIBRATION,
    VibrationMethod,
)
from asperity.vibrotactile.lsf import frequencies_of
from asperity.vibrotactile.model import TextureModel

DT, MASS = 1e-3, 0.05


def model():
    """Return white noise whose size is the force [m/s^2 per N], at any speed above rest."""
    speeds, forces = np.array([0.0, 0.2, 0.0, 0.2, 0.01, 0.01]), np.array([0, 0, 2, 2, 0, 2.0])
    variance = np.where(speeds > 0.0, forces**2, 0.0)
    lsf = np.tile(frequencies_of([1.0, 0.0, 0.0]), (6, 1))
    return TextureModel("white", 1.0 / DT, speeds, forces, lsf, variance)


@pytest.fixture(scope="module")
def felt():
    """Return wrenches of a slide along x at 0.1 m/s, and of a rest of a second after it."""
    renderer = VibrationMethod(model=model(), mass=MASS).prepare(load_scene("probe-plate"), dt=DT)
    x = -0.03 + 0.1 * DT * np.minimum(np.arange(1500), 500)
    wrenches = [renderer.wrench(np.array([place, 0, 0.5e-3, 1.0, 0, 0, 0])) for place in x]
    renderer.reset()
    poses = [np.array([place, 0, 0.5e-3, 1.0, 0, 0, 0]) for place in x[:50]]
    poses = [np.array([place, 0, 0.5e-3, 1.0, 0, 0, 0]) for place in x[:50]]
    first = [renderer.wrench(pose).force for pose in poses]
    force, torque = ([getattr(w, name) for w in wrenches] for name in ("force", "torque"))
    return np.array(force), np.array(torque), first


def test_it_vibrates_across_the_motion_while_it_slides(felt):
    force, torque, _ = felt
    sliding = slice(100, 500)
    assert force[:, 2] == pytest.approx(400.0 * 1e-3)
    assert np.abs(force[:, 0]).max() < 1e-9
    there = VibrationMethod(model=model()).model.filter_at(0.1, 0.4).variance
    assert force[sliding, 1].std() == pytest.approx(MASS * np.sqrt(there), rel=0.15)
    # The push across acts at the tip, below the centre of mass.
    assert np.corrcoef(torque[sliding, 0], force[sliding, 1])[0, 1] > 0.99


def test_at_rest_it_is_silent_and_a_reset_begins_anew(felt):
    force, _, first = felt
    assert np.abs(force[1200:, 1]).max() < 0.02 * force[100:500, 1].std()
    assert np.array(first) == pytest.approx(force[:50])


def test_what_it_cannot_do():
    assert "textured" not in (RECORDED_VIBRATION.can(load_scene("probe-plate")) or "")
    assert RECORDED_VIBRATION.can(load_scene("probe-plate")) is None
    assert "one body" in RECORDED_VIBRATION.can(load_scene("hammer-blocks"))


def test_the_harmonic_method_vibrates_at_the_texture_s_own_frequency():
    """A slide over waves of 2 mm at 0.1 m/s: 50 Hz, of which noise alone has less."""
    scene = load_scene("probe-plate")
    x = -0.03 + 0.1 * DT * np.arange(1000)
    poses = [np.array([place, 0, 0.5e-3, 1.0, 0, 0, 0]) for place in x]
    shares = []
    for method in (RECORDED_HARMONIC, RECORDED_VIBRATION):
        renderer = method.prepare(scene, dt=DT)
        across = np.array([renderer.wrench(pose).force[1] for pose in poses])[200:]
        power = np.abs(np.fft.rfft((across - across.mean()) * np.hanning(across.size))) ** 2
        frequency = np.fft.rfftfreq(across.size, DT)
        shares.append(power[np.abs(frequency / 50.0 - 1.0) < 0.25].sum() / power.sum())
    assert shares[0] == pytest.approx(0.72, abs=0.1)
    assert shares[1] < shares[0] - 0.1
