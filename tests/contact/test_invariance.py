"""What the force must not depend on: how a surface is stored, and how a plate is modelled."""

import math

import numpy as np
import pytest
from naive_bodies import engine_of, plate, pose, ripple, rough, solid, touch, turn

from asperity.geometry.bodies import Body, Geom
from asperity.texture.height_field import HeightField

SIZE = 20e-3
STIFFNESS = 400.0


def stored(count):
    """Return one surface, waves of 0.7 to 4 mm, 20 mm square, stored at `count`^2 samples."""
    rng = np.random.default_rng(11)
    x = (np.arange(count) + 0.5) * SIZE / count
    heights = np.zeros((count, count))
    for _ in range(40):
        i, j = rng.integers(-28, 29, 2)
        wave = 2.0 * np.pi / SIZE
        size = 4e-6 * min(1.0, 8.0 / max(1.0, math.hypot(i, j)))
        phase = rng.uniform(0.0, 2.0 * np.pi)
        heights += size * np.cos(wave * (i * x[None, :] + j * x[:, None]) + phase)
    return HeightField(heights, SIZE / count, "wrap")


def rub(engine, height, steps=25, quaternion=(1.0, 0.0, 0.0, 0.0)):
    """Return the wrenches of a slide over 4 mm, across borders of all the plates below."""
    slide = np.linspace(-2.03e-3, 1.97e-3, steps)
    return np.array([
        touch(engine, pose(x, 0.37 * x + 1e-5, height, quaternion)).wrench for x in slide
    ])  # fmt: skip


def apart(wrenches, others):
    """Return the largest difference of forces, relative to the largest force."""
    size = np.abs(wrenches[:, :3]).max()
    return np.abs(wrenches - others)[:, :3].max() / size


@pytest.mark.parametrize(("kind", "finest"), [
    ("sphere", 1024),
    pytest.param("sphere", 2048, marks=pytest.mark.slow),
    pytest.param("capsule", 2048, marks=pytest.mark.slow),
])  # fmt: skip
def test_the_resolution_of_a_map_does_not_matter(kind, finest):
    lying = turn([1, 0, 0], math.pi / 2) if kind == "capsule" else (1.0, 0.0, 0.0, 0.0)
    height = 1.45e-3 if kind == "sphere" else 1.15e-3
    rubs = [
        rub(engine_of(solid(kind), plate(stored(n), SIZE / 2)), height, 15, lying)
        for n in (finest, finest // 2, finest // 4, finest // 8)
    ]
    for other in rubs[1:]:
        assert apart(rubs[0], other) < 0.01


@pytest.mark.parametrize("kind", ["sphere", "box", "cylinder"])
@pytest.mark.parametrize("texture", [None, rough(3, 8e-6)])
def test_the_number_of_boxes_of_a_plate_does_not_matter(kind, texture):
    height = {"sphere": 1.45e-3, "box": 1.18e-3, "cylinder": 1.18e-3}[kind]
    tilt = turn([1, 2, 0], 0.02)
    whole, *pieces = (
        rub(engine_of(solid(kind), plate(texture, 8e-3, n)), height, 15, tilt) for n in (1, 2, 4, 8)
    )
    assert whole[:, 2].min() > 0.0
    for other in pieces:
        assert apart(whole, other) < 0.01


def test_probes_of_different_size_feel_different():
    """In a valley a small probe reaches deeper, and it climbs steeper sides."""
    wavelength, amplitude = 1.2e-3, 0.1e-3
    depths, steepest = [], []
    for diameter in (0.5e-3, 1.5e-3, 3e-3):
        tool = Body("tool", [Geom("sphere", (0.5 * diameter,))])
        engine = engine_of(tool, plate(ripple(amplitude, wavelength)))
        valley = touch(engine, pose(0.5 * wavelength, 0, 0.5 * diameter - 50e-6))
        depths.append(float(np.sum(valley.weight * valley.depth)) if valley.depth.size else 0.0)
        slide = [pose(x, 0, 0.5 * diameter) for x in np.linspace(0, 0.48 * wavelength, 30)]
        wrenches = np.array([touch(engine, at).wrench for at in slide])
        pressed = wrenches[wrenches[:, 2] > 0.0]
        steepest.append(float(np.max(np.abs(pressed[:, 0]) / pressed[:, 2])))
    assert depths[0] <= depths[1] - 5e-6 or depths[0] == 0.0
    assert depths[1] < depths[2] - 5e-6
    assert steepest[0] > 1.05 * steepest[1] > 1.05**2 * steepest[2]
