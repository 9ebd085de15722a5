"""Anti-aliasing of texture that passes faster than the tick.

The problem: a probe that crosses 2 mm ridges at 169 mm/s meets 84 of them a second. The force jumps
where the probe drops from one ridge to the next, and the harmonics of a jump decay slowly. Sampled
once a tick, those above half the tick rate alias to tones that are not multiples of 84 Hz.

The idea: between two ticks the tool moves at constant velocity. The wrench is evaluated at
sub-poses on this path, at least two for the shortest wavelength if more than half of it passes,
and around each jump by repeated bisection until the jump's position is accurate enough. A change
that continues that of the ticks before is not a jump. The wrench, linear between sub-poses, is
averaged over time by a window: the tick itself (`"tick"`), or a Dolph-Chebyshev window of 60 dB
over the last five ticks (`"band"`), which passes hardly anything above half the tick rate. The
windows are integrated exactly over the linear pieces, so sub-poses may be unevenly spaced.

The cost is delay: half a tick for "tick", two and a half ticks for "band". If a tick has a
deadline, the number of sub-poses is limited by the time: fewer sub-poses let some aliases through,
but a late wrench is worse.
"""

from __future__ import annotations

import functools
import heapq
import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity._core.kernels import inner_kernel, kernel

SPAN = {"off": 0, "tick": 1, "band": 5}
"""Length of the window in ticks."""
BUDGET = 64
"""Largest number of evaluations of the wrench in one tick."""
PER_WAVE = 2
"""Smallest number of sub-poses per shortest wavelength passed, from half a wavelength on."""
ATTENUATION_DB = 60.0
"""Attenuation of the side lobes of the "band" window [dB]."""
LEAP = {"tick": 0.2, "band": 1e-4}
"""Bisection of a jump ends when jump times interval is this fraction of wrench times tick.

It is coarser for "tick": the side lobes of a plain mean are far above the error, and the slowest
ticks take a half to a third of the time that they take with a quarter of it.
"""
_TAPS = 256
"""Samples a tick of the tabulated window."""


class SubPoses(NamedTuple):
    """The wrench over one tick, `wrench` (m, 6) at times `s` (m,), 0 to 1; linear between them."""

    s: Array
    wrench: Array
    spent: bool
    """Whether the budget ran out."""


def sub_poses(
    evaluate: Callable[[float], Array],
    first: Array,
    count: int,
    *,
    lever: float,
    leap: float = LEAP["band"],
    halve: bool = True,
    before: Sequence[Array] = (),
    in_time: Callable[[], bool] = lambda: True,
) -> SubPoses:
    """Evaluate the wrench at sub-poses of a tick.

    Parameters
    ----------
    evaluate : callable
        Returns the wrench (6,) at a fraction 0 < s <= 1 of the tick.
    first : (6,) array
        The wrench at s = 0.
    count : int
        Number of evenly spaced sub-poses that the motion needs.
    lever : float
        Length by which torques are divided to compare them with forces [m].
    leap : float
        Accuracy of the positions of jumps: see `LEAP`.
    halve : bool
        Whether to bisect around jumps. These evaluations are not in the order of time, so this
        excludes laws with a state.
    before : sequence of (6,) arrays
        The wrenches one and two ticks before `first`, as far as they are known.
    in_time : callable
        Returns whether there is time for another evaluation. The last pose, s = 1, is always
        evaluated.
    """
    start = min(count, BUDGET)
    s, wrench = [0.0], [first]
    for i in range(1, start):
        if not in_time():
            break
        s.append(i / start)
        wrench.append(evaluate(s[-1]))
    s.append(1.0)
    wrench.append(evaluate(1.0))
    spent, start = count + 1 > len(s), len(s) - 1
    if not halve or start == BUDGET:
        return SubPoses(np.array(s), np.array(wrench), spent)
    if start == 1:
        one, two = (*before, first, first)[:2]
        size, *leaps = _least_difference(wrench[1], first, one, two, len(before), lever)
    else:
        size = max(_size(w, lever) for w in wrench)
        leaps = [_size(g - f, lever) for f, g in itertools.pairwise(wrench)]
    left, tolerance = BUDGET - start, leap * size
    heap: list[tuple[float, float, float, Array, Array]] = []

    def push(a: float, b: float, f: Array, g: Array, e: float) -> None:
        error = (b - a) * e
        if error > tolerance:
            heapq.heappush(heap, (-error, a, b, f, g))

    for i in range(start):
        push(s[i], s[i + 1], wrench[i], wrench[i + 1], leaps[i])
    if not heap:  # most ticks of a slow hand
        return SubPoses(np.array(s), np.array(wrench), spent)
    while heap and left and in_time():
        _, a, b, f, g = heapq.heappop(heap)
        middle = 0.5 * (a + b)
        between = evaluate(middle)
        left -= 1
        s.append(middle)
        wrench.append(between)
        # If this is a jump, the error of the linear piece is all in the half that changes more.
        missed, rise, rest = _on_the_way(f, between, g, lever)
        share = 2.0 * missed / max(rise + rest, 1e-300)
        push(a, middle, f, between, share * rise)
        push(middle, b, between, g, share * rest)
    order = np.argsort(s)
    return SubPoses(np.array(s)[order], np.array(wrench)[order], bool(heap) or spent)


@functools.cache
def make_ready() -> None:
    """Compile or load the kernels that a tick may need."""
    sub_poses(lambda s: np.full(6, float(s > 0.3)), np.zeros(6), 1, lever=1.0)


