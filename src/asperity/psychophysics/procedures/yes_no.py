"""Yes or no: one interval, with the signal at one of some levels or without it."""

from __future__ import annotations

import itertools
import math

import numpy as np

from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.session.trials import Trial
from asperity.psychophysics.settings import YesNoSettings

_RUN = 12
"""Least number of trials within which levels and trials without signal are mixed."""


def yes_no_trials(design: ExperimentDesign, seed: list[int]) -> list[Trial]:
    """Return all trials; levels and trials without the signal are spread over the session."""
    settings = design.settings
    assert isinstance(settings, YesNoSettings)
    rng = np.random.default_rng(seed)
    practice: list[float | None] = [settings.highest, None] * math.ceil(settings.practice / 2)
    rows = [(practice[i], 0) for i in rng.permutation(settings.practice)]
    signals, without = settings.repeats * len(settings.levels), settings.trials_without
    runs = max(1, (signals + without) // _RUN)
    # Each run has its share of every level and of the trials without the signal.
    shares = [_shares(settings.repeats, runs) for _ in settings.levels] + [_shares(without, runs)]
    for share in zip(*shares, strict=True):
        levels: list[float | None] = [*settings.levels, None]
        run = [level for level, count in zip(levels, share, strict=True) for _ in range(count)]
        rows += [(run[i], 1) for i in rng.permutation(len(run))]
    return [yes_no_trial(design, n, level, block) for n, (level, block) in enumerate(rows, 1)]


def _shares(count: int, runs: int) -> list[int]:
    """Return how many of so many trials are in each run: as even as can be."""
    ends = [round(count * i / runs) for i in range(runs + 1)]
    return [end - begin for begin, end in itertools.pairwise(ends)]


def yes_no_trial(design: ExperimentDesign, number: int, level: float | None, block: int) -> Trial:
    """Return a trial at a level of the signal, or without it (None)."""
    settings = design.settings
    assert isinstance(settings, YesNoSettings)
    value = settings.standard if level is None else settings.comparison(level)
    right = int(value != settings.standard)
    return Trial(
        number, "yes-no", (design.stimuli.level(value),), block, level, level, right, target=1
    )


def yes_no_catch(design: ExperimentDesign, number: int) -> Trial:
    """Return a trial with a plain signal."""
    settings = design.settings
    assert isinstance(settings, YesNoSettings)
    level = settings.highest if design.catch.level is None else design.catch.level
    return yes_no_trial(design, number, level, 1)
