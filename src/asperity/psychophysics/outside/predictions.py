r"""A model beside people's answers: likelihood, correlation over cells, and the raters' ceiling.

A model is one positive number for each cell, such as a metric of vibration. It may not be compared
with answers as it is, since its unit is not theirs; one slope b is fitted, and nothing else:

- magnitudes: log rating = a_person + b log model + noise, by least squares. Beside it stand the
  *null*, with the persons' means alone, and the *cells*, with a free mean for each cell, which no
  model of the cells can beat;
- choices and rankings: scores b log model in the models of Bradley & Terry and of Plackett & Luce.
  Beside it stand chance, and free scores for all cells.

The log-likelihoods are given per answer. `explained` is how far the model gets from null to cells,
0 to 1. With a slope fitted to the same answers this is a description, not a prediction; the slope's
sign is given, because a model that must be turned round is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.psychophysics.analysis.scales import fit_scale
from asperity.psychophysics.outside.answers import Answers
from asperity.psychophysics.outside.reliability import mean_over_raters, rater_reliability
from asperity.psychophysics.outside.summary import comparable_ratings

LEAST_CELLS = 3
_SLOPES = 60.0
"""Largest slope that is tried, in scores a unit of log."""


def compare_model(
    answers: Answers, model: Mapping[tuple[str, str], float], *, seed: int = 0
) -> dict[str, Any]:
    """Return how a model stands beside answers, ready for JSON.

    Parameters
    ----------
    answers : Answers
    model : mapping
        (stimulus, condition) -> value above 0. A key with an empty condition serves all.
    seed : int
        Of the splits of raters.
    """
    values = np.array([_value(model, cell) for cell in answers.cells])
    known = np.isfinite(values)
    if known.sum() < LEAST_CELLS:
        raise AsperityError(
            f"the model has a value for {int(known.sum())} of {len(values)} cells of the answers; "
            f"it needs {LEAST_CELLS} or more, named as there, such as {answers.cells[0]!r}"
        )
    if np.any(values[known] <= 0.0):
        raise AsperityError("the values of a model must be above 0")
    logs = np.log10(values)
    if not np.ptp(logs[known]) > 0.0:
        raise AsperityError("the model has the same value for every cell: nothing to compare")
    found = {
        "cells": int(known.sum()), "cells_without_a_value": int((~known).sum()),
        "method": answers.method,
    }  # fmt: skip
    if answers.method == "magnitude":
        return found | _magnitudes(answers, logs, known, seed)
    return found | _orders(answers, logs, known)


def _value(model: Mapping[tuple[str, str], float], cell: tuple[str, str]) -> float:
    return float(model.get(cell, model.get((cell[0], ""), math.nan)))


def _magnitudes(answers: Answers, logs: Array, known: Array, seed: int) -> dict[str, Any]:
    ratings, how = comparable_ratings(answers)
    ratings = ratings[:, known]
    x = logs[known]
    # Without the persons' means, which every model may have.
    centred = ratings - np.nanmean(ratings, axis=1, keepdims=True)
    there = np.isfinite(centred)
    x_all = np.where(there, np.broadcast_to(x, centred.shape), np.nan)
    x_all = x_all - np.nanmean(x_all, axis=1, keepdims=True)
    slope = float(np.nansum(x_all * centred) / np.nansum(x_all**2))
    mean = mean_over_raters(centred)
    n = int(there.sum())
    levels = {
        "null": _gaussian(centred[there]),
        "model": _gaussian((centred - slope * x_all)[there]),
        "cells": _gaussian((centred - mean)[there]),
    }
    reliability = rater_reliability(ratings, seed=seed)
    pearson = float(np.corrcoef(x, mean)[0, 1])
    ranks = [np.argsort(np.argsort(v)) for v in (x, mean)]
    return {
        "answers": n, "scale": how, "slope": slope, "turned_round": slope < 0.0,
        "log_likelihood_per_answer": levels, "explained": _explained(levels),
        "correlation": pearson, "rank_correlation": float(np.corrcoef(ranks[0], ranks[1])[0, 1]),
        "reliability": asdict(reliability),
        "model": x.tolist(), "mean": mean.tolist(),
        "names": [", ".join(filter(None, c)) for c, k in zip(answers.cells, known, strict=True)
                  if k],
    }  # fmt: skip


def _gaussian(residual: Array) -> float:
    """Return the log-likelihood an answer of a normal distribution with the residuals' spread."""
    variance = max(float(np.mean(residual**2)), 1e-300)
    return -0.5 * (math.log(2.0 * math.pi * variance) + 1.0)


def _explained(levels: Mapping[str, float]) -> float | None:
    """Return how far the model gets from null to cells; None if there is nothing to explain."""
    whole = levels["cells"] - levels["null"]
    return (levels["model"] - levels["null"]) / whole if whole > 0.0 else None


def _orders(answers: Answers, logs: Array, known: Array) -> dict[str, Any]:
    from scipy.optimize import minimize_scalar  # slow to import

    orders = [[i for i in order if known[i]] for order in answers.orders()]
    orders = [order for order in orders if len(order) > 1]
    if not orders:
        raise AsperityError("the model has values for no two cells that were compared")
    best = minimize_scalar(
        lambda b: -plackett_luce(b * logs, orders), bounds=(-_SLOPES, _SLOPES), method="bounded"
    )
    slope = float(best.x)
    names = [", ".join(filter(None, cell)) for cell in answers.cells]
    scale = fit_scale(names, orders, samples=2).values
    levels = {
        "null": plackett_luce(0.0 * scale, orders) / len(orders),
        "model": plackett_luce(slope * logs, orders) / len(orders),
        "cells": plackett_luce(scale, orders) / len(orders),
    }
    x, y = logs[known], scale[known]
    ranks = [np.argsort(np.argsort(v)) for v in (x, y)]
    return {
        "answers": len(orders), "scale": "Bradley-Terry and Plackett-Luce", "slope": slope,
        "turned_round": slope < 0.0, "log_likelihood_per_answer": levels,
        "explained": _explained(levels), "correlation": float(np.corrcoef(x, y)[0, 1]),
        "rank_correlation": float(np.corrcoef(ranks[0], ranks[1])[0, 1]),
        "model": x.tolist(), "mean": y.tolist(),
        "names": [name for name, k in zip(names, known, strict=True) if k],
    }  # fmt: skip


def plackett_luce(scores: Array, orders: list[list[int]]) -> float:
    """Return the log-likelihood of rankings, each a row of choices among those that are left."""
    total = 0.0
    for order in orders:
        s = scores[order]
        top = float(np.max(s))
        left = np.log(np.cumsum(np.exp(s - top)[::-1])[::-1]) + top
        total += float(np.sum((s - left)[:-1]))
    return total
