"""Search for one metric and one hand that reproduce most findings, and its uncertainty.

Every hand of a Sobol design is dragged through every condition once; some 70 metrics are computed
from the same drags. The result is a table of booleans, hand x metric x finding, from which all else
is counted:

- the *choice* is not the pair that gets most: the best of thousands of pairs is lucky. It is the
  metric that gets most on average over all hands, with the hand whose neighbourhood in the design
  (itself and its four nearest) gets most. Findings that are held out do not count;
- the *most* is the pair that gets most, for comparison;
- the *bootstrap* draws findings with replacement, chooses again, and scores the choice on the
  findings that were not drawn;
- the *profile* of a parameter is the most findings that any design gets in each part of its range.

The module is in the package, not among the tools of the repository, because `asperity findings
--fit` runs it wherever asperity is installed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.studies.literature.catalogue import SEARCHED
from asperity.studies.literature.finding import Finding
from asperity.studies.literature.laboratory import Laboratory, Plan, Tables
from asperity.studies.literature.measures import COLUMNS, Measure
from asperity.studies.literature.plates import Dots, Sinusoids

RANGES = {"mass": (0.01, 0.5), "stiffness": (50.0, 5000.0), "damping": (0.3, 30.0)}
"""Ranges of the hand's parameters [kg], [N/m], [N s/m], log-uniform; asperity's, and wide."""
UNITS = {"mass": "kg", "stiffness": "N/m", "damping": "N s/m"}
"""Units of the hand's parameters."""
HELD_OUT = ("static.speed", "grit.generated", "grit.measured")
"""Findings that the choice does not use. The measured papers are judged for the choice alone."""
LOWS = (5.0, 10.0, 20.0, 40.0, 80.0)
HIGHS = (50.0, 100.0, 200.0, 400.0, 800.0)
"""Edges of the bands that are tried [Hz]."""
WAVE_BANDS = (None, (10.0, 100.0), (20.0, 200.0), (20.0, 400.0), (40.0, 400.0))
"""The bands tried with norms other than the RMS, which take longer."""
NEIGHBOURHOOD = slice(0, 5)
"""Hands in a neighbourhood, nearest first, including the hand itself."""


class Conditions(NamedTuple):
    """Conditions that the choice does not use."""

    plan: Plan
    dots: Dots
    sinusoids: Sinusoids


def draw_conditions(seed: int) -> Conditions:
    """Return probes, forces, speeds and plates drawn at random around those of the findings."""
    rng = np.random.default_rng(seed)

    def levels(low: float, high: float, *steps: float) -> tuple[float, ...]:
        first = float(rng.uniform(low, high))
        return tuple(first * step for step in steps)

    height = float(rng.uniform(0.2e-3, 0.5e-3))
    plan = Plan(
        diameters=levels(1.4e-3, 2.2e-3, 1.0, 1.5, 2.0),
        forces=levels(0.15, 0.45, 1.0, 2.0, 3.0),
        speeds=levels(0.03, 0.06, 1.0, 2.0, 4.0),
        heights=(0.5 * height, height),
    )
    dots = Dots(
        height=height,
        diameter=float(rng.uniform(0.3e-3, 0.8e-3)),
        jitter=float(rng.uniform(0.2, 0.7)),
        seed=seed,
    )
    return Conditions(plan, dots, Sinusoids(float(rng.uniform(0.05e-3, 0.15e-3))))


def candidate_measures() -> tuple[Measure, ...]:
    """Return the metrics to try: the studies' four, and norms of signals in bands."""
    bands = [None, *((low, high) for low in LOWS for high in HIGHS if high >= 2.5 * low)]
    tried = [(band, 2.0) for band in bands]
    tried += [(band, power) for band in WAVE_BANDS for power in (4.0, np.inf)]
    norms = [
        Measure(signal=signal, band=band, power=power)
        for signal in ("acceleration", "force")
        for band, power in tried
    ]
    others = [Measure(signal="velocity"), Measure(signal="position")]
    return tuple(dict.fromkeys([*COLUMNS.values(), *norms, *others]))


def sample_hands(count: int, seed: int = 0) -> list[Hand]:
    """Return the hands of a scrambled Sobol design over `RANGES`; `count` is a power of 2."""
    from scipy.stats import qmc  # slow to import

    if count < 2 or count & (count - 1):
        raise AsperityError(f"hands must be a power of 2, at least 2, got {count}")
    low, high = np.log(list(RANGES.values())).T
    design = qmc.Sobol(len(RANGES), rng=seed).random(count)
    return [Hand(*row) for row in np.exp(low + design * (high - low)).tolist()]


class SearchResult(NamedTuple):
    """Result of `search`: the table of which designs reproduce which findings."""

    hands: list[Hand]
    measures: tuple[Measure, ...]
    findings: tuple[Finding, ...]
    holds: NDArray[np.bool_]
    """Shape (hands, measures, findings)."""
    failed: list[int]
    """Indices of hands that could not be dragged in some condition; they get no finding."""


