r"""Cubic B-spline interpolation of sampled heights, in one and two dimensions.

Samples are at `(i + 1/2) * pixel_size`. Between them the surface is the interpolating cubic
B-spline: twice continuously differentiable, so that the slope at a contact has no ripple at the
texel frequency. In units of samples,

    s(t) = sum_{a=0..3} B_a(t) c[i + a]

with `t` the position inside cell `i`, the interval from sample `i - 1` to sample `i`. The
coefficients are padded, so that a kernel can index cell `i` with `c[i .. i+3]` without testing for
a border.

Beyond its ends a height map either *wraps* (period n) or *mirrors* (period 2 n, half-sample
symmetric); inside, a clamped map equals the mirrored one. The prefilter is exact at both ends.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from asperity._core.arrays import Array
from asperity._core.kernels import kernel, small_kernel

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

BORDERS = ("wrap", "mirror")
_SIXTH, _TWO_THIRDS = 1.0 / 6.0, 2.0 / 3.0
_POLE = math.sqrt(3.0) - 2.0
_REACH = 40
"""Reach of a height's influence on the coefficients [samples]: `_POLE`**40 is 1e-23."""
_PAD = {"wrap": "wrap", "mirror": "symmetric"}


def spline_coefficients(heights: Array, border: str, margin: int = 0) -> Array:
    """Return the B-spline coefficients of `heights`, padded on every side.

    Parameters
    ----------
    heights : (n,) or (nv, nu) array
        Heights at the centres of the samples.
    border : {"wrap", "mirror"}
        Continuation of the surface beyond its ends.
    margin : int
        Number of cells beyond each end, at most one period.

    Returns
    -------
    (n + 4 + 2 margin,) or (nv + 4 + 2 margin, nu + 4 + 2 margin) array
        Cell `i`, `-margin <= i <= n + margin`, uses entries `i + margin .. i + margin + 3`.
    """
    # The padding repeats the map itself, so both ends are exact.
    values = np.asarray(heights, dtype=np.float64)
    values = np.pad(values, _REACH, mode=_PAD[border])  # type: ignore[call-overload]
    for _ in range(values.ndim):
        values = np.ascontiguousarray(values.T)  # the axes alternate; both are in order at the end
        _filter(values)
    inside = tuple(slice(_REACH, -_REACH) for _ in range(values.ndim))
    return np.pad(values[inside], margin + 2, mode=_PAD[border])  # type: ignore[call-overload]


def spline_along(coefficients: Array) -> BSpline:
    """Return the spline of coefficients without margin along their first axis [samples, 0 to n]."""
    from scipy.interpolate import BSpline  # slow to import

    return BSpline(np.arange(len(coefficients) + 4.0) - 3.5, coefficients, 3)


def _filter(values: Array) -> None:
    """Convert heights to coefficients along the first axis, in place, except `_REACH` at its ends.

    The filter of Unser, Aldroubi & Eden (1993), forwards and backwards, row by row.
    """
    values *= 6.0
    for i in range(1, len(values)):
        values[i] += _POLE * values[i - 1]
    values[-1] *= -_POLE  # as if all beyond were zero: `_REACH` samples on, the error is negligible
    for i in range(len(values) - 2, -1, -1):
        values[i] = _POLE * (values[i + 1] - values[i])


@small_kernel
def weights(t):
    """Return the cubic B-spline weights of four coefficients at t, 0 to 1, in a cell."""
    r = 1.0 - t
    t2, r2 = t * t, r * r
    return (
        r2 * r * _SIXTH, _TWO_THIRDS - t2 + 0.5 * t2 * t, _TWO_THIRDS - r2 + 0.5 * r2 * r,
        t2 * t * _SIXTH,
    )  # fmt: skip


@small_kernel
def slope_weights(t):
    """Return the derivatives of `weights` with respect to t."""
    r = 1.0 - t
    return -0.5 * r * r, 1.5 * t * t - 2.0 * t, 2.0 * r - 1.5 * r * r, 0.5 * t * t


@small_kernel
def curvature_weights(t):
    """Return the second derivatives of `weights` with respect to t."""
    return 1.0 - t, 3.0 * t - 2.0, 1.0 - 3.0 * t, t


@kernel
def evaluate_1d(coefficients, cell, t):
    """Return value, slope and curvature of the spline at `t` in `cell`, per sample."""
    w, dw, ddw = weights(t), slope_weights(t), curvature_weights(t)
    value = slope = curvature = 0.0
    for i in range(4):
        c = coefficients[cell + i]
        value += w[i] * c
        slope += dw[i] * c
        curvature += ddw[i] * c
    return value, slope, curvature


@kernel
def evaluate_2d(coefficients, row, column, tv, tu):
    """Return value and all derivatives up to the second of the spline, per sample.

    Returns
    -------
    tuple of 6 floats
        `s, s_u, s_v, s_uu, s_uv, s_vv` at `(tv, tu)` in cell `(row, column)`.
    """
    a0, a1, a2, a3 = weights(tu)
    b0, b1, b2, b3 = slope_weights(tu)
    c0, c1, c2, c3 = curvature_weights(tu)
    w, dw, ddw = weights(tv), slope_weights(tv), curvature_weights(tv)
    s = s_u = s_v = s_uu = s_uv = s_vv = 0.0
    for i in range(4):
        # Indexed singly: a row sliced as an array would be reference-counted each time.
        k0, k1 = coefficients[row + i, column], coefficients[row + i, column + 1]
        k2, k3 = coefficients[row + i, column + 2], coefficients[row + i, column + 3]
        value = a0 * k0 + a1 * k1 + a2 * k2 + a3 * k3
        slope = b0 * k0 + b1 * k1 + b2 * k2 + b3 * k3
        s += w[i] * value
        s_v += dw[i] * value
        s_vv += ddw[i] * value
        s_u += w[i] * slope
        s_uv += dw[i] * slope
        s_uu += w[i] * (c0 * k0 + c1 * k1 + c2 * k2 + c3 * k3)
    return s, s_u, s_v, s_uu, s_uv, s_vv
