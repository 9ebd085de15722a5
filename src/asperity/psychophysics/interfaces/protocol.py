"""The interface between a session and its participant, and a simulated one."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from asperity.errors import AsperityError, require_positive
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


class TakenBack(Exception):  # noqa: N818  (no error)
    """The participant takes back the last answer."""


@dataclass(frozen=True)
class Progress:
    """Progress of a session."""

    done: int
    """Trials answered; of adjustments, those that are settled."""
    most: int
    """Largest number of trials; adaptive methods may end earlier."""
    resumed: bool = False
    can_take_back: bool = False
    """Whether the last answer may be taken back now."""


class Reply(NamedTuple):
    """An unchecked answer, and the response time from the question [s]."""

    answer: Any
    seconds: float


class ParticipantInterface:
    """Shows trials to a participant and returns the answers. Any method may raise `Paused`.

    `ready` and `last` may raise `TakenBack` where the progress allows it. What is not
    overridden shows nothing and goes on at once; `ask` must be.
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

    def rest(self, seconds: float, progress: Progress) -> None:
        """Show a break of at least so many seconds; return when the participant goes on."""

    def taken_back(self) -> None:
        """Show that the last answer was taken back."""

    def last(self, progress: Progress) -> None:
        """Return when the participant, who may take back the last answer, finishes."""

    def over(self, message: str) -> None:
        """Show that the session has ended."""


class SimulatedInterface(ParticipantInterface):
    """A simulated participant with known parameters, who answers at once.

    Random numbers depend only on the seeds and the number of the trial.
    """

    kind = SIMULATED

    def __init__(self, design: ExperimentDesign, participant: str = "", session: int = 1) -> None:
        self.settings = s = design.simulated
        self.design = design
        digest = hashlib.sha256(participant.encode()).digest()
        own = float(np.random.default_rng([s.seed, *digest[:8]]).normal())
        self._exponent = s.exponent * 10.0 ** (s.spread * own)
        threshold, guess = 0.0, None
        if design.adaptive is not None:
            threshold = design.forced_choice.intensity(s.threshold) + s.spread * own
            guess = design.forced_choice.guess
        self.truth = Psychometric(threshold, s.width, s.lapse, guess, s.function)
        self._seed = [s.seed, _STREAM, *seeds(design, participant, session)]
        if design.kind == "adjust" and s.rates == "parameter":
            for standard in design.standards():
                if standard.value is None:
                    raise AsperityError(
                        f"stimuli.{standard.name}.value is missing: what a simulated participant "
                        "matches by"
                    )
                if design.matching.scale == "log":
                    require_positive(f"stimuli.{standard.name}.value", standard.value)

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
            if trial.kind == "yes-no":
                return self._yes_or_no(trial, rng)
            hit = rng.random() < float(self.truth(trial.intensity))
            others = [i for i in range(1, len(trial.stimuli) + 1) if i != trial.target]
            if hit or len(others) == 1:
                return trial.target if hit else others[0]
            return others[int(rng.integers(len(others)))]
        if trial.kind == "yes-no":
            return self._yes_or_no(trial, rng)
        if trial.kind == "adjust" and by_parameter:
            return self._change(trial)
        magnitudes = [self._magnitude(trial, i, felt, rng) for i in range(len(trial.stimuli))]
        if trial.kind == "number":
            return float(f"{10.0 ** magnitudes[0]:.3g}")
        lapsed = rng.random() < self.settings.lapse
        if trial.kind == "adjust":
            apart = magnitudes[0] - magnitudes[1]
            return 0 if abs(apart) <= max(self.settings.noise, 0.01) else 1 if apart > 0.0 else -1
        felt_as = np.array(magnitudes)
        if self.design.method == "odd-one-out":
            felt_as = np.abs(felt_as - np.median(felt_as))
        keys = rng.random(len(magnitudes)) if lapsed else felt_as
        order = [int(i) + 1 for i in np.argsort(-keys, kind="stable")]
        return order[0] if trial.kind == "choice" else order

    def _yes_or_no(self, trial: Trial, rng: np.random.Generator) -> int:
        """Return 1 for yes: what is sensed, of unit variance, lies above the criterion."""
        s, settings = self.settings, self.design.settings
        if rng.random() < s.lapse:
            return int(rng.integers(2))
        signal = 0.0
        if trial.level is not None and trial.right == 1:
            apart = trial.level
            if getattr(settings, "level", "") == "value":
                apart -= getattr(settings, "standard", 0.0)
            signal = (abs(apart) / s.threshold) ** s.exponent
        return int(signal + rng.normal() > s.criterion)

    def _change(self, trial: Trial) -> int:
        """Return how the comparison should change towards what feels equal in this adjustment."""
        s, settings = self.settings, self.design.matching
        rng = np.random.default_rng([*self._seed, _STREAM, trial.track or 0])
        value = trial.stimuli[0].value
        assert value is not None
        assert trial.intensity is not None
        noise = s.noise if settings.scale == "log" else s.noise * abs(value)
        aim = settings.intensity(value * s.bias) + noise * rng.normal()
        # It may lie beyond what can be adjusted.
        aim = min(max(aim, settings.intensity(settings.low)), settings.intensity(settings.high))
        steps = (aim - trial.intensity) / settings.intensity(settings.step)
        if abs(steps) <= 0.5 + 1e-9:
            return 0
        size = 2 if abs(steps) > 0.5 * (1 + settings.coarse) else 1
        return size if (steps > 0.0) == (settings.more == "larger") else -size

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
        return math.log10(s.modulus) + self._exponent * math.log10(judged) + s.noise * rng.normal()
