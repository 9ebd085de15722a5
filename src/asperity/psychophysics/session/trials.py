"""A trial: its stimuli, the valid answers, and the presented intervals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from asperity.errors import AsperityError
from asperity.psychophysics.stimuli import Stimulus
from asperity.psychophysics.texts import Texts, read_texts

Answer = float | int | list[int]
"""A number above 0; an interval, from 1; a ranking of intervals, largest first; 1 for yes and 0 for
no; or a key of `ADJUST`."""
ADJUST = {2: "++", 1: "+", 0: "=", -1: "-", -2: "--"}
"""How the second interval should change to equal the first, and what is typed for it."""


@dataclass(frozen=True)
class Trial:
    """One trial.

    Parameters
    ----------
    number : int
        From 1.
    kind : {"number", "choice", "order", "yes-no", "adjust"}
        Kind of answer.
    stimuli : tuple of Stimulus
        One for each interval.
    block : int
        Counted from 1; 0 for practice.
    level, intensity : float, optional
        In a forced choice, the level of the comparison, and the same on the intensity scale.
    right : int, optional
        The correct answer by the physical stimuli: an interval, from 1, or 1 for yes and 0 for no;
        None where they are equal, or where there is none.
    track : int, optional
        Interleaved staircase, or adjustment, to which it belongs, from 1.
    target : int, optional
        The answer that gets more frequent as the level rises: the right one, or where levels lie on
        both sides of the standard the choice of the comparison as larger.
    catch : bool
        Whether it is a catch trial: reported, and left out of the analysis.
    step : int, optional
        Of an adjustment, from 1.
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
    catch: bool = False
    step: int | None = None

    @property
    def practice(self) -> bool:
        """Whether it is a practice trial, left out of the analysis."""
        return self.block == 0

    @property
    def counts(self) -> bool:
        """Whether it is analysed: no practice and no catch trial."""
        return not (self.practice or self.catch)

    def to_json(self) -> dict[str, Any]:
        """Return a dict of JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> Trial:
        """Return a trial from what `to_json` returned."""
        stimuli = tuple(Stimulus(**s) for s in entry["stimuli"])
        return cls(**{**entry, "stimuli": stimuli})

    def parse_answer(self, answer: Any, texts: Texts | None = None) -> Answer:
        """Return a valid answer in the form that is stored, or raise.

        Raises
        ------
        AsperityError
            The answer is not valid. The message is one line for the participant, in the language of
            the texts.
        """
        texts = texts or read_texts()
        count = len(self.stimuli)
        text = str(answer).strip().lower()
        if self.kind == "number":
            try:
                number = float(text.replace(",", "."))
            except ValueError:
                number = math.nan
            if not (math.isfinite(number) and number > 0.0):
                raise AsperityError(texts("number_wanted"))
            return number
        if self.kind == "order":
            words = answer if isinstance(answer, list) else text.replace(",", " ").split()
            order = [int(word) for word in words if str(word).isdecimal()]
            if sorted(order) != list(range(1, count + 1)) or len(order) != len(words):
                raise AsperityError(texts("order_wanted", count=count))
            return order
        if self.kind == "yes-no":
            valid = {word: 1 for word in ("1", *texts("yes_words").split())}
            valid |= {word: 0 for word in ("0", *texts("no_words").split())}
            why = texts("yes_no_wanted")
        elif self.kind == "adjust":
            valid = {word: step for step, word in ADJUST.items()}
            if type(answer) is int:  # of a button
                valid = {str(step): step for step in ADJUST}
            why = texts("adjust_wanted")
        else:
            valid = {str(i): i for i in range(1, count + 1)}
            why = texts("choice_wanted", choices=texts.choices(count))
        if text not in valid:
            raise AsperityError(why)
        return valid[text]

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


def standing_answers(events: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the answers of a journal that were not taken back, each with how many were before.

    `taken_back` is the number of earlier answers to the same trial that were taken back.
    """
    standing: list[dict[str, Any]] = []
    taken_back: dict[int, int] = {}
    for event in events:
        if event["event"] == "answer":
            number = event["trial"]["number"]
            standing.append({**event, "taken_back": taken_back.get(number, 0)})
        elif event["event"] == "taken_back":
            number = standing.pop()["trial"]["number"]
            taken_back[number] = taken_back.get(number, 0) + 1
    return standing
