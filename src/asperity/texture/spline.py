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
from numpy.typing import NDArray

from asperity._core.kernels import kernel

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

BORDERS = ("wrap", "mirror")
_POLE = math.sqrt(3.0) - 2.0
_REACH = 40
"""Reach of a height's influence on the coefficients [samples]: `_POLE`**40 is 1e-23."""
_PAD = {"wrap": "wrap", "mirror": "symmetric"}


def spline_coefficients(
    heights: NDArray[np.float64], border: str, margin: int = 0
) -> NDArray[np.float64]:
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


def spline_along(coefficients: NDArray[np.float64]) -> BSpline:
    """Return the spline of coefficients without margin along their first axis [samples, 0 to n]."""
    from scipy.interpolate import BSpline  # slow to import

    return BSpline(np.arange(len(coefficients) + 4.0) - 3.5, coefficients, 3)


def _filter(values: NDArray[np.float64]) -> None:
    """Convert heights to coefficients along the first axis, in place, except `_REACH` at its ends.

    The filter of Unser, Aldroubi & Eden (1993), forwards and backwards, row by row.
    """
    values *= 6.0
    for i in range(1, len(values)):
        values[i] += _POLE * values[i - 1]
    values[-1] *= -_POLE  # as if all beyond were zero: `_REACH` samples on, the error is negligible
    for i in range(len(values) - 2, -1, -1):
        values[i] = _POLE * (values[i + 1] - values[i])


@kernel
def evaluate_1d(coefficients, cell, t):
    """Return value, slope and curvature of the spline at `t` in `cell`, per sample."""
    s = 1.0 - t
    c0, c1 = coefficients[cell], coefficients[cell + 1]
    c2, c3 = coefficients[cell + 2], coefficients[cell + 3]
    value = (
        s * s * s * c0
        + (4.0 - 6.0 * t * t + 3.0 * t * t * t) * c1
        + (4.0 - 6.0 * s * s + 3.0 * s * s * s) * c2
        + t * t * t * c3
    ) / 6.0
    slope = (
        -0.5 * s * s * c0
        + (1.5 * t * t - 2.0 * t) * c1
        + (2.0 * s - 1.5 * s * s) * c2
        + 0.5 * t * t * c3
    )
    curvature = s * c0 + (3.0 * t - 2.0) * c1 + (3.0 * s - 2.0) * c2 + t * c3
    return value, slope, curvature


@kernel
def evaluate_2d(coefficients, row, column, tv, tu):
    """Return value and all derivatives up to the second of the spline, per sample.

    Returns
    -------
    tuple of 6 floats
        `s, s_u, s_v, s_uu, s_uv, s_vv` at `(tv, tu)` in cell `(row, column)`.
    """
    ru = 1.0 - tu
    wu0, wu1 = ru * ru * ru / 6.0, (4.0 - 6.0 * tu * tu + 3.0 * tu * tu * tu) / 6.0
    wu2, wu3 = (4.0 - 6.0 * ru * ru + 3.0 * ru * ru * ru) / 6.0, tu * tu * tu / 6.0
    du0, du1 = -0.5 * ru * ru, 1.5 * tu * tu - 2.0 * tu
    du2, du3 = 2.0 * ru - 1.5 * ru * ru, 0.5 * tu * tu
    cu0, cu1, cu2, cu3 = ru, 3.0 * tu - 2.0, 3.0 * ru - 2.0, tu
    rv = 1.0 - tv
    wv = (
        rv * rv * rv / 6.0,
        (4.0 - 6.0 * tv * tv + 3.0 * tv * tv * tv) / 6.0,
        (4.0 - 6.0 * rv * rv + 3.0 * rv * rv * rv) / 6.0,
        tv * tv * tv / 6.0,
    )
    dv = (-0.5 * rv * rv, 1.5 * tv * tv - 2.0 * tv, 2.0 * rv - 1.5 * rv * rv, 0.5 * tv * tv)
    cv = (rv, 3.0 * tv - 2.0, 3.0 * rv - 2.0, tv)
    s = s_u = s_v = s_uu = s_uv = s_vv = 0.0
    for a in range(4):
        # Indexed singly: a row sliced as an array would be reference-counted each time.
        c0, c1 = coefficients[row + a, column], coefficients[row + a, column + 1]
        c2, c3 = coefficients[row + a, column + 2], coefficients[row + a, column + 3]
        value = wu0 * c0 + wu1 * c1 + wu2 * c2 + wu3 * c3
        slope = du0 * c0 + du1 * c1 + du2 * c2 + du3 * c3
        s += wv[a] * value
        s_v += dv[a] * value
        s_vv += cv[a] * value
        s_u += wv[a] * slope
        s_uv += dv[a] * slope
        s_uu += wv[a] * (cu0 * c0 + cu1 * c1 + cu2 * c2 + cu3 * c3)
    return s, s_u, s_v, s_uu, s_uv, s_vv
