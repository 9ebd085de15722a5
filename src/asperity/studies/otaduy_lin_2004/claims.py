"""The paper's claims about human perception, evaluated on the studies' data.

Every claim is evaluated for every metric; it may be false. Sources: [OL] Otaduy &
Lin (2004), section and sentence; the human findings behind them are Lederman et al. (1999) for
speed, Lederman et al. (2000) for diameter and force, and Klatzky & Lederman (1999) for the
quadratic, as [OL] section 3.1 reports them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
from numpy.typing import NDArray

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
    measured: dict[str, Any]
    holds: bool
    note: str


def evaluate_claims(studies: dict[str, xr.Dataset]) -> list[Claim]:
    """Return the claims that can be judged from `studies` (study name -> dataset)."""
    claims: list[Claim] = []
    for study in FACTORS:
        if study in studies:
            for metric in METRICS:
                claims += _of_study(study, studies[study], metric)
    if "models" in studies:
        claims += _of_models(studies["models"])
    return claims


def _of_study(study: str, data: xr.Dataset, metric: str) -> list[Claim]:
    judges: dict[str, list[Callable[[xr.Dataset, str], Claim]]] = {
        "diameter": [_quadratic, _peak_rises, _peak_shrinks, _peak_scales],
        "force": [_quadratic, _force_more, _force_place],
        "speed": [
            _quadratic,
            _fast_large,
            _fast_largest,
            _slow_small,
            _constant_small,
            _peak_moves_right,
        ],
    }
    return [judge(data, metric) for judge in judges[study] if data.sizes["level"] > 1]


def _claim(
    data: xr.Dataset, metric: str, name: str, text: str, source: str,
    measured: dict[str, Any], holds: bool | np.bool_, note: str = "",
) -> Claim:  # fmt: skip
    notes = [note] if note else []
    if metric == "band_rms":
        notes.append(POST_HOC)
    return {
        "id": f"{data.attrs['study']}.{name}.{metric}",
        "claim": f"{text} [{METRICS[metric].label}]",
        "source": source,
        "measured": _plain(measured),
        "holds": bool(holds),
        "note": " ".join(notes),
    }


def _plain(value: Any) -> Any:
    """Return `value` with NumPy numbers as Python numbers of six digits; NaN becomes None."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(entry) for entry in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value


