"""Trials that do not depend on the answers: magnitudes, pairs and rankings."""

from __future__ import annotations

import itertools

import numpy as np

from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.procedures.orders import balanced_orders
from asperity.psychophysics.session.trials import Trial
from asperity.psychophysics.settings import MagnitudeSettings, PairsSettings, RankingSettings
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
