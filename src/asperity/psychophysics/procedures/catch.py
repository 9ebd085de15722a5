"""Catch trials among the trials of any procedure, which does not see them."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace

import numpy as np

from asperity.psychophysics.session.trials import Answer, Trial

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
