"""Peaks of roughness over spacing: the literature's quadratic fit, and refinement of the peak."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

METRIC_ERROR = 1e-4
"""Relative numerical error of the metrics that a peak's uncertainty allows for."""
_FARTHEST = 100.0
"""Largest distance of a fitted peak from 1 mm [decades]."""


class QuadraticFit(NamedTuple):
    """`log10 y = c0 + c1 x + c2 x^2` with `x = log10(spacing in mm)`."""

    coefficients: NDArray[np.float64]
    """c0, c1, c2."""
    r_squared: float
    peak_spacing: float
    """Spacing of the parabola's peak [m]; NaN if it has none."""
    peak_error: float
    """Standard error of `peak_spacing` [m], from the residuals."""

    def __call__(self, spacing: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the fitted values at `spacing` [m]."""
        x = np.log10(np.asarray(spacing) * 1e3)
        c0, c1, c2 = self.coefficients
        return 10.0 ** (c0 + c1 * x + c2 * x * x)


def fit_quadratic(spacing: NDArray[np.float64], values: NDArray[np.float64]) -> QuadraticFit:
    """Fit a quadratic in log-log, as Klatzky & Lederman (1999) do for roughness.

    Parameters
    ----------
    spacing : (n,) array
        [m], at least 4.
    values : (n,) array
        Of the metric, above 0.
    """
    x, y = np.log10(spacing * 1e3), np.log10(values)
    design = np.stack([np.ones_like(x), x, x * x], axis=1)
    c, *_ = np.linalg.lstsq(design, y, rcond=None)
    residual = y - design @ c
    total = float(np.sum((y - np.mean(y)) ** 2))
    r_squared = 1.0 - float(np.sum(residual**2)) / total if total > 0.0 else 0.0
    # A straight line has no peak, whichever way rounding bends it.
    if c[2] >= 0.0 or abs(c[1]) > -2.0 * _FARTHEST * c[2]:
        return QuadraticFit(c, r_squared, float("nan"), float("nan"))
    covariance = np.linalg.inv(design.T @ design) * np.sum(residual**2) / max(x.size - 3, 1)
    top = -0.5 * c[1] / c[2]
    gradient = np.array([0.0, -0.5 / c[2], 0.5 * c[1] / c[2] ** 2])
    spread = float(np.sqrt(gradient @ covariance @ gradient))
    peak = 10.0**top * 1e-3
    return QuadraticFit(c, r_squared, peak, peak * np.log(10.0) * spread)


class Peak(NamedTuple):
    """The largest value of a metric over spacing."""

    spacing: float
    """[m]"""
    value: float
    uncertainty: float
    """Half the width over which the metric is within its numerical error of the peak [m]."""
    inside: bool
    """False if the metric is largest at an end of the range: then there is no peak in it."""


def refine_peak(
    metric: Callable[[float], float],
    spacing: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    rounds: int = 5,
) -> Peak:
    """Return the peak of `metric` near the largest of `values`, by local refinement.

    Each round puts four new points into the bracket around the best one (equal steps in log
    spacing) and shrinks the bracket to that point's neighbours.
    """
    xs, ys = list(np.log(spacing)), list(values)
    best = int(np.argmax(ys))
    if best in (0, len(xs) - 1):
        return Peak(float(spacing[best]), float(values[best]), float("nan"), False)
    low, high = xs[best - 1], xs[best + 1]
    for _ in range(rounds):
        for x in np.linspace(low, high, 6)[1:-1]:
            if min(abs(x - known) for known in xs) > 1e-9:
                xs.append(float(x))
                ys.append(metric(float(np.exp(x))))
        order = np.argsort(xs)
        xs, ys = [xs[i] for i in order], [ys[i] for i in order]
        best = int(np.argmax(ys))
        low, high = xs[max(best - 1, 0)], xs[min(best + 1, len(xs) - 1)]
    top = ys[best]
    first = last = best
    while first > 0 and ys[first - 1] >= (1.0 - METRIC_ERROR) * top:
        first -= 1
    while last < len(ys) - 1 and ys[last + 1] >= (1.0 - METRIC_ERROR) * top:
        last += 1
    width = xs[min(last + 1, len(xs) - 1)] - xs[max(first - 1, 0)]
    place = float(np.exp(xs[best]))
    return Peak(place, float(top), 0.5 * place * width, True)
