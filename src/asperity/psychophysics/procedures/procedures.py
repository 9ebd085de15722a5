"""The order of trials: one procedure for each experimental method.

The next trial depends only on the design, the participant, the session number and the answers so
far. Random numbers are seeded from these for each trial, so that a resumed session continues
exactly as it would have without the interruption.
"""

from __future__ import annotations

import hashlib
import itertools
from typing import Protocol

import numpy as np

from asperity.psychophysics.design import (
    ConstantSettings,
    ExperimentDesign,
    MagnitudeSettings,
    PairsSettings,
    RankingSettings,
)
from asperity.psychophysics.procedures.questplus import QuestPlus, QuestPlusSettings
from asperity.psychophysics.procedures.staircase import Staircase, StaircaseSettings
from asperity.psychophysics.session.trials import Answer, Trial
from asperity.psychophysics.stimuli import Stimulus


class Procedure(Protocol):
    """Chooses the trials of a session."""

    @property
    def most(self) -> int:
        """Largest number of trials."""

    def next(self) -> Trial | None:
        """Return the next trial, the same one until it is answered; None after the last."""

    def answer(self, trial: Trial, answer: Answer) -> None:
        """Record the answer to that trial."""


def seeds(design: ExperimentDesign, participant: str, session: int) -> list[int]:
    """Return the seeds of all random numbers of a session."""
    digest = hashlib.sha256(f"{participant}/{session}".encode()).digest()
    return [design.seed, int.from_bytes(digest[:6], "big")]


def procedure(design: ExperimentDesign, participant: str, session: int) -> Procedure:
    """Return the procedure of an experiment for a participant's session."""
    seed = seeds(design, participant, session)
    settings = design.settings
    if isinstance(settings, MagnitudeSettings):
        return _Listed(_magnitude(design, settings, seed))
    if isinstance(settings, PairsSettings):
        return _Listed(_pairs(design, settings, seed))
    if isinstance(settings, RankingSettings):
        return _Listed(_rankings(design, settings, seed))
    return ForcedChoice(design, seed)


class _Listed:
    """Trials in a fixed order that does not depend on the answers."""

    def __init__(self, trials: list[Trial]) -> None:
        self._trials = trials
        self._done = 0

    @property
    def most(self) -> int:
        return len(self._trials)

    def next(self) -> Trial | None:
        return self._trials[self._done] if self._done < len(self._trials) else None

    def answer(self, trial: Trial, answer: Answer) -> None:
        del trial, answer
        self._done += 1


def _magnitude(
    design: ExperimentDesign, settings: MagnitudeSettings, seed: list[int]
) -> list[Trial]:
    """Return blocks of all stimuli, each in a new random order; no stimulus twice in a row."""
    rng, stimuli = np.random.default_rng(seed), design.all_stimuli()
    rows: list[tuple[Stimulus, int]] = []
    left = settings.practice
    while left > 0:  # practice also covers the range of stimuli
        for i in rng.permutation(len(stimuli))[:left]:
            rows.append((stimuli[i], 0))
        left = settings.practice - len(rows)
    for block in range(1, settings.blocks + 1):
        order = rng.permutation(len(stimuli))
        if rows and len(stimuli) > 1 and rows[-1][0] == stimuli[order[0]]:
            order = np.roll(order, -1)
        rows += [(stimuli[i], block) for i in order]
    return [Trial(n, "number", (s,), block) for n, (s, block) in enumerate(rows, 1)]


def _pairs(design: ExperimentDesign, settings: PairsSettings, seed: list[int]) -> list[Trial]:
    """Return all pairs in each block, in random order; the order within a pair alternates."""
    rng, stimuli = np.random.default_rng(seed), design.all_stimuli()
    pairs = list(itertools.combinations(stimuli, 2))
    rows: list[tuple[tuple[Stimulus, Stimulus], int]] = []
    for i in rng.integers(0, len(pairs), settings.practice):
        rows.append((pairs[i], 0))
    reversed_order = rng.random(len(pairs)) < 0.5
    for block in range(1, settings.repeats + 1):
        for i in rng.permutation(len(pairs)):
            a, b = pairs[i]
            rows.append(((b, a) if reversed_order[i] else (a, b), block))
        reversed_order = ~reversed_order
    return [Trial(n, "choice", pair, block) for n, (pair, block) in enumerate(rows, 1)]


def _rankings(design: ExperimentDesign, settings: RankingSettings, seed: list[int]) -> list[Trial]:
    """Return trials of all stimuli, each in a new random order."""
    rng, stimuli = np.random.default_rng(seed), design.all_stimuli()
    blocks = [0] * settings.practice + list(range(1, settings.repeats + 1))
    return [
        Trial(n, "order", tuple(stimuli[i] for i in rng.permutation(len(stimuli))), block)
        for n, block in enumerate(blocks, 1)
    ]


