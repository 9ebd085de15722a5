"""Noise that has passed a high-pass filter: fitted before it, made, and mixed."""

import numpy as np
import pytest
from scipy import signal

from asperity.errors import AsperityError
from asperity.vibrotactile.ar import burg
from asperity.vibrotactile.fit import fit
from asperity.vibrotactile.harmonic import high_pass_gain
from asperity.vibrotactile.high_pass import fit_before, passed_gain, power_response, sections
from asperity.vibrotactile.lsf import power_gain
from asperity.vibrotactile.rates import at_rate
from asperity.vibrotactile.signals import Exploration, explored
from asperity.vibrotactile.synthesis import Synthesiser
from asperity.vibrotactile.triangles import triangulated, weigh, without_slivers

RATE, CORNER = 2000.0, 20.0
SLOW = signal.butter(1, 45.0, fs=RATE)[1]
"""Of an AR process that is felt up to 45 Hz, as coarse sandpaper at 30 mm/s."""


def before(seed, seconds):
    """Return what there is before the filter."""
    noise = np.random.default_rng(seed).standard_normal(int(seconds * RATE) + 4000)
    return signal.lfilter([1.0], SLOW, noise)[4000:]


def recorded(seed, seconds):
    """Return the same as recordings have it."""
    time = np.arange(int(seconds * RATE)) / RATE
    pose, wrench = np.zeros((time.size, 7)), np.zeros((time.size, 6))
    pose[:, 0], pose[:, 3] = 0.03 * time, 1.0
    wrench[:, 2], wrench[:, 0] = 1.0, 1e-3 * before(seed, seconds)
    return explored(time, pose, wrench, np.ones(time.size, np.int64), mass=0.05).vibration


def share(density, frequency):
    """Return the share of power from 26 to 44 Hz."""
    inside = (frequency > 26.0) & (frequency < 44.0)
    return float(density[inside].sum() / density.sum())


def test_the_filter_is_that_behind_the_recordings():
    frequency = np.geomspace(2.0, 400.0, 50)
    there = power_response(CORNER, RATE, frequency)
    np.testing.assert_allclose(there, high_pass_gain(frequency, CORNER) ** 2, rtol=0.1)
    f, before_it = signal.welch(before(0, 200.0), RATE, nperseg=2048)
    _, behind_it = signal.welch(recorded(0, 200.0) * 0.05e3, RATE, nperseg=2048)
    inside = (f > 12.0) & (f < 300.0)
    ratio = behind_it[inside] / before_it[inside]
    np.testing.assert_allclose(ratio, power_response(CORNER, RATE, f[inside]), rtol=0.1, atol=0.02)
    assert sections(0.0, RATE).shape == (0, 6)
    assert power_response(0.0, RATE, frequency) == pytest.approx(1.0)


def test_the_gain_behind_it_is_that_of_noise_made():
    made = signal.sosfilt(sections(CORNER, RATE), before(1, 400.0))
    assert np.var(made) == pytest.approx(passed_gain(SLOW, CORNER, RATE), rel=0.03)
    assert passed_gain(SLOW, 0.0, RATE) == power_gain(SLOW)
    assert passed_gain(SLOW, 1e-3, RATE) == pytest.approx(power_gain(SLOW), rel=1e-3)


@pytest.mark.parametrize("seconds", [1.3, 20.0])
def test_a_band_next_to_the_corner_is_found_where_an_ar_filter_alone_is_too_broad(seconds):
    frequency = np.linspace(0.0, 0.5 * RATE, 20001)
    z = np.exp(-2j * np.pi * frequency / RATE)
    response = power_response(CORNER, RATE, frequency)
    true = share(response / np.abs(np.polyval(SLOW[::-1], z)) ** 2, frequency)
    for seed in range(4):
        slide = recorded(seed, seconds)
        for order in (2, 8, 20):
            a = fit_before([slide], 20, CORNER, RATE)[order].coefficients
            own = share(response / np.abs(np.polyval(a[::-1], z)) ** 2, frequency)
            assert own == pytest.approx(true, abs=0.06), (seed, order)
        if seconds > 10.0:  # a recording that leaves no doubt
            alone = burg([slide], 20)[20].coefficients
            assert share(1.0 / np.abs(np.polyval(alone[::-1], z)) ** 2, frequency) < true - 0.04


