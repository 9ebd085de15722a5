"""The parts of explorations that stay the same, of which each becomes a model or a part of one.

Every exploration leaves one at least, or is named with the reason why it cannot.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from asperity._core.arrays import Array, Mask
from asperity.vibrotactile.periods import Passage
from asperity.vibrotactile.segments import cuts
from asperity.vibrotactile.signals import Exploration, true_stretches

_BLOCK = 0.02
"""Cuts fall on multiples of this [s]."""
_SEGMENT_ORDER = 8
"""Of the AR processes that tell stretches apart."""
_SLOWEST = 1e-3
"""Below this speed the tool rests [m/s]."""
_SPREAD = 0.3
"""How far speed and force may vary within a stretch, as deviation over mean."""


class Stretch(NamedTuple):
    """A part of an exploration that stays the same."""

    exploration: Exploration
    begin: int
    end: int
    speed: float
    """Mean [m/s]."""
    force: float
    """Mean [N]."""
    vibration: Array
    """Without its mean [m/s^2]."""


class Division(NamedTuple):
    """The stretches of an exploration."""

    stretches: list[Stretch]
    dropped: int
    """Left out because speed or force changed too much within them."""
    lost: str
    """Why there is no stretch; empty if there is one."""


def sliding(exploration: Exploration, shortest: float) -> Mask:
    """Return where the tool slides (n,): in motion and in contact.

    A tool that hops from crest to crest slides: contact lost for less than `shortest` [s], the
    length of a stretch, is the texture's doing. Only a longer loss ends a slide.
    """
    touching = exploration.touching.copy()
    for begin, end in zip(*true_stretches(~touching), strict=True):
        inside = begin > 0 and end < touching.size
        if inside and end - begin < int(shortest * exploration.rate):
            touching[begin:end] = True
    return np.asarray(touching & (exploration.speed > _SLOWEST))


def stretches_of(exploration: Exploration, shortest: float, longest: float) -> Division:
    """Return the stretches of an exploration, of `shortest` to `longest` [s]."""
    rate, found, dropped = exploration.rate, [], 0
    least = int(shortest * rate)
    slides = list(zip(*true_stretches(sliding(exploration, shortest)), strict=True))
    spreads = []
    for begin, end in slides:
        if end - begin < least:
            continue
        places = cuts(
            exploration.vibration[begin:end], order=_SEGMENT_ORDER, block=round(_BLOCK * rate),
            shortest=least, longest=int(longest * rate),
        )  # fmt: skip
        for first, last in pairwise(places):
            stretch = _stretch(exploration, int(begin) + first, int(begin) + last)
            spread = _spread(stretch, least)
            spreads.append(max(spread))
            if max(spread) > _SPREAD:
                dropped += 1
            else:
                found.append(stretch)
    if found:
        return Division(found, dropped, "")
    if spreads:
        return Division([], dropped, f"speed or force vary by {100 * min(spreads):.0f} % or more "
                     f"in every stretch; valid: {100 * _SPREAD:.0f} % or less")  # fmt: skip
    longest_slide = max((int(end - begin) for begin, end in slides), default=0) / rate
    return Division([], 0, f"the tool slides in contact for {longest_slide:.3g} s at most; valid: "
                 f"{shortest:g} s or more")  # fmt: skip


def _stretch(exploration: Exploration, begin: int, end: int) -> Stretch:
    part = exploration.vibration[begin:end]
    speed, force = exploration.speed[begin:end], exploration.force[begin:end]
    return Stretch(
        exploration, begin, end, float(speed.mean()), float(force.mean()), part - part.mean()
    )


def _spread(stretch: Stretch, shortest: int) -> tuple[float, float]:
    """Return deviation over mean of speed and of force.

    Of the force, its mean over `shortest` samples counts: on coarse or stiff relief the normal
    force follows the texture, slower than 20 Hz at low speed, and that is no change of the hand's.
    """
    cut = slice(stretch.begin, stretch.end)
    speed = stretch.exploration.speed[cut]
    force = uniform_filter1d(stretch.exploration.force[cut], shortest, mode="nearest")
    return (
        float(speed.std()) / max(stretch.speed, 1e-300),
        float(force.std()) / max(stretch.force, 1e-300),
    )


def joined(stretches: Sequence[Stretch]) -> list[Passage]:
    """Return stretches as runs over the travelled distance; adjacent ones are one run."""
    ordered = sorted(stretches, key=lambda one: (id(one.exploration), one.begin))
    spans: list[tuple[Exploration, int, int]] = []
    for one in ordered:
        if spans and spans[-1][0] is one.exploration and spans[-1][2] == one.begin:
            spans[-1] = (one.exploration, spans[-1][1], one.end)
        else:
            spans.append((one.exploration, one.begin, one.end))
    out = []
    for exploration, begin, end in spans:
        vibration = exploration.vibration[begin:end]
        distance = np.cumsum(exploration.speed[begin:end]) / exploration.rate
        out.append(Passage(vibration - vibration.mean(), distance - distance[0], exploration.rate))
    return out
