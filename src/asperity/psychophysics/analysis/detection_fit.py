r"""The level of d' = 1 of yes/no with several levels.

    P(yes | x) = Phi((x / threshold)^exponent - place),  P(yes | no signal) = Phi(-place)

that is d' as a power function of the distance x from the standard, of an observer of equal variance
with one criterion, `place` standard deviations above the mean without signal (Macmillan & Creelman
2005, Detection Theory, 2nd ed.). By maximum likelihood, with an interval by profile likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import log_ndtr
from scipy.stats import chi2

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.psychophysics.analysis.psychometric_search import profile_end

_REACH = float(np.log(20.0))
"""How far beyond the levels the threshold is looked for, as a logarithm."""
_EXPONENTS = (float(np.log(0.2)), float(np.log(8.0)))
_PLACES = (-6.0, 6.0)
_GRID = (33, 13, 25)
"""Values of log threshold, log exponent and place from which the search begins."""
_ROUNDS, _SHRINK = 26, 0.72
_STEPS = 25
"""Steps from the best threshold to the end of the search."""


@dataclass(frozen=True)
class DetectionFit:
    """The fitted model; distances are from the standard."""

    threshold: float
    """Distance of d' = 1."""
    low: float
    high: float
    exponent: float
    place: float
    """Of the criterion, above the mean without signal [SD]."""
    at_bound: bool
    """Whether the threshold or the exponent lies at an end of the search: it is not determined."""


def fit_detection(
    distances: ArrayLike, yes: ArrayLike, trials: ArrayLike, without: tuple[int, int],
    confidence: float = 0.95,
) -> DetectionFit:  # fmt: skip
    """Fit d' as a power function of the distance from the standard.

    Parameters
    ----------
    distances : (n,) array
        Of each level of the signal, above 0, different; two or more.
    yes, trials : (n,) array of int
        Answers "yes" and trials at each.
    without : (int, int)
        Answers "yes" and trials without the signal.
    confidence : float

    Raises
    ------
    AsperityError
        There are fewer than two distances, or one is not above 0.
    """
    x = np.asarray(distances, dtype=np.float64)
    if len(np.unique(x)) < 2 or np.any(x <= 0.0):
        raise AsperityError(f"d' of 1 needs two distances or more above 0, got {x.tolist()}")
    search = _Search(
        np.log(x), np.append(np.asarray(yes, dtype=np.float64), without[0]),
        np.append(np.asarray(trials, dtype=np.float64), without[1]),
    )  # fmt: skip
    best = search.climbed(search.coarse(np.full(1, np.nan)), search.pitch)[0]
    level = float(search.likelihood(best)) - 0.5 * float(chi2.ppf(confidence, 1))
    ends = [search.end(float(best[0]), float(far[0]), level) for far in (search.low, search.high)]
    near = np.minimum(np.abs(best - search.low), np.abs(best - search.high))[:2]
    low, high = np.exp(ends)
    return DetectionFit(
        float(np.exp(best[0])), float(low), float(high), float(np.exp(best[1])), float(best[2]),
        # The likelihood is flat where the threshold is far from all levels.
        bool(near[0] < search.pitch[0] or near[1] < 1e-3),
    )  # fmt: skip


class _Search:
    """The likelihood over log threshold, log exponent and place, and its maximum."""

    def __init__(self, log_x: Array, yes: Array, trials: Array) -> None:
        self._log_x, self._yes, self._trials = log_x, yes, trials
        self.low = np.array([log_x.min() - _REACH, _EXPONENTS[0], _PLACES[0]])
        self.high = np.array([log_x.max() + _REACH, _EXPONENTS[1], _PLACES[1]])
        self.pitch = (self.high - self.low) / (np.array(_GRID) - 1)

    def likelihood(self, p: Array) -> Array:
        """Return the log likelihood (...) of parameters (..., 3)."""
        log_d = np.exp(p[..., 1, None]) * (self._log_x - p[..., 0, None])
        d = np.exp(np.minimum(log_d, 4.0))  # d' above 55 is as good as any
        z = np.concatenate([d, np.zeros((*d.shape[:-1], 1))], axis=-1) - p[..., 2, None]
        terms = self._yes * log_ndtr(z) + (self._trials - self._yes) * log_ndtr(-z)
        return np.asarray(terms.sum(axis=-1))

    def coarse(self, held: Array) -> Array:
        """Return the best points (k, 3) of a grid, with the log threshold held unless NaN (k,)."""
        axes = [np.linspace(a, b, n) for a, b, n in zip(self.low, self.high, _GRID, strict=True)]
        points = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)
        rest = points[points[:, 0] == axes[0][0]]
        out = []
        for value in held:
            tried = points if np.isnan(value) else np.array(rest)
            if not np.isnan(value):
                tried[:, 0] = value
            out.append(tried[int(np.argmax(self.likelihood(tried)))])
        return np.array(out)

    def climbed(self, at: Array, pitch: Array) -> Array:
        """Return the maxima (k, 3) near points, on ever smaller grids; pitch 0 holds."""
        sides = [(-1.0, 0.0, 1.0) if size > 0.0 else (0.0,) for size in pitch]
        offsets = np.stack([axis.ravel() for axis in np.meshgrid(*sides, indexing="ij")], axis=1)
        for _ in range(_ROUNDS):
            near = np.clip(at[:, None, :] + offsets * pitch, self.low, self.high)
            at = near[np.arange(len(at)), np.argmax(self.likelihood(near), axis=1)]
            pitch = _SHRINK * pitch
        return at

    def end(self, near: float, far: float, level: float) -> float:
        """Return where the profile of the threshold falls below a level first, or the far end."""
        pitch = self.pitch * np.array([0.0, 1.0, 1.0])
        return profile_end(
            lambda values: self.likelihood(self.climbed(self.coarse(values), pitch)),
            lambda close, beyond: np.linspace(close, beyond, _STEPS),
            (near, far), level,
        )  # fmt: skip
