"""The published fit: the choice of a search, and its score on findings and conditions held out."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.studies.literature import hand_search
from asperity.studies.literature.finding import Finding
from asperity.studies.literature.hand_search import (
    HELD_OUT,
    RANGES,
    SearchResult,
    parameter_values,
    percentile_interval,
)
from asperity.studies.literature.laboratory import Laboratory, Tables, judge_or_explain
from asperity.studies.literature.measures import COLUMNS, Measure, measure_of

PUBLISHED = Path(__file__).with_name("published_fit.json")
"""The fit of the documentation: a `fit.json` written by `asperity findings --fit`."""
_PARTS = 8
"""Parts of each parameter's range in its profile."""
_LISTED = 10
"""Length of lists of metrics."""
REFERENCES = ("max_acceleration", "band_rms")
"""Metrics with which, and the default hand, the choice is compared."""
DESIGNS = ("chosen", "most", *REFERENCES)
OTHERS = 4
"""Number of held-out sets of conditions."""


def run_fit(
    count: int = 64, *, seed: int = 0, progress: Callable[[], None] | None = None
) -> dict[str, Any]:
    """Search `count` hands (a power of 2) and all metrics; return the fit, ready for JSON."""
    searched = hand_search.search(hand_search.sample_hands(count, seed), progress=progress)
    default = hand_search.search([Hand()], tuple(COLUMNS.values()))
    return summarise(searched, default, seed=seed, progress=progress)


def summarise(
    searched: SearchResult,
    default: SearchResult,
    *,
    seed: int = 0,
    others: int = OTHERS,
    progress: Callable[[], None] | None = None,
) -> dict[str, Any]:
    """Return the fit of a search, ready for JSON; `default` is the search of the default hand."""
    hands, measures, findings, holds, failed = searched
    ids = [finding.id for finding in findings]
    counted = np.array([finding not in HELD_OUT for finding in ids])
    weights = counted.astype(np.float64)
    best = hand_search.choose(holds, weights, hand_search.find_neighbours(hands))
    most = hand_search.most_findings(holds, weights)
    row, most_row = holds[best.hand, best.measure], holds[most.hand, most.measure]
    counts = holds[:, :, counted].sum(axis=2)
    names = list(COLUMNS)
    fixed = {name: default.holds[0, names.index(name)] for name in REFERENCES}
    pairs = [(hands[c.hand], measures[c.measure]) for c in (best, most)]
    designs = [*pairs, *((Hand(), COLUMNS[name]) for name in REFERENCES)]
    return {
        "schema": 1,
        "hands": len(hands),
        "metrics": len(measures),
        "seed": seed,
        "failed_hands": len(failed),
        "ranges": {name: list(ends) for name, ends in RANGES.items()},
        "chosen": _pair(*pairs[0]),
        "most": _pair(*pairs[1]) | {"got": most.got, "pairs": int(np.sum(counts == most.got))},
        "counted": int(counted.sum()),
        "got": best.got,
        "pairs_as_good": int(np.sum(counts >= best.got)),
        "hands_as_good": _as_good(hands, counts[:, best.measure] >= best.got),
        "mean_of_metric": float(counts[:, best.measure].mean()),
        "holds": dict(zip(ids, row.tolist(), strict=True)),
        "held_out_findings": {
            name: [bool(v[ids.index(name)]) for v in (row, most_row, *fixed.values())]
            for name in HELD_OUT
            if name in ids
        },
        "references": {
            name: {"counted": int(values[counted].sum()), "all": int(values.sum())}
            for name, values in fixed.items()
        },
        "held_out_sets": others,
        "held_out_conditions": _elsewhere(findings, designs, others, progress),
        "bootstrap": _resampled(searched, counted, fixed, seed),
        "profile": _profiles(hands, counts, best.measure),
        "best_metrics": _best(measures, counts),
        "share_of_designs": {name: float(np.mean(holds[:, :, i])) for i, name in enumerate(ids)},
        "best_with": {
            name: int(counts[holds[:, :, i]].max(initial=0)) for i, name in enumerate(ids)
        },
    }


def _as_good(hands: Sequence[Hand], good: NDArray[np.bool_]) -> dict[str, Any]:
    """Return how many hands are as good with the chosen metric, and their ranges."""
    kept = [hand for hand, is_good in zip(hands, good.tolist(), strict=True) if is_good]
    spans = {name: parameter_values(kept, name) for name in RANGES}
    return {"hands": len(kept)} | {
        name: [float(values.min()), float(values.max())] for name, values in spans.items()
    }


