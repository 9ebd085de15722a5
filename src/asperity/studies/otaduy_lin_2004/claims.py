"""The paper's claims about human perception, evaluated on the studies' data.

Every claim is evaluated for every metric; it may be false. Sources: [OL] Otaduy &
Lin (2004), section and sentence; the human findings behind them are Lederman et al. (1999) for
speed, Lederman et al. (2000) for diameter and force, and Klatzky & Lederman (1999) for the
quadratic, as [OL] section 3.1 reports them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from asperity._core.data import table_beside
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.otaduy_lin_2004.drags import MODELS
from asperity.studies.otaduy_lin_2004.studies import FACTORS

if TYPE_CHECKING:
    import xarray as xr

LARGE_SPACING = 2.5e-3
"""The spacing that counts as large [m]; asperity's."""
LEAST_R_SQUARED = 0.9
SAME_RATIO = 0.05
SAME_PLACE = 0.10
NEARLY_CONSTANT = 0.15
BLIND = 1e-9
"""Least relative change of a metric with the probe's diameter of a model that depends on it."""
POST_HOC = "This metric was chosen after the paper's had been seen to miss the effect of speed."


class Claim(TypedDict):
    """One claim, as in `claims.json`."""

    id: str
    claim: str
    source: str
    question: str
    """`paper`: does the paper's analysis reproduce (its sinusoid, its metric)? `people`: does the
    model predict what people feel? `asperity`: neither."""
    counted: bool
    """Whether it counts for the first question: not if the model cannot fail it."""
    measured: dict[str, Any]
    holds: bool
    note: str


def count_reproduced(claims: Sequence[Claim]) -> tuple[int, int]:
    """Return how many of the counted claims of the paper hold, and how many there are."""
    counted = [claim["holds"] for claim in claims if claim["counted"]]
    return sum(counted), len(counted)


def evaluate_claims(studies: dict[str, xr.Dataset]) -> list[Claim]:
    """Return the claims that can be judged from `studies` (study name -> dataset).

    The paper's claims are about rigid probes: of studies with a finger none is judged.
    """
    studies = {name: data for name, data in studies.items() if not of_finger(data)}
    claims = [
        _claim(studies[study], metric, *rule[:3], rule.judge(studies[study], metric))
        for study in FACTORS
        if study in studies and studies[study].sizes["level"] > 1
        for metric in METRICS
        for rule in _RULES[study]
    ]
    if "models" in studies:
        claims += _of_models(studies["models"])
    return claims


def of_finger(data: xr.Dataset) -> bool:
    """Return whether a study was of a soft finger."""
    return data.attrs.get("tool", "probe") == "finger"


class _Judgement(NamedTuple):
    measured: dict[str, Any]
    holds: bool | np.bool_
    note: str = ""


class _Rule(NamedTuple):
    name: str
    text: str
    """May name the ends of the range of spacings, `{smallest}` and `{largest}` [mm]."""
    source: str
    judge: Callable[[xr.Dataset, str], _Judgement]


PAPER_RULES = (
    "diameter.quadratic", "diameter.peak_higher", "diameter.peak_smaller_spacing",
    "force.more_everywhere", "force.peak_stays", "speed.faster_rougher_at_large",
    "speed.faster_rougher_at_largest", "speed.peak_moves_right", "speed.constant_at_small",
)  # fmt: skip
"""The nine claims of the paper's three plates, the last of them the failure that it reports."""
BY_CONSTRUCTION = ("force.more_everywhere", "models.probe_size")
"""Claims that the model cannot fail: Eq. 6 has the force as a factor, and the earlier models do
not know the probe."""
_PEOPLE_RULES = (*PAPER_RULES[:-1], "speed.slower_rougher_at_small")