def test_what_cannot_be_fitted_is_refused():
    with pytest.raises(AsperityError, match="order 20 needs stretches longer"):
        fit_before([np.ones(10)], 20, CORNER, RATE)
    with pytest.raises(AsperityError, match="zero throughout"):
        fit_before([np.zeros(100)], 2, CORNER, RATE)


@pytest.fixture(scope="module")
def model():
    """Return a model of slides whose band moves with the speed, and whose size is the force."""
    slides = []
    for i, (speed, force) in enumerate([(v, f) for v in (0.03, 0.08, 0.16) for f in (0.3, 1.0)]):
        fast = signal.resample_poly(recorded(i, 16.0), 3, round(100.0 * speed))
        vibration = force * fast[: int(3.0 * RATE)]
        n = vibration.size
        speeds, forces = np.full(n, speed), np.full(n, force)
        one = (f"{speed} {force}", RATE, vibration, speeds, forces, np.zeros(n), np.ones(n, bool))
        slides.append(Exploration(*one))
    return fit(slides).model


@pytest.mark.parametrize("place", [(0.03, 0.3), (0.03, 0.6), (0.1, 0.8), (0.02, 0.2)])
def test_what_is_made_has_the_filters_density(model, place):
    assert model.noise_high_pass == CORNER
    n = 400000
    made = Synthesiser(model, seed=3).block(np.full(n, place[0]), np.full(n, place[1]))
    frequency, found = signal.welch(made, RATE, nperseg=1024)
    there = model.filter_at(*place).density(frequency, RATE)
    inside = (frequency > 15.0) & (frequency < 300.0)
    np.testing.assert_allclose(found[inside], there[inside], rtol=0.35)
    assert found[frequency < 8.0].max() < 0.02 * found.max()
    low = at_rate(model, 1000.0).filter_at(*place).density(frequency, 1000.0)
    np.testing.assert_allclose(low[inside], there[inside], rtol=0.35)


def test_sample_by_sample_is_as_in_a_block(model):
    speeds = np.linspace(0.0, 0.16, 200)
    whole = Synthesiser(model, seed=1).block(speeds, np.full(200, 0.6))
    one = Synthesiser(model, seed=1)
    for _ in range(2):
        assert [one.next(v, 0.6) for v in speeds] == pytest.approx(whole, rel=1e-12)
        one.reset()


def test_beyond_the_fastest_the_models_of_that_speed_go_on():
    """Also where the one of the middle force was recorded at a speed a little lower."""
    speeds = np.array([0.08, 0.08, 0.08, 0.16, 0.1599, 0.16, 0.003, 0.003, 0.006, 0.006])
    forces = np.array([0.3, 0.6, 1.2, 0.3, 0.6, 1.2, 0.3, 1.2, 0.3, 1.2])
    plain = triangulated(speeds, forces, stretch=8.0)
    triangles = without_slivers(plain)
    mesh = triangulated(speeds, forces, triangles)
    assert set(triangles.ravel()) == set(range(10))  # no model is left out
    away = []
    for one in (plain, mesh):
        corners, weights = np.empty(3, np.int64), np.empty(3)
        assert weigh(one, 0.17, 0.6, -1, corners, weights) == -1
        away.append(weights @ np.abs(forces[corners] - 0.6))
    assert away[0] > 0.2
    assert away[1] == pytest.approx(0.0, abs=1e-3)


def test_between_forces_those_of_the_same_speed_are_mixed(model):
    """At a speed that was recorded, others have no part: their bands lie elsewhere."""
    for speed in (0.03, 0.08, 0.16):
        for force in (0.35, 0.6, 0.9):
            corners, shares = model.weights(speed, force)
            assert shares @ (np.abs(model.speeds[corners] / speed - 1.0) > 0.05) < 1e-3
