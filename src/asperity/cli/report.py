"""The report of `asperity demo`: one HTML file that contains its figures and sounds.

The text of the page is the template `demo_report.html`; here are the numbers that fill it.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from asperity import __version__
from asperity._core.data import table_beside
from asperity._core.digits import plain_number, telling
from asperity.cli.demo_pipeline import PROBES, SOUND_PROBES, Results
from asperity.drawing.pages import render
from asperity.runs.run_scene import described
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.otaduy_lin_2004.claims import (
    LEAST_R_SQUARED,
    NEARLY_CONSTANT,
    SAME_PLACE,
    SAME_RATIO,
    Claim,
    count_reproduced,
)
from asperity.viewer.pictures import PICTURED, PICTURES


def report_page(results: Results) -> str:
    """Return the report of a demo as HTML."""
    measured = [origin.startswith("Measured") for origin in results.remarks.values()]
    return render(
        "demo_report.html",
        version=__version__,
        results=results,
        folder=results.folder,
        claims=results.claims,
        reproduced=count_reproduced(results.claims),
        holding={claim["id"] for claim in results.claims if claim["holds"]},
        settings=results.settings,
        middle=results.settings.middle(),
        metrics=METRICS,
        verdicts=partial(verdict_rows, results.claims),
        measured_text=measured_text,
        plain_number=plain_number,
        described=described,
        surfaces_title="Real surfaces" if all(measured) else (
            "Real surfaces, and stand-ins where the measured file is missing" if any(measured)
            else "Stand-ins for real surfaces"
        ),
        sound_level=f"{next(iter(results.sounds.values()))[0].level:.1f}".replace("-", "−"),
        sound_probes=[f"{PROBES[place] * 1e3:g} mm" for place in SOUND_PROBES],
        probes=PROBES,
        view_pictures=[(name, PICTURES / f"{name}.jpg") for name in PICTURED],
    )  # fmt: skip


_METRIC = "of the metric"
"""In place of a unit: that of the claim's metric."""
_SHOWN: dict[str, tuple[str, float, str]] = table_beside(__file__, "claims_table.toml")
"""Measured number of a claim -> its name, its scale from SI units, and its unit; no unit: a
ratio."""


def verdict_rows(claims: list[Claim], study: str) -> list[dict[str, Any]]:
    """Return a row for each claim of a study, with a verdict for each metric."""
    rows: dict[str, dict[str, Claim]] = {}
    for claim in claims:
        if claim["id"].startswith(f"{study}."):
            _, subject, metric = claim["id"].rsplit(".", 2)
            rows.setdefault(subject, {})[metric] = claim
    return [
        {
            "claim": next(iter(by_metric.values()))["claim"].rsplit(" [", 1)[0],
            "source": next(iter(by_metric.values()))["source"],
            "verdicts": [(by_metric[key]["holds"], main_number(by_metric[key])) for key in METRICS],
        }
        for by_metric in rows.values()
    ]


def main_number(claim: Claim) -> str:
    """Return the numbers that decide a claim, with as many digits as the verdict needs."""
    measured = claim["measured"]
    _, name, metric = claim["id"].rsplit(".", 2)
    unit = _with_unit("", _METRIC, metric)
    if name == "quadratic":
        return "R² " + _numbers(measured["r_squared"], (LEAST_R_SQUARED, 1.0))
    if name == "peak_scales":
        spread = _numbers([100.0 * measured["spread"]], (100.0 * SAME_RATIO,), 2)
        return f"ratios {_numbers(measured['ratio'], (), 2)}; they differ by {spread} %"
    if name == "more_everywhere":
        return "least ratio " + _numbers(measured["smallest_ratio_between_levels"], (1.0,), 2)
    if name == "peak_higher":
        return _numbers(measured["peak_value"]) + unit
    if name == "constant_at_small":
        spread = _numbers([100.0 * measured["spread"]], (100.0 * NEARLY_CONSTANT,), 2)
        return f"differs by {spread} %"
    if "largest_spread" in measured:
        return f"spread up to {_numbers([100.0 * measured['largest_spread']])} %"
    if "value" in measured:
        return _numbers(measured["value"]) + unit
    peaks = f"{_numbers(measured['peak_spacing_mm'])} mm"
    if "shift" in measured:
        shift = _numbers([100.0 * measured["shift"]], (100.0 * SAME_PLACE,), 2)
        return f"{peaks}; they differ by {shift} %"
    doubt = max((x for x in measured["peak_uncertainty_mm"] if x is not None), default=None)
    return peaks if doubt is None else f"{peaks}, each ± {plain_number(doubt, 2)} mm or less"


def measured_text(claim: Claim) -> str:
    """Return everything that was measured for a claim, each number with its unit."""
    metric = claim["id"].rsplit(".", 1)[1]
    parts = []
    for key, value in claim["measured"].items():
        name, scale, unit = _SHOWN[key]
        values = value if isinstance(value, list) else [value]
        scaled = [None if one is None else scale * one for one in values]
        parts.append(_with_unit(f"{name} {_numbers(scaled)}", unit, metric))
    return "; ".join(parts)


def _with_unit(text: str, unit: str, metric: str) -> str:
    if unit == _METRIC:
        unit = METRICS[metric].unit
        unit = "(dimensionless)" if unit == "1" else unit
    return f"{text} {unit}" if unit else text


def _numbers(
    values: list[float | None], limits: tuple[float, ...] = (), digits: int = 3
) -> str:  # fmt: skip
    known = [value for value in values if value is not None]
    texts = iter(telling(known, limits, digits=digits))
    return " / ".join("none" if value is None else next(texts) for value in values)
