"""QUEST+: each trial at the intensity whose answer is expected to be most informative.

Watson (2017), QUEST+: a general multidimensional Bayesian adaptive psychometric method, J. Vision
17(3):10. A posterior is kept over a grid of parameters. For each possible intensity, the expected
entropy of the posterior after the answer is computed, and the intensity with the smallest is
presented next: three matrix products per trial.

Implemented here from the paper because the Python packages of QUEST+ are under the GPL.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_between, require_choice, require_not_negative
from asperity.psychophysics.analysis.psychometric import FUNCTIONS, probability

PARAMETERS = ("threshold", "width", "lapse")


@dataclass(frozen=True)
class QuestPlusSettings:
    """Grid of QUEST+ and its stopping rule.

    Parameters
    ----------
    trials : int
        Largest number of trials.
    levels : int
        Number of levels to choose from, from lowest to highest of the experiment, on its scale.
    thresholds : int
        Values of the threshold on the grid of parameters, over the same range.
    widths : tuple of float
        Values of the width, as intensities (decades on a logarithmic scale).
    lapses : tuple of float
        Values of the lapse rate.
    function : {"logistic", "normal", "weibull"}
    until : float
        End earlier when the posterior standard deviation of the threshold falls below this
        [intensity]. Default 0: never.
    """

    trials: int = 160
    levels: int = 41
    thresholds: int = 61
    widths: tuple[float, ...] = (0.25, 0.4, 0.63, 1.0, 1.6)
    lapses: tuple[float, ...] = (0.0, 0.02, 0.04)
    function: str = "weibull"
    until: float = 0.0

    def __post_init__(self) -> None:
        require_between("trials", self.trials, 1, 10000)
        require_between("levels", self.levels, 2, 1000)
        require_between("thresholds", self.thresholds, 2, 1000)
        require_not_negative("until", self.until)
        require_choice("function", self.function, FUNCTIONS)
        if not self.widths or not self.lapses:
            raise AsperityError("widths and lapses must each hold at least one value")
        for width in self.widths:
            require_between("widths", width, 1e-9, 1e9)
        for lapse in self.lapses:
            require_between("lapses", lapse, 0.0, 0.5)

    @property
    def most(self) -> int:
        """Largest number of trials."""
        return self.trials


@dataclass
class QuestPlus:
    """The posterior over the parameters, and the intensity to present next.

    Parameters
    ----------
    intensities : (s,) array
        Intensities to choose from.
    thresholds, widths, lapses : array
        Values of the parameters; the grid is their product.
    guess : float or None
        None: equal to the lapse rate.
    function : str
    prior : (thresholds, widths, lapses) array, optional
        Default: uniform.
    """

    intensities: Array
    thresholds: Array
    widths: Array
    lapses: Array
    guess: float | None = 0.5
    function: str = "weibull"
    prior: Array | None = None
    posterior: Array = field(init=False)
    """(thresholds, widths, lapses), sums to 1."""
    done: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        grid = np.meshgrid(self.thresholds, self.widths, self.lapses, indexing="ij")
        shape = grid[0].shape
        t, w, lapse = (axis.reshape(1, -1) for axis in grid)
        x = np.asarray(self.intensities, dtype=np.float64)[:, None]
        right = np.clip(probability(x, t, w, lapse, self.guess, self.function), 1e-12, 1.0 - 1e-12)
        self._likelihood = np.stack([1.0 - right, right])  # (answer, intensity, parameters)
        self._entropy_rate = -np.einsum("asp,asp->sp", self._likelihood, np.log(self._likelihood))
        prior = np.ones(shape) if self.prior is None else np.asarray(self.prior, dtype=np.float64)
        if prior.shape != shape or not np.all(prior >= 0.0) or not prior.sum() > 0.0:
            raise AsperityError(
                f"prior must have shape {shape} and values of 0 or above, not all 0; "
                f"got shape {prior.shape}"
            )
        self.posterior = prior / prior.sum()

    def expected_entropy(self) -> Array:
        """Return the expected entropy [nat] of the posterior after an answer at each intensity.

        H(theta | answer) = H(theta) + H(answer | theta) - H(answer): this identity avoids
        computing the posterior of either answer.
        """
        p = self.posterior.ravel()
        now = -np.sum(p * np.log(np.where(p > 0.0, p, 1.0)))
        given = self._entropy_rate @ p
        answer = np.clip(self._likelihood @ p, 1e-300, 1.0)  # (answer, intensity)
        return np.asarray(now + given + np.sum(answer * np.log(answer), axis=0))

    def next(self) -> float:
        """Return the intensity with the smallest expected entropy."""
        return float(self.intensities[int(np.argmin(self.expected_entropy()))])

    def answer(self, intensity: float, right: bool) -> None:
        """Update the posterior with an answer at the grid intensity nearest to `intensity`."""
        at = int(np.argmin(np.abs(self.intensities - intensity)))
        posterior = self.posterior * self._likelihood[int(right), at].reshape(self.posterior.shape)
        self.posterior = posterior / posterior.sum()
        self.done += 1

    def estimate(self) -> dict[str, tuple[float, float]]:
        """Return mean and standard deviation of the posterior by parameter."""
        estimates = {}
        for axis, (name, values) in enumerate(
            zip(PARAMETERS, (self.thresholds, self.widths, self.lapses), strict=True)
        ):
            others = tuple(i for i in range(3) if i != axis)
            marginal = self.posterior.sum(axis=others)
            mean = float(marginal @ values)
            estimates[name] = (mean, float(np.sqrt(max(marginal @ (values - mean) ** 2, 0.0))))
        return estimates