class ForcedChoice:
    """A standard and a comparison in random order, at the level of the adaptive method."""

    def __init__(self, design: ExperimentDesign, seed: list[int]) -> None:
        self._design, self._seed = design, seed
        self._settings = design.forced_choice
        self._levels = _levels(design, seed)
        self._done = 0
        self._next: Trial | None = None

    @property
    def most(self) -> int:
        """Largest number of trials."""
        return self._settings.practice + self._levels.most

    def next(self) -> Trial | None:
        """Return the trial that comes next."""
        if self._next is None:
            number = self._done + 1
            rng = np.random.default_rng([*self._seed, number])
            if number <= self._settings.practice:
                self._next = self._trial(number, self._settings.high, None, 0, rng)
            elif not self._levels.is_over:
                intensity, track = self._levels.next(rng)
                self._next = self._trial(number, self._settings.level_of(intensity), track, 1, rng)
        return self._next

    def answer(self, trial: Trial, answer: Answer) -> None:
        """Update the adaptive method, except after a practice trial."""
        if not trial.practice:
            assert trial.intensity is not None
            self._levels.answer(trial.intensity, trial.track, answer == trial.right)
        self._done += 1
        self._next = None

    def _trial(
        self, number: int, level: float, track: int | None, block: int, rng: np.random.Generator
    ) -> Trial:
        settings, stimuli = self._settings, self._design.stimuli
        pair = [stimuli.level(settings.standard), stimuli.level(settings.comparison(level))]
        reversed_order = bool(rng.random() < 0.5)
        # The comparison is the second interval, or the first if the order is reversed.
        right = 2 if settings.comparison_is_right else 1
        if reversed_order:
            pair, right = pair[::-1], 3 - right
        return Trial(
            number, "choice", tuple(pair), block, level, settings.intensity(level), right, track
        )


class _Levels(Protocol):
    """Chooses the level of the next trial."""

    @property
    def most(self) -> int: ...

    @property
    def is_over(self) -> bool: ...

    def next(self, rng: np.random.Generator) -> tuple[float, int | None]: ...

    def answer(self, intensity: float, track: int | None, right: bool) -> None: ...


def _levels(design: ExperimentDesign, seed: list[int]) -> _Levels:
    adaptive = design.adaptive
    if isinstance(adaptive, StaircaseSettings):
        return _Staircases(staircases(design))
    if isinstance(adaptive, QuestPlusSettings):
        return _Quest(quest_plus(design), adaptive)
    assert isinstance(adaptive, ConstantSettings)
    return _Constant(design, adaptive, seed)


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
        np.array(adaptive.widths), np.array(adaptive.lapses), 0.5, adaptive.function,
    )  # fmt: skip


class _Staircases:
    def __init__(self, tracks: list[Staircase]) -> None:
        self._tracks = tracks

    @property
    def most(self) -> int:
        return sum(track.trials for track in self._tracks)

    @property
    def is_over(self) -> bool:
        return all(track.is_over for track in self._tracks)

    def next(self, rng: np.random.Generator) -> tuple[float, int | None]:
        live = [i for i, track in enumerate(self._tracks) if not track.is_over]
        # The track with the fewest answers, so that all tracks end at about the same time.
        fewest = min(self._tracks[i].done for i in live)
        behind = [i for i in live if self._tracks[i].done == fewest]
        i = behind[int(rng.integers(len(behind)))]
        return self._tracks[i].intensity, i + 1

    def answer(self, intensity: float, track: int | None, right: bool) -> None:
        del intensity
        assert track is not None
        self._tracks[track - 1].answer(right)


class _Quest:
    def __init__(self, quest: QuestPlus, settings: QuestPlusSettings) -> None:
        self._quest, self._settings = quest, settings

    @property
    def most(self) -> int:
        return self._settings.trials

    @property
    def is_over(self) -> bool:
        sure = self._quest.done > 0 and (
            self._quest.estimate()["threshold"][1] < self._settings.until
        )
        return sure or self._quest.done >= self._settings.trials

    def next(self, rng: np.random.Generator) -> tuple[float, int | None]:
        del rng
        return self._quest.next(), None

    def answer(self, intensity: float, track: int | None, right: bool) -> None:
        del track
        self._quest.answer(intensity, right)


class _Constant:
    def __init__(
        self, design: ExperimentDesign, settings: ConstantSettings, seed: list[int]
    ) -> None:
        rng = np.random.default_rng(seed)
        levels = np.array(settings.levels)
        # Each block holds each level once, so that every level is spread over the session.
        order = [rng.permutation(levels) for _ in range(settings.repeats)]
        self._order = [design.forced_choice.intensity(float(v)) for v in np.concatenate(order)]
        self._done = 0

    @property
    def most(self) -> int:
        return len(self._order)

    @property
    def is_over(self) -> bool:
        return self._done >= len(self._order)

    def next(self, rng: np.random.Generator) -> tuple[float, int | None]:
        del rng
        return self._order[self._done], None

    def answer(self, intensity: float, track: int | None, right: bool) -> None:
        del intensity, track, right
        self._done += 1
