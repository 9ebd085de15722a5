"""A soft fingertip on surfaces: closed forms, the rigid limit, energy, and the scene's skin."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import jv

from asperity.contact.soft.skin import SoftSkin, foundation_modulus
from asperity.contact.soft.skin_contact import SkinContact
from asperity.errors import AsperityError
from asperity.geometry.offsets.analytic import Grating, Sinusoid
from asperity.geometry.offsets.dots import DotPlate
from asperity.geometry.offsets.sampled import HeightMap
from asperity.scene.builtin.finger_plate import finger_on
from asperity.studies.skin.fingertip import Fingertip

SMOOTH = Fingertip(ridge_amplitude=0.0)
FLAT = Sinusoid(1e-12, 1e-3)


def test_on_a_plane_it_is_winklers_paraboloid():
    force = 0.02  # so low that the ellipsoid is its paraboloid
    rest, _ = SMOOTH.rest(FLAT, force)
    along, across, up = SMOOTH.semi_axes
    radii = along**2 / up, across**2 / up
    k = foundation_modulus(SMOOTH.modulus, SMOOTH.poisson, SMOOTH.thickness)
    depth = np.sqrt(force / (np.pi * k * np.sqrt(radii[0] * radii[1])))
    np.testing.assert_allclose(-rest.height, depth, rtol=0.01)
    np.testing.assert_allclose(rest.deepest, depth, rtol=0.01)
    # U = F d / 3, as F rises with the square of d.
    np.testing.assert_allclose(rest.energy, force * depth / 3.0, rtol=0.01)


def test_the_pad_has_the_contact_that_its_modulus_was_fitted_to():
    rest, _ = SMOOTH.rest(FLAT, 0.6)
    assert rest.deepest.max() == pytest.approx(1.05e-3, rel=0.05)


@pytest.mark.parametrize("length", [1e-3, 1.6e-3, 2.5e-3, 6e-3])
def test_low_waves_pass_as_the_transform_of_the_pressure_says(length):
    force, amplitude = 0.02, 1e-7
    path = SMOOTH.path(Sinusoid(amplitude, length), force).samples
    passed = 2.0 * np.fft.rfft(path)[1] / path.size
    passed = (passed * np.exp(-1j * np.pi / path.size)).real / amplitude  # samples lie half-way
    along, across, up = SMOOTH.semi_axes
    k = foundation_modulus(SMOOTH.modulus, SMOOTH.poisson, SMOOTH.thickness)
    depth = np.sqrt(force / (np.pi * k * along * across / up))
    z = 2.0 * np.pi / length * np.sqrt(2.0 * along**2 / up * depth)
    assert passed == pytest.approx(8.0 * jv(2, z) / z**2, abs=0.006)
    assert abs(passed) < 8.0 / z**2


def test_a_hard_round_pad_traces_the_offset_surface_of_the_sphere():
    surface, trace = Sinusoid(0.1e-3, 1.5e-3), Sinusoid(0.1e-3, 1.5e-3).tracer(3e-3)
    ball = Fingertip((1.5e-3,) * 3, ridge_amplitude=0.0, pixel=4e-6, line=8e-6)
    errors = []
    for modulus in (1e8, 4e8, 16e8):
        path = replace(ball, modulus=modulus).path(surface, 0.3)
        places = (np.arange(path.samples.size) + 0.5) * path.pixel_size
        errors.append(np.max(np.abs(path.samples - trace(places).height)))
    # H lies below the offset by the first touch, as 1 / sqrt(modulus).
    assert errors[0] < 25e-6
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.1)
    assert errors[2] == pytest.approx(0.5 * errors[1], rel=0.1)


@pytest.mark.parametrize(
    "surface", [Sinusoid(0.1e-3, 2.2e-3), Grating(0.2e-3, 2e-3, 0.5e-3, 0.3e-3)]
)
def test_the_force_is_that_of_the_pressures_on_the_slopes(surface):
    # F_u = integral of p dh/du, summed here by other code than the path's.
    force, finger = 0.58, replace(SMOOTH, pixel=10e-6, line=0.1e-3)
    rest, pixel = finger.rest(surface, force)
    table = finger.slope_table(surface, force)
    k = foundation_modulus(finger.modulus, finger.poisson, finger.thickness)
    x = (np.arange(-9000, 9000) + 0.5) * 1e-6
    y = (np.arange(70) + 0.5) * 0.1e-3
    along, across, up = finger.semi_axes
    shape = up * (1.0 - np.sqrt(1.0 - np.minimum((x / along) ** 2 + (y[:, None] / across) ** 2, 1)))
    largest = force * np.max(np.abs(table(np.linspace(0.0, surface.period, 500))))
    for i in range(0, rest.height.size, 29):
        u = (i + 0.5) * pixel
        delta = np.maximum(surface.heights(u + x) - rest.height[i] - shape, 0.0)
        assert delta.max() < 0.5 * finger.thickness  # the layer is linear
        normal = k * delta.sum() * 2e-10
        along_u = k * (delta * surface.slopes(u + x)).sum() * 2e-10
        assert normal == pytest.approx(force, rel=2e-3)
        assert along_u == pytest.approx(force * table(np.array(u)), abs=0.03 * largest)


def test_ridges_pick_up_what_has_their_spacing():
    force, amplitude = 0.58, 1e-6
    of_ridges = Sinusoid(amplitude, SMOOTH.ridge_spacing)
    smooth, ridged = (f.path(of_ridges, force).samples for f in (SMOOTH, Fingertip()))
    # p gains K b cos(k x), which over the contact's area A gives H an amplitude of A K a b / 2 F.
    rest, _ = Fingertip().rest(FLAT, force)
    along, across, up = SMOOTH.semi_axes
    area = 2.0 * np.pi * along * across / up * -rest.height.mean()
    k = foundation_modulus(SMOOTH.modulus, SMOOTH.poisson, SMOOTH.thickness)
    expected = area * k * amplitude * Fingertip().ridge_amplitude / force
    assert np.ptp(ridged) == pytest.approx(expected, rel=0.1)
    assert np.ptp(smooth) < 0.01 * np.ptp(ridged)


def test_it_is_the_scenes_skin_but_for_the_direction_of_the_springs():
    force, length = 0.3, 3e-3
    plate = {"length": 0.05, "half": 0.004, "colour": "1 1 1", "height": 0.0075}
    wave = {"kind": "sinusoid", "wavelength": length, "amplitude": 1e-4}
    bodies = {body.name: body for body in finger_on("f", plate, wave, length=0.02).bodies}
    skin = SoftSkin(
        bodies["finger"], 3e-3, 1.2e4, taxels=(48, 192), facing=(0, 0, -1), size=(0.014, 0.012),
        middle=(0, 0, 0),
    )  # fmt: skip
    contact = SkinContact(skin, [bodies["plate"]], [[0, 0, -0.004, 1, 0, 0, 0]])

    def rests(u):
        low, high = 0.0055, 0.0071
        for _ in range(40):
            z = 0.5 * (low + high)
            wrench = contact.wrench([u, 0, z, 1, 0, 0, 0])
            low, high = (z, high) if wrench[2] > force else (low, z)
        return z - 0.007, -wrench[0]

    rest, pixel = Fingertip().rest(Sinusoid(1e-4, length), force)
    table = Fingertip().slope_table(Sinusoid(1e-4, length), force)
    places = (np.arange(0, rest.height.size, 15) + 0.5) * pixel
    found = np.array([rests(u) for u in places])
    np.testing.assert_allclose(found[:, 0], rest.height[::15], atol=0.06e-3)
    largest = np.max(np.abs(found[:, 1]))
    np.testing.assert_allclose(found[:, 1], force * table(places), atol=0.4 * largest)
    assert np.corrcoef(found[:, 1], table(places))[0, 1] > 0.95


def test_dots_carry_a_finger_and_give_it_a_path():
    plate = DotPlate(2e-3, jitter=0.0, rows=1, columns=1)
    path = SMOOTH.path(plate, 0.58)
    assert path.period == pytest.approx(2.5e-3)
    assert 0.1e-6 < np.ptp(path.samples) < 0.1e-3


def test_what_a_finger_cannot_do_is_said():
    with pytest.raises(AsperityError, match="a width of a surface"):
        SMOOTH.path(HeightMap(np.random.default_rng(0).normal(size=(20, 20)) * 1e-6, 1e-4), 0.5)
    with pytest.raises(AsperityError, match=r"100 N presses.*3 mm.*12000 Pa.*smaller force"):
        SMOOTH.path(FLAT, 100.0)
    with pytest.raises(AsperityError, match="rim"):
        replace(SMOOTH, semi_axes=(2e-3, 2e-3, 0.5e-3)).path(FLAT, 0.5)
    with pytest.raises(AsperityError, match=r"ridge_amplitude.*-1"):
        Fingertip(ridge_amplitude=-1.0)
