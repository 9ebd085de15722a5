"""Trials of magnitudes, pairs, rankings, yes or no, and the steps of adjustments."""

from __future__ import annotations

import itertools
import math
from collections.abc import Generator

import numpy as np

from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.procedures.orders import balanced_orders
from asperity.psychophysics.session.trials import Answer, Trial
from asperity.psychophysics.settings import (
    MagnitudeSettings,
    PairsSettings,
    RankingSettings,
    YesNoSettings,
)
from asperity.psychophysics.stimuli import Stimulus


def fixed_trials(design: ExperimentDesign, seed: list[int], row: int | None) -> list[Trial]:
    """Return all trials of a session.

    Parameters
    ----------
    design : ExperimentDesign
        Of magnitudes, pairs or rankings.
    seed : list of int
        Of what is drawn.
    row : int or None
        First row of orders that are balanced over participants; None: orders are drawn.
    """
    stimuli, settings = design.all_stimuli(), design.settings
    rng = np.random.default_rng(seed)
    if isinstance(settings, MagnitudeSettings):
        orders = _orders(design, len(stimuli), settings.blocks, row)
        return _magnitudes(stimuli, settings, orders, rng)
    if isinstance(settings, PairsSettings):
        pairs = list(itertools.combinations(stimuli, 2))
        orders = _orders(design, len(pairs), settings.repeats, row)
        return _pairs(pairs, settings, orders, row, rng)
    assert isinstance(settings, RankingSettings)
    orders = _orders(design, len(stimuli), settings.repeats, row)
    return _rankings(stimuli, settings, orders, rng)


def _orders(
    design: ExperimentDesign, count: int, blocks: int, row: int | None
) -> list[list[int]] | None:
    return None if row is None else balanced_orders(count, blocks, row, [design.seed])


def _magnitudes(
    stimuli: list[Stimulus], settings: MagnitudeSettings, orders: list[list[int]] | None,
    rng: np.random.Generator,
) -> list[Trial]:  # fmt: skip
    """Return blocks of all stimuli, each in a new order; if drawn, no stimulus twice in a row."""
    rows: list[tuple[Stimulus, int]] = []
    while len(rows) < settings.practice:  # practice also covers the range of stimuli
        order = rng.permutation(len(stimuli))[: settings.practice - len(rows)]
        rows += [(stimuli[i], 0) for i in order]
    for block in range(1, settings.blocks + 1):
        if orders is None:
            order = rng.permutation(len(stimuli))
            if rows and len(stimuli) > 1 and rows[-1][0] == stimuli[order[0]]:
                order = np.roll(order, -1)
        else:
            order = np.array(orders[block - 1])
        rows += [(stimuli[i], block) for i in order]
    return [Trial(n, "number", (s,), block) for n, (s, block) in enumerate(rows, 1)]


def _pairs(
    pairs: list[tuple[Stimulus, Stimulus]], settings: PairsSettings,
    orders: list[list[int]] | None, row: int | None, rng: np.random.Generator,
) -> list[Trial]:  # fmt: skip
    """Return all pairs in each block; the order within a pair alternates from block to block."""
    rows = [(pairs[i], 0) for i in rng.integers(0, len(pairs), settings.practice)]
    reversed_order = rng.random(len(pairs)) < 0.5
    if row is not None:  # two neighbouring participants have opposite orders
        reversed_order = (np.arange(len(pairs)) + row) % 2 == 0
    for block in range(1, settings.repeats + 1):
        for i in rng.permutation(len(pairs)) if orders is None else orders[block - 1]:
            a, b = pairs[i]
            rows.append(((b, a) if reversed_order[i] else (a, b), block))
        reversed_order = ~reversed_order
    return [Trial(n, "choice", pair, block) for n, (pair, block) in enumerate(rows, 1)]


def _rankings(
    stimuli: list[Stimulus], settings: RankingSettings, orders: list[list[int]] | None,
    rng: np.random.Generator,
) -> list[Trial]:  # fmt: skip
    """Return trials of all stimuli, each in a new order."""
    blocks = [0] * settings.practice + list(range(1, settings.repeats + 1))
    trials = []
    for n, block in enumerate(blocks, 1):
        order = rng.permutation(len(stimuli)).tolist()
        if orders is not None and block:
            order = orders[block - 1]
        trials.append(Trial(n, "order", tuple(stimuli[i] for i in order), block))
    return trials


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


_THIRD = 1.0 / 3.0
"""Part of the range, at either end, in which adjustments start."""


def adjustments(
    design: ExperimentDesign, seed: list[int], row: int | None
) -> Generator[Trial, Answer, None]:
    """Yield the steps of all adjustments; is sent the answer to each.

    Every change is a trial with its own recordings and its own line in the journal, so that a
    session goes on in the middle of an adjustment, and any change can be taken back.

    Parameters
    ----------
    design : ExperimentDesign
        Of an adjustment or a matching.
    seed : list of int
        Of what is drawn.
    row : int or None
        First row of orders that are balanced over participants; None: orders are drawn.
    """
    settings, standards = design.matching, design.standards()
    rng, count = np.random.default_rng(seed), len(standards)
    plan = [(int(rng.integers(count)), i % 2, 0) for i in range(settings.practice)]
    orders = None
    first = rng.integers(2, size=count)
    if row is not None:
        orders = balanced_orders(count, settings.repeats, row, [design.seed])
        first = (np.arange(count) + row) % 2
    for block in range(settings.repeats):
        order = rng.permutation(count) if orders is None else orders[block]
        plan += [(int(i), int(first[i] + block) % 2, block + 1) for i in order]
    low, high = settings.intensity(settings.low), settings.intensity(settings.high)
    number = 0
    for track, (which, side, block) in enumerate(plan, 1):
        part = _THIRD * rng.random() + (1.0 - _THIRD) * side
        value = settings.value_of(low + part * (high - low))
        for step in range(1, settings.steps + 1):
            number += 1
            answer = yield Trial(
                number, "adjust", (standards[which], design.stimuli.level(value)), block, value,
                settings.intensity(value), track=track, step=step,
            )  # fmt: skip
            assert isinstance(answer, int)
            if answer == 0:
                break
            value = settings.changed(value, answer)


def ends_adjustment(design: ExperimentDesign, trial: Trial, answer: Answer) -> bool:
    """Return whether an answer ends its adjustment: it is settled, or given up."""
    return answer == 0 or trial.step == design.matching.steps
