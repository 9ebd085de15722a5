"""A trial: its stimuli, the valid answers, and the presented intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from asperity.errors import AsperityError
from asperity.psychophysics.stimuli import Stimulus

Answer = float | int | list[int]
"""A number above 0; an interval, from 1; or a ranking of intervals, largest first."""


@dataclass(frozen=True)
class Trial:
    """One trial.

    Parameters
    ----------
    number : int
        From 1.
    kind : {"number", "choice", "order"}
        Kind of answer.
    stimuli : tuple of Stimulus
        One for each interval.
    block : int
        Counted from 1; 0 for practice.
    level, intensity : float, optional
        In a forced choice, the level of the comparison, and the same on the intensity scale.
    right : int, optional
        The interval, from 1, that is the correct answer, by the physical stimuli; None where they
        are equal, or where there is none.
    track : int, optional
        Interleaved staircase to which it belongs, from 1.
    target : int, optional
        The answer that gets more frequent as the level rises: the right one, or where levels lie on
        both sides of the standard the choice of the comparison as larger.
    """

    number: int
    kind: str
    stimuli: tuple[Stimulus, ...]
    block: int = 1
    level: float | None = None
    intensity: float | None = None
    right: int | None = None
    track: int | None = None
    target: int | None = None

    @property
    def practice(self) -> bool:
        """Whether it is a practice trial, left out of the analysis."""
        return self.block == 0

    def to_json(self) -> dict[str, Any]:
        """Return a dict of JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> Trial:
        """Return a trial from what `to_json` returned."""
        stimuli = tuple(Stimulus(**s) for s in entry["stimuli"])
        return cls(**{**entry, "stimuli": stimuli})

    def parse_answer(self, answer: Any) -> Answer:
        """Return a valid answer in the form that is stored, or raise.

        Raises
        ------
        AsperityError
            The answer is not valid. The message is one line for the participant.
        """
        count = len(self.stimuli)
        if self.kind == "number":
            try:
                number = float(str(answer).strip().replace(",", "."))
            except ValueError:
                number = math.nan
            if not (math.isfinite(number) and number > 0.0):
                raise AsperityError("please give a number above 0")
            return number
        if self.kind == "choice":
            text = str(answer).strip()
            choices = [str(i + 1) for i in range(count)]
            if text not in choices:
                raise AsperityError(f"please answer {' or '.join(choices)}")
            return int(text)
        words = answer if isinstance(answer, list) else str(answer).replace(",", " ").split()
        order = [int(word) for word in words if str(word).isdecimal()]
        if sorted(order) != list(range(1, count + 1)) or len(order) != len(words):
            raise AsperityError(f"please give the numbers 1 to {count}, each once, in order")
        return order

    def is_right(self, answer: Answer) -> bool | None:
        """Return whether an answer is right, or None if there is no right answer."""
        return None if self.right is None else answer == self.right

    def is_target(self, answer: Answer) -> bool | None:
        """Return whether an answer is the target, or None if there is none."""
        return None if self.target is None else answer == self.target


@dataclass(frozen=True)
class PresentedInterval:
    """Facts of one presented interval."""

    recording: str
    """File, in the session's folder."""
    ticks: int
    seconds: float
    measures: Mapping[str, float] = field(default_factory=dict)
    """Measures of the exploration, by name: see `presenters.exploration_measures`."""
    loop_report: Mapping[str, Any] = field(default_factory=dict)
    """Report of the servo loop: missed ticks, fallbacks, ..."""

    def to_json(self) -> dict[str, Any]:
        """Return a dict of JSON values."""
        return {
            "recording": self.recording, "ticks": self.ticks, "seconds": self.seconds,
            "measures": dict(self.measures), **self.loop_report,
        }  # fmt: skip
