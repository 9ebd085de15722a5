"""The interface between a session and its participant, and a simulated one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from asperity.psychophysics.analysis.psychometric import Psychometric
from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.procedures.procedures import seeds
from asperity.psychophysics.session.trials import PresentedInterval, Trial

SIMULATED = "simulated"
"""Kind of interface of a machine that answers; all others are of persons."""
_STREAM = 0x5EED
"""Separates the random numbers of the simulated participant from those of the procedure."""


class Paused(Exception):  # noqa: N818  (no error)
    """The participant or the experimenter pauses the session."""


@dataclass(frozen=True)
class Progress:
    """Progress of a session."""

    done: int
    """Trials answered."""
    most: int
    """Largest number of trials; adaptive methods may end earlier."""
    resumed: bool = False


class Reply(NamedTuple):
    """An unchecked answer, and the response time from the question [s]."""

    answer: Any
    seconds: float


class ParticipantInterface:
    """Shows trials to a participant and returns the answers. Any method may raise `Paused`.

    What is not overridden shows nothing and goes on at once; `ask` must be.
    """

    kind = ""
    """Kind of interface, for the journal."""

    def welcome(self, design: ExperimentDesign, progress: Progress) -> None:
        """Show the instructions; return when the participant is ready."""

    def ready(self, trial: Trial, progress: Progress) -> None:
        """Return when the participant starts the trial."""

    def begun(self, interval: int) -> None:
        """Show that an interval, counted from 1, has begun."""

    def done(self) -> bool:
        """Return whether the participant wants to end the interval."""
        return False

    def ended(self, interval: int) -> None:
        """Show that an interval has ended."""

    def ask(self, trial: Trial, felt: list[PresentedInterval]) -> Reply:
        """Ask the question of a trial; return the reply."""
        raise NotImplementedError

    def refuse(self, why: str) -> None:
        """Show why a reply is not a valid answer; `ask` is called again."""

    def feedback(self, right: bool) -> None:
        """Show whether the answer was right."""

    def over(self, message: str) -> None:
        """Show that the session has ended."""


class SimulatedInterface(ParticipantInterface):
    """A simulated participant with known parameters, who answers at once.

    Random numbers depend only on the seeds and the number of the trial.
    """

    kind = SIMULATED

    def __init__(self, design: ExperimentDesign, participant: str = "", session: int = 1) -> None:
        self.settings = s = design.simulated
        threshold, guess = 0.0, None
        if design.method == "forced-choice":
            threshold = design.forced_choice.intensity(s.threshold)
            guess = design.forced_choice.guess
        self.truth = Psychometric(threshold, s.width, s.lapse, guess, s.function)
        self._seed = [s.seed, _STREAM, *seeds(design, participant, session)]

    def ask(self, trial: Trial, felt: list[PresentedInterval]) -> Reply:
        """Return the simulated participant's answer."""
        return Reply(self.answer(trial, felt), 0.0)

    def refuse(self, why: str) -> None:
        """Fail: a simulated answer is always valid, and asking again would never end."""
        raise AssertionError(f"the answer of a simulated participant was refused: {why}")

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
        if by_parameter and trial.intensity is not None and trial.target is not None:
            hit = rng.random() < float(self.truth(trial.intensity))
            return trial.target if hit else 3 - trial.target
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