def _question(data: xr.Dataset, metric: str, name: str) -> tuple[str, bool]:
    """Return the question that a claim belongs to, and whether it counts for the first."""
    rule = f"{data.attrs['study']}.{name}"
    if rule.startswith(BY_CONSTRUCTION[1]):
        return "paper", False
    own = metric == "max_acceleration" and data.attrs["surface"] == "sinusoid"
    if own and rule in PAPER_RULES:
        return "paper", rule not in BY_CONSTRUCTION
    return ("people" if rule in _PEOPLE_RULES else "asperity"), False


def _claim(
    data: xr.Dataset, metric: str, name: str, text: str, source: str, found: _Judgement
) -> Claim:
    ends = _mm(data["spacing"].values)
    text = text.format(smallest=f"{ends[0]:.3g}", largest=f"{ends[-1]:.3g}")
    notes = [found.note] if found.note else []
    if metric == "band_rms":
        notes.append(POST_HOC)
    question, counted = _question(data, metric, name)
    if f"{data.attrs['study']}.{name}".startswith(BY_CONSTRUCTION):
        notes.append("By construction: the model cannot fail it.")
    return {
        "id": f"{data.attrs['study']}.{name}.{metric}",
        "claim": f"{text} [{METRICS[metric].label}]",
        "source": source,
        "question": question,
        "counted": counted,
        "measured": plain(found.measured),
        "holds": bool(found.holds),
        "note": " ".join(notes),
    }


def plain(value: Any) -> Any:
    """Return `value` with NumPy numbers as Python numbers of six digits; NaN becomes None."""
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(entry) for entry in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value