@kernel
def moved_most(count, point, last, pose):
    """Return an upper bound on the displacement of the contact points [m] between two poses (7,).

    `count` and `point` are those of `contact.contacts.Contacts` at the pose `last`.
    """
    less = more = away = lever = 0.0
    for i in range(3, 7):
        less += (pose[i] - last[i]) ** 2
        more += (pose[i] + last[i]) ** 2
    # The rotation angle follows from the chord between the quaternions, either sign of one.
    angle = 4.0 * math.asin(min(0.5 * math.sqrt(min(less, more)), 1.0))
    for i in range(3):
        away += (pose[i] - last[i]) ** 2
    for c in range(count[0]):
        square = 0.0
        for i in range(3):
            square += (point[c, i] - last[i]) ** 2
        lever = max(lever, square)
    return math.sqrt(away) + angle * math.sqrt(lever)


@kernel
def _least_difference(last, first, one, two, known, lever):
    """Return the larger magnitude of two wrenches, and an estimate of the jump between them [N].

    The estimate is the smallest of the differences of first to third order over the last ticks, as
    far as the wrenches `one` and `two` ticks before the `first` are `known`. A jump appears in each
    of them with at least its size, while a smooth change is smaller in each higher order.
    """
    size = once = twice = thrice = 0.0
    for i in range(6):
        part = 1.0 if i < 3 else 1.0 / lever
        d1 = last[i] - first[i]
        d2 = d1 - (first[i] - one[i])
        d3 = d2 - (first[i] - 2.0 * one[i] + two[i])
        size = max(size, part * max(abs(last[i]), abs(first[i])))
        once, twice = max(once, part * abs(d1)), max(twice, part * abs(d2))
        thrice = max(thrice, part * abs(d3))
    if known > 0:
        once = min(once, twice)
    return size, min(once, thrice) if known > 1 else once


@kernel
def _on_the_way(f, between, g, lever):
    """Return the distance of a wrench from the mean of its neighbours, and from each of them."""
    return (
        _distance(between, 0.5, f, 0.5, g, lever),
        _distance(between, 1.0, f, 0.0, g, lever),
        _distance(between, 0.0, f, 1.0, g, lever),
    )


@inner_kernel
def _distance(one, p, f, q, g, lever):
    """Return the magnitude of `one - p f - q g`."""
    size = 0.0
    for i in range(6):
        part = 1.0 if i < 3 else 1.0 / lever
        size = max(size, part * abs(one[i] - p * f[i] - q * g[i]))
    return size


def _size(wrench: Array, lever: float) -> float:
    """Return the largest component, torques over `lever`, as a force [N]."""
    fx, fy, fz, tx, ty, tz = map(abs, wrench.tolist())
    return float(max(fx, fy, fz, max(tx, ty, tz) / lever))


class Window:
    """A weighted mean over the last ticks, of wrenches that are linear between sub-poses.

    `weigh(nodes)` adds one tick and returns the mean over the window. Before the first tick the
    wrench counts as constant.
    """

    def __init__(self, mode: str) -> None:
        self.span = SPAN[mode]
        taps = self.span * _TAPS
        weights = np.full(taps, 1.0 / taps)
        if mode == "band":
            from scipy.signal.windows import chebwin  # slow to import, and seldom needed

            weights = chebwin(taps, ATTENUATION_DB)
            weights /= weights.sum()
        self.weights: Array = weights
        """Weight of each tap, 256 to a tick; their sum is 1."""
        # Integrals of w and of t w up to each tap, t in ticks; w is constant over a tap.
        t = np.arange(taps + 1) / _TAPS
        self._weight = np.append(weights * _TAPS, 0.0)
        self._w = np.concatenate([[0.0], np.cumsum(weights)])
        self._tw = np.concatenate([[0.0], np.cumsum(weights * 0.5 * (t[1:] + t[:-1]))])
        self._parts: Array | None = None

    def reset(self) -> None:
        """Discard the ticks so far."""
        self._parts = None

    def weigh(self, nodes: SubPoses) -> Array:
        """Add a tick; return the weighted wrench (6,)."""
        if self.span == 1:  # constant weight: trapezoidal rule
            if nodes.s.size == 2:
                return np.asarray(0.5 * (nodes.wrench[0] + nodes.wrench[1]))
            means = 0.5 * (nodes.wrench[:-1] + nodes.wrench[1:])
            return np.asarray(np.diff(nodes.s) @ means)
        if self._parts is None:
            rest = nodes.wrench[0]
            still = SubPoses(np.array([0.0, 1.0]), np.array([rest, rest]), False)
            self._parts = np.repeat(self._part(still)[None], self.span, axis=0)
        self._parts = np.roll(self._parts, 1, axis=0)
        self._parts[0] = self._part(nodes)
        ages = np.arange(self.span)
        return np.asarray(self._parts[ages, ages].sum(axis=0))

    def _part(self, nodes: SubPoses) -> Array:
        """Return the contribution of a tick to the mean at an age of 0, 1, ... ticks: (span, 6)."""
        # The newest tick is the last of the span.
        begin = self.span - 1.0 - np.arange(self.span)
        t = begin[:, None] + nodes.s
        tap = np.floor(t * _TAPS).astype(np.int64)
        begun, weight = tap / _TAPS, self._weight[tap]
        w = np.diff(self._w[tap] + weight * (t - begun))
        tw = np.diff(self._tw[tap] + 0.5 * weight * (t - begun) * (t + begun))
        width = np.diff(nodes.s)
        # On a piece F = f + (g - f) (t - t0) / width.
        later = (tw - t[:, :-1] * w) / width
        return np.asarray((w - later) @ nodes.wrench[:-1] + later @ nodes.wrench[1:])
