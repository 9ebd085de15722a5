"""Predictions before data: what the model expects where no finding is, with intervals.

Nothing here is judged against people. Each row is the ratio of roughness in two conditions, as the
difference of the metric's log10, over the members of the ensemble; a laboratory that measures both
conditions can say whether people lie within. What was fitted on what is part of the document, and
a hash over its content shows whether it has been changed since.
"""

from __future__ import annotations

import datetime
import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity import __version__
from asperity._core.output import write_whole
from asperity.drawing.pages import render
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.studies.ensemble.members import DAMPINGS, MASSES, PATHS, STIFFNESSES, ensemble_hands
from asperity.studies.literature.halves_page import chosen_measure, read_published_halves
from asperity.studies.literature.laboratory import Laboratory, Tables, Touch
from asperity.studies.literature.measures import COLUMNS, PAPER, Measure
from asperity.studies.literature.plates import Dots, Gratings

FACTORS = {
    "probe": (2e-3, 4e-3),
    "height": (0.15e-3, 0.35e-3),
    "speed": (0.03, 0.12),
    "force": (0.4, 1.2),
}
"""The two levels of each factor, SI; none of the findings has these together."""
UNITS = {"probe": (1e3, "mm"), "height": (1e3, "mm"), "speed": (1e3, "mm/s"), "force": (1.0, "N")}
SPACINGS = (1e-3, 2e-3, 3e-3)
"""[m]"""
SEEDS = (10, 11)
"""Of the plates' jitter; not those of the findings."""
FIRM, LIGHT = (STIFFNESSES[-1], DAMPINGS[-1]), (STIFFNESSES[0], DAMPINGS[0])
"""Stiffness [N/m] and damping [N s/m] of a probe held firmly, and of one that is nearly free."""
INTERVAL = (5.0, 95.0)

Rows = list[dict[str, Any]]


def predict(
    measures: dict[str, Measure],
    *,
    hands: Sequence[Hand] | None = None,
    seeds: Sequence[int] = SEEDS,
    progress: Callable[[], None] | None = None,
) -> Rows:
    """Return the predictions, a row each, for every metric.

    Parameters
    ----------
    measures : dict
        Name -> metric.
    hands : sequence of Hand, optional
        By default those of the ensemble.
    seeds : sequence of int
        Of the plates.
    progress : callable, optional
        Called after each hand.
    """
    tables: Tables = {}
    hands = list(hands or ensemble_hands())
    found: dict[str, list[NDArray[np.float64]]] = {}
    for hand in hands:
        lab = Laboratory(hand, tables=tables, measures=tuple(measures.values()))
        for name, values in _contrasts(lab, measures, seeds):
            found.setdefault(name, []).append(values)
        if progress:
            progress()
    grips = _grips(hands, measures, seeds, tables)
    rows = [_row(name, np.concatenate(values), measures) for name, values in found.items()]
    return rows + [_row(name, values, measures) for name, values in grips]


def _row(name: str, values: NDArray[np.float64], measures: dict[str, Measure]) -> dict[str, Any]:
    """Return the intervals of one contrast; `values` (members, metrics)."""
    return {
        "contrast": name,
        "members": len(values),
        "log10_ratio": {
            metric: {
                "median": _rounded(np.median(column)),
                "low": _rounded(np.percentile(column, INTERVAL[0])),
                "high": _rounded(np.percentile(column, INTERVAL[1])),
                "share_above_0": _rounded(np.mean(column > 0.0)),
            }
            for metric, column in zip(measures, values.T, strict=True)
        },
    }


def _rounded(value: Any) -> float:
    """Return a number to three decimals, so that the document does not depend on the last bits."""
    return round(float(value), 3) + 0.0