def search(
    hands: Sequence[Hand],
    measures: tuple[Measure, ...] | None = None,
    *,
    findings: Sequence[Finding] | None = None,
    plan: Plan | None = None,
    progress: Callable[[], None] | None = None,
) -> SearchResult:
    """Judge findings for every hand and metric; by default all except the measured papers."""
    measures = measures or candidate_measures()
    findings = tuple(findings or (f for f in SEARCHED if f.id != "grit.measured"))
    tables: Tables = {}
    holds = np.zeros((len(hands), len(measures), len(findings)), dtype=bool)
    failed = []
    for i, hand in enumerate(hands):
        lab = Laboratory(hand, plan or Plan(spacings=10), tables=tables, measures=measures)
        try:
            holds[i] = [[bool(f.judge(lab, m).holds) for f in findings] for m in measures]
        except AsperityError:
            holds[i] = False
            failed.append(i)
        if progress:
            progress()
    return SearchResult(list(hands), measures, findings, holds, failed)


class HandChoice(NamedTuple):
    """One hand and one metric."""

    hand: int
    measure: int
    got: int
    """Number of counted findings that it gets."""


def choose(
    holds: NDArray[np.bool_], weights: NDArray[np.float64], near: NDArray[np.int64]
) -> HandChoice:
    """Return the choice, as the module defines it.

    Parameters
    ----------
    holds : (hands, metrics, findings) array
    weights : (findings,) array
        How often each finding counts.
    near : (hands, n) array
        As `find_neighbours` returns it.
    """
    counts = holds @ weights
    measure = int(np.lexsort((counts.max(axis=0), counts.mean(axis=0)))[-1])
    own = counts[:, measure]
    hand = int(np.lexsort((own, own[near].mean(axis=1)))[-1])
    return HandChoice(hand, measure, round(float(own[hand])))


def most_findings(holds: NDArray[np.bool_], weights: NDArray[np.float64]) -> HandChoice:
    """Return the pair that gets most; of equal pairs, the one with the best metric on average."""
    counts = holds @ weights
    best = np.argwhere(counts >= counts.max() - 1e-9)
    by_measure = counts.mean(axis=0)
    hand, measure = max(best.tolist(), key=lambda at: by_measure[at[1]])
    return HandChoice(hand, measure, round(float(counts[hand, measure])))


def find_neighbours(hands: Sequence[Hand]) -> NDArray[np.int64]:
    """Return the indices of the hands nearest to each in log parameters, itself first."""
    low, high = np.log(list(RANGES.values())).T
    place = np.log([[getattr(hand, name) for name in RANGES] for hand in hands])
    place = (place - low) / (high - low)
    away = np.linalg.norm(place[:, None] - place[None], axis=2)
    return np.argsort(away, axis=1, kind="stable")[:, NEIGHBOURHOOD]


@dataclass
class Bootstrap:
    """Choices from resampled findings, and how they score."""

    choices: list[tuple[int, int]]
    """Hand and metric of each choice."""
    drawn: list[float]
    """Fraction of the drawn findings that the choice gets."""
    left_out: list[float]
    """Fraction of the findings not drawn that the choice gets."""
    left_out_lucky: list[float] = field(default_factory=list)
    """The same for the pair that gets most of the drawn findings."""
    left_out_of: dict[str, list[float]] = field(default_factory=dict)
    """The same for fixed designs, by name."""


def bootstrap(
    holds: NDArray[np.bool_],
    near: NDArray[np.int64],
    *,
    rounds: int = 500,
    seed: int = 0,
    fixed: dict[str, NDArray[np.bool_]] | None = None,
) -> Bootstrap:
    """Resample the findings (last axis) and choose each time.

    `fixed` holds one boolean a finding for designs that are not chosen again.
    """
    rng, n = np.random.default_rng(seed), holds.shape[-1]
    found = Bootstrap([], [], [], [], {name: [] for name in fixed or {}})
    while len(found.choices) < rounds:
        weights = np.bincount(rng.integers(0, n, n), minlength=n).astype(np.float64)
        left = weights == 0.0
        if not left.any():
            continue
        best = choose(holds, weights, near)
        row = holds[best.hand, best.measure]
        most = most_findings(holds, weights)
        found.left_out_lucky.append(float(np.mean(holds[most.hand, most.measure][left])))
        found.choices.append((best.hand, best.measure))
        found.drawn.append(float(row @ weights / n))
        found.left_out.append(float(np.mean(row[left])))
        for name, other in (fixed or {}).items():
            found.left_out_of[name].append(float(np.mean(other[left])))
    return found


def profile_counts(
    values: NDArray[np.float64], counts: NDArray[np.int64], edges: NDArray[np.float64]
) -> list[int | None]:
    """Return the largest count among the hands in each part of a parameter's range."""
    part = np.clip(np.digitize(values, edges) - 1, 0, edges.size - 2)
    return [
        int(counts[part == i].max()) if np.any(part == i) else None for i in range(edges.size - 1)
    ]


def parameter_values(hands: Sequence[Hand], name: str) -> NDArray[np.float64]:
    """Return one parameter of all hands, SI."""
    return np.array([getattr(hand, name) for hand in hands])


def percentile_interval(values: NDArray[np.float64]) -> dict[str, Any]:
    """Return median and the central 90 % of bootstrapped values."""
    low, middle, high = np.percentile(values, [5.0, 50.0, 95.0])
    return {"low": float(low), "median": float(middle), "high": float(high)}
