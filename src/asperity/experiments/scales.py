"""Scales from paired comparisons and rankings.

- *Bradley-Terry* (Bradley & Terry 1952, Biometrika 39, 324-345), and for rankings its extension by
  Plackett (1975, J. R. Stat. Soc. C 24, 193-202) and Luce: the odds of choosing i before j are
  exp(s_i - s_j); a ranking is a row of such choices, each among those that are left. Fitted by the
  MM algorithm of Hunter (2004, Ann. Stat. 32, 384-406).
- *Thurstone, case V* (Thurstone 1927, Psychol. Rev. 34, 273-286): i is chosen before j with
  probability Phi(s_i - s_j); the unit is the standard deviation of a difference.

Scales have a mean of 0. An infinite scale, where one stimulus was always or never chosen, is kept
finite by a weak prior: every stimulus once more chosen and not chosen, by `PRIOR` of a trial,
against one of scale 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_ndtr, ndtr

from asperity.errors import AsperityError

PRIOR = 0.1
"""Trials; ours."""
_STEPS = 2000
_CLOSE = 1e-10


@dataclass(frozen=True)
class Scale:
    """Where each stimulus lies, and how surely."""

    names: tuple[str, ...]
    values: NDArray[np.float64]
    """(n,), mean 0."""
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    model: str
    separated: bool
    """Whether the answers alone give no finite scale, so that the prior does."""


def fit_scale(
    names: Sequence[str],
    orders: Sequence[Sequence[int]],
    *,
    model: str = "bradley-terry",
    samples: int = 500,
    confidence: float = 0.95,
    seed: int = 0,
) -> Scale:
    """Return the scale that answers give, with intervals by bootstrap over trials.

    Parameters
    ----------
    names : sequence of str
        Of the stimuli.
    orders : sequence of sequence of int
        For each trial the stimuli by number, the one with most of what was asked for first.
    model : {"bradley-terry", "thurstone"}
        Thurstone's takes a ranking as all its pairs.
    samples : int
        Of the bootstrap: trials drawn with replacement.
    confidence : float
    seed : int
    """
    n = len(names)
    if not orders:
        raise AsperityError("a scale needs one answer at least")
    fit = _plackett_luce if model == "bradley-terry" else _thurstone
    values = fit(n, list(orders))
    rng = np.random.default_rng(seed)
    again = np.empty((samples, n))
    for i in range(samples):
        drawn = rng.integers(0, len(orders), len(orders))
        again[i] = fit(n, [orders[k] for k in drawn])
    tails = 50.0 * (1.0 - confidence)
    low, high = np.percentile(again, [tails, 100.0 - tails], axis=0)
    return Scale(tuple(names), values, low, high, model, not _connected(n, orders))


def wins(n: int, orders: Sequence[Sequence[int]]) -> NDArray[np.float64]:
    """Return how often i was put before j (n, n)."""
    table = np.zeros((n, n))
    for order in orders:
        for place, i in enumerate(order):
            for j in order[place + 1 :]:
                table[i, j] += 1.0
    return table


def circular_triads(table: NDArray[np.float64]) -> tuple[int, int]:
    """Return how many triads are circular (i before j before k before i), and of how many.

    By majority over repeats; pairs that are even are left out with their triads.
    """
    n, circular, whole = len(table), 0, 0
    sign = np.sign(table - table.T)
    for i in range(n):
        for j in range(i + 1, n):
            for k in range(j + 1, n):
                turns = (sign[i, j], sign[j, k], sign[k, i])
                if 0.0 in turns:
                    continue
                whole += 1
                circular += abs(sum(turns)) == 3.0
    return circular, whole


def _plackett_luce(n: int, orders: list[Sequence[int]]) -> NDArray[np.float64]:
    # Each stage of a ranking: who is left, and who is taken. Padded for one product of arrays.
    most = max(len(order) for order in orders)
    left, taken = [], []
    for order in orders:
        for stage in range(len(order) - 1):
            row = list(order[stage:]) + [n] * (most - len(order) + stage)
            left.append(row)
            taken.append(order[stage])
    members = np.array(left)
    chosen = np.bincount(taken, minlength=n).astype(np.float64) + PRIOR
    worth = np.ones(n + 1)
    worth[n] = 0.0
    for _ in range(_STEPS):
        rate = np.repeat(1.0 / worth[members].sum(axis=1), most)
        shares = np.bincount(members.ravel(), weights=rate, minlength=n + 1)[:n]
        shares += 2.0 * PRIOR / (worth[:n] + 1.0)
        new = chosen / shares
        done = np.max(np.abs(np.log(new / worth[:n]))) < _CLOSE
        worth[:n] = new
        if done:
            break
    scale = np.log(worth[:n])
    return np.asarray(scale - scale.mean())


def _thurstone(n: int, orders: list[Sequence[int]]) -> NDArray[np.float64]:
    table = wins(n, orders)
    first, second = np.nonzero(table)
    weight = table[first, second]

    def cost(s: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        apart = s[first] - s[second]
        value = -weight @ log_ndtr(apart) - PRIOR * np.sum(log_ndtr(s) + log_ndtr(-s))
        slope = weight * _hazard(apart)
        gradient = np.bincount(second, slope, n) - np.bincount(first, slope, n)
        gradient -= PRIOR * (_hazard(s) - _hazard(-s))
        return float(value), gradient

    scale = minimize(cost, np.zeros(n), jac=True, method="L-BFGS-B").x
    return np.asarray(scale - scale.mean())


def _hazard(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return phi(z) / Phi(z)."""
    return np.asarray(np.exp(-0.5 * z * z - log_ndtr(z)) / np.sqrt(2.0 * np.pi))


def _connected(n: int, orders: Sequence[Sequence[int]]) -> bool:
    """Return whether everyone was put before everyone else, if through others (Ford 1957)."""
    reach = (wins(n, orders) > 0.0) | np.eye(n, dtype=bool)
    for _ in range(n):
        reach = (reach.astype(int) @ reach.astype(int)) > 0
    return bool(reach.all())


def predicted(scale: Scale) -> NDArray[np.float64]:
    """Return the probability (n, n) that i is put before j."""
    apart = scale.values[:, None] - scale.values[None, :]
    if scale.model == "thurstone":
        return np.asarray(ndtr(apart))
    return np.asarray(1.0 / (1.0 + np.exp(-apart)))
