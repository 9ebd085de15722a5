"""The right answer to a trial, from the values of the stimuli that it presents and from no more."""

from __future__ import annotations

from collections.abc import Sequence

from asperity.psychophysics.settings import ForcedChoiceSettings


def interval_with_most(values: Sequence[float], settings: ForcedChoiceSettings) -> int | None:
    """Return the interval, from 1, whose value has more than all others; None if none has."""
    for i, value in enumerate(values):
        others = [*values[:i], *values[i + 1 :]]
        if all(settings.has_more(value, other) for other in others):
            return i + 1
    return None


def odd_interval(values: Sequence[float]) -> int | None:
    """Return the interval, from 1, that differs from two equal ones; None if none does."""
    for i, value in enumerate(values):
        others = [*values[:i], *values[i + 1 :]]
        if len(set(others)) == 1 and value not in others:
            return i + 1
    return None
