"""Who stands before the participant: asks, is told, and says when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.interfaces.simulated_participants import SimulatedParticipant
from asperity.psychophysics.procedures.procedures import seeds
from asperity.psychophysics.session.trials import PresentedInterval, Trial


class Paused(Exception):  # noqa: N818  (no error)
    """The participant, or the experimenter, wants to go on another time."""


@dataclass(frozen=True)
class Progress:
    """How far a session is."""

    done: int
    """Trials answered."""
    most: int
    """Trials there are at most; adaptive methods may end before."""
    resumed: bool = False


class Reply(NamedTuple):
    """What was answered, unchecked, and how long it took from the question [s]."""

    answer: Any
    seconds: float


class Front(Protocol):
    """What a session asks of a front end. Any of these may raise `Paused`."""

    kind: str
    """For the journal: who answered, by what."""

    def welcome(self, design: ExperimentDesign, progress: Progress) -> None:
        """Show the instructions; return when the participant is ready."""

    def ready(self, trial: Trial, progress: Progress) -> None:
        """Return when the participant wants the trial to begin."""

    def begun(self, interval: int) -> None:
        """Be told that an interval, from 1, can be felt now."""

    def done(self) -> bool:
        """Return whether the participant has felt enough of the interval."""

    def ended(self, interval: int) -> None:
        """Be told that an interval is over."""

    def ask(self, trial: Trial, felt: list[PresentedInterval]) -> Reply:
        """Ask the question of a trial; return what was answered."""

    def refuse(self, why: str) -> None:
        """Say why something was no answer; it is asked again."""

    def feedback(self, right: bool) -> None:
        """Say whether the answer was right."""

    def over(self, told: str) -> None:
        """Say that the session is over."""


class SimulatedFront:
    """A simulated participant, who needs no asking twice."""

    kind = "simulated"

    def __init__(self, design: ExperimentDesign, participant: str = "", session: int = 1) -> None:
        settings = design.simulated
        threshold = 0.0
        if design.method == "forced-choice":
            threshold = design.forced_choice.intensity(settings.threshold)
        self._participant = SimulatedParticipant(
            settings, threshold, seeds(design, participant, session)
        )

    def welcome(self, design: ExperimentDesign, progress: Progress) -> None:
        """Say nothing."""

    def ready(self, trial: Trial, progress: Progress) -> None:
        """Begin at once."""

    def begun(self, interval: int) -> None:
        """Say nothing."""

    def done(self) -> bool:
        """Feel everything to its end."""
        return False

    def ended(self, interval: int) -> None:
        """Say nothing."""

    def ask(self, trial: Trial, felt: list[PresentedInterval]) -> Reply:
        """Answer as the truth and the trial's number want it."""
        return Reply(self._participant.answer(trial, felt), 0.0)

    def refuse(self, why: str) -> None:
        """Never happens; a loop without end would be worse."""
        raise AssertionError(f"a simulated participant was refused: {why}")

    def feedback(self, right: bool) -> None:
        """Learn nothing."""

    def over(self, told: str) -> None:
        """Say nothing."""
