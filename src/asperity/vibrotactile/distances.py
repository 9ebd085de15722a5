"""How far a synthesised vibration is from a recorded one: spectrum and size."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError

LOWEST = 20.0
"""Frequencies that count begin here [Hz]."""
HIGHEST = 1000.0
"""And end here, or at half the rate [Hz]: hands feel little above."""
_RESOLUTION = 8.0
"""Of the spectra [Hz]."""


class Match(NamedTuple):
    """How well a vibration is reproduced."""

    fit: float
    """Goodness-of-fit criterion of the amplitude spectra: 1 is equal in shape."""
    itakura_saito: float
    """Itakura and Saito's distance of third-octave powers, after `level` is taken out: 0 is equal.
    """
    level: float
    """RMS of the reproduction over that of the recording: 1 is equal."""


def spectrum(signal: Array, rate: float) -> tuple[Array, Array]:
    """Return frequencies [Hz] and the one-sided power spectral density: Welch (1967), Hann."""
    from scipy import signal as filters

    size = min(signal.size, max(round(rate / _RESOLUTION), 16))
    frequency, density = filters.welch(signal, rate, "hann", size, detrend="constant")
    return np.asarray(frequency), np.asarray(density)


def match(recorded: Array, made: Array, rate: float) -> Match:
    r"""Return how well `made` (m,) reproduces `recorded` (n,), both at `rate` [Hz].

    Notes
    -----
    `fit` is the criterion of Hernandez-Andres, Romero & Lee (2001),
    `|sum A B| / sqrt(sum A^2 sum B^2)`, of the amplitude spectra A and B, which Culbertson et al.
    (2013) take for the match of haptic textures. `itakura_saito` is the mean over third-octave
    bands of `r - log r - 1`, r the power recorded over the power made (Itakura & Saito 1968), each
    of total 1; a band with less than -40 dB of the loudest in both does not count. Third octaves,
    because hands tell frequencies apart no better than by some 20 to 30 % (asperity's choice).
    """
    for name, values in (("recorded", recorded), ("synthesised", made)):
        if values.size < 16 or not np.any(values):
            raise AsperityError(f"the {name} vibration is too short or zero: nothing to compare")
    frequency, a = spectrum(recorded, rate)
    other, b = spectrum(made, rate)
    if other.size != frequency.size:
        b = np.interp(frequency, other, b)
    inside = (frequency >= LOWEST) & (frequency <= min(HIGHEST, 0.5 * rate))
    frequency, a, b = frequency[inside], a[inside], b[inside]
    fit = float(np.sqrt(a) @ np.sqrt(b) / np.sqrt(a.sum() * b.sum()))
    first, second = third_octaves(frequency, a), third_octaves(frequency, b)
    level = float(np.sqrt(b.sum() / a.sum()))
    first, second = first / first.sum(), second / second.sum()
    heard = np.maximum(first / first.max(), second / second.max()) > 1e-4
    ratio = np.maximum(first[heard], 1e-12) / np.maximum(second[heard], 1e-12)
    return Match(fit, float(np.mean(ratio - np.log(ratio) - 1.0)), level)


def third_octaves(frequency: Array, density: Array) -> Array:
    """Return the power in third-octave bands from 20 Hz on, of those that hold a frequency."""
    band = np.floor(3.0 * np.log2(np.maximum(frequency, 1e-9) / LOWEST) + 1e-9).astype(np.int64)
    sums = np.bincount(band, weights=density)
    return np.asarray(sums[np.bincount(band) > 0], dtype=np.float64)
