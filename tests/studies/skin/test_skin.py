"""Parts between grip and channels, each against a closed form or a published curve."""

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.runs.vibration_metrics import detection_threshold_db
from asperity.studies.skin.channels import CHANNELS, channel_level, envelope_db, threshold_db
from asperity.studies.skin.pooling import Pooling
from asperity.studies.skin.pressed_finger import PressedFinger
from asperity.studies.skin.transmission import FINGERTIP, PALM, Tissue, transmissibility


def test_transmissibility_is_that_of_a_mass_shaken_at_its_base():
    f = np.geomspace(1.0, 2000.0, 50)
    for tissue in (FINGERTIP, PALM, Tissue(120.0, 0.2)):
        r, z = f / tissue.natural_frequency, tissue.damping_ratio
        magnitude = np.sqrt((1 + (2 * z * r) ** 2) / ((1 - r**2) ** 2 + (2 * z * r) ** 2))
        np.testing.assert_allclose(np.abs(transmissibility(f, tissue)), magnitude)
        # Whatever the damping, the tissue moves as far as the grip at sqrt(2) f_n and at rest.
        crossing = np.sqrt(2.0) * tissue.natural_frequency
        assert np.abs(transmissibility(crossing, tissue)) == pytest.approx(1.0)
        assert np.abs(transmissibility(0.0, tissue)) == 1.0


def test_the_tissues_equation_of_motion_gives_the_same():
    from scipy.integrate import solve_ivp

    tissue, f = Tissue(200.0, 0.5), 260.0
    w0, w, z = 2 * np.pi * tissue.natural_frequency, 2 * np.pi * f, tissue.damping_ratio

    def rates(t, s):
        base, base_rate = np.sin(w * t), w * np.cos(w * t)
        return [s[1], 2 * z * w0 * (base_rate - s[1]) + w0**2 * (base - s[0])]

    times = np.linspace(0.05, 0.05 + 5 / f, 2001)
    moved = solve_ivp(rates, (0, times[-1]), [0, 0], t_eval=times, rtol=1e-9, atol=1e-12).y[0]
    assert moved.max() == pytest.approx(abs(complex(transmissibility(f, tissue))), rel=1e-3)


def test_the_envelope_of_the_channels_is_a_published_threshold_curve():
    for low, high, most in ((40.0, 300.0, 3.5), (10.0, 500.0, 8.0)):
        f = np.geomspace(low, high, 60)
        mine = envelope_db(f) - envelope_db(250.0)
        published = detection_threshold_db(f) - detection_threshold_db(250.0)
        assert np.max(np.abs(mine - published)) <= most


def test_each_channel_mediates_its_range():
    lowest = {
        f: min(CHANNELS, key=lambda c, f=f: threshold_db(c, f)) for f in (1.0, 20.0, 100.0, 250.0)
    }
    assert lowest == {1.0: "sa1", 20.0: "fa1", 100.0: "fa2", 250.0: "fa2"}


def test_a_vibration_at_threshold_is_one_threshold():
    for channel in CHANNELS:
        at = 1e-6 * 10 ** (threshold_db(channel, 50.0) / 20)
        one = channel_level(channel, np.array([50.0]), np.array([at]))
        assert one == pytest.approx(1.0)
        both = channel_level(channel, np.array([50.0, 50.0]), np.array([3 * at, 4 * at]))
        assert both == pytest.approx(5.0)


def test_pooling_saturates():
    pooling = Pooling(exponent=2.0, semi_saturation=10.0)
    assert pooling.compressed(10.0) == pytest.approx(0.5)
    assert pooling.compressed(0.0) == 0.0
    few = pooling.intensity(dict.fromkeys(CHANNELS, 20.0))
    many = pooling.intensity(dict.fromkeys(CHANNELS, 2000.0))
    assert few < many < 3.0
    only = Pooling(weights={"fa1": 2.0})
    assert only.intensity({"fa1": 30.0, "fa2": 1e9}) == pytest.approx(1.0)
    with pytest.raises(AsperityError, match=r"weights name.*p9.*fa1, fa2, sa1"):
        Pooling(weights={"p9": 1.0})


@pytest.mark.parametrize("force", [0.2, 0.6])
def test_a_pressed_finger_on_a_plane_is_winklers(force):
    finger = PressedFinger()
    pixel = 0.05e-3
    pressure = finger.pressure(np.zeros((321, 321)), pixel, force)
    depth, radius = finger.flat_contact(force)
    assert pressure.sum() * pixel**2 == pytest.approx(force, rel=1e-6)
    assert pressure.max() == pytest.approx(finger.stiffness * depth, rel=2e-3)
    contact = np.sqrt(np.count_nonzero(pressure) * pixel**2 / np.pi)
    assert contact == pytest.approx(radius, rel=5e-3)


def test_a_raised_punch_carries_the_load_alone():
    # One flat-topped dot high enough keeps the skin off the floor: p = F / area, nearly.
    finger, pixel = PressedFinger(), 0.05e-3
    heights = np.zeros((321, 321))
    heights[150:171, 150:171] = 2e-3
    pressure = finger.pressure(heights, pixel, 0.01)
    assert np.count_nonzero(pressure) == 21**2
    assert pressure.max() == pytest.approx(0.01 / (21 * pixel) ** 2, rel=0.02)


def test_unevenness_grows_with_relief_and_is_zero_on_a_flat():
    finger, pixel = PressedFinger(), 0.1e-3
    x = np.arange(161) * pixel

    def waves(amplitude):
        return [
            np.tile(amplitude * np.sin(2 * np.pi * (x / 3e-3 + phase)), (161, 1))
            for phase in np.arange(6) / 6
        ]

    values = [finger.unevenness(waves(a), pixel, 0.5) for a in (0.0, 0.02e-3, 0.1e-3)]
    assert values[0] < 1e-9
    assert 0.0 < 2.0 * values[1] < values[2]


def test_a_patch_too_small_is_refused():
    with pytest.raises(AsperityError, match=r"patch of 2.1 mm is too small.*0.6 N"):
        PressedFinger().pressure(np.zeros((21, 21)), 0.1e-3, 0.6)
