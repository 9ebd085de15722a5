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

The package choix (MIT licence) also fits Bradley-Terry and Plackett-Luce models, but with a
Dirichlet prior, which gives other scales than the symmetric one here. Its data carry no weights,
and it fits one data set at a time; here all bootstrap samples are fitted together.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.special import expit, log_ndtr, ndtr

from asperity._core.arrays import Array
from asperity.errors import AsperityError

PRIOR = 0.1
"""Weight of the prior [trials]; a project choice."""
_STEPS = 2000
_CLOSE = 1e-8


@dataclass(frozen=True)
class Scale:
    """Scale values of the stimuli with confidence intervals."""

    names: tuple[str, ...]
    values: Array
    """(n,), mean 0."""
    low: Array
    high: Array
    model: str
    separated: bool
    """Whether the answers alone give no finite scale, so that the prior limits it."""


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
        For each trial the indices of its stimuli, the one with most of the attribute first.
    model : {"bradley-terry", "thurstone"}
        Thurstone's takes a ranking as all its pairs.
    samples : int
        Of the bootstrap: trials drawn with replacement.
    confidence : float
    seed : int
    """
    n = len(names)
    if not orders:
        raise AsperityError("a scale needs at least one answer, got 0")
    rng = np.random.default_rng(seed)
    drawn = rng.multinomial(len(orders), np.full(len(orders), 1.0 / len(orders)), samples)
    # The first row is the answers themselves: each trial once.
    weights = np.concatenate([np.ones((1, len(orders))), drawn])
    fit = _plackett_luce if model == "bradley-terry" else _thurstone
    fitted = fit(n, orders, weights)
    tails = 50.0 * (1.0 - confidence)
    low, high = np.percentile(fitted[1:], [tails, 100.0 - tails], axis=0)
    return Scale(tuple(names), fitted[0], low, high, model, not _connected(n, orders))


def wins(n: int, orders: Sequence[Sequence[int]]) -> Array:
    """Return how often i was put before j (n, n)."""
    table = np.zeros((n, n))
    for order in orders:
        for place, i in enumerate(order):
            for j in order[place + 1 :]:
                table[i, j] += 1.0
    return table


def circular_triads(table: Array) -> tuple[int, int]:
    """Return how many triads are circular (i before j before k before i), and of how many.

    By majority over repeats; pairs that are even are left out with their triads.
    """
    sign = np.sign(table - table.T)
    triads = [
        sign[i, j] + sign[j, k] + sign[k, i]
        for i, j, k in itertools.combinations(range(len(table)), 3)
        if sign[i, j] and sign[j, k] and sign[k, i]
    ]
    return sum(int(abs(turns) == 3.0) for turns in triads), len(triads)


def _plackett_luce(n: int, orders: Sequence[Sequence[int]], weights: Array) -> Array:
    """Return scales (samples, n) of trials that count as often as `weights` (samples, trials)."""
    # Each stage of a ranking is a choice among those that are left.
    stages = [(t, o[i], frozenset(o[i:])) for t, o in enumerate(orders) for i in range(len(o) - 1)]
    groups = {group: k for k, group in enumerate(dict.fromkeys(g for _, _, g in stages))}
    members = np.zeros((len(groups), n))
    for group, k in groups.items():
        members[k, list(group)] = 1.0
    asked, taken = np.zeros((len(orders), len(groups))), np.zeros((len(orders), n))
    for trial, first, group in stages:
        asked[trial, groups[group]] += 1.0
        taken[trial, first] += 1.0
    count, chosen = weights @ asked, weights @ taken + PRIOR
    worth = np.ones((len(weights), n))
    for _ in range(_STEPS):
        # Hunter (2004), Eq. 30, with the prior's choices against one of worth 1.
        shares = (count / (worth @ members.T)) @ members + 2.0 * PRIOR / (worth + 1.0)
        new = chosen / shares
        done = np.max(np.abs(np.log(new / worth))) < _CLOSE
        worth = new
        if done:
            break
    scale = np.log(worth)
    return np.asarray(scale - scale.mean(axis=1, keepdims=True))


def _thurstone(n: int, orders: Sequence[Sequence[int]], weights: Array) -> Array:
    """Return scales (samples, n), by Newton's method on a cost that is convex."""
    tables = np.stack([wins(n, [order]) for order in orders])
    table = np.tensordot(weights, tables, axes=1)
    scale = np.zeros((len(weights), n))
    for _ in range(_STEPS):
        apart = scale[:, :, None] - scale[:, None, :]
        slope, bend = _hazard(apart), _bend(apart)
        pull = table * slope
        gradient = pull.sum(axis=1) - pull.sum(axis=2)
        gradient -= PRIOR * (_hazard(scale) - _hazard(-scale))
        stiff = table * bend + np.swapaxes(table * bend, 1, 2)
        own = stiff.sum(axis=2) + PRIOR * (_bend(scale) + _bend(-scale))
        hessian = own[:, :, None] * np.eye(n) - stiff
        step = np.linalg.solve(hessian, gradient[:, :, None])[:, :, 0]
        scale = scale - np.clip(step, -1.0, 1.0)
        if np.max(np.abs(step)) < _CLOSE:
            break
    return np.asarray(scale - scale.mean(axis=1, keepdims=True))


def _hazard(z: Array) -> Array:
    """Return phi(z) / Phi(z)."""
    return np.asarray(np.exp(-0.5 * z * z - log_ndtr(z)) / np.sqrt(2.0 * np.pi))


def _bend(z: Array) -> Array:
    """Return minus the second derivative of log Phi(z): above 0."""
    hazard = _hazard(z)
    return np.asarray(np.maximum(hazard * (z + hazard), 1e-12))


def _connected(n: int, orders: Sequence[Sequence[int]]) -> bool:
    """Return whether everyone was put before everyone else, if through others (Ford 1957)."""
    count, _ = connected_components(wins(n, orders), connection="strong")
    return bool(count == 1)


def predicted(scale: Scale) -> Array:
    """Return the probability (n, n) that i is put before j."""
    apart = scale.values[:, None] - scale.values[None, :]
    return np.asarray(ndtr(apart) if scale.model == "thurstone" else expit(apart))
