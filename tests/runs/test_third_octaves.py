"""Third octaves: where a tone is found, and that no power is lost."""

import numpy as np
import pytest

from asperity.errors import AsperityError
from asperity.runs.third_octaves import nominal, third_octaves
from asperity.runs.vibration_metrics import spectrum


@pytest.mark.parametrize("frequency", [31.5, 63.0, 100.0, 250.0])
def test_a_tone_is_in_its_band(frequency):
    t = np.arange(8000) / 4000.0
    wave = 3.0 * np.sin(2 * np.pi * frequency * t)
    middles, rms = third_octaves(*spectrum(wave, 1 / 4000.0, periodic=False))
    most = int(np.argmax(rms))
    assert nominal(middles[most]) == f"{frequency:g}"
    assert rms[most] == pytest.approx(3.0 / np.sqrt(2.0), rel=0.02)
    assert np.sqrt(np.sum(rms**2)) == pytest.approx(3.0 / np.sqrt(2.0), rel=1e-3)


def test_white_noise_rises_by_a_decibel_a_band():
    noise = np.random.default_rng(2).standard_normal(2**17)
    middles, rms = third_octaves(*spectrum(noise, 1e-3, periodic=True))
    high = middles > 20.0
    slope = np.polyfit(np.log10(middles[high]), 20.0 * np.log10(rms[high]), 1)[0]
    assert slope == pytest.approx(10.0, abs=0.5)  # dB in a decade, of ten bands


def test_bands_narrower_than_the_distance_of_lines_are_left_out():
    middles, _ = third_octaves(*spectrum(np.random.default_rng(3).standard_normal(100), 1e-3,
                                         periodic=True))  # fmt: skip
    step = 10.0
    assert middles[0] * (10.0**0.05 - 10.0**-0.05) >= step
    assert middles[0] * (10.0**-0.05 - 10.0**-0.15) < step
    assert middles[-1] * 10.0**0.05 <= 500.0 + 0.5 * step


def test_one_line_is_no_spectrum():
    with pytest.raises(AsperityError, match="two lines or more, got 1"):
        third_octaves(np.array([1.0]), np.array([1.0]))


def test_names_are_the_usual_ones():
    named = [nominal(10.0 ** (k / 10.0)) for k in range(10, 28)]
    assert named == ["10", "12.5", "16", "20", "25", "31.5", "40", "50", "63", "80", "100", "125",
                     "160", "200", "250", "315", "400", "500"]  # fmt: skip
