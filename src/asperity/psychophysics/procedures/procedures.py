"""The order of trials: one procedure for each experimental method.

The next trial depends only on the design, the participant, the session number and the answers so
far. Random numbers are seeded from these for each trial, so that a resumed session continues
exactly as it would have without the interruption.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Generator, Iterable

import numpy as np

from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.procedures.questplus import QuestPlus, QuestPlusSettings
from asperity.psychophysics.procedures.staircase import Staircase, StaircaseSettings
from asperity.psychophysics.session.trials import Answer, Trial
from asperity.psychophysics.settings import (
    ConstantSettings,
    MagnitudeSettings,
    PairsSettings,
    RankingSettings,
)
from asperity.psychophysics.stimuli import Stimulus

Trials = Generator[Trial, bool | None, None]
"""Yields trials; is sent whether the answer to each was its target."""


class Procedure:
    """Chooses the trials of a session.

    Parameters
    ----------
    most : int
        Largest number of trials.
    trials : generator of Trial
        Is sent whether the answer to each trial was its target.
    """

    def __init__(self, most: int, trials: Trials) -> None:
        self.most, self._trials = most, trials
        self._next = next(trials, None)

    def next(self) -> Trial | None:
        """Return the next trial, the same one until it is answered; None after the last."""
        return self._next

    def answer(self, trial: Trial, answer: Answer) -> None:
        """Record the answer to that trial."""
        try:
            self._next = self._trials.send(trial.is_target(answer))
        except StopIteration:
            self._next = None


def seeds(design: ExperimentDesign, participant: str, session: int) -> list[int]:
    """Return the seeds of all random numbers of a session."""
    digest = hashlib.sha256(f"{participant}/{session}".encode()).digest()
    return [design.seed, int.from_bytes(digest[:6], "big")]


def procedure(design: ExperimentDesign, participant: str, session: int) -> Procedure:
    """Return the procedure of an experiment for a participant's session."""
    seed, settings = seeds(design, participant, session), design.settings
    rng = np.random.default_rng(seed)
    if isinstance(settings, MagnitudeSettings):
        trials = _magnitudes(design.all_stimuli(), settings, rng)
    elif isinstance(settings, PairsSettings):
        trials = _pairs(design.all_stimuli(), settings, rng)
    elif isinstance(settings, RankingSettings):
        trials = _rankings(design.all_stimuli(), settings, rng)
    else:
        assert design.adaptive is not None
        return Procedure(settings.practice + design.adaptive.most, _forced_choices(design, seed))
    return Procedure(len(trials), _one_by_one(trials))


def _one_by_one(trials: list[Trial]) -> Trials:
    yield from trials  # which have no right answer: what is sent is None


def _magnitudes(
    stimuli: list[Stimulus], settings: MagnitudeSettings, rng: np.random.Generator
) -> list[Trial]:
    """Return blocks of all stimuli, each in a new random order; no stimulus twice in a row."""
    rows: list[tuple[Stimulus, int]] = []
    while len(rows) < settings.practice:  # practice also covers the range of stimuli
        order = rng.permutation(len(stimuli))[: settings.practice - len(rows)]
        rows += [(stimuli[i], 0) for i in order]
    for block in range(1, settings.blocks + 1):
        order = rng.permutation(len(stimuli))
        if rows and len(stimuli) > 1 and rows[-1][0] == stimuli[order[0]]:
            order = np.roll(order, -1)
        rows += [(stimuli[i], block) for i in order]
    return [Trial(n, "number", (s,), block) for n, (s, block) in enumerate(rows, 1)]


def _pairs(
    stimuli: list[Stimulus], settings: PairsSettings, rng: np.random.Generator
) -> list[Trial]:
    """Return all pairs in each block, in random order; the order within a pair alternates."""
    pairs = list(itertools.combinations(stimuli, 2))
    rows = [(pairs[i], 0) for i in rng.integers(0, len(pairs), settings.practice)]
    reversed_order = rng.random(len(pairs)) < 0.5
    for block in range(1, settings.repeats + 1):
        for i in rng.permutation(len(pairs)):
            a, b = pairs[i]
            rows.append(((b, a) if reversed_order[i] else (a, b), block))
        reversed_order = ~reversed_order
    return [Trial(n, "choice", pair, block) for n, (pair, block) in enumerate(rows, 1)]


