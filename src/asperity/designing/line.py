"""The offset surface along one stroke as a periodic cubic spline, and the adjoint of its slopes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array, Indices


def spline_gain(turns: NDArray[Any]) -> Array:
    """Return the transfer function of B-spline coefficients to heights.

    It is symmetric, and so its own adjoint.

    Parameters
    ----------
    turns : array
        Waves, in turns a sample.
    """
    return np.asarray((2.0 + np.cos(2.0 * np.pi * turns)) / 3.0)


def spline_weights(t: Array) -> Array:
    """Return the weights of four coefficients (4, n) at places `t`, 0 to 1, in a cell."""
    r = 1.0 - t
    return np.stack([
        r**3 / 6.0, 2.0 / 3.0 - t**2 + 0.5 * t**3, 2.0 / 3.0 - r**2 + 0.5 * r**3, t**3 / 6.0,
    ])  # fmt: skip


def _slope_weights(t: Array) -> Array:
    r = 1.0 - t
    return np.stack([-0.5 * r * r, 1.5 * t * t - 2.0 * t, 2.0 * r - 1.5 * r * r, 0.5 * t * t])


def _curvature_weights(t: Array) -> Array:
    return np.stack([1.0 - t, 3.0 * t - 2.0, 1.0 - 3.0 * t, t])


@dataclass(frozen=True, eq=False)
class OffsetLine:
    """Heights of a probe's lowest point along a stroke that repeats.

    Parameters
    ----------
    heights : (n,) array
        Offset heights [m] at `i * period / n`.
    period : float
        [m], above 0.
    """

    heights: Array
    period: float

    @property
    def step(self) -> float:
        """Distance between samples [m]."""
        return self.period / self.heights.size

    @cached_property
    def _coefficients(self) -> Array:
        n = self.heights.size
        return np.asarray(
            np.fft.irfft(np.fft.rfft(self.heights) / spline_gain(np.fft.rfftfreq(n)), n)
        )

    def _cells(self, places: Array) -> tuple[Indices, Array]:
        """Return the four coefficients' indices (4, m) of each place, and the place in its cell."""
        scaled = places / self.step
        first = np.floor(scaled)
        around = first.astype(np.int64)[None, :] + np.arange(-1, 3)[:, None]
        return around % self.heights.size, scaled - first

    def slopes(self, places: Array) -> tuple[Array, Array]:
        """Return slope [1] and curvature [1/m] at places (m,) [m]."""
        around, t = self._cells(places)
        near = self._coefficients[around]
        slope = np.sum(_slope_weights(t) * near, axis=0) / self.step
        return slope, np.sum(_curvature_weights(t) * near, axis=0) / self.step**2

    def slopes_adjoint(self, places: Array, weights: Array) -> Array:
        """Return the gradient (n,) of `sum(weights * slope(places))` by the heights."""
        around, t = self._cells(places)
        n = self.heights.size
        parts = _slope_weights(t) * (weights / self.step)
        gradient = np.bincount(around.ravel(), parts.ravel(), n)
        return np.asarray(np.fft.irfft(np.fft.rfft(gradient) / spline_gain(np.fft.rfftfreq(n)), n))
