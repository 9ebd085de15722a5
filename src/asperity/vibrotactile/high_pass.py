"""Noise behind a high-pass filter: an AR filter before it, and the filter itself.

Every recording has passed a high-pass filter of known gain G (`signals.explored`). An AR filter has
poles alone: of usual order, it cannot fall to zero at rest, and where a texture is felt at
frequencies near the corner, as coarse sandpaper at low speed, its band comes out too broad. So the
AR filter A is fitted to what there was *before* the high-pass filter, and what it makes passes that
filter again: the density of the noise is `s^2 G^2 / |A|^2`.

`1 / |A|^2` is fitted to the periodogram over G^2, as linear prediction fits a spectrum (Makhoul
1975). Below the corner, where next to nothing was recorded, the ordinates are missing, and are
those of the fit itself, again and again until it stays (expectation and maximisation: Dempster,
Laird & Rubin 1977), but no larger than those next to them. That these go together is asperity's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.vibrotactile.ar import Autoregression, levinson
from asperity.vibrotactile.lsf import power_gain

_ROUNDS = 200
"""At most, of filling in what is missing."""
_STAYS = 1e-3
"""By which part the ordinates filled in change when it ends."""
_BINS = 1 << 14
"""Least number of frequencies of a spectrum."""


def sections(corner: float, rate: float) -> Array:
    """Return the second-order sections (2, 6) of the causal filter of gain G; (0, 6) for corner 0.

    A Butterworth filter of order 2, twice: `signals.explored` applies it forwards and backwards.
    """
    if corner == 0.0:
        return np.empty((0, 6))
    from scipy import signal

    one = signal.butter(2, corner, "high", fs=rate, output="sos")
    return np.asarray(np.vstack([one, one]), dtype=np.float64)


def power_response(corner: float, rate: float, frequency: Array) -> Array:
    """Return G^2 at frequencies (n,) [Hz]: 1 for corner 0."""
    z = np.exp(-2j * np.pi * np.asarray(frequency) / rate)
    out = np.ones(np.shape(frequency))
    for row in sections(corner, rate):
        out = out * np.abs(np.polyval(row[2::-1], z) / np.polyval(row[:2:-1], z)) ** 2
    return np.asarray(out)


def passed_gain(coefficients: Array, corner: float, rate: float) -> float:
    """Return the variance behind G of what 1 / A makes of white noise of variance 1.

    `coefficients` are those of A, (p + 1,), the first 1. For corner 0 it is exact; else to a part
    in a thousand if no resonance is narrower than 1 Hz.
    """
    if corner == 0.0:
        return power_gain(coefficients)
    frequency = spectral_grid(rate)
    z = np.exp(-2j * np.pi * frequency / rate)
    under = np.abs(np.polyval(coefficients[::-1], z)) ** 2
    return float(np.fft.irfft(power_response(corner, rate, frequency) / under)[0])


def fit_before(
    segments: Sequence[Array], order: int, corner: float, rate: float
) -> list[Autoregression]:
    """Return the AR models of orders 0 to `order` of what there was before the high-pass filter.

    Parameters
    ----------
    segments : sequence of (n_i,) arrays
        Stretches of one and the same process behind the filter, without its mean. Each longer than
        `order`.
    order : int
    corner, rate : float
        Of the filter, above 0, and of the samples [Hz].
    """
    if not segments or min(s.size for s in segments) <= order:
        raise AsperityError(f"an AR model of order {order} needs stretches longer than that")
    if not any(np.any(s) for s in segments):
        raise AsperityError("the signal is zero throughout: there is no vibration to fit")
    count = sum(s.size for s in segments)
    frequency = spectral_grid(rate, 2 * max(s.size for s in segments))
    bins = frequency.size - 1
    density = np.zeros(frequency.size)
    for one in segments:
        window = np.hanning(one.size)
        density += one.size * np.abs(np.fft.rfft(one * window, 2 * bins)) ** 2 / (window @ window)
    # A quarter of the power is left at the corner; all below it counts as missing.
    first = int(np.searchsorted(frequency, corner))
    density[:first] = 0.0
    density[first:] /= count * power_response(corner, rate, frequency[first:])
    most = float(density[first : max(int(1.5 * first), first + 1)].mean()) + 1e-12 * density.mean()
    known = np.fft.irfft(density)[: order + 1]
    angle = np.pi * np.arange(first) / bins
    cosines = np.cos(np.outer(np.arange(order + 1), angle)) / bins
    cosines[:, 0] *= 0.5
    z, missing = np.exp(-1j * angle), np.full(first, most)
    out = []
    for p in range(order + 1):
        for _ in range(_ROUNDS):
            model = levinson(known[: p + 1] + cosines[: p + 1] @ missing, count)
            filled = model.variance / np.abs(np.polyval(model.coefficients[::-1], z)) ** 2
            filled = np.minimum(filled, most)
            change = np.abs(filled / missing - 1.0).max()
            missing = filled
            if change < _STAYS:
                break
        out.append(model)
    return out


def spectral_grid(rate: float, least: int = 0) -> Array:
    """Return frequencies from 0 to half the rate [Hz], half a Hz apart or less."""
    bins = 1 << int(np.ceil(np.log2(max(rate, 0.5 * least, _BINS))))
    return np.linspace(0.0, 0.5 * rate, bins + 1)
