"""The metrics against hand-made motions whose answer is known."""

import re
from pathlib import Path

import numpy as np
import pytest

from asperity.dynamics.dragged_hand.hand import Motion, MotionStatus
from asperity.errors import AsperityError
from asperity.runs.vibration_metrics import (
    METRICS,
    acceleration_spectrum,
    band_gain,
    band_rms,
    detection_threshold_db,
    evaluate,
    spectrum,
    threshold_weighted_power,
)


def sine_motion(frequency, amplitude, repeats=3, samples=256, status=MotionStatus.PERIODIC):
    """A hand whose u'' is a sine of one frequency: whole repeats, so exact."""
    step = repeats / frequency / samples
    t = np.arange(samples) * step
    w = 2.0 * np.pi * frequency
    wave = amplitude * np.sin(w * t)
    return Motion(
        status, 1, 0.0, step, place=t * 0.1 - wave / w**2, lag=-wave / w**2,
        speed=0.1 - amplitude * np.cos(w * t) / w, acceleration=wave,
        largest=amplitude, smallest=-amplitude, mismatch=0.0,
    )  # fmt: skip


def test_maxima_are_the_ones_the_integrator_located():
    motion = sine_motion(60.0, 2.0)._replace(largest=3.0, smallest=-5.0)
    assert evaluate("max_acceleration", motion) == 3.0
    assert evaluate("max_abs_acceleration", motion) == 5.0


@pytest.mark.parametrize("frequency", [20.0, 63.2455532, 200.0])
def test_band_rms_of_a_sine_is_its_rms_times_the_filter(frequency):
    # A second-order Butterworth band-pass: 1 in the middle, 1/sqrt(2) at its edges.
    gain = 1.0 if frequency == pytest.approx(63.2455532) else np.sqrt(0.5)
    found = evaluate("band_rms", sine_motion(frequency, 2.0))
    assert found == pytest.approx(gain * 2.0 / np.sqrt(2.0), rel=1e-6)


def test_band_gain_is_scipys_butterworth():
    from scipy import signal

    frequencies = np.geomspace(2.0, 2000.0, 50)
    b, a = signal.butter(2, [2 * np.pi * 20, 2 * np.pi * 200], btype="bandpass", analog=True)
    _, response = signal.freqs(b, a, 2 * np.pi * frequencies)
    np.testing.assert_allclose(band_gain(frequencies, (20, 200)), np.abs(response) ** 2, rtol=1e-9)


def test_spectrum_keeps_the_power_windowed_or_not():
    rng = np.random.default_rng(0)
    wave = rng.normal(size=4096)
    for periodic in (True, False):
        _, amplitudes = spectrum(wave, 1e-3, periodic=periodic)
        assert np.sum(amplitudes**2) / 2 == pytest.approx(np.var(wave), rel=0.06)


def test_spectrum_from_the_lag_is_that_of_the_acceleration():
    frequencies, amplitudes = acceleration_spectrum(sine_motion(60.0, 2.0))
    assert frequencies[np.argmax(amplitudes)] == pytest.approx(60.0)
    assert np.max(amplitudes) == pytest.approx(2.0, rel=1e-9)


def test_harmonics_of_a_jumping_acceleration_are_those_of_its_fourier_series():
    # A square wave of u'': harmonic k has amplitude 4 / (pi k). From the lag 256 samples give
    # the 31st to 1 %; from the samples of u'' themselves it would be off by 5 %.
    n, k = 256, np.arange(1, 20001, 2)
    t = np.arange(n) / n
    lag = np.array(
        [-np.sum(4 / np.pi / k * np.sin(2 * np.pi * k * x) / (2 * np.pi * k) ** 2) for x in t]
    )
    motion = sine_motion(1.0, 1.0, 1, n)._replace(lag=lag, acceleration=np.sign(0.5 - t))
    _, amplitudes = acceleration_spectrum(motion)
    expected = 4 / np.pi / k[:16]
    np.testing.assert_allclose(amplitudes[k[:16] - 1], expected, rtol=0.01)


def test_threshold_curve_is_lowest_at_250_hz_and_capped():
    assert detection_threshold_db(250.0) == pytest.approx(-45.0)
    frequencies = np.geomspace(1.0, 5000.0, 400)
    curve = detection_threshold_db(frequencies)
    assert np.all(curve <= 0.0)
    assert frequencies[np.argmin(curve)] == pytest.approx(250.0, rel=0.05)


def test_threshold_weighted_power_counts_each_line_by_its_own_threshold():
    frequencies, amplitudes = np.array([2.0, 250.0]), np.array([3.0, 2.0])
    expected = 3.0**2 + (2.0 * 10 ** (45 / 20)) ** 2
    assert threshold_weighted_power(frequencies, amplitudes) == pytest.approx(expected)
    assert threshold_weighted_power(frequencies, amplitudes, 2.0) == pytest.approx(expected / 4)


def test_band_rms_needs_a_band():
    with pytest.raises(AsperityError, match=r"band must rise.*200 to 20"):
        band_rms(np.array([1.0]), np.array([1.0]), (200.0, 20.0))


def test_unknown_metric_names_the_choices():
    with pytest.raises(AsperityError, match=r"'max_accel'.*did you mean.*band_rms"):
        evaluate("max_accel", sine_motion(60.0, 1.0))


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_is_documented_where_it_can_be_chosen(name):
    docs = Path(__file__).parents[3] / "docs"
    assert f"| `{name}` |" in (docs / "concepts.md").read_text("utf-8")
    option = re.search(
        r"^\| `--metric .*Metric of the main figure.*$", (docs / "cli.md").read_text("utf-8"), re.M
    )
    assert name in option[0]


def test_every_metric_says_whose_it_is():
    assert all(metric.origin for metric in METRICS.values())
    assert "after" in METRICS["band_rms"].origin
