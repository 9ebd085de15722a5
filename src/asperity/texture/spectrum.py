"""Fourier or cosine waves of a height map: the wavelengths present, and their attenuation."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array

UNSEEN = 1e-3
"""Share of the slope's variance in waves shorter than `Spectrum.shortest`, at most."""


class Spectrum(NamedTuple):
    """Waves of a map, including its mean; each counts `weights` times."""

    waves: NDArray[Any]
    wavenumbers: Array
    weights: Array
    shape: tuple[int, ...]
    wraps: bool

    @classmethod
    def of(cls, samples: Array, pixel_size: tuple[float, float], *, wraps: bool) -> Spectrum:
        """Return the waves of `samples` [m], repeated (`wraps`) or mirrored at the borders."""
        from scipy import fft  # slow to import

        (rows, columns), (pu, pv) = samples.shape, pixel_size
        waves: NDArray[Any]
        if wraps:
            along_u = np.fft.rfftfreq(columns, pu).astype(np.float64)
            along_v = np.fft.fftfreq(rows, pv).astype(np.float64)
            waves = fft.rfft2(samples)
            weights = np.full(along_u.size, 2.0)
            weights[0] = 1.0
            if columns % 2 == 0:
                weights[-1] = 1.0
        else:  # the cosine transform: the Fourier transform of the mirrored map
            along_u = np.arange(columns) / (2.0 * columns * pu)
            along_v = np.arange(rows) / (2.0 * rows * pv)
            waves = fft.dctn(samples, norm="ortho")
            weights = np.ones(columns)
        wavenumbers = np.hypot(along_v[:, None], along_u[None, :])
        return cls(waves, wavenumbers, weights, samples.shape, wraps)

    @property
    def slope_power(self) -> Array:
        """Contribution of each wave to the variance of the slope, up to a factor."""
        return np.abs(self.waves) ** 2 * self.wavenumbers**2 * self.weights

    def heights(self, factors: Array) -> Array:
        """Return the map with its waves multiplied by `factors`."""
        from scipy import fft

        if self.wraps:
            return fft.irfft2(self.waves * factors, s=self.shape)
        return fft.idctn(self.waves * factors, norm="ortho")

    def shortest(self) -> float:
        """Return the wavelength [m] below which lies at most `UNSEEN` of the slope's variance."""
        power, k = self.slope_power.ravel(), self.wavenumbers.ravel()
        allowed = UNSEEN * power.sum()
        # Sorting all waves of a large map is slow: find the wavenumber band first, then sort that.
        rings = (k * (1023.0 / k.max())).astype(np.int64)
        beyond = np.cumsum(np.bincount(rings, power, 1025)[::-1])[::-1]
        ring = int(np.flatnonzero(beyond > allowed)[-1])
        chosen = np.flatnonzero(rings == ring)
        chosen = chosen[np.argsort(-k[chosen])]
        tail = beyond[ring + 1] + np.cumsum(power[chosen])
        return 1.0 / float(k[chosen[int(np.flatnonzero(tail > allowed)[0])]])
