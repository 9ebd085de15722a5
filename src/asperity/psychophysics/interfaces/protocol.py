"""The interface between a session and its participant, and a simulated one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.interfaces.simulated_participants import SimulatedParticipant
from asperity.psychophysics.procedures.procedures import seeds
from asperity.psychophysics.session.trials import PresentedInterval, Trial


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


class ParticipantInterface(Protocol):
    """Shows trials to a participant and returns the answers. Any method may raise `Paused`."""

    kind: str
    """Kind of interface, for the journal."""

    def welcome(self, design: ExperimentDesign, progress: Progress) -> None:
        """Show the instructions; return when the participant is ready."""

    def ready(self, trial: Trial, progress: Progress) -> None:
        """Return when the participant starts the trial."""

    def begun(self, interval: int) -> None:
        """Show that an interval, counted from 1, has begun."""

    def done(self) -> bool:
        """Return whether the participant wants to end the interval."""

    def ended(self, interval: int) -> None:
        """Show that an interval has ended."""

    def ask(self, trial: Trial, felt: list[PresentedInterval]) -> Reply:
        """Ask the question of a trial; return the reply."""

    def refuse(self, why: str) -> None:
        """Show why a reply is not a valid answer; `ask` is called again."""

    def feedback(self, right: bool) -> None:
        """Show whether the answer was right."""

    def over(self, message: str) -> None:
        """Show that the session has ended."""


class SimulatedInterface:
    """A simulated participant, who answers at once."""

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
        """Show nothing."""

    def ready(self, trial: Trial, progress: Progress) -> None:
        """Begin at once."""

    def begun(self, interval: int) -> None:
        """Show nothing."""

    def done(self) -> bool:
        """Feel every interval to its end."""
        return False

    def ended(self, interval: int) -> None:
        """Show nothing."""

    def ask(self, trial: Trial, felt: list[PresentedInterval]) -> Reply:
        """Return the simulated participant's answer."""
        return Reply(self._participant.answer(trial, felt), 0.0)

    def refuse(self, why: str) -> None:
        """Fail: a simulated answer is always valid, and asking again would never end."""
        raise AssertionError(f"the answer of a simulated participant was refused: {why}")

    def feedback(self, right: bool) -> None:
        """Ignore the feedback."""

    def over(self, message: str) -> None:
        """Show nothing."""
