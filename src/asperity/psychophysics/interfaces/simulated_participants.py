"""Parameters of simulated participants.

They serve to try out an experiment and to test its analysis. They are no model of people.
"""

from __future__ import annotations

from dataclasses import dataclass

from asperity.errors import require_between, require_choice, require_not_negative, require_positive
from asperity.psychophysics.analysis.psychometric import FUNCTIONS

RATES = ("parameter", "band_rms", "largest_force")
"""Quantity that a simulated participant judges: the value of the stimulus, or from the recording
the RMS of the tangential force in 20 to 200 Hz or its largest value."""


@dataclass(frozen=True)
class SimulatedSettings:
    """True parameters of a simulated participant.

    Parameters
    ----------
    rates : {"parameter", "band_rms", "largest_force"}
        Quantity that is judged. With "parameter", forced choices follow the psychometric function.
    threshold : float
        Level of a forced choice where F is a half; of yes/no, where d' is 1.
    width : float
        Width of the psychometric function, in intensity (decades on a logarithmic scale).
    lapse : float
        Proportion of answers that are wrong, or random, independent of the stimulus.
    function : {"logistic", "normal", "weibull"}
    exponent : float
        Exponent of the magnitude as a power law of the judged quantity; of yes/no, of d' over the
        level.
    modulus : float
        Magnitude at a judged quantity of 1.
    noise : float
        Standard deviation of the decimal logarithm of a magnitude, drawn in each interval, or of
        what a participant adjusts to, drawn in each adjustment (on a linear scale, as a part of the
        standard).
    criterion : float
        Of yes/no: how far above the mean without the signal "yes" begins [SD].
    bias : float
        Of adjustments: the value that feels equal, as a multiple of the standard.
    spread : float
        Standard deviation between participants of the threshold's intensity (forced choices) and of
        the decimal logarithm of the exponent (magnitudes). It follows from the participant's code,
        so that it is the same in each condition.
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
    criterion: float = 0.5
    bias: float = 1.0
    spread: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        require_choice("rates", self.rates, RATES)
        require_choice("function", self.function, FUNCTIONS)
        require_positive("width", self.width)
        require_positive("modulus", self.modulus)
        require_between("lapse", self.lapse, 0.0, 0.5)
        require_between("exponent", self.exponent, -10.0, 10.0)
        require_not_negative("noise", self.noise)
        require_not_negative("spread", self.spread)
        require_between("criterion", self.criterion, -10.0, 10.0)
        require_positive("bias", self.bias)
