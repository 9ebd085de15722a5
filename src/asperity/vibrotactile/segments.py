r"""A vibration cut into stretches in which it stays the same.

AutoPARM's criterion (Davis, Lee & Rodriguez-Yam 2006), which Culbertson et al. (2014) use: of all
ways to cut a signal of n samples into m stretches, each an AR process of order p, the best has the
shortest description,

    log m + m log n + sum_j [ log p + (p + 2) / 2 log n_j + n_j / 2 log(2 pi s_j^2) ] .

They search it with a genetic algorithm, and the orders with it. Here (asperity's own) one order
serves for all stretches, as mixing them wants in the end, log m is left out, cuts fall on a grid
of blocks, and dynamic programming finds the best such cut, the same at every run.

The package ruptures is not used: it evaluates a custom cost one segment at a time, where this
module evaluates all candidate starts at once, and it has no longest segment.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.arrays import Array

_MOST_BLOCKS = 400


def cuts(
    signal: Array, *, order: int, block: int, shortest: int, longest: int | None = None
) -> list[int]:
    """Return where stretches begin, and where the last ends: samples, from 0 to `signal.size`.

    Parameters
    ----------
    signal : (n,) array
    order : int
        Of the AR processes that tell stretches apart.
    block : int
        Cuts fall on its multiples [samples]; made longer where there would be over 400.
    shortest : int
        No stretch is shorter [samples], unless the signal is.
    longest : int, optional
        Nor longer, to a block [samples].
    """
    n = signal.size
    block = max(block, order + 1, math.ceil(n / _MOST_BLOCKS))
    count = n // block
    least = max(math.ceil(shortest / block), 1)
    most = count if longest is None else max(math.ceil(longest / block), 2 * least)
    if count < 2 * least:
        return [0, n]
    upto, after = _lag_sums(signal, order, block, count)
    best = np.full(count + 1, np.inf)
    best[0] = 0.0
    before = np.zeros(count + 1, np.int64)
    for end in range(1, count + 1):
        starts = np.arange(max(end - most, 0), end - least + 1)
        starts = starts[np.isfinite(best[starts])]
        if not starts.size:
            continue
        length = (n if end == count else end * block) - starts * block
        power = _residual((upto[end] - after[starts]) / length[:, None])
        cost = best[starts] + math.log(n * max(order, 1))
        cost += 0.5 * (order + 2) * np.log(length)
        cost += 0.5 * length * np.log(2.0 * math.pi * power)
        place = int(np.argmin(cost))
        best[end], before[end] = cost[place], starts[place]
    out, at = [n], count
    while at > 0:
        at = int(before[at])
        out.append(at * block)
    return out[::-1]


def _lag_sums(signal: Array, order: int, block: int, count: int) -> tuple[Array, Array]:
    """Return sums (count + 1, order + 1) of products at each lag up to the end of each block.

    The second leaves out what reaches back over its beginning: less those, a stretch's sums are
    those of the stretch alone, and so make a sound autocovariance.
    """
    ends = np.append(np.arange(count) * block, signal.size)
    upto, after = np.zeros((count + 1, order + 1)), np.zeros((count + 1, order + 1))
    for lag in range(order + 1):
        products = np.zeros(signal.size + 1)
        products[lag + 1 :] = signal[lag:] * signal[: signal.size - lag]
        running = np.cumsum(products)
        upto[:, lag] = running[ends]
        after[:, lag] = running[np.minimum(ends + lag, signal.size)]
    return upto, after


def _residual(covariance: Array) -> Array:
    """Return the variance (k,) that AR models of autocovariances (k, p + 1) leave: Levinson."""
    k, width = covariance.shape
    # A stretch of silence, or of one tone, leaves nothing: a floor keeps it sound.
    error = covariance[:, 0] * (1.0 + 1e-9) + 1e-300
    floor = 1e-12 * error
    a = np.zeros((k, width))
    a[:, 0] = 1.0
    for i in range(1, width):
        reflection = -np.einsum("ij,ij->i", a[:, :i], covariance[:, i:0:-1]) / error
        reflection = np.clip(reflection, -0.999999, 0.999999)
        a[:, : i + 1] = a[:, : i + 1] + reflection[:, None] * a[:, i::-1]
        error = np.maximum(error * (1.0 - reflection**2), floor)
    return np.asarray(error)
