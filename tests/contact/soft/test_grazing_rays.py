"""Rays that all but touch a texture: what they pass is no exit, and what is one lies on it."""

from __future__ import annotations

import math

import mujoco
import numpy as np

import asperity
from asperity.texture.height_field import HeightField

_TILT = math.radians(35.0)


def _wave() -> HeightField:
    """Return waves 0.6 mm high whose flanks are steeper than the rays of the test."""
    x = np.arange(100) * 1e-5
    heights = 3e-4 * np.sin(2.0 * np.pi * x / 1e-3)
    return HeightField(np.tile(heights, (8, 1)), 1e-5, border="wrap")


def test_every_exit_of_a_dense_bundle_of_rays_lies_on_the_texture() -> None:
    """The rays are 3 nm from each other, so that some pass a crest as closely."""
    texture = _wave()
    plate = asperity.Body("plate", [asperity.Geom("box", (0.01, 0.01, 0.004))], texture)
    pad = asperity.Body("pad", [asperity.Geom("box", (1e-3, 1e-3, 1e-3))])
    skin = asperity.SoftSkin(
        pad, thickness=1e-3, modulus=1e4, taxels=(64, 1024), facing=(0, 0, -1), size=(8e-4, 8e-4)
    )
    contact = asperity.SkinContact(skin, [plate])
    # Turned about the vertical, so that each row of taxels is a little further along the waves.
    turn = np.zeros(4)
    mujoco.mju_mulQuat(
        turn, [math.cos(1e-3), 0.0, 0.0, math.sin(1e-3)],
        [math.cos(_TILT / 2), 0.0, math.sin(_TILT / 2), 0.0],
    )  # fmt: skip
    contact.wrench([2e-4, 0.0, 0.004 + 8.2e-4, *turn])
    pressed = contact.compression > 0.0
    assert 0.1 < pressed.mean() < 0.9
    points = contact.points[pressed]
    away = points[:, 2] - 0.004 - texture.heights(points[:, 0] + 0.01, points[:, 1])
    assert np.abs(away).max() < 1e-12
