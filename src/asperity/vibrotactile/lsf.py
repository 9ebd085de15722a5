r"""Line spectral frequencies of a filter, and back.

Of a polynomial `A(z) = 1 + a_1 z^-1 + ... + a_p z^-p` the two polynomials

    A(z) + z^-(p + 1) A(1 / z)   and   A(z) - z^-(p + 1) A(1 / z)

have all their zeros on the unit circle, in turn, exactly if the zeros of A lie within it (Itakura
1975; Soong & Juang 1984). The angles of those zeros in (0, pi), counted upwards, are the line
spectral frequencies [rad per sample]; the first belongs to the sum. So a filter 1 / A is stable
exactly if they increase strictly between 0 and pi, and any mean of several such rows is stable
again: that is why models are mixed by them and not by their coefficients (Culbertson et al. 2014).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity._core.kernels import kernel
from asperity.errors import AsperityError


def frequencies_of(coefficients: ArrayLike) -> Array:
    """Return the line spectral frequencies (p,) [rad] of coefficients `1, a_1, ..., a_p` (p + 1,).

    Raises
    ------
    AsperityError
        The filter is not stable, or so nearly unstable that the frequencies cannot be separated.
    """
    a = np.asarray(coefficients, dtype=np.float64)
    order = a.size - 1
    if not is_stable(a):
        raise AsperityError(f"a filter of order {order} is not stable: it has no line spectrum")
    longer, turned = np.append(a, 0.0), np.append(0.0, a[::-1])
    total, difference = longer + turned, longer - turned
    # The zeros at 1 and -1, which every such polynomial has, are divided out.
    if order % 2 == 0:
        total = _divided(total, (1.0, 1.0))
        difference = _divided(difference, (1.0, -1.0))
    else:
        difference = _divided(difference, (1.0, 0.0, -1.0))
    out = np.empty(order)
    out[0::2] = _angles(total)
    out[1::2] = _angles(difference)
    if not are_stable(out):
        raise AsperityError(
            f"a filter of order {order} is too close to instability: two of its line spectral "
            "frequencies coincide; fit a lower order"
        )
    return out


def coefficients_of(frequencies: ArrayLike) -> Array:
    """Return the coefficients (p + 1,), the first 1, of line spectral frequencies (p,) [rad]."""
    lsf = np.ascontiguousarray(frequencies, dtype=np.float64)
    out = np.empty(lsf.size + 1)
    fill_coefficients(lsf, np.empty((2, lsf.size + 3)), out)
    return out


def are_stable(frequencies: ArrayLike) -> bool:
    """Return whether line spectral frequencies (..., p) are those of stable filters."""
    lsf = np.asarray(frequencies, dtype=np.float64)
    ends = np.concatenate(
        [np.zeros((*lsf.shape[:-1], 1)), lsf, np.full((*lsf.shape[:-1], 1), math.pi)], axis=-1
    )
    return bool(np.isfinite(lsf).all() and (np.diff(ends, axis=-1) > 0.0).all())


def reflections_of(coefficients: ArrayLike) -> Array:
    """Return the reflection coefficients (p,) of `1, a_1, ..., a_p`: below 1 in size if stable.

    The step-down recursion. Past the first that is 1 or more the rest are NaN.
    """
    a = np.array(coefficients, dtype=np.float64)
    out = np.full(a.size - 1, np.nan)
    for i in range(a.size - 1, 0, -1):
        k = out[i - 1] = a[i]
        if not abs(k) < 1.0:
            break
        a = (a[:i] - k * a[i:0:-1]) / (1.0 - k * k)
    return out


def is_stable(coefficients: ArrayLike) -> bool:
    """Return whether the filter 1 / A of `1, a_1, ..., a_p` is stable (Schur & Cohn)."""
    return bool(np.all(np.abs(reflections_of(coefficients)) < 1.0))


def power_gain(coefficients: ArrayLike) -> float:
    """Return the variance of what the stable filter 1 / A makes of white noise of variance 1."""
    return float(1.0 / np.prod(1.0 - reflections_of(coefficients) ** 2))


def _divided(polynomial: Array, by: tuple[float, ...]) -> Array:
    return np.asarray(np.polydiv(polynomial, by)[0], dtype=np.float64)


def _angles(polynomial: Array) -> Array:
    """Return the angles in (0, pi) of the zeros of a symmetric polynomial, upwards."""
    angles = np.abs(np.angle(np.roots(polynomial)))
    # They come in conjugate pairs: of each, one.
    return np.sort(angles)[::2]


@kernel
def fill_coefficients(lsf, room, out):
    """Fill `out` (p + 1,) with the coefficients of `lsf` (p,); `room` is (2, p + 3)."""
    order = lsf.size
    for part in range(2):
        line = room[part]
        for i in range(order + 3):
            line[i] = 0.0
        line[0] = 1.0
        size = 0
        for i in range(part, order, 2):
            middle = -2.0 * math.cos(lsf[i])
            for j in range(size + 2, 1, -1):
                line[j] += middle * line[j - 1] + line[j - 2]
            line[1] += middle * line[0]
            size += 2
        # The zeros that were divided out: at -1 of the sum, at 1 of the difference, or at both.
        if order % 2 == 0:
            sign = 1.0 if part == 0 else -1.0
            for j in range(size + 1, 0, -1):
                line[j] += sign * line[j - 1]
        elif part == 1:
            for j in range(size + 2, 1, -1):
                line[j] -= line[j - 2]
    for i in range(order + 1):
        out[i] = 0.5 * (room[0, i] + room[1, i])
