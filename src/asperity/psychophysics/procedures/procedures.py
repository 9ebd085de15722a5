"""The order of trials: one procedure for each experimental method.

The next trial depends only on the design, the participant, the session number and the answers so
far. Random numbers are seeded from these for each trial, so that a resumed session continues
exactly as it would have without the interruption.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.procedures.fixed import (
    adjustments,
    ends_adjustment,
    fixed_trials,
    yes_no_catch,
    yes_no_trials,
)
from asperity.psychophysics.procedures.orders import balanced_positions, participant_number
from asperity.psychophysics.procedures.questplus import QuestPlus, QuestPlusSettings
from asperity.psychophysics.procedures.staircase import Staircase, StaircaseSettings
from asperity.psychophysics.session.trials import Answer, Trial
from asperity.psychophysics.settings import (
    ConstantSettings,
    ForcedChoiceSettings,
    OddOneOutSettings,
    YesNoSettings,
)


class Procedure:
    """Chooses the trials of a session.

    Parameters
    ----------
    most : int
        Largest number of trials, or of adjustments.
    trials : generator of Trial
        Is sent the answer to each.
    ends : callable, optional
        Whether an answer to a trial counts towards `most`. Default: all do.
    """

    def __init__(
        self, most: int, trials: Trials,
        ends: Callable[[Trial, Answer], bool] = lambda trial, answer: True,
    ) -> None:  # fmt: skip
        self.most, self._trials, self._ends = most, trials, ends
        self.done = 0
        """Trials answered, or adjustments ended."""
        self._next = next(trials, None)

    def next(self) -> Trial | None:
        """Return the next trial, the same one until it is answered; None after the last."""
        return self._next

    def answer(self, trial: Trial, answer: Answer) -> None:
        """Record the answer to that trial."""
        self.done += self._ends(trial, answer)
        try:
            self._next = self._trials.send(answer)
        except StopIteration:
            self._next = None


def seeds(design: ExperimentDesign, participant: str, session: int) -> list[int]:
    """Return the seeds of all random numbers of a session."""
    digest = hashlib.sha256(f"{participant}/{session}".encode()).digest()
    return [design.seed, int.from_bytes(digest[:6], "big")]


def procedure(design: ExperimentDesign, participant: str, session: int) -> Procedure:
    """Return the procedure of an experiment for a participant's session.

    Raises
    ------
    AsperityError
        Orders are balanced over participants, and the code has no number.
    """
    seed, settings = seeds(design, participant, session), design.settings
    number = participant_number(participant) if design.session.balanced else None
    row = None if number is None else number + session - 1
    if design.kind == "adjust":
        matching = design.matching
        most = matching.practice + matching.repeats * len(design.standards())
        return Procedure(most, adjustments(design, seed, row), partial(ends_adjustment, design))
    if isinstance(settings, YesNoSettings):
        listed = yes_no_trials(design, seed)
        return _with_catch(
            design, len(listed), settings.practice, _one_by_one(listed), seed,
            lambda number, _: yes_no_catch(design, number),
        )  # fmt: skip
    if design.adaptive is None:
        listed = fixed_trials(design, seed, row)
        return Procedure(len(listed), _one_by_one(listed))
    chosen, most = design.forced_choice, design.adaptive.most
    positions = None
    if number is not None:
        positions = balanced_positions(
            chosen.intervals, chosen.practice + most, number, [design.seed, session]
        )
    choices = Choices(design, positions)
    level = chosen.high if design.catch.level is None else design.catch.level
    return _with_catch(
        design, chosen.practice + most, chosen.practice, _forced_choices(choices, seed), seed,
        lambda number, rng: choices.drawn(number, level, None, 1, rng),
    )  # fmt: skip


def _with_catch(
    design: ExperimentDesign, most: int, practice: int, trials: Trials, seed: list[int],
    make: Callable[[int, np.random.Generator], Trial],
) -> Procedure:  # fmt: skip
    """Return a procedure with the catch trials of its design."""
    every = design.catch.every
    if not every:
        return Procedure(most, trials)
    most += -(-(most - practice) // every)
    return Procedure(most, with_catch_trials(trials, every, seed, make))


def _one_by_one(trials: list[Trial]) -> Trials:
    # Not `yield from`: a list cannot be sent the answers.
    for trial in trials:  # noqa: UP028
        yield trial


@dataclass(frozen=True)
class Choices:
    """Trials of a standard and a comparison, in two or three intervals.

    Parameters
    ----------
    design : ExperimentDesign
        Of a method of `CHOICES`.
    positions : list of int, optional
        The interval of the comparison in each trial, from 0. Default: it is drawn.
    """

    design: ExperimentDesign
    positions: list[int] | None = None

    def trial(
        self, number: int, level: float, track: int | None, block: int, rng: np.random.Generator
    ) -> Trial:
        """Return the trial of a number at a level."""
        if self.positions is None:
            return self.drawn(number, level, track, block, rng)
        return self._at(self.positions[number - 1], number, level, track, block, rng)

    def drawn(
        self, number: int, level: float, track: int | None, block: int, rng: np.random.Generator
    ) -> Trial:
        """Return a trial whose comparison is in an interval that is drawn."""
        intervals = self.design.forced_choice.intervals
        # Of two intervals the comparison is the second, or the first if the order is reversed.
        place = int(rng.random() >= 0.5) if intervals == 2 else int(rng.integers(intervals))
        return self._at(place, number, level, track, block, rng)

    def _at(
        self, place: int, number: int, level: float, track: int | None, block: int,
        rng: np.random.Generator,
    ) -> Trial:  # fmt: skip
        settings, stimuli = self.design.forced_choice, self.design.stimuli
        single, others = settings.comparison(level), settings.standard
        odd = isinstance(settings, OddOneOutSettings)
        if (
            isinstance(settings, OddOneOutSettings)
            and settings.odd == "either"
            and (rng.random() < 0.5)
        ):
            single, others = others, single
        values = [others] * settings.intervals
        values[place] = single
        right = odd_interval(values) if odd else interval_with_most(values, settings)
        target = place + 1 if odd or settings.comparison_is_target else 2 - place
        return Trial(
            number, "choice", tuple(map(stimuli.level, values)), block, level,
            settings.intensity(level), right, track, target,
        )  # fmt: skip


def _forced_choices(choices: Choices, seed: list[int]) -> Trials:
    """Yield trials at the levels of the adaptive method."""
    settings, adaptive = choices.design.forced_choice, choices.design.adaptive
    # Seeded for each trial, so that random numbers do not depend on earlier answers.
    numbered = ((n, np.random.default_rng([*seed, n])) for n in itertools.count(1))
    for number, rng in itertools.islice(numbered, settings.practice):
        yield choices.trial(number, settings.high, None, 0, rng)
    if isinstance(adaptive, StaircaseSettings):
        yield from _staircase_trials(choices, numbered)
    elif isinstance(adaptive, QuestPlusSettings):
        yield from _quest_trials(choices, adaptive, numbered)
    elif isinstance(adaptive, ConstantSettings):
        levels, order = np.array(adaptive.levels), np.random.default_rng(seed)
        # Each block holds each level once, so that every level is spread over the session.
        blocks = [order.permutation(levels) for _ in range(adaptive.repeats)]
        for level, (number, rng) in zip(np.concatenate(blocks), numbered, strict=False):
            level = settings.level_of(settings.intensity(float(level)))
            yield choices.trial(number, level, None, 1, rng)


Numbered = Iterable[tuple[int, np.random.Generator]]


def _staircase_trials(choices: Choices, numbered: Numbered) -> Trials:
    tracks = staircases(choices.design)
    for number, rng in numbered:
        live = [i for i, track in enumerate(tracks) if not track.is_over]
        if not live:
            return
        # The track with the fewest answers, so that all tracks end at about the same time.
        fewest = min(tracks[i].done for i in live)
        behind = [i for i in live if tracks[i].done == fewest]
        i = behind[int(rng.integers(len(behind)))]
        level = choices.design.forced_choice.level_of(tracks[i].intensity)
        trial = choices.trial(number, level, i + 1, 1, rng)
        answer = yield trial
        tracks[i].answer(bool(trial.is_target(answer)))


def _quest_trials(choices: Choices, settings: QuestPlusSettings, numbered: Numbered) -> Trials:
    quest = quest_plus(choices.design)
    for number, rng in itertools.islice(numbered, settings.trials):
        level = choices.design.forced_choice.level_of(quest.next())
        trial = choices.trial(number, level, None, 1, rng)
        answer = yield trial
        assert trial.intensity is not None
        quest.answer(trial.intensity, bool(trial.is_target(answer)))
        if quest.estimate()["threshold"][1] < settings.until:
            return


def staircases(design: ExperimentDesign) -> list[Staircase]:
    """Return the staircase tracks of an experiment in their initial state."""
    settings, adaptive = design.forced_choice, design.adaptive
    assert isinstance(adaptive, StaircaseSettings)
    return [
        Staircase(
            settings.intensity(start),
            tuple(map(settings.intensity, adaptive.steps)),  # a factor as its logarithm
            adaptive.down, adaptive.up_ratio, adaptive.reversals, adaptive.trials,
            settings.intensity(settings.low), settings.intensity(settings.high),
        )
        for start in adaptive.start
    ]  # fmt: skip


def quest_plus(design: ExperimentDesign) -> QuestPlus:
    """Return the QUEST+ procedure of an experiment in its initial state."""
    settings, adaptive = design.forced_choice, design.adaptive
    assert isinstance(adaptive, QuestPlusSettings)
    low, high = settings.intensity(settings.low), settings.intensity(settings.high)
    return QuestPlus(
        np.linspace(low, high, adaptive.levels), np.linspace(low, high, adaptive.thresholds),
        np.array(adaptive.widths), np.array(adaptive.lapses), settings.guess, adaptive.function,
    )  # fmt: skip


def interval_with_most(values: Sequence[float], settings: ForcedChoiceSettings) -> int | None:
    """Return the interval, from 1, whose value has more than all others; None if none has."""
    return next((
        i for i, (value, others) in enumerate(_each_and_others(values), 1)
        if all(settings.has_more(value, other) for other in others)
    ), None)  # fmt: skip


def _each_and_others(values: Sequence[float]) -> Iterator[tuple[float, list[float]]]:
    return ((value, [*values[:i], *values[i + 1 :]]) for i, value in enumerate(values))


def odd_interval(values: Sequence[float]) -> int | None:
    """Return the interval, from 1, that differs from two equal ones; None if none does."""
    return next((
        i for i, (value, others) in enumerate(_each_and_others(values), 1)
        if len(set(others)) == 1 and value not in others
    ), None)  # fmt: skip


Trials = Generator[Trial, Answer, None]
"""Yields trials; is sent the answer to each."""
_STREAM = 0xCA7C
"""Separates the random numbers of catch trials from those of the procedure."""


def with_catch_trials(
    trials: Trials, every: int, seed: list[int],
    make: Callable[[int, np.random.Generator], Trial],
) -> Trials:  # fmt: skip
    """Yield trials with a catch trial before a random one of every so many; numbered anew.

    Parameters
    ----------
    trials : generator of Trial
        Practice trials stay without.
    every : int
        1 or more.
    seed : list of int
    make : callable
        Returns the catch trial of a number, from random numbers.
    """
    rng, number, since = np.random.default_rng([*seed, _STREAM]), 0, 0
    place = int(rng.integers(every))
    trial = next(trials, None)
    while trial is not None:
        if not trial.practice:
            if since == place:
                number += 1
                yield replace(make(number, rng), catch=True)
            since += 1
            if since == every:
                since, place = 0, int(rng.integers(every))
        number += 1
        answer = yield replace(trial, number=number)
        try:
            trial = trials.send(answer)
        except StopIteration:
            return
