"""Spectra in third octaves: few enough numbers to be read, and about as fine as the skin's."""

from __future__ import annotations

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError

_NOMINAL = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)
"""Names of the bands of a decade."""


def third_octaves(frequencies: Array, amplitudes: Array) -> tuple[Array, Array]:
    """Return the RMS of a signal in each third octave.

    Bands have their middle at 10^(k/10) Hz and their edges at 10^((k -+ 1/2)/10) Hz (IEC 61260-1,
    base ten). The power of a line is spread evenly over its share of the spectrum, so that bands
    narrower than the distance between lines can be left out: the lowest band is the first that is
    at least as wide.

    Parameters
    ----------
    frequencies : (n,) array
        Of the lines [Hz], at equal distances, without zero.
    amplitudes : (n,) array
        Of the sinusoids, in the signal's unit.

    Returns
    -------
    middles : (m,) array
        Middle of each band [Hz].
    rms : (m,) array
        In the signal's unit.

    Raises
    ------
    AsperityError
        Fewer than two lines.
    """
    if len(frequencies) < 2:
        raise AsperityError(f"a spectrum has two lines or more, got {len(frequencies)}")
    step = float(frequencies[1] - frequencies[0])
    width = 10.0**0.05 - 10.0**-0.05
    first = int(np.ceil(10.0 * np.log10(max(step / width, float(frequencies[0])))))
    last = int(np.floor(10.0 * np.log10(float(frequencies[-1]) + 0.5 * step) - 0.5))
    bands = np.arange(first, max(last, first - 1) + 1)
    edges = 10.0 ** (0.1 * (np.arange(first, first + len(bands) + 1) - 0.5))
    power = np.concatenate([[0.0], np.cumsum(0.5 * np.asarray(amplitudes, np.float64) ** 2)])
    borders = float(frequencies[0]) + step * (np.arange(len(frequencies) + 1) - 0.5)
    inside = np.diff(np.interp(edges, borders, power))
    middles = np.asarray(10.0 ** (0.1 * bands), np.float64)
    return middles, np.sqrt(np.maximum(inside, 0.0))


def nominal(middle: float) -> str:
    """Return the name of the band around a frequency [Hz]: 31.6 Hz is in that of 31.5."""
    place = round(10.0 * float(np.log10(middle)))
    decade, step = divmod(place, 10)
    return f"{_NOMINAL[step] * 10.0**decade:g}"