def _mm(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(values) * 1e3


def _levels(data: xr.Dataset) -> NDArray[np.float64]:
    return np.asarray(data[data.attrs["factor"]])


def _peak_figures(data: xr.Dataset, metric: str) -> dict[str, Any]:
    return {
        data.attrs["factor"]: _levels(data),
        "peak_spacing_mm": _mm(data[f"{metric}_peak"].values),
        "peak_uncertainty_mm": _mm(data[f"{metric}_peak_uncertainty"].values),
        "peak_value": data[f"{metric}_peak_value"].values,
    }


def _inside(data: xr.Dataset, metric: str) -> bool:
    return bool(np.all(data[f"{metric}_peak_inside"].values))


def _no_peak(data: xr.Dataset, metric: str) -> str:
    return "" if _inside(data, metric) else "Not every level has its peak inside the range."


def _at(data: xr.Dataset, metric: str, spacing: float) -> NDArray[np.float64]:
    """Return the metric at every level, interpolated in log-log to one spacing."""
    x = np.log(data["spacing"].values)
    return np.exp([np.interp(np.log(spacing), x, np.log(row)) for row in data[metric].values])


def _quadratic(data: xr.Dataset, metric: str) -> Claim:
    r_squared = data[f"{metric}_fit_r_squared"].values
    fitted = data[f"{metric}_fit_peak"].values
    bias = fitted / data[f"{metric}_peak"].values - 1.0
    return _claim(
        data, metric, "quadratic",
        "The curve over spacing is well approximated by a quadratic in log-log (R^2 >= 0.9)",
        "[OL] 4.2, Effects of Probe Diameter",
        {
            data.attrs["factor"]: _levels(data),
            "r_squared": r_squared,
            "fitted_peak_mm": _mm(fitted),
            "fitted_peak_error_mm": _mm(data[f"{metric}_fit_peak_error"].values),
            "peak_mm": _mm(data[f"{metric}_peak"].values),
            "bias_of_fitted_peak": bias,
        },
        np.all(r_squared >= LEAST_R_SQUARED),
        "Bias: the parabola's peak over the curve's own, minus 1.",
    )  # fmt: skip


def _peak_rises(data: xr.Dataset, metric: str) -> Claim:
    values = data[f"{metric}_peak_value"].values
    return _claim(
        data, metric, "peak_higher", "A smaller probe gives a higher peak",
        "[OL] 3.1 and 4.2, after Lederman et al. (2000)",
        _peak_figures(data, metric), _inside(data, metric) and np.all(np.diff(values) < 0.0),
        _no_peak(data, metric),
    )  # fmt: skip


def _peak_shrinks(data: xr.Dataset, metric: str) -> Claim:
    return _claim(
        data, metric, "peak_smaller_spacing", "A smaller probe peaks at a smaller spacing",
        "[OL] 3.1 and 4.2, after Lederman et al. (2000)",
        _peak_figures(data, metric), _inside(data, metric) and _rises(data, metric),
        _no_peak(data, metric),
    )  # fmt: skip


def _rises(data: xr.Dataset, metric: str) -> bool:
    """Return whether each level's peak exceeds the one before by more than both uncertainties."""
    place = data[f"{metric}_peak"].values
    doubt = data[f"{metric}_peak_uncertainty"].values
    return bool(np.all(np.diff(place) > doubt[1:] + doubt[:-1]))


def _peak_scales(data: xr.Dataset, metric: str) -> Claim:
    attrs = data.attrs
    scale = np.pi * np.sqrt(2.0 * attrs["amplitude"] * _levels(data))
    ratio = data[f"{metric}_peak"].values / scale
    spread = float(np.ptp(ratio) / np.mean(ratio))
    note = "The scale is the drop point of a sinusoid; the claim is asperity's, not the paper's."
    if attrs["surface"] != "sinusoid":
        note += " This surface is no sinusoid."
    return _claim(
        data, metric, "peak_scales", "The peak's spacing scales with pi sqrt(2 a D), within 5 %",
        "asperity, from the geometry of [OL] Figure 2",
        {"diameter": _levels(data), "ratio": ratio, "spread": spread},
        _inside(data, metric) and spread <= SAME_RATIO, note,
    )  # fmt: skip


def _force_more(data: xr.Dataset, metric: str) -> Claim:
    steps = np.diff(data[metric].values, axis=0)
    return _claim(
        data, metric, "more_everywhere", "A larger normal force gives more, at every spacing",
        "[OL] 3.1 and 4.2, after Lederman et al. (2000)",
        {
            "normal_force": _levels(data),
            "smallest_ratio_between_levels": np.min(
                data[metric].values[1:] / data[metric].values[:-1], axis=1
            ),
        },
        np.all(steps > 0.0),
    )  # fmt: skip


def _force_place(data: xr.Dataset, metric: str) -> Claim:
    place = data[f"{metric}_peak"].values
    shift = float(np.ptp(place) / np.mean(place))
    return _claim(
        data, metric, "peak_stays", "The peak's place barely moves with force (under 10 %)",
        "[OL] 3.1 and 4.2, after Lederman et al. (2000); the 10 % is asperity's",
        _peak_figures(data, metric) | {"shift": shift},
        _inside(data, metric) and shift < SAME_PLACE, _no_peak(data, metric),
    )  # fmt: skip


def _fast_large(data: xr.Dataset, metric: str) -> Claim:
    at = _at(data, metric, LARGE_SPACING)
    in_range = data["spacing"].values[0] <= LARGE_SPACING <= data["spacing"].values[-1]
    return _claim(
        data, metric, "faster_rougher_at_large",
        f"At large spacing ({LARGE_SPACING * 1e3:g} mm) faster gives more",
        "[OL] 3.1 and 4.2, after Lederman et al. (1999)",
        {"speed": _levels(data), "value": at}, in_range and np.all(np.diff(at) > 0.0),
        "" if in_range else "The studied range does not reach it.",
    )  # fmt: skip


def _fast_largest(data: xr.Dataset, metric: str) -> Claim:
    at = data[metric].values[:, -1]
    return _claim(
        data, metric, "faster_rougher_at_largest",
        f"At the largest spacing ({data['spacing'].values[-1] * 1e3:.3g} mm) faster gives more",
        "[OL] 3.1 and 4.2, after Lederman et al. (1999)",
        {"speed": _levels(data), "value": at}, np.all(np.diff(at) > 0.0),
    )  # fmt: skip


def _slow_small(data: xr.Dataset, metric: str) -> Claim:
    at = data[metric].values[:, 0]
    return _claim(
        data, metric, "slower_rougher_at_small",
        f"At small spacing ({data['spacing'].values[0] * 1e3:.3g} mm) slower gives more",
        "the human finding: [OL] 3.1, after Lederman et al. (1999)",
        {"speed": _levels(data), "value": at}, np.all(np.diff(at) < 0.0),
        "The paper reports that its own simulation misses this.",
    )  # fmt: skip


def _constant_small(data: xr.Dataset, metric: str) -> Claim:
    at = data[metric].values[:, 0]
    spread = float(np.ptp(at) / np.mean(at))
    return _claim(
        data, metric, "constant_at_small",
        f"At small spacing ({data['spacing'].values[0] * 1e3:.3g} mm) the metric is nearly "
        "constant with speed (within 15 %): the failure that the paper reports",
        "[OL] 4.2, Effects of Exploratory Speed; the 15 % is asperity's",
        {"speed": _levels(data), "value": at, "spread": spread}, spread <= NEARLY_CONSTANT,
        "Structural: above the hand's resonance u'' is -F_u / m whatever the speed.",
    )  # fmt: skip


def _peak_moves_right(data: xr.Dataset, metric: str) -> Claim:
    return _claim(
        data, metric, "peak_moves_right", "A faster probe peaks at a larger spacing",
        "[OL] 3.1, after Lederman et al. (1999)",
        _peak_figures(data, metric), _inside(data, metric) and _rises(data, metric),
        _no_peak(data, metric),
    )  # fmt: skip


def _of_models(data: xr.Dataset) -> list[Claim]:
    claims = []
    for metric in METRICS:
        for model in data["model"].values:
            values = data[metric].sel(model=model).values
            spread = np.ptp(values, axis=0) / np.mean(values, axis=0)
            feels = model == "otaduy-lin"
            verb = "feels" if feels else "cannot feel"
            measured = {"median_spread": np.median(spread), "largest_spread": np.max(spread)}
            claims.append(
                _claim(
                    data,
                    metric,
                    f"probe_size.{model}",
                    f"The model of {MODELS[str(model)]} {verb} the size of the probe",
                    "[OL] 3.3: earlier models cannot capture the influence of probe geometry",
                    measured,
                    (np.max(spread) > BLIND) == feels,
                    "Spread: (largest - smallest) / mean of the metric over the diameters.",
                )
            )
    return claims
