"""A trial: what is presented in it, and what may be answered."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from asperity.errors import AsperityError
from asperity.psychophysics.stimuli import Stimulus

Answer = float | int | list[int]
"""A number above 0; an interval, from 1; or intervals in order, the one with most first."""


@dataclass(frozen=True)
class Trial:
    """One trial.

    Parameters
    ----------
    number : int
        From 1.
    kind : {"number", "choice", "order"}
        What is answered.
    stimuli : tuple of Stimulus
        One for each interval.
    block : int
        From 1; 0 of practice.
    level, intensity : float, optional
        Of a forced choice: how far the comparison is from the standard, and that on its scale.
    right : int, optional
        The interval, from 1, that has more of what is asked for.
    track : int, optional
        Which of the interleaved staircases it belongs to, from 1.
    """

    number: int
    kind: str
    stimuli: tuple[Stimulus, ...]
    block: int = 1
    level: float | None = None
    intensity: float | None = None
    right: int | None = None
    track: int | None = None

    @property
    def practice(self) -> bool:
        """Whether it is left out of the analysis."""
        return self.block == 0

    def plain(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "number": self.number, "kind": self.kind, "block": self.block, "level": self.level,
            "intensity": self.intensity, "right": self.right, "track": self.track,
            "stimuli": [stimulus.plain() for stimulus in self.stimuli],
        }  # fmt: skip

    @staticmethod
    def from_plain(told: Mapping[str, Any]) -> Trial:
        """Return a trial as `plain` told it."""
        stimuli = tuple(Stimulus(s["name"], s["value"]) for s in told["stimuli"])
        return Trial(**{**told, "stimuli": stimuli})

    def checked(self, answer: Any) -> Answer:
        """Return an answer as it is kept, or refuse one that is none.

        Raises
        ------
        AsperityError
            One line that says what would be an answer; fit to be shown to the participant.
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
        """Return whether an answer is right, or None where there is no right one."""
        return None if self.right is None else answer == self.right


@dataclass(frozen=True)
class PresentedInterval:
    """What came of presenting one interval."""

    recording: str
    """File, in the session's folder."""
    ticks: int
    seconds: float
    measures: Mapping[str, float] = field(default_factory=dict)
    """Of what was felt, by name: see `presenters.measured`."""
    told: Mapping[str, Any] = field(default_factory=dict)
    """Of the loop: ticks missed, and the like."""

    def plain(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "recording": self.recording, "ticks": self.ticks, "seconds": self.seconds,
            "measures": dict(self.measures), **self.told,
        }  # fmt: skip
