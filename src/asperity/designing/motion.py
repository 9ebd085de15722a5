r"""The periodic motion of the dragged hand as one system of equations, and its adjoint.

`dragged_hand.hand.drag` integrates Eq. 7 of Otaduy & Lin (2004) in time. For gradients the same
motion is written as what it is, a periodic solution: with y = u - v t at N equal steps of one
period,

    m D2 y + b D1 y + k y + F_n H'(v t + y) = 0,

central differences D1, D2 that close round the period. Newton's method solves it; its matrix is
tridiagonal but for two corners. With the gradient g of a metric by y, the adjoint `J^T a = g` is
one more such solution, and the gradient by the offset heights is `-F_n a . dH'/dH`.

A periodic solution need not be the one to which a hand settles; what comes out of a design is
therefore judged by `drag`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity.designing.line import OffsetLine
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError

_RATE = 6000.0
"""Least number of samples a second: thirty to a wave of 200 Hz."""
_SAMPLES_A_STEP = 4
_NEWTON_STEPS = 60
_RESIDUAL = 1e-11
"""Largest residual at which the motion counts as found, relative to the normal force."""
_STAGES = ((1.0,), (0.25, 0.5, 0.75, 1.0), tuple(np.linspace(0.05, 1.0, 20)))
"""Shares of the normal force through which the solution is followed, if shorter ways fail."""


class Lag(NamedTuple):
    """A periodic motion: `values` (n,) of u - v t [m], `step` [s] apart."""

    values: Array
    step: float
    force: float
    """Normal force [N]."""
    hand: Hand
    speed: float

    @property
    def places(self) -> Array:
        """Where the hand is, u [m]."""
        return self.values + self.speed * self.step * np.arange(self.values.size)


def _bands(lag: Lag) -> tuple[float, float, float]:
    """Return the constant entries below, on and above the diagonal."""
    hand, step = lag.hand, lag.step
    inertia, friction = hand.mass / step**2, 0.5 * hand.damping / step
    return inertia - friction, hand.stiffness - 2.0 * inertia, inertia + friction


def _solve_cyclic(below: float, diagonal: Array, above: float, right: Array) -> Array:
    """Solve a tridiagonal system whose first and last unknown are neighbours."""
    from scipy.linalg import solve_banded

    n = diagonal.size
    # Sherman & Morrison: the corners are a product of two vectors.
    gamma = -diagonal[0]
    bands = np.empty((3, n))
    bands[0], bands[1], bands[2] = above, diagonal, below
    bands[1, 0] -= gamma
    bands[1, -1] -= above * below / gamma
    both = np.zeros((n, 2))
    both[:, 0] = right
    both[0, 1], both[-1, 1] = gamma, above
    x, q = solve_banded((1, 1), bands, both, overwrite_ab=True, check_finite=False).T
    share = below / gamma
    return np.asarray(x - q * (x[0] + share * x[-1]) / (1.0 + q[0] + share * q[-1]))


def _residual(lag: Lag, line: OffsetLine, share: float) -> tuple[Array, Array]:
    """Return the residual [N] and the diagonal of its Jacobian."""
    below, middle, above = _bands(lag)
    y = lag.values
    slope, curvature = line.slopes(lag.places)
    force = share * lag.force
    out = below * np.roll(y, 1) + middle * y + above * np.roll(y, -1) + force * slope
    return out, middle + force * curvature


def _newton(lag: Lag, line: OffsetLine, share: float) -> Lag | None:
    """Return the solution for a share of the normal force, or None."""
    below, _, above = _bands(lag)
    residual, diagonal = _residual(lag, line, share)
    size = float(np.max(np.abs(residual)))
    for _ in range(_NEWTON_STEPS):
        if size <= _RESIDUAL * lag.force:
            return lag
        change = _solve_cyclic(below, diagonal, above, -residual)
        length = 1.0
        while True:
            trial = lag._replace(values=lag.values + length * change)
            after, diagonal_after = _residual(trial, line, share)
            largest = float(np.max(np.abs(after)))
            if largest < size * (1.0 - 0.1 * length):
                break
            length *= 0.5
            if length < 1e-3:
                # What rounding leaves of m / step^2 is a solution too.
                return lag if size <= 1e3 * _RESIDUAL * lag.force else None
        lag, residual, diagonal, size = trial, after, diagonal_after, largest
    return None


def periodic_lag(
    line: OffsetLine, hand: Hand, force: float, speed: float, start: Array | None = None
) -> Lag:
    """Return the periodic motion over a line.

    Parameters
    ----------
    line : OffsetLine
    hand : Hand
    force : float
        Normal force [N], above 0.
    speed : float
        [m/s], above 0.
    start : (n,) array, optional
        Values of a motion over a similar line, from which the search begins.

    Raises
    ------
    AsperityError
        No periodic motion was found, as for a hand that rests in a notch.
    """
    seconds = line.period / speed
    # Even, so that the last wave has a pair of samples; a power of two is fastest.
    count = 1 << int(np.ceil(np.log2(max(_SAMPLES_A_STEP * line.heights.size, seconds * _RATE))))
    rest = Lag(np.zeros(count), seconds / count, force, hand, speed)
    if start is not None and start.size == count:
        found = _newton(rest._replace(values=start), line, 1.0)
        if found is not None:
            return found
    for stages in _STAGES:
        lag: Lag | None = rest
        for share in stages:
            lag = None if lag is None else _newton(lag, line, share)
        if lag is not None:
            return lag
    raise AsperityError(
        f"the hand has no periodic motion at {speed * 1e3:.3g} mm/s under {force:g} N: "
        "it stays in a notch; give less force, more speed or a stiffer hand"
    )


def heights_gradient(lag: Lag, line: OffsetLine, by_lag: Array) -> Array:
    """Return the gradient of a metric by the offset heights (n,), from that by the lag (N,)."""
    below, _, above = _bands(lag)
    _, diagonal = _residual(lag, line, 1.0)
    adjoint = _solve_cyclic(above, diagonal, below, by_lag)  # the transposed system
    return line.slopes_adjoint(lag.places, -lag.force * adjoint)
