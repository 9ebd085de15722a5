"""Texture that passes faster than the tick: what a hand feels of it, without false tones.

The problem: a probe that crosses 2 mm ridges at 169 mm/s meets 84 of them a second, and each has
harmonics. The force leaps where the probe falls from one ridge to the next, and the harmonics of a
leap fall off slowly; sampled once a tick, those above half the tick's rate come back as tones that
are no multiple of 84 Hz.

The idea: between the last pose and this one the tool moves evenly. The wrench is evaluated at
sub-poses on the way, at least eight for the shortest wave, and more by halving around each leap,
until its place is known well. What goes on as in the ticks before is no leap. Linear between them,
it is weighted by a window in time: the tick itself (`"tick"`), or a Dolph-Chebyshev window of 60 dB
over the last five ticks (`"band"`), which passes hardly anything above half the tick's rate. The
windows act exactly on the linear pieces, so uneven sub-poses do no harm.

The price is delay: half a tick for "tick", two and a half ticks for "band". Where a tick has a
deadline, there are as many sub-poses as there is time for: fewer of them let false tones through,
but a wrench that comes too late is not felt at all.
"""

from __future__ import annotations

import functools
import heapq
import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel

SPAN = {"off": 0, "tick": 1, "band": 5}
"""How many ticks the window spans."""
BUDGET = 64
"""Most evaluations of the wrench in one tick."""
PER_WAVE = 8
"""Sub-poses a wave of the shortest wavelength, at least."""
ATTENUATION_DB = 60.0
LEAP = {"tick": 1e-3, "band": 1e-4}
"""A leap of the wrench is halved until leap times interval is this part of wrench times tick.

The side lobes of a plain mean are far above what finer places would take away.
"""
_TAPS = 256
"""Of the tabulated window, a tick."""


class SubPoses(NamedTuple):
    """The wrench over one tick: linear between `s` (m,) in 0 to 1, `wrench` (m, 6)."""

    s: NDArray[np.float64]
    wrench: NDArray[np.float64]
    spent: bool
    """Whether the budget ran out."""


