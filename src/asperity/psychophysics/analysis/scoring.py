"""Damped Fisher scoring of psychometric functions, for many sessions or samples at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array

if TYPE_CHECKING:
    from asperity.psychophysics.analysis.psychometric_search import LikelihoodSearch

_ROUNDS = 60
_CLOSE = 1e-8
"""Gain of the log likelihood at which scoring ends."""
_PARTS = (1.0, 0.5, 0.2)
"""Of a step, of which the best is gone."""
_STEP = 1e-6
"""Of differences, as a part of the range of a parameter."""


class Climb:
    """Damped Fisher scoring of many maxima at once, within bounds.

    Parameters
    ----------
    search : LikelihoodSearch
    sessions : tuple of array
        Intensities and trials (n, m), lowest and highest parameters (n, 3); or one row for all.
    hits : (n, m) array
    free : (k,) array of int
        The parameters that change.
    held : (str, (n,) array) or None
    """

    def __init__(
        self, search: LikelihoodSearch, sessions: tuple[Array, ...], hits: Array,
        free: NDArray[np.intp], held: tuple[str, Array] | None,
    ) -> None:  # fmt: skip
        self._search, self._hits, self._free, self._held = search, hits, free, held
        rows = np.broadcast_to
        self._x = rows(sessions[0], hits.shape)
        self._count = rows(sessions[1], hits.shape)
        self._low = rows(sessions[2], (len(hits), 3))
        self._high = rows(sessions[3], (len(hits), 3))

    def from_points(self, at: Array) -> Array:
        """Return the points (n, 3) to which scoring from points leads."""
        at, damping = np.array(at), np.full(len(at), 1e-3)
        live, parts = np.arange(len(at)), np.array(_PARTS)[:, None]
        likely = self._likely(at[:, None], live)[:, 0]
        for _ in range(_ROUNDS):
            step = self._step(at[live], live, damping[live])
            # Where the function fits badly, whole steps go too far.
            tried = at[live, None] + parts * step[:, None]
            tried = np.clip(tried, self._low[live, None], self._high[live, None])
            tried = self._on(tried, live)
            heights = self._likely(tried, live)
            best = np.arange(len(live)), np.argmax(heights, axis=1)
            moved, now = tried[best], heights[best]
            better = now > likely[live]
            gain = np.where(better, now, 0.0) - np.where(better, likely[live], 0.0)
            at[live[better]], likely[live[better]] = moved[better], now[better]
            damping[live] = np.where(better, damping[live] / 6.0, damping[live] * 6.0)
            # Over once a long step gains nothing, or no step however short does.
            over = (better & (gain < _CLOSE) & (damping[live] < 1e-2)) | (damping[live] > 1e9)
            live = live[~over]
            if not live.size:
                break
        return at

    def _on(self, points: Array, live: NDArray[np.intp]) -> Array:
        """Return points (n, k, 3) with the held quantity in place."""
        if self._held is None:
            return points
        quantity, values = self._held
        return self._search.with_held(points, quantity, values[live])

    def _psi(self, points: Array, live: NDArray[np.intp]) -> Array:
        """Return the probabilities (n, k, m) of points (n, k, 3)."""
        return self._search.psi_at(self._x[live, None], plain(points))

    def _likely(self, points: Array, live: NDArray[np.intp]) -> Array:
        """Return the log likelihood (n, k) of points (n, k, 3); -inf beyond the bounds."""
        p, hits, count = self._psi(points, live), self._hits[live], self._count[live]
        out = hits[:, None] * np.log(p) + (count - hits)[:, None] * np.log1p(-p)
        inside = self._search.inside(points, self._low[live], self._high[live])
        return np.where(inside, out.sum(axis=-1), -np.inf)

    def _step(self, at: Array, live: NDArray[np.intp], damping: Array) -> Array:
        """Return the damped scoring steps (n, 3)."""
        free, low, high = self._free, self._low[live], self._high[live]
        # Away from the bound, so that both points are within.
        apart = _STEP * (high - low)[:, free]
        apart = np.where(at[:, free] + apart > high[:, free], -apart, apart)
        near = np.repeat(at[:, None], 1 + len(free), axis=1)
        near[:, 1 + np.arange(len(free)), free] += apart
        psi = self._psi(self._on(near, live), live)
        p = psi[:, 0]
        slope = (psi[:, 1:] - psi[:, :1]) / apart[:, :, None]  # (n, k, m)
        weight = 1.0 / (p * (1.0 - p))
        uphill = np.einsum("nkm,nm->nk", slope, (self._hits[live] - self._count[live] * p) * weight)
        curved = np.einsum("nkm,nlm,nm->nkl", slope, slope, self._count[live] * weight)
        # Parameters at a bound beyond which it rises stay there.
        here, small = at[:, free], 1e-12
        stuck = (here <= low[:, free] + small) & (uphill < 0.0)
        stuck |= (here >= high[:, free] - small) & (uphill > 0.0)
        uphill[stuck] = 0.0
        curved *= ~stuck[:, :, None] & ~stuck[:, None, :]
        size = np.einsum("nkk->nk", curved)
        size += damping[:, None] * size + np.where(size > 1e-9, 1e-9, 1.0)
        out = np.zeros_like(at)
        out[:, free] = np.linalg.solve(curved, uphill[:, :, None])[:, :, 0]
        return out


def plain(points: Array) -> Array:
    """Return points with the width in place of its logarithm."""
    out = np.array(points)
    out[..., 1] = np.exp(out[..., 1])
    return out