def _contrasts(
    lab: Laboratory, measures: dict[str, Measure], seeds: Sequence[int]
) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield name and values (plates, metrics) of every contrast of one hand."""
    names = list(FACTORS)
    logs = np.empty((2, 2, 2, 2, len(SPACINGS), len(seeds), len(measures)))
    for at in itertools.product((0, 1), repeat=4):
        level = {name: FACTORS[name][i] for name, i in zip(names, at, strict=True)}
        touch = Touch(level["probe"], level["force"], level["speed"])
        for k, seed in enumerate(seeds):
            plate = Dots(height=level["height"], seed=seed, lines=PATHS)
            for j, measure in enumerate(measures.values()):
                curve = lab.curve(measure, plate, touch, SPACINGS)
                logs[at[0], at[1], at[2], at[3], :, k, j] = np.log10(np.maximum(curve, 1e-300))
    for axis, name in enumerate(names):
        effect = np.diff(logs, axis=axis).mean(axis=(0, 1, 2, 3))
        low, high = (f"{v * UNITS[name][0]:g}" for v in FACTORS[name])
        for i, spacing in enumerate(SPACINGS):
            yield (
                f"{name}: {high} over {low} {UNITS[name][1]}, dots {spacing * 1e3:g} mm apart",
                effect[i],
            )
    for one, other in itertools.combinations(range(4), 2):
        both = np.diff(np.diff(logs, axis=one), axis=other).mean(axis=(0, 1, 2, 3, 4))
        yield f"interaction of {names[one]} and {names[other]}, all spacings", both
    middle = lab.plan.touch()
    for spacing in SPACINGS:
        pairs = []
        for seed in seeds:
            plates = Gratings(), Dots(seed=seed, lines=PATHS)
            grating, dots = (
                np.array([lab.curve(m, p, middle, [spacing])[0] for m in measures.values()])
                for p in plates
            )
            pairs.append(np.log10(np.maximum(grating, 1e-300) / np.maximum(dots, 1e-300)))
        yield f"gratings over dots, 0.4 mm high, {spacing * 1e3:g} mm apart", np.array(pairs)


def _grips(
    hands: Sequence[Hand], measures: dict[str, Measure], seeds: Sequence[int], tables: Tables
) -> list[tuple[str, NDArray[np.float64]]]:
    """Return the contrasts of a probe held firmly and one that is nearly free, over the masses."""
    masses = sorted({hand.mass for hand in hands} & set(MASSES)) or [hands[0].mass]
    found = []
    for speed in FACTORS["speed"]:
        for spacing in SPACINGS:
            values = []
            for mass, seed in itertools.product(masses, seeds):
                plate = Dots(seed=seed, lines=PATHS)
                firm, light = (
                    np.array([
                        Laboratory(Hand(mass, *grip), tables=tables).curve(
                            m, plate, Touch(3e-3, 0.58, speed), [spacing]
                        )[0]
                        for m in measures.values()
                    ])
                    for grip in (FIRM, LIGHT)
                )  # fmt: skip
                values.append(np.log10(np.maximum(firm, 1e-300) / np.maximum(light, 1e-300)))
            name = (
                f"held firmly over nearly free, {speed * 1e3:g} mm/s, dots {spacing * 1e3:g} mm "
                "apart"
            )
            found.append((name, np.array(values)))
    return found


def document(
    rows: Rows, measures: dict[str, Measure], *, date: str, fitted: dict[str, str], version: str
) -> dict[str, Any]:
    """Return the dated document of predictions, with its hash.

    Parameters
    ----------
    rows : list of dict
        As `predict` returns them.
    measures : dict
        Name -> metric.
    date : str
        YYYY-MM-DD.
    fitted : dict
        Name of the metric -> what it was fitted on, in words.
    version : str
        Of asperity.
    """
    content = {
        "schema": 1, "date": date, "asperity": version,
        "metrics": {name: measure.name for name, measure in measures.items()},
        "fitted_on": fitted,
        "hands": {"mass_kg": MASSES, "stiffness_n_m": STIFFNESSES, "damping_n_s_m": DAMPINGS},
        "levels": FACTORS, "spacings_m": SPACINGS, "seeds": SEEDS, "interval_percent": INTERVAL,
        "predictions": rows,
    }  # fmt: skip
    plain: dict[str, Any] = json.loads(json.dumps(content))
    return plain | {"sha256": content_hash(plain)}


def content_hash(content: dict[str, Any]) -> str:
    """Return the hash of a document without its own `sha256`."""
    kept = {key: value for key, value in content.items() if key != "sha256"}
    text = json.dumps(kept, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def page(found: dict[str, Any]) -> str:
    """Return the document as Markdown."""
    rows = [
        (row["contrast"], [_cell(row["log10_ratio"][name]) for name in found["metrics"]])
        for row in found["predictions"]
    ]
    heads = [name.replace("|", "\\|") for name in found["metrics"].values()]
    return render("predictions.md", found=found, heads=heads, rows=rows)


def _cell(values: dict[str, float]) -> str:
    text = f"{values['median']:+.2f} ({values['low']:+.2f} to {values['high']:+.2f})"
    return f"**{text}**" if values["low"] * values["high"] > 0.0 else text


def published_measures() -> tuple[dict[str, Measure], dict[str, str]]:
    """Return the metrics that predictions are made for, and what each was fitted on."""
    halves = read_published_halves()
    first = ", ".join(halves["halves"]["first"])
    return {"paper": PAPER, "band": COLUMNS["band_rms"], "chosen": chosen_measure()}, {
        "paper": "nothing; it is the metric of Otaduy & Lin (2004).",
        "band": "nothing by search; it was taken after the paper's metric had missed the effect of "
        "speed in the seed paper's third plate.",
        "chosen": f"the median over the ensemble of these findings, out of {halves['metrics']} "
        f"metrics: {first}. The hands were fitted on nothing.",
    }


def write_predictions(
    folder: Path, date: str = "", *, progress: Callable[[], None] | None = None
) -> Path:
    """Write DATE.json and DATE.md into a folder; return the path of the page.

    A file of the same date is kept if it has other content: predictions are not rewritten.
    """
    date = date or datetime.date.today().isoformat()
    try:
        datetime.date.fromisoformat(date)
    except ValueError as error:
        raise AsperityError(f"date must be YYYY-MM-DD, got {date!r}") from error
    measures, fitted = published_measures()
    found = document(
        predict(measures, progress=progress), measures, date=date, fitted=fitted,
        version=__version__,
    )  # fmt: skip
    stored = folder / f"{date}.json"
    if stored.exists() and json.loads(stored.read_text("utf-8"))["sha256"] != found["sha256"]:
        raise AsperityError(
            f"{stored} has other predictions of that date, and is kept: give another --date"
        )
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(found, indent=1, ensure_ascii=False) + "\n"
    write_whole(stored, text)
    path = folder / f"{date}.md"
    write_whole(path, page(found))
    return path
