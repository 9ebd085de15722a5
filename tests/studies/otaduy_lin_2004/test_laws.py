"""The force laws: signs, limits, and what each of them can and cannot feel."""

import numpy as np
import pytest

from asperity.dynamics.dragged_hand.hand import Hand, MotionStatus, shake
from asperity.errors import AsperityError
from asperity.geometry.offsets.analytic import Grating, Sinusoid
from asperity.geometry.offsets.dots import DotPlate
from asperity.geometry.offsets.sampled import SampledProfile
from asperity.studies.otaduy_lin_2004.force_models import ho, minsky, otaduy_lin, siira_pai

WAVE = Sinusoid(0.1e-3, 1.5e-3)
UPHILL = np.linspace(0.55, 0.95, 9) * WAVE.spacing
"""From a trough at half a period up to the crest at a whole one."""


@pytest.mark.parametrize(
    "table",
    [otaduy_lin.texture_force(WAVE, 3e-3, 0.5), minsky.texture_force(WAVE, 0.5),
     ho.texture_force(WAVE, 0.5)],
)  # fmt: skip
def test_uphill_resists(table):
    assert np.all(table(UPHILL) > 0.0)
    assert np.all(table(-UPHILL) < 0.0)


def test_force_is_the_normal_force_times_the_slope_of_the_offset():
    u = np.linspace(0, 2 * WAVE.spacing, 301)
    expected = 0.7 * WAVE.tracer(2e-3)(u).slope
    np.testing.assert_allclose(otaduy_lin.texture_force(WAVE, 2e-3, 0.7)(u), expected, atol=1e-6)


def test_minsky_is_the_limit_of_a_probe_of_no_size():
    u = np.linspace(0.03, 0.97, 200) * WAVE.spacing
    point = minsky.texture_force(WAVE, 0.5)(u)
    misses = [
        np.max(np.abs(otaduy_lin.texture_force(WAVE, d, 0.5)(u) - point)) for d in (1e-4, 1e-5)
    ]
    assert misses[1] < 0.2 * misses[0] < 0.2 * 0.2


def test_ho_is_minskys_where_the_texture_is_taller_than_the_depth():
    # A point pressed in by F / k less than the height meets the bare texture.
    soft = ho.texture_force(WAVE, 0.01, stiffness=1e5)
    crest = np.linspace(0.7, 0.97, 50) * WAVE.spacing
    np.testing.assert_allclose(soft(crest), minsky.texture_force(WAVE, 0.01)(crest), rtol=1e-4)


def test_ho_grows_with_height_and_gain_until_then():
    u = UPHILL[:4]
    low, high = (ho.texture_force(WAVE, 5.0, stiffness=300.0, gain=g)(u) for g in (1.0, 2.0))
    np.testing.assert_allclose(high, 2.0 * low, rtol=1e-4)


def test_siira_pai_is_seeded_noise_of_the_asked_level_and_band():
    noise = siira_pai.texture_force(0.5, 20.0, level=0.3, seed=3)
    assert np.std(noise) == pytest.approx(0.15)
    np.testing.assert_array_equal(noise, siira_pai.texture_force(0.5, 20.0, level=0.3, seed=3))
    assert np.any(noise != siira_pai.texture_force(0.5, 20.0, level=0.3, seed=4))
    power = np.abs(np.fft.rfft(noise)) ** 2
    frequency = np.fft.rfftfreq(noise.size, 1e-3)
    assert np.mean(power[frequency > 450]) < 0.02 * np.mean(power[frequency < 100])


def test_a_shaken_hand_is_scipys_linear_system():
    from scipy import signal

    noise, hand = siira_pai.texture_force(0.5, 1.0), Hand()
    motion = shake(noise, 1e-3, hand, 0.1)
    fine = 200
    system = ([-1.0], [hand.mass, hand.damping, hand.stiffness])
    times = np.arange(noise.size * fine) * 1e-3 / fine
    _, lag, _ = signal.lsim(system, np.repeat(noise, fine), times, interp=False)
    assert motion.status == MotionStatus.APERIODIC
    np.testing.assert_allclose(motion.lag, lag[::fine][-motion.lag.size :], atol=1e-9)
    expected = -(hand.stiffness * motion.lag + hand.damping * (motion.speed - 0.1)
                 + noise[-motion.lag.size :]) / hand.mass  # fmt: skip
    np.testing.assert_allclose(motion.acceleration, expected, atol=1e-9)


@pytest.mark.parametrize("surface", [Grating(0.4e-3, 1e-3), DotPlate(1e-3, flank=0.0)])
def test_point_models_refuse_walls(surface):
    with pytest.raises(AsperityError, match=r"walls have? no slope|flank"):
        minsky.texture_force(surface, 0.5)


def test_a_mirrored_profile_gives_the_table_that_its_whole_period_gives():
    rng = np.random.default_rng(0)
    heights = np.cumsum(rng.normal(size=64))
    profile = SampledProfile(1e-5 * (heights - heights.mean()), 50e-6, "mirror")
    table = otaduy_lin.texture_force(profile, 1e-3, 1.0)
    u = rng.uniform(0, profile.period, 2000)
    away = np.min(np.abs(u[:, None] - table.jumps), axis=1) > 1e-7
    exact = profile.tracer(1e-3)(u).slope
    np.testing.assert_allclose(table(u)[away], exact[away], atol=2e-5 * np.max(np.abs(exact)))


@pytest.mark.parametrize("law", [
    lambda f: otaduy_lin.texture_force(WAVE, 3e-3, f), lambda f: minsky.texture_force(WAVE, f),
    lambda f: ho.texture_force(WAVE, f), lambda f: siira_pai.texture_force(f, 1.0),
])  # fmt: skip
def test_a_force_must_be_above_zero(law):
    for bad in (0.0, -0.5, np.nan, np.inf):
        with pytest.raises(AsperityError, match=r"normal_force must be .* above 0 \[N\]"):
            law(bad)
