"""Adjustment and matching: trials in which a comparison is changed until it equals a standard.

Every change is a trial with its own recordings and its own line in the journal, so that a session
goes on in the middle of an adjustment, and any change can be taken back.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from asperity.psychophysics.design import ExperimentDesign
from asperity.psychophysics.procedures.orders import balanced_orders
from asperity.psychophysics.session.trials import Answer, Trial

_THIRD = 1.0 / 3.0
"""Part of the range, at either end, in which adjustments start."""


def adjustments(
    design: ExperimentDesign, seed: list[int], row: int | None
) -> Generator[Trial, Answer, None]:
    """Yield the steps of all adjustments; is sent the answer to each.

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
