"""Simulated participants with known parameters.

They serve to try out an experiment and to test its analysis. They are no model of people.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asperity.errors import require_between, require_choice, require_not_negative, require_positive
from asperity.psychophysics.analysis.psychometric import FUNCTIONS, Psychometric

if TYPE_CHECKING:
    from asperity.psychophysics.session.trials import PresentedInterval, Trial

RATES = ("parameter", "band_rms", "largest_force")
"""Quantity that a simulated participant judges: the value of the stimulus, or from the recording
the RMS of the tangential force in 20 to 200 Hz or its largest value."""

_STREAM = 0x5EED
"""Separates the random numbers of the participant from those of the procedure."""


@dataclass(frozen=True)
class SimulatedSettings:
    """True parameters of a simulated participant.

    Parameters
    ----------
    rates : {"parameter", "band_rms", "largest_force"}
        Quantity that is judged. With "parameter", forced choices follow the psychometric function.
    threshold : float
        Level of a forced choice where F is a half.
    width : float
        Width of the psychometric function, in intensity (decades on a logarithmic scale).
    lapse : float
        Proportion of answers that are wrong, or random, independent of the stimulus.
    function : {"logistic", "normal", "weibull"}
    exponent : float
        Exponent of the magnitude as a power law of the judged quantity.
    modulus : float
        Magnitude at a judged quantity of 1.
    noise : float
        Standard deviation of the decimal logarithm of a magnitude, drawn in each interval.
    seed : int
    """

    rates: str = "parameter"
    threshold: float = 0.2
    width: float = 0.6
    lapse: float = 0.02
    function: str = "weibull"
    exponent: float = 1.0
    modulus: float = 10.0
    noise: float = 0.1
    seed: int = 0

    def __post_init__(self) -> None:
        require_choice("rates", self.rates, RATES)
        require_choice("function", self.function, FUNCTIONS)
        require_positive("width", self.width)
        require_positive("modulus", self.modulus)
        require_between("lapse", self.lapse, 0.0, 0.5)
        require_between("exponent", self.exponent, -10.0, 10.0)
        require_not_negative("noise", self.noise)


class SimulatedParticipant:
    """Answers trials. Random numbers depend only on the seeds and the number of the trial.

    Parameters
    ----------
    settings : SimulatedSettings
    threshold : float
        On the scale of intensities.
    who : sequence of int
        Seeds of this participant and session.
    """

    def __init__(
        self, settings: SimulatedSettings, threshold: float = 0.0, who: Sequence[int] = ()
    ) -> None:
        self.settings = settings
        self._seed = [settings.seed, _STREAM, *who]
        s = settings
        self.truth = Psychometric(threshold, s.width, s.lapse, 0.5, s.function)

    def answer(self, trial: Trial, felt: list[PresentedInterval]) -> float | int | list[int]:
        """Return the answer to a trial: a number, an interval from 1, or an order of them.

        Parameters
        ----------
        trial : Trial
        felt : list of PresentedInterval
            Its intervals, with the measures of their recordings.
        """
        rng = np.random.default_rng([*self._seed, trial.number])
        by_parameter = self.settings.rates == "parameter"
        if by_parameter and trial.intensity is not None and trial.right is not None:
            right = rng.random() < float(self.truth(trial.intensity))
            return trial.right if right else 3 - trial.right
        magnitudes = [self._magnitude(trial, i, felt, rng) for i in range(len(trial.stimuli))]
        if trial.kind == "number":
            return float(f"{10.0 ** magnitudes[0]:.3g}")
        lapsed = rng.random() < self.settings.lapse
        keys = rng.random(len(magnitudes)) if lapsed else np.array(magnitudes)
        order = [int(i) + 1 for i in np.argsort(-keys, kind="stable")]
        return order[0] if trial.kind == "choice" else order

    def _magnitude(
        self, trial: Trial, interval: int, felt: list[PresentedInterval], rng: np.random.Generator
    ) -> float:
        """Return the decimal logarithm of the perceived magnitude of an interval."""
        s = self.settings
        value = trial.stimuli[interval].value
        judged = value if s.rates == "parameter" else felt[interval].measures[s.rates]
        if judged is None:
            raise ValueError(f"the stimulus {trial.stimuli[interval].name} has no value to rate")
        judged = max(judged, 1e-300)
        return math.log10(s.modulus) + s.exponent * math.log10(judged) + s.noise * rng.normal()