def _rankings(
    stimuli: list[Stimulus], settings: RankingSettings, rng: np.random.Generator
) -> list[Trial]:
    """Return trials of all stimuli, each in a new random order."""
    blocks = [0] * settings.practice + list(range(1, settings.repeats + 1))
    return [
        Trial(n, "order", tuple(stimuli[i] for i in rng.permutation(len(stimuli))), block)
        for n, block in enumerate(blocks, 1)
    ]


def _forced_choices(design: ExperimentDesign, seed: list[int]) -> Trials:
    """Yield a standard and a comparison in random order, at the level of the adaptive method."""
    settings, adaptive = design.forced_choice, design.adaptive
    # Seeded for each trial, so that random numbers do not depend on earlier answers.
    numbered = ((n, np.random.default_rng([*seed, n])) for n in itertools.count(1))
    for number, rng in itertools.islice(numbered, settings.practice):
        yield _forced_choice(design, number, settings.high, None, 0, rng)
    if isinstance(adaptive, StaircaseSettings):
        yield from _staircase_trials(design, numbered)
    elif isinstance(adaptive, QuestPlusSettings):
        yield from _quest_trials(design, adaptive, numbered)
    elif isinstance(adaptive, ConstantSettings):
        levels, order = np.array(adaptive.levels), np.random.default_rng(seed)
        # Each block holds each level once, so that every level is spread over the session.
        blocks = [order.permutation(levels) for _ in range(adaptive.repeats)]
        for level, (number, rng) in zip(np.concatenate(blocks), numbered, strict=False):
            level = settings.level_of(settings.intensity(float(level)))
            yield _forced_choice(design, number, level, None, 1, rng)


Numbered = Iterable[tuple[int, np.random.Generator]]


def _staircase_trials(design: ExperimentDesign, numbered: Numbered) -> Trials:
    tracks = staircases(design)
    for number, rng in numbered:
        live = [i for i, track in enumerate(tracks) if not track.is_over]
        if not live:
            return
        # The track with the fewest answers, so that all tracks end at about the same time.
        fewest = min(tracks[i].done for i in live)
        behind = [i for i in live if tracks[i].done == fewest]
        i = behind[int(rng.integers(len(behind)))]
        level = design.forced_choice.level_of(tracks[i].intensity)
        right = yield _forced_choice(design, number, level, i + 1, 1, rng)
        tracks[i].answer(bool(right))


def _quest_trials(
    design: ExperimentDesign, settings: QuestPlusSettings, numbered: Numbered
) -> Trials:
    quest = quest_plus(design)
    for number, rng in itertools.islice(numbered, settings.trials):
        level = design.forced_choice.level_of(quest.next())
        trial = _forced_choice(design, number, level, None, 1, rng)
        right = yield trial
        assert trial.intensity is not None
        quest.answer(trial.intensity, bool(right))
        if quest.estimate()["threshold"][1] < settings.until:
            return


def _forced_choice(
    design: ExperimentDesign, number: int, level: float, track: int | None, block: int,
    rng: np.random.Generator,
) -> Trial:  # fmt: skip
    settings, stimuli = design.forced_choice, design.stimuli
    values = [settings.standard, settings.comparison(level)]
    # The comparison is the second interval, or the first if the order is reversed.
    compared = 2
    if rng.random() < 0.5:
        values, compared = values[::-1], 1
    more = settings.has_more(*values)
    right = None if more is None else 1 if more else 2
    target = compared if settings.comparison_is_target else 3 - compared
    return Trial(
        number, "choice", tuple(map(stimuli.level, values)), block, level,
        settings.intensity(level), right, track, target,
    )  # fmt: skip


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
