r"""Psychometric functions: how often an answer is right, over the intensity of the stimulus.

    psi(x) = guess + (1 - guess - lapse) F(x)

`F` rises from 0 to 1. All kinds have the same two parameters: the *threshold*, where `F` is a half,
and the *width*, from where `F` is 0.05 to where it is 0.95 (as in Schuett et al. 2016, Vision Res.
122, 105-123). In a two-interval forced choice the threshold is thus where 75 % are right, but for
lapses. The intensity x is the level itself on a linear scale and its decimal logarithm on a
logarithmic one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit, ndtr, ndtri

from asperity._core.arrays import Array
from asperity.errors import require_between, require_choice, require_positive

FUNCTIONS = {
    "logistic": "F = 1 / (1 + exp(-2 ln 19 (x - threshold) / width))",
    "normal": "F = Phi(2 Phi^-1(0.95) (x - threshold) / width)",
    "weibull": "F = 1 - 2^-exp(4.067 (x - threshold) / width): Weibull's in the level, "
    "if x is its logarithm",
}
_LOGISTIC = 2.0 * math.log(19.0)
_NORMAL = 2.0 * float(ndtri(0.95))
_WEIBULL = math.log(-math.log(0.05)) - math.log(-math.log(0.95))
STEEPNESS = {
    "logistic": 0.25 * _LOGISTIC,
    "normal": _NORMAL / math.sqrt(2.0 * math.pi),
    "weibull": 0.5 * math.log(2.0) * _WEIBULL,
}
"""Derivative of F at the threshold, where the width is 1."""


@dataclass(frozen=True)
class Psychometric:
    """A psychometric function.

    Parameters
    ----------
    threshold : float
        Intensity where F is a half.
    width : float
        From F = 0.05 to F = 0.95, above 0.
    lapse : float
        How often an answer is wrong whatever the stimulus, 0 to 0.5.
    guess : float or None
        How often it is right whatever the stimulus; 0.5 of two intervals. None: as often as it
        lapses, so that psi = lapse + (1 - 2 lapse) F, where levels lie on both sides.
    function : {"logistic", "normal", "weibull"}
    """

    threshold: float
    width: float
    lapse: float = 0.0
    guess: float | None = 0.5
    function: str = "weibull"

    def __post_init__(self) -> None:
        require_positive("width", self.width)
        require_between("lapse", self.lapse, 0.0, 0.5)
        if self.guess is not None:
            require_between("guess", self.guess, 0.0, 1.0)
        require_choice("function", self.function, FUNCTIONS)

    def __call__(self, intensity: ArrayLike) -> Array:
        """Return the probability of a right answer."""
        return probability(
            intensity, self.threshold, self.width, self.lapse, self.guess, self.function
        )

    def at(self, right: float) -> float:
        """Return the intensity at which so many answers are right; NaN where there is none."""
        return float(
            self.threshold + self.width * place(right, self.lapse, self.guess, self.function)
        )

    @property
    def slope(self) -> float:
        """Derivative of psi at the threshold, per unit of intensity."""
        guess = self.lapse if self.guess is None else self.guess
        return (1.0 - guess - self.lapse) * STEEPNESS[self.function] / self.width


def hits_by_level(intensities: ArrayLike, right: ArrayLike) -> tuple[Array, Array, Array]:
    """Return the different intensities of trials, rising, their numbers of trials, and of hits.

    Intensities that differ by rounding alone, by less than 1e-7 of their range, are one.
    """
    values, inverse = np.unique(np.asarray(intensities, dtype=np.float64), return_inverse=True)
    first = np.diff(values) > 1e-7 * np.ptp(values)
    first = np.concatenate([np.ones(min(values.size, 1), dtype=np.bool_), first])
    at = (np.cumsum(first) - 1)[inverse]
    hits = np.bincount(at, weights=np.asarray(right, dtype=np.float64))
    return values[first], np.bincount(at).astype(np.float64), np.asarray(hits, dtype=np.float64)


def probability(
    intensity: ArrayLike,
    threshold: ArrayLike,
    width: ArrayLike,
    lapse: ArrayLike,
    guess: float | None,
    function: str,
) -> Array:
    """Return psi(x) of arrays that broadcast against each other."""
    shift = np.asarray(intensity, dtype=np.float64) - np.asarray(threshold, dtype=np.float64)
    z = shift / np.asarray(width, dtype=np.float64)
    rising: Array
    if function == "logistic":
        rising = np.asarray(expit(_LOGISTIC * z))
    elif function == "normal":
        rising = np.asarray(ndtr(_NORMAL * z))
    else:
        rising = np.asarray(-np.expm1(-math.log(2.0) * np.exp(np.minimum(_WEIBULL * z, 300.0))))
    lapses = np.asarray(lapse, dtype=np.float64)
    chance = lapses if guess is None else guess
    return np.asarray(chance + (1.0 - chance - lapses) * rising)


def place(right: float, lapse: ArrayLike, guess: float | None, function: str) -> Array:
    """Return where so many answers are right, in widths from the threshold; NaN where nowhere."""
    lapses = np.asarray(lapse, dtype=np.float64)
    chance = lapses if guess is None else guess
    part = (right - chance) / (1.0 - chance - lapses)
    return quantile(np.where((part > 0.0) & (part < 1.0), part, np.nan), function)


def quantile(part: ArrayLike, function: str) -> Array:
    """Return where F has a value between 0 and 1, in widths from the threshold."""
    rising = np.asarray(part, dtype=np.float64)
    if function == "logistic":
        return np.asarray(np.log(rising / (1.0 - rising)) / _LOGISTIC)
    if function == "normal":
        return np.asarray(ndtri(rising) / _NORMAL)
    return np.asarray(np.log(-np.log1p(-rising) / math.log(2.0)) / _WEIBULL)
