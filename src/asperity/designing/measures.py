r"""What a design aims at in a motion: RMS in a band, power over threshold, or the largest u''.

All but the largest u'' are quadratic forms of the Fourier series Y of the lag, `sum w |Y|^2`, whose
gradient by the lag is a Fourier synthesis of `w Y`. Several strokes count as one long one: powers
are averaged, and the largest is that of all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from asperity._core.arrays import Array
from asperity.designing.motion import Lag
from asperity.errors import AsperityError, require_choice
from asperity.runs.vibration_metrics import DEFAULT_BAND, band_gain, detection_threshold_db

QUANTITIES = ("acceleration", "force")
METRIC_NAMES = ("band_rms", "threshold_power", "max_acceleration")


@dataclass(frozen=True)
class VibrationMeasure:
    """A number of a hand's motion.

    Parameters
    ----------
    metric : str
        One of `METRIC_NAMES`, which are those of `runs.vibration_metrics`.
    band : (low, high)
        Of `band_rms` [Hz], behind a second-order band-pass.
    quantity : {"acceleration", "force"}
        Of what: u'' of the hand [m/s^2], or the texture's force on it [N]; force for `band_rms`.
    """

    metric: str = "band_rms"
    band: tuple[float, float] = DEFAULT_BAND
    quantity: str = "acceleration"

    def __post_init__(self) -> None:
        require_choice("metric", self.metric, METRIC_NAMES)
        require_choice("quantity", self.quantity, QUANTITIES)
        if self.quantity == "force" and self.metric != "band_rms":
            raise AsperityError(
                f'a quantity of "force" has the metric band_rms only, not {self.metric}'
            )
        band_gain(1.0, self.band)  # refuses a band that does not rise

    @property
    def unit(self) -> str:
        """Of the value."""
        if self.metric == "threshold_power":
            return "1"
        return "N" if self.quantity == "force" else "m/s²"

    @property
    def label(self) -> str:
        """For tables and axes."""
        if self.metric == "band_rms":
            what = "u''" if self.quantity == "acceleration" else "force"
            return f"RMS of {what}, {self.band[0]:.4g} to {self.band[1]:.4g} Hz"
        return {"threshold_power": "power over threshold", "max_acceleration": "max u''"}[
            self.metric
        ]

    @property
    def degree(self) -> float:
        """Power of the motion's size with which the value grows."""
        return 2.0 if self.metric == "threshold_power" else 1.0

    def _weights(self, lag: Lag) -> Array:
        """Return w of the quadratic form, by wave of the lag."""
        n = lag.values.size
        f = np.fft.rfftfreq(n, lag.step)[1:]
        turns = 2.0 * np.pi * f
        pairs = np.full(f.size, 4.0 / n**2)
        pairs[-1] /= 2.0
        if self.quantity == "force":
            hand = lag.hand
            gain = (hand.stiffness - hand.mass * turns**2) ** 2 + (hand.damping * turns) ** 2
        else:
            gain = turns**4
        if self.metric == "threshold_power":
            gain = gain * 10.0 ** (-detection_threshold_db(f) / 10.0)
        else:
            gain = 0.5 * gain * band_gain(f, self.band)
        return np.concatenate([[0.0], pairs * gain])

    def _power(self, lag: Lag) -> tuple[float, Array]:
        """Return the quadratic form of a stroke, and its gradient by the lag."""
        waves = np.fft.rfft(lag.values)
        weights = self._weights(lag)
        weighted = weights * waves
        weighted[-1] *= 2.0  # the last wave has no mirror image in the synthesis
        n = lag.values.size
        return float(np.sum(weights * np.abs(waves) ** 2)), n * np.fft.irfft(weighted, n)

    def _largest(self, lag: Lag) -> tuple[float, Array]:
        """Return the largest u'' of a stroke, and its gradient by the lag."""
        y = lag.values
        second = (np.roll(y, -1) - 2.0 * y + np.roll(y, 1)) / lag.step**2
        at, gradient = int(np.argmax(second)), np.zeros(y.size)
        for shift, weight in ((-1, 1.0), (0, -2.0), (1, 1.0)):
            gradient[(at + shift) % y.size] += weight / lag.step**2
        return float(second[at]), gradient

    def value_and_gradients(self, lags: list[Lag]) -> tuple[float, list[Array]]:
        """Return the value over several strokes, and its gradient by the lag of each."""
        if self.metric == "max_acceleration":
            each = [self._largest(lag) for lag in lags]
            first = int(np.argmax([value for value, _ in each]))
            zeros = [np.zeros_like(gradient) for _, gradient in each]
            zeros[first] = each[first][1]
            return each[first][0], zeros
        each = [self._power(lag) for lag in lags]
        power = sum(value for value, _ in each) / len(each)
        if self.metric == "threshold_power":
            return power, [gradient / len(each) for _, gradient in each]
        value = math.sqrt(power)
        scale = 0.5 / (value * len(each)) if value > 0.0 else 0.0
        return value, [gradient * scale for _, gradient in each]
