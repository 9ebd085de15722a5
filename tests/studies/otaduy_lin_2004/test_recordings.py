"""The simulated vibration against 24 recordings of a robot sliding over two gratings."""

import re

import numpy as np
import pytest

from asperity.dynamics.dragged_hand.hand import Hand, drag
from asperity.geometry.offsets.analytic import Grating
from asperity.runs.vibration_metrics import spectrum
from asperity.studies.otaduy_lin_2004.force_models.otaduy_lin import texture_force

RATE = 35.6
"""[Hz], of the recordings."""
WITHIN = 0.02
"""How far the recordings' own peaks lie from speed / period, at most; see the data's notes."""
PERIODS = {"2mm": 4e-3, "10mm": 20e-3}
"""Real period [m] of the board of each name: twice the name."""

PROBE = 6e-3


def recorded_peak(path, near):
    """Frequency of the strongest line within a factor of 1.5 of `near`, refined between the bins.

    The power of the signal's rate, summed over the channels. The window leaves out what the
    boards' whole length does to the sensor, and in one recording (2 mm, F150, 5 mm/s) a stronger
    line at 2.2 Hz that the other 23 lack.
    """
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    rate = np.diff(table[:, 3:], axis=0)
    padded = 8 * rate.shape[0]
    window = np.hanning(rate.shape[0])[:, None]
    power = np.sum(np.abs(np.fft.rfft(rate * window, padded, axis=0)) ** 2, axis=1)
    seconds = (table[-1, 0] - table[0, 0]) * 1e-3
    frequency = np.arange(power.size) * rate.shape[0] / seconds / padded
    inside = (frequency > near / 1.5) & (frequency < near * 1.5)
    return frequency[np.argmax(np.where(inside, power, 0.0))]


def simulated_peak(period, speed, force):
    # The loads are counts of no known unit; taken as a few tenths of a newton.
    grating = Grating(height=1e-3, spacing=0.6 * period, ridge=0.4 * period, flank=0.1 * period)
    motion = drag(texture_force(grating, PROBE, force), Hand(), speed)
    # Up and down, which is what a compliant sensor pressed on the board follows.
    height = grating.tracer(PROBE)(motion.place).height
    frequencies, amplitudes = spectrum(height, motion.step, periodic=True)
    return frequencies[np.argmax(amplitudes)]


def test_recorded_and_simulated_vibration_peak_at_speed_over_period(data):
    files = sorted((data / "recordings" / "fabricslide_board").glob("*.csv"))
    assert len(files) == 24
    misses = []
    for path in files:
        board, load, speed = re.fullmatch(r"Board(\d+mm)_F(\d+)_V-(\d+)mmps_0", path.stem).groups()
        expected = float(speed) * 1e-3 / PERIODS[board]
        if expected >= 0.5 * RATE:
            continue
        simulated = simulated_peak(PERIODS[board], float(speed) * 1e-3, float(load) * 1e-3)
        assert simulated == pytest.approx(expected, rel=1e-6), path.name
        misses.append(abs(recorded_peak(path, simulated) / simulated - 1.0))
    assert len(misses) == 24
    assert max(misses) < WITHIN
