"""One fixed metric, chosen on half of the findings over the ensemble, judged on the other half.

The members are 36 hands times plates of jittered dots. The seven findings of the seed paper are
judged over dots too, as people felt them, not over sinusoids. For every member and metric the
share of findings that come out is counted, in each half; the choice is the metric with the largest
median share in the first half (of equal ones, the largest mean). Nothing of the second half is
looked at for it.

The halves are drawn by a fixed seed from the findings' names, before any outcome was known.
Findings do not count if the model cannot fail them, if their verdict does not depend on the metric,
if they need files of measured surfaces, or if over dots they are another one once more.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.dragged_hand.normal_motion import NormalProbe
from asperity.runs.vibration_metrics import DEFAULT_BAND
from asperity.studies.ensemble.members import PATHS, ensemble_hands
from asperity.studies.ensemble.processes import over_items
from asperity.studies.literature.catalogue import FINDINGS
from asperity.studies.literature.finding import Finding
from asperity.studies.literature.fit import as_json
from asperity.studies.literature.laboratory import Laboratory, Plan, Tables, judge_or_explain
from asperity.studies.literature.measures import COLUMNS, PAPER, SKIN_MEASURES, Measure
from asperity.studies.literature.plates import Dots
from asperity.studies.skin.pressed_finger import PressedFinger

PLATES = tuple(
    Dots(height=height, seed=seed, lines=PATHS)
    for height, seed in ((0.1e-3, 0), (0.2e-3, 1), (0.4e-3, 2))
)
"""The plates of the ensemble; asperity's."""
TWICE = ("static.speed",)
"""Over dots the same condition and criterion as `speed.peak`."""
WITH_FILES = ("grit.measured",)
SPLIT_SEED = 0
SPACINGS = 10
LOWS = (5.0, 10.0, 20.0, 40.0)
HIGHS = (50.0, 100.0, 200.0, 400.0)
"""Edges of the bands that are tried [Hz]."""
REFERENCES = {"paper": PAPER, "band": COLUMNS["band_rms"]}
"""Metrics beside which the choice is put: the paper's, and the RMS of u'' in 20 to 200 Hz."""


def candidates() -> tuple[Measure, ...]:
    """Return the metrics to choose from: the studies' four, norms in bands, the skin's channels."""
    bands = [(low, high) for low in LOWS for high in HIGHS if high >= 2.5 * low]
    norms = [
        Measure(signal=signal, band=band)
        for signal in ("acceleration", "force")
        for band in (None, *bands)
    ]
    sharper = [
        Measure(signal=signal, band=band, power=4.0)
        for signal in ("acceleration", "force")
        for band in (DEFAULT_BAND, (40.0, 400.0))
    ]
    others = [Measure(signal="velocity"), Measure(signal="position")]
    every = [*COLUMNS.values(), *norms, *sharper, *others, *SKIN_MEASURES]
    return tuple(dict.fromkeys(every))


def counted_findings() -> tuple[Finding, ...]:
    """Return the findings that count, in the order of the catalogue."""
    left_out = (*TWICE, *WITH_FILES)
    return tuple(
        finding for finding in FINDINGS
        if not finding.by_construction and not finding.any_metric and finding.id not in left_out
    )  # fmt: skip