def _pair(hand: Hand, measure: Measure) -> dict[str, Any]:
    return asdict(hand) | {"metric": as_json(measure), "name": measure.name}


def as_json(measure: Measure) -> dict[str, Any]:
    """Return a metric as JSON values; an infinite power becomes None."""
    return asdict(measure) | {"power": measure.power if np.isfinite(measure.power) else None}


def chosen_design(fit: dict[str, Any]) -> tuple[Hand, Measure]:
    """Return hand and metric of a fit."""
    best = fit["chosen"]
    return Hand(*(best[name] for name in RANGES)), measure_of(best["metric"])


def read_published_fit() -> dict[str, Any]:
    """Return the fit of the documentation."""
    fit: dict[str, Any] = json.loads(PUBLISHED.read_text("utf-8"))
    return fit


def _elsewhere(
    findings: Sequence[Finding],
    designs: Sequence[tuple[Hand, Measure]],
    others: int,
    progress: Callable[[], None] | None,
) -> dict[str, dict[str, int]]:
    """Return in how many held-out sets of conditions each design gets each finding."""
    times = {name: {f.id: 0 for f in findings} for name in DESIGNS}
    for seed in range(1, others + 1):
        plan, dots, sinusoids = hand_search.draw_conditions(seed)
        tables: Tables = {}
        labs = {
            hand: Laboratory(hand, plan, dots=dots, sinusoids=sinusoids, tables=tables)
            for hand, _ in designs
        }
        for name, (hand, measure) in zip(DESIGNS, designs, strict=True):
            for finding in findings:
                verdict = judge_or_explain(finding, labs[hand], measure)
                times[name][finding.id] += bool(verdict.holds)
        if progress:
            progress()
    return times


def _resampled(
    searched: SearchResult,
    counted: NDArray[np.bool_],
    fixed: dict[str, NDArray[np.bool_]],
    seed: int,
) -> dict[str, Any]:
    """Return the bootstrap over the counted findings."""
    found = hand_search.bootstrap(
        searched.holds[:, :, counted],
        hand_search.find_neighbours(searched.hands),
        seed=seed,
        fixed={name: row[counted] for name, row in fixed.items()},
    )
    rounds = len(found.choices)
    hands = [searched.hands[i] for i, _ in found.choices]
    metrics = [searched.measures[i] for _, i in found.choices]
    norms = [m for m in metrics if m.kind == "norm"]
    bands = [m.band for m in norms if m.band]
    return {
        "rounds": rounds,
        **{name: percentile_interval(parameter_values(hands, name)) for name in RANGES},
        "metric": _shares([m.name for m in metrics], rounds),
        "signal": _shares([m.signal if m.kind == "norm" else m.name for m in metrics], rounds),
        "norm": _shares([f"{m.power:g}" for m in norms], rounds),
        "low_edge": percentile_interval(np.array([band[0] for band in bands])) if bands else None,
        "high_edge": percentile_interval(np.array([band[1] for band in bands])) if bands else None,
        "drawn": float(np.mean(found.drawn)),
        "left_out": float(np.mean(found.left_out)),
        "left_out_lucky": float(np.mean(found.left_out_lucky)),
        "left_out_of": {name: float(np.mean(v)) for name, v in found.left_out_of.items()},
        "left_out_of_a_random_design": float(np.mean(searched.holds[:, :, counted])),
    }


def _shares(names: list[str], total: int) -> dict[str, float]:
    return {name: count / total for name, count in Counter(names).most_common(_LISTED)}


def _profiles(
    hands: Sequence[Hand], counts: NDArray[np.int64], measure: int
) -> dict[str, dict[str, Any]]:
    profiles = {}
    for name, (low, high) in RANGES.items():
        edges = np.geomspace(low, high, _PARTS + 1)
        values = parameter_values(hands, name)
        profiles[name] = {
            "edges": edges.tolist(),
            "any_metric": hand_search.profile_counts(values, counts.max(axis=1), edges),
            "chosen_metric": hand_search.profile_counts(values, counts[:, measure], edges),
        }
    return profiles


def _best(measures: Sequence[Measure], counts: NDArray[np.int64]) -> list[dict[str, Any]]:
    order = np.lexsort((-counts.mean(axis=0), -counts.max(axis=0)))
    return [
        {"name": measures[i].name, "best": int(column.max()), "mean": float(column.mean())}
        for i, column in ((i, counts[:, i]) for i in order[:_LISTED])
    ]
