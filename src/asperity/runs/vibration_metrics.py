r"""Metrics of vibration: from the hand's acceleration to one number that may track roughness.

The seed paper measures `max(u'')` (Otaduy & Lin 2004, section 4.2). The others here:

- `max|u''|`, which differs from it by 6 to 138 % over the default studies;
- the RMS of u'' in a band, 20 to 200 Hz by default. It was chosen *after* the paper's metric
  was seen to miss the effect of speed, because it does not: a metric found after the fact;
- the power of u'' weighted by the threshold of detection, `P = sum_f (A_f / T_f)^2`, after
  Bensmaia & Hollins (2003) as others quote them (not checked against the paper), with the
  threshold curve of the MPEG haptics reference model.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity.dynamics.dragged_hand.hand import Motion, MotionStatus
from asperity.errors import AsperityError, require_choice

DEFAULT_BAND = (20.0, 200.0)
"""[Hz]; see the module's docstring."""


def spectrum(signal: Array, step: float, *, periodic: bool) -> tuple[Array, Array]:
    """Return the one-sided amplitude spectrum of a record.

    Parameters
    ----------
    signal : (n,) array
        Values at equal steps.
    step : float
        Time between samples [s].
    periodic : bool
        Whether the record is whole repeats of a periodic motion: then its Fourier series is
        taken as it is; otherwise under a Hann window, scaled to keep the power.

    Returns
    -------
    frequencies : (m,) array
        [Hz], without zero.
    amplitudes : (m,) array
        Of the sinusoids, in the signal's unit; the power is `sum(amplitudes**2) / 2`.
    """
    centred = signal - np.mean(signal)
    n = centred.size
    if not periodic:
        window = np.hanning(n)
        centred = centred * window / np.sqrt(np.mean(window**2))
    transform = np.abs(np.fft.rfft(centred))[1:]
    frequencies = np.fft.rfftfreq(n, step)[1:].astype(np.float64)
    amplitudes = 2.0 * transform / n
    if n % 2 == 0:
        amplitudes[-1] /= np.sqrt(2.0)
    return frequencies, amplitudes


def acceleration_spectrum(motion: Motion) -> tuple[Array, Array]:
    """Return frequencies [Hz] and amplitudes of u'' [m/s^2] of a motion.

    u'' jumps where the contact does, and samples of a jumping signal alias: the k-th harmonic of
    N samples is off by a part k / N. Of a motion that repeats, the series of u - v t is taken
    instead, and differentiated twice term by term: it is smoother by two orders, and its error
    a part (k / N)^3.
    """
    if motion.status == MotionStatus.APERIODIC:
        return spectrum(motion.acceleration, motion.step, periodic=False)
    frequencies, amplitudes = spectrum(motion.lag, motion.step, periodic=True)
    return frequencies, amplitudes * (2.0 * np.pi * frequencies) ** 2


def band_gain(frequencies: ArrayLike, band: tuple[float, float]) -> Array:
    """Return the power gain of a second-order Butterworth band-pass at `frequencies` [Hz]."""
    low, high = band
    if not 0.0 < low < high < np.inf:
        raise AsperityError(
            f"band must rise from above 0 Hz and be finite, got {low:g} to {high:g} Hz"
        )
    f = np.asarray(frequencies, dtype=np.float64)
    return 1.0 / (1.0 + ((f**2 - low * high) / (f * (high - low))) ** 4)


def detection_threshold_db(frequencies: ArrayLike) -> Array:
    r"""Return the threshold of detecting vibration [dB], relative to its value at 0 dB.

    `T(f) = 50 (log10(c f + b) / log10 b)^2 - 45`, at most 0, with `c = 1/550`, `b = 1 - 250 c`:
    lowest, -45 dB, at 250 Hz. From the psychohaptic model of the MPEG reference software
    (the formula, not its loop, which stops at the first bin).
    """
    c = 1.0 / 550.0
    b = 1.0 - 250.0 * c
    f = np.asarray(frequencies, dtype=np.float64)
    curve = 50.0 * (np.log10(c * f + b) / np.log10(b)) ** 2 - 45.0
    return np.minimum(curve, 0.0)


def threshold_weighted_power(
    frequencies: Array, amplitudes: Array, reference: float = 1.0
) -> float:
    """Return `sum (A_f / (reference 10^(T/20)))^2` of the amplitudes of u''.

    The curve is relative; an acceleration amplitude of `reference` [m/s^2] at a frequency where
    T is 0 dB counts 1. The default, 1 m/s^2, is a choice that changes no order and no place of a
    peak.
    """
    weight = 10.0 ** (-detection_threshold_db(frequencies) / 20.0) / reference
    return float(np.sum((amplitudes * weight) ** 2))


def band_rms(
    frequencies: Array, amplitudes: Array, band: tuple[float, float] = DEFAULT_BAND
) -> float:
    """Return the RMS [m/s^2] of what a second-order band-pass lets through."""
    return float(np.sqrt(0.5 * np.sum(amplitudes**2 * band_gain(frequencies, band))))


class Metric(NamedTuple):
    """A way to make one number of a motion."""

    label: str
    """For axes, without the unit."""
    unit: str
    origin: str
    """Whose metric it is."""
    of: Callable[[Motion, tuple[float, float]], float]
    """Return the metric of a motion; the band [Hz] concerns `band_rms` only."""


METRICS = {
    "max_acceleration": Metric(
        "max u''", "m/s²", "Otaduy & Lin (2004), section 4.2", lambda motion, _: motion.largest
    ),
    "max_abs_acceleration": Metric(
        "max |u''|",
        "m/s²",
        "variant of the paper's metric",
        lambda motion, _: max(motion.largest, -motion.smallest),
    ),
    "band_rms": Metric(
        "RMS of u'' in the band",
        "m/s²",
        "asperity's, chosen after the paper's metric had failed",
        lambda motion, band: band_rms(*acceleration_spectrum(motion), band),
    ),
    "threshold_power": Metric(
        "threshold-weighted power of u''",
        "1",
        "after Bensmaia & Hollins (2003), as quoted; threshold curve of the MPEG haptics model",
        lambda motion, _: threshold_weighted_power(*acceleration_spectrum(motion)),
    ),
}


def evaluate(name: str, motion: Motion, *, band: tuple[float, float] = DEFAULT_BAND) -> float:
    """Return the metric `name` (a key of `METRICS`) of a motion."""
    require_choice("metric", name, METRICS)
    return METRICS[name].of(motion, band)