def draw_halves(ids: Sequence[str], seed: int = SPLIT_SEED) -> NDArray[np.bool_]:
    """Return which findings are in the first half; the draw depends on the names alone."""
    order = np.argsort(np.array(ids))
    first = np.zeros(len(ids), dtype=bool)
    first[order[np.random.default_rng(seed).permutation(len(ids))[: (len(ids) + 1) // 2]]] = True
    return first


@dataclass(frozen=True)
class Design:
    """A model and a metric."""

    measure: Measure
    lift_off: bool = False
    """Whether the probe has a mass along the normal and may lose contact."""
    skin: bool = False
    """Whether a finger is judged by the pressure on its skin instead of by vibration."""


@dataclass(frozen=True)
class FindingsTable:
    """Which member gets which finding, under which metric."""

    findings: tuple[Finding, ...]
    measures: tuple[Measure, ...]
    hands: tuple[Hand, ...]
    holds: NDArray[np.bool_]
    """Shape (hands, plates, metrics, findings)."""

    def rows(self) -> NDArray[np.bool_]:
        """Return the table with one axis for the members."""
        return self.holds.reshape(-1, *self.holds.shape[2:])


def judge_ensemble(
    measures: tuple[Measure, ...] | None = None,
    *,
    hands: Sequence[Hand] | None = None,
    findings: tuple[Finding, ...] | None = None,
    plates: tuple[Dots, ...] = PLATES,
    processes: int | None = None,
    progress: Callable[[], None] | None = None,
) -> FindingsTable:
    """Judge findings for every hand, plate and metric; `progress` is called after every hand."""
    measures = measures or candidates()
    hands = tuple(hands or ensemble_hands())
    findings = findings or counted_findings()
    tried = tuple(map(Design, measures))
    holds = judge_designs(tried, hands, findings, plates, processes, progress)
    return FindingsTable(findings, measures, hands, holds)


_TABLES: Tables = {}
"""Slope tables of this process; they do not depend on the hand."""


def judge_designs(
    tried: tuple[Design, ...], hands: Sequence[Hand], findings: Sequence[Finding],
    plates: tuple[Dots, ...], processes: int | None, progress: Callable[[], None] | None,
) -> NDArray[np.bool_]:  # fmt: skip
    """Return the verdicts, shape (hands, plates, designs, findings)."""
    judge = functools.partial(
        _judge_hand, tried=tried, names=[finding.id for finding in findings], plates=plates
    )
    return np.stack(over_items(judge, hands, processes=processes, progress=progress))


def _judge_hand(
    hand: Hand, tried: tuple[Design, ...], names: Sequence[str], plates: tuple[Dots, ...]
) -> NDArray[np.bool_]:
    """Return the verdicts of one hand, shape (plates, designs, findings)."""
    by_name = {finding.id: finding for finding in FINDINGS}
    holds = np.zeros((len(plates), len(tried), len(names)), dtype=bool)
    for lift_off in (False, True):
        kept = [j for j, design in enumerate(tried) if design.lift_off is lift_off]
        measures = tuple(dict.fromkeys(tried[j].measure for j in kept))
        curves: dict[Any, Any] = {}
        records: dict[Any, Any] = {}
        for i, dots in enumerate(plates):
            for j in kept:
                # Drags do not depend on the skin, nor those without dots on the plate: they are
                # shared.
                lab = Laboratory(
                    hand, Plan(spacings=SPACINGS, heights=(0.5 * dots.height, dots.height)),
                    dots=dots, sinusoids=dots, measures=measures, tables=_TABLES,
                    normal=NormalProbe() if lift_off else None,
                    skin=PressedFinger() if tried[j].skin else None,
                    _curves=curves, _records=records,
                )  # fmt: skip
                for k, name in enumerate(names):
                    verdict = judge_or_explain(by_name[name], lab, tried[j].measure)
                    holds[i, j, k] = bool(verdict.holds)
    return holds


def choose_metric(rows: NDArray[np.bool_], first: NDArray[np.bool_]) -> int:
    """Return the index of the metric that gets most of the first half over the members.

    Parameters
    ----------
    rows : (members, metrics, findings) array
    first : (findings,) array
        The first half.
    """
    shares = rows[:, :, first].mean(axis=2)
    medians, means = np.median(shares, axis=0), shares.mean(axis=0)
    return int(np.lexsort((means, medians))[-1])


def summarise_halves(table: FindingsTable) -> dict[str, Any]:
    """Return the choice, and the shares of both halves, ready for JSON."""
    rows, ids = table.rows(), [finding.id for finding in table.findings]
    first = draw_halves(ids)
    chosen = choose_metric(rows, first)
    designs = {"chosen": chosen} | {
        name: table.measures.index(measure) for name, measure in REFERENCES.items()
    }
    swapped = choose_metric(rows, ~first)

    def shares(index: int) -> dict[str, Any]:
        halves = {"first": first, "second": ~first}
        found = {name: rows[:, index][:, half].mean(axis=1) for name, half in halves.items()}
        return {
            name: {
                "median": float(np.median(values)), "mean": float(values.mean()),
                "low": float(np.percentile(values, 5.0)),
                "high": float(np.percentile(values, 95.0)),
            }
            for name, values in found.items()
        }  # fmt: skip

    second = np.median(rows[:, :, ~first].mean(axis=2), axis=0)
    return {
        "schema": 1,
        "members": int(rows.shape[0]),
        "hands": len(table.hands),
        "plates": [[plate.height, plate.seed] for plate in PLATES],
        "metrics": len(table.measures),
        "split_seed": SPLIT_SEED,
        "chosen": as_json(table.measures[chosen]) | {"name": table.measures[chosen].name},
        "halves": {
            "first": [name for name, is_in in zip(ids, first, strict=True) if is_in],
            "second": [name for name, is_in in zip(ids, first, strict=True) if not is_in],
        },
        "shares": {name: shares(index) for name, index in designs.items()},
        "rank_on_second": int(1 + np.sum(second > second[chosen])),
        "swapped": {
            "name": table.measures[swapped].name, "shares": shares(swapped),
        },
        "findings": {
            name: {
                design: float(rows[:, index, i].mean()) for design, index in designs.items()
            }
            for i, name in enumerate(ids)
        },
    }  # fmt: skip