def sub_poses(
    evaluate: Callable[[float], NDArray[np.float64]],
    first: NDArray[np.float64],
    count: int,
    *,
    lever: float,
    leap: float = LEAP["band"],
    halve: bool = True,
    before: Sequence[NDArray[np.float64]] = (),
    in_time: Callable[[], bool] = lambda: True,
) -> SubPoses:
    """Evaluate the wrench on the way through a tick.

    Parameters
    ----------
    evaluate : callable
        The wrench (6,) at a place 0 < s <= 1 of the way.
    first : (6,) array
        The wrench at s = 0.
    count : int
        Sub-poses that the motion asks for.
    lever : float
        Length that makes a force of a torque, to compare leaps [m].
    leap : float
        How exactly leaps are placed: see `LEAP`.
    halve : bool
        Evaluate more around leaps. These come out of order: not for a wrench that remembers.
    before : sequence of (6,) arrays
        The wrenches one and two ticks before `first`, if they are known.
    in_time : callable
        Whether there is time for another one, on the way or around a leap. The last pose, s = 1, is
        always looked at.
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
        size, *leaps = _leap(wrench[1], first, before, lever)
    else:
        size = max(_size(w, lever) for w in wrench)
        leaps = [_size(g - f, lever) for f, g in itertools.pairwise(wrench)]
    left, tolerance = BUDGET - start, leap * size
    heap: list[tuple[float, float, float, NDArray[np.float64], NDArray[np.float64]]] = []

    def push(a: float, b: float, f: NDArray[np.float64], g: NDArray[np.float64], e: float) -> None:
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
        # What the line missed lies, for a leap, all in the half that changes more.
        missed, rise, rest = _on_the_way(f, between, g, lever)
        share = 2.0 * missed / max(rise + rest, 1e-300)
        push(a, middle, f, between, share * rise)
        push(middle, b, between, g, share * rest)
    order = np.argsort(s)
    return SubPoses(np.array(s)[order], np.array(wrench)[order], bool(heap) or spent)


@functools.cache
def make_ready() -> None:
    """Have the machine code that a tick may need, before any hurry."""
    sub_poses(lambda s: np.full(6, float(s > 0.3)), np.zeros(6), 1, lever=1.0)


@kernel
def moved_most(count, point, last, pose):
    """Return how far a contact's place moves at most [m], as the tool goes from pose to pose (7,).

    `count[0]` and `point` as of `engine.memory.Contacts`, at the last pose.
    """
    less = more = away = lever = 0.0
    for i in range(3, 7):
        less += (pose[i] - last[i]) ** 2
        more += (pose[i] + last[i]) ** 2
    # A quaternion and its negative are one turn; between unit quaternions the chord is known.
    turn = 4.0 * math.asin(min(0.5 * math.sqrt(min(less, more)), 1.0))
    for i in range(3):
        away += (pose[i] - last[i]) ** 2
    for c in range(count[0]):
        square = 0.0
        for i in range(3):
            square += (point[c, i] - last[i]) ** 2
        lever = max(lever, square)
    return math.sqrt(away) + turn * math.sqrt(lever)


def _leap(
    last: NDArray[np.float64],
    first: NDArray[np.float64],
    before: Sequence[NDArray[np.float64]],
    lever: float,
) -> tuple[float, float]:
    """Return the larger size of two wrenches, and what may be a leap of what lies between [N].

    A leap is in the differences of the ticks' wrenches of each order, and at least as large; what
    changes smoothly is smaller in each. Those are looked at that are known `before` the `first`.
    """
    one = before[0] if before else first
    two = before[1] if len(before) > 1 else one
    return _least_difference(last, first, one, two, len(before), lever)


@kernel
def _least_difference(last, first, one, two, known, lever):
    """Return the larger size of `last` and `first`, and the smallest of their differences."""
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
    """Return how far a wrench is off the mean of those beside it, and how far from either."""
    return (
        _distance(between, 0.5, f, 0.5, g, lever),
        _distance(between, 1.0, f, 0.0, g, lever),
        _distance(between, 0.0, f, 1.0, g, lever),
    )


@inner_kernel
def _distance(one, p, f, q, g, lever):
    """Return the size of `one - p f - q g`."""
    size = 0.0
    for i in range(6):
        part = 1.0 if i < 3 else 1.0 / lever
        size = max(size, part * abs(one[i] - p * f[i] - q * g[i]))
    return size


def _size(wrench: NDArray[np.float64], lever: float) -> float:
    """Return the largest component, torques over `lever`, as a force [N]."""
    fx, fy, fz, tx, ty, tz = map(abs, wrench.tolist())
    return float(max(fx, fy, fz, max(tx, ty, tz) / lever))


def dolph_chebyshev(taps: int, attenuation_db: float) -> NDArray[np.float64]:
    """Return the window (taps,) with side lobes all at -`attenuation_db`, of sum 1.

    From its spectrum, the Chebyshev polynomial T_(taps-1) (Dolph 1946); `taps` is even.
    """
    order = taps - 1
    ripple = 10.0 ** (attenuation_db / 20.0)
    edge = math.cosh(math.acosh(ripple) / order)
    k = np.arange(taps)
    x = edge * np.cos(np.pi * k / taps)
    high = np.abs(x) > 1.0
    polynomial = np.cos(order * np.arccos(np.clip(x, -1.0, 1.0)))
    sign = np.where(x < 0.0, (-1.0) ** order, 1.0)
    polynomial[high] = (sign * np.cosh(order * np.arccosh(np.maximum(np.abs(x), 1.0))))[high]
    spectrum = polynomial * np.exp(1j * np.pi * k / taps)
    half = np.real(np.fft.fft(spectrum))[1 : taps // 2 + 1]
    window = np.concatenate([half[::-1], half])
    return np.asarray(window / window.sum())


class Window:
    """A weight over the last ticks, applied to wrenches that are linear between sub-poses.

    `weigh(nodes)` takes one tick and returns the weighted mean over the window's span. Before the
    first tick the wrench was the first one.
    """

    def __init__(self, mode: str) -> None:
        self.span = SPAN[mode]
        taps = self.span * _TAPS
        weights = np.full(taps, 1.0 / taps)
        if mode == "band":
            weights = dolph_chebyshev(taps, ATTENUATION_DB)
        # Integrals of w and of t w up to each tap; t in ticks. In a tap the weight is even.
        t = np.arange(taps + 1) / _TAPS
        self._weight = np.append(weights * _TAPS, 0.0)
        self._w = np.concatenate([[0.0], np.cumsum(weights)])
        self._tw = np.concatenate([[0.0], np.cumsum(weights * 0.5 * (t[1:] + t[:-1]))])
        self._parts: NDArray[np.float64] | None = None

    def reset(self) -> None:
        """Forget the ticks so far."""
        self._parts = None

    def weigh(self, nodes: SubPoses) -> NDArray[np.float64]:
        """Add a tick; return the weighted wrench (6,)."""
        if self.span == 1:  # even weight over the tick: trapezia
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

    def _part(self, nodes: SubPoses) -> NDArray[np.float64]:
        """Return what a tick gives to the mean when it is 0, 1, ... ticks old: (span, 6)."""
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
