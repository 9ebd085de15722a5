"""Soft skins against what is known of a bed of springs (Johnson, 1985, section 4.3)."""

import numpy as np
import pytest
from scipy.optimize import brentq

from asperity.contact.body_pair import BodyPair
from asperity.contact.soft.layer import layer_pressure
from asperity.contact.soft.skin import SoftSkin, foundation_modulus
from asperity.contact.soft.skin_contact import SkinContact
from asperity.geometry.bodies import Body, Geom
from asperity.texture.height_field import HeightField

RADIUS, DEPTH = 8e-3, 1e-3


def pad(texture=None, **options):
    """Return a flat pad of 24 mm whose upper side, at z = 0, is soft."""
    slab = Body("pad", [Geom("box", (12e-3, 12e-3, 5e-3), (0.0, 0.0, -5e-3))], texture)
    return SoftSkin(
        slab, **{"thickness": 4e-3, "modulus": 5e4, "poisson": 0.4, "taxels": (128, 128)} | options
    )


def pressed(contact, depth):
    """Return the wrench of a pad raised by a depth [m]."""
    return contact.wrench([0.0, 0.0, depth, 1.0, 0.0, 0.0, 0.0])


def ball_at_rest():
    """Return a ball that touches z = 0 from above."""
    return Body("ball", [Geom("sphere", (RADIUS,), (0.0, 0.0, RADIUS))])


def test_modulus_of_the_foundation_is_johnsons():
    assert foundation_modulus(1e5, 0.0, 2e-3) == pytest.approx(5e7)
    assert foundation_modulus(1e5, 0.25, 1e-3) == pytest.approx(1.2e8)


def test_a_ball_has_the_closed_forms_of_force_and_radius():
    skin = pad()
    contact = SkinContact(skin, [ball_at_rest()])
    wrench = pressed(contact, DEPTH)
    low = RADIUS - DEPTH
    volume = np.pi * ((RADIUS**3 - low**3) / 3.0 * 2.0 - low * (RADIUS**2 - low**2))
    assert -wrench[2] == pytest.approx(skin.stiffness_per_area * volume, rel=2e-3)
    radius = np.sqrt(contact.contact_area / np.pi)
    assert radius == pytest.approx(np.sqrt(2.0 * RADIUS * DEPTH - DEPTH**2), rel=5e-3)
    assert np.abs(wrench[[0, 1, 3, 4, 5]]).max() < 1e-9 * abs(wrench[2])
    # For small depths K pi R d^2, the parabola's.
    wrench = pressed(contact, 0.05 * DEPTH)
    parabola = skin.stiffness_per_area * np.pi * RADIUS * (0.05 * DEPTH) ** 2
    assert -wrench[2] == pytest.approx(parabola, rel=1e-2)


def test_finer_taxels_come_closer_to_the_closed_form():
    low = RADIUS - DEPTH
    volume = np.pi * ((RADIUS**3 - low**3) / 3.0 * 2.0 - low * (RADIUS**2 - low**2))
    errors = []
    for count in (16, 48, 144):
        skin = pad(taxels=(count, count))
        # Off the middle, where rows and columns are in no special place.
        wrench = SkinContact(skin, [ball_at_rest()]).wrench(
            [0.41e-3, 0.23e-3, DEPTH, 1.0, 0.0, 0.0, 0.0]
        )
        errors.append(abs(-wrench[2] / (skin.stiffness_per_area * volume) - 1.0))
    assert errors[2] < 1e-3
    assert errors[2] < 0.2 * errors[0]


def test_a_flat_punch_gives_flat_pressure():
    punch = Body("punch", [Geom("box", (4.5e-3, 3e-3, 3e-3), (0.0, 0.0, 3e-3))])
    skin = pad(taxels=(96, 96))  # 0.25 mm: the punch ends on borders of taxels
    contact = SkinContact(skin, [punch])
    wrench = pressed(contact, 2e-4)
    inside = contact.pressure > 0.0
    assert np.count_nonzero(inside) == 36 * 24
    np.testing.assert_allclose(contact.pressure[inside], skin.stiffness_per_area * 2e-4, rtol=1e-12)
    assert -wrench[2] == pytest.approx(skin.stiffness_per_area * 2e-4 * 9e-3 * 6e-3, rel=1e-9)
    assert contact.energy == pytest.approx(0.5 * -wrench[2] * 2e-4, rel=1e-9)


def test_under_a_textured_punch_the_pressure_follows_the_texture():
    n, size = 64, 2e-3
    u = (np.arange(n) + 0.5) * (size / n)
    wave = HeightField(
        2e-5 * np.cos(2 * np.pi * u / size) * np.ones((n, 1)), pixel_size=size / n, border="wrap"
    )
    punch = Body("punch", [Geom("box", (4e-3, 4e-3, 3e-3), (0.0, 0.0, 3e-3))], wave)
    skin = pad(taxels=(96, 96))
    contact = SkinContact(skin, [punch])
    pressed(contact, 2e-4)
    u = np.broadcast_to(contact.points[..., 0], contact.pressure.shape)
    inside = contact.pressure > 0.0
    expected = skin.stiffness_per_area * (2e-4 + 2e-5 * np.cos(2 * np.pi * u / size))
    np.testing.assert_allclose(contact.pressure[inside], expected[inside], rtol=1e-4)


def test_the_stiffer_the_skin_the_closer_to_the_rigid_contact():
    """At the same force the rigid penetration depth vanishes: as E^-1/2 under a ball."""
    force, rigid_depths = 0.5, []
    ball, n = ball_at_rest(), (0.0, 0.0, -1.0)
    for modulus in (1e5, 1e7, 1e9):
        skin = pad(modulus=modulus, size=(6e-3, 6e-3), middle=(0, 0, 0), taxels=(256, 256))
        contact = SkinContact(skin, [ball])
        depth = brentq(lambda z, c=contact: -pressed(c, z)[2] - force, 0.0, 3e-3, xtol=1e-14)
        pose = (0.0, 0.0, depth, 1.0, 0.0, 0.0, 0.0)
        rigid = BodyPair(skin.body, ball).depth(pose, (0, 0, 0, 1, 0, 0, 0), n)
        pressed(contact, depth)
        assert contact.compression.max() == pytest.approx(rigid.depth, abs=2e-8)
        rigid_depths.append(rigid.depth)
    assert rigid_depths[1] / rigid_depths[0] == pytest.approx(0.1, rel=0.05)
    assert rigid_depths[2] / rigid_depths[1] == pytest.approx(0.1, rel=0.15)


def test_the_layer_stiffens_beyond_half_of_its_thickness():
    thickness, k = 2e-3, 1e7
    values = np.linspace(0.0, 3e-3, 4001)
    rows = np.array([layer_law(k, thickness, value) for value in values])
    pressure, slope, energy = rows.T
    straight = values <= 1e-3
    np.testing.assert_allclose(pressure[straight], k * values[straight], rtol=1e-12)
    assert (np.diff(slope) >= -1e-6 * slope[1:]).all()
    step = values[1] - values[0]
    np.testing.assert_allclose(
        np.diff(energy), 0.5 * step * (pressure[1:] + pressure[:-1]), rtol=2e-3
    )
    np.testing.assert_allclose(np.diff(pressure), 0.5 * step * (slope[1:] + slope[:-1]), rtol=2e-2)
    assert layer_law(k, thickness, 1.9e-3)[0] > 4.0 * k * 1.0e-3


def layer_law(k, thickness, compression):
    """Return pressure, slope and energy per area, by the function's own Python source."""
    return layer_pressure.py_func(k, thickness, compression)