def _mm(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(values) * 1e3


def _levels(data: xr.Dataset) -> dict[str, Any]:
    return {data.attrs["factor"]: np.asarray(data[data.attrs["factor"]])}


def _peaks(
    data: xr.Dataset, metric: str, holds: bool | np.bool_, more: dict[str, Any] | None = None
) -> _Judgement:
    """Return a judgement of peaks, which holds only if every level's is inside the range."""
    inside = np.all(data[f"{metric}_peak_inside"].values)
    measured = _levels(data) | {
        "peak_spacing_mm": _mm(data[f"{metric}_peak"].values),
        "peak_uncertainty_mm": _mm(data[f"{metric}_peak_uncertainty"].values),
        "peak_value": data[f"{metric}_peak_value"].values,
    }
    note = "" if inside else "Not every level has its peak inside the range."
    return _Judgement(measured | (more or {}), inside and holds, note)


def _quadratic(data: xr.Dataset, metric: str) -> _Judgement:
    r_squared = data[f"{metric}_fit_r_squared"].values
    fitted, peak = data[f"{metric}_fit_peak"].values, data[f"{metric}_peak"].values
    measured = _levels(data) | {
        "r_squared": r_squared,
        "fitted_peak_mm": _mm(fitted),
        "fitted_peak_error_mm": _mm(data[f"{metric}_fit_peak_error"].values),
        "peak_mm": _mm(peak),
        "bias_of_fitted_peak": fitted / peak - 1.0,
    }
    note = "Bias: the parabola's peak over the curve's own, minus 1."
    return _Judgement(measured, np.all(r_squared >= LEAST_R_SQUARED), note)


def _peak_falls(data: xr.Dataset, metric: str) -> _Judgement:
    return _peaks(data, metric, np.all(np.diff(data[f"{metric}_peak_value"].values) < 0.0))


def _peak_moves_right(data: xr.Dataset, metric: str) -> _Judgement:
    """Judge whether each level's peak exceeds the one before by more than both uncertainties."""
    place = data[f"{metric}_peak"].values
    doubt = data[f"{metric}_peak_uncertainty"].values
    return _peaks(data, metric, np.all(np.diff(place) > doubt[1:] + doubt[:-1]))


def _peak_stays(data: xr.Dataset, metric: str) -> _Judgement:
    place = data[f"{metric}_peak"].values
    shift = float(np.ptp(place) / np.mean(place))
    return _peaks(data, metric, shift < SAME_PLACE, {"shift": shift})


def _peak_scales(data: xr.Dataset, metric: str) -> _Judgement:
    attrs, levels = data.attrs, _levels(data)
    scale = np.pi * np.sqrt(2.0 * attrs["amplitude"] * levels["diameter"])
    ratio = data[f"{metric}_peak"].values / scale
    spread = float(np.ptp(ratio) / np.mean(ratio))
    note = "Ratio: peak's spacing over drop point. The claim is asperity's, not the paper's."
    if attrs["surface"] != "sinusoid":
        note += " This surface is no sinusoid."
    inside = np.all(data[f"{metric}_peak_inside"].values)
    measured = levels | {"ratio": ratio, "spread": spread}
    return _Judgement(measured, inside and spread <= SAME_RATIO, note)


def _more_everywhere(data: xr.Dataset, metric: str) -> _Judgement:
    values = data[metric].values
    ratio = np.min(values[1:] / values[:-1], axis=1)
    measured = _levels(data) | {"smallest_ratio_between_levels": ratio}
    return _Judgement(measured, np.all(np.diff(values, axis=0) > 0.0))


def _more_at_large(data: xr.Dataset, metric: str) -> _Judgement:
    """Judge the metric at `LARGE_SPACING`, interpolated in log-log."""
    spacing = data["spacing"].values
    x, large = np.log(spacing), np.log(LARGE_SPACING)
    at = np.exp([np.interp(large, x, np.log(row)) for row in data[metric].values])
    in_range = spacing[0] <= LARGE_SPACING <= spacing[-1]
    note = "" if in_range else "The studied range does not reach it."
    return _Judgement(_levels(data) | {"value": at}, in_range and np.all(np.diff(at) > 0.0), note)


def _more_at_largest(data: xr.Dataset, metric: str) -> _Judgement:
    at = data[metric].values[:, -1]
    return _Judgement(_levels(data) | {"value": at}, np.all(np.diff(at) > 0.0))


def _less_at_smallest(data: xr.Dataset, metric: str) -> _Judgement:
    at = data[metric].values[:, 0]
    note = "The paper reports that its own simulation misses this."
    return _Judgement(_levels(data) | {"value": at}, np.all(np.diff(at) < 0.0), note)


def _constant_at_smallest(data: xr.Dataset, metric: str) -> _Judgement:
    at = data[metric].values[:, 0]
    spread = float(np.ptp(at) / np.mean(at))
    measured = _levels(data) | {"value": at, "spread": spread}
    note = "Structural: above the hand's resonance u'' is -F_u / m whatever the speed."
    return _Judgement(measured, spread <= NEARLY_CONSTANT, note)


_JUDGES = (
    _quadratic, _peak_falls, _peak_moves_right, _peak_stays, _peak_scales, _more_everywhere,
    _more_at_large, _more_at_largest, _less_at_smallest, _constant_at_smallest,
)  # fmt: skip
_RULES = {
    study: [
        _Rule(**rule | {"judge": next(j for j in _JUDGES if j.__name__ == f"_{rule['judge']}")})
        for rule in rules
    ]
    for study, rules in table_beside(__file__, "claims.toml").items()
}


def _of_models(data: xr.Dataset) -> list[Claim]:
    claims = []
    for metric in METRICS:
        for model, title in MODELS.items():
            values = data[metric].sel(model=model).values
            spread = np.ptp(values, axis=0) / np.mean(values, axis=0)
            feels = model == "otaduy-lin"
            verb = "feels" if feels else "cannot feel"
            found = _Judgement(
                {"median_spread": np.median(spread), "largest_spread": np.max(spread)},
                (np.max(spread) > BLIND) == feels,
                "Spread: (largest - smallest) / mean of the metric over the diameters.",
            )
            claims.append(_claim(
                data, metric, f"probe_size.{model}",
                f"The model of {title} {verb} the size of the probe",
                "[OL] 3.3: earlier models cannot capture the influence of probe geometry", found,
            ))  # fmt: skip
    return claims
