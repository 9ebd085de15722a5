"""The report of `asperity demo`: one HTML file that contains its figures and sounds.

The text of the page is the template `demo_report.html`; here are the numbers that fill it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from asperity import __version__
from asperity.cli.demo_pipeline import PROBES, Results
from asperity.drawing.pages import render
from asperity.runs.run_scene import described
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.otaduy_lin_2004.claims import Claim, count_reproduced
from asperity.viewer.pictures import PICTURED, PICTURES


def report_page(results: Results) -> str:
    """Return the report of a demo as HTML."""
    middle = results.settings.middle()
    return render(
        "demo_report.html",
        version=__version__,
        results=results,
        folder=results.folder,
        claims=results.claims,
        reproduced=count_reproduced(results.claims),
        holding={claim["id"] for claim in results.claims if claim["holds"]},
        settings=_settings(results),
        metrics=METRICS,
        verdicts=partial(_verdicts, results.claims),
        surfaces_title=_surfaces_title(results),
        probes=_values(PROBES, 1e3, "mm"),
        speed=f"{middle['speed'] * 1e3:g} mm/s",
        normal_force=f"{middle['normal_force']:g} N",
        run_numbers=partial(_run_numbers, results),
        view_pictures=[(name, PICTURES / f"{name}.jpg") for name in PICTURED],
        durations=results.seconds,
    )


def _settings(results: Results) -> list[tuple[str, str]]:
    """Return names and values of the studies' settings."""
    settings, hand = results.settings, results.settings.hand
    low, high = settings.spacing_range
    return [
        ("surface", f"{settings.surface}, amplitude {settings.stimulus.amplitude * 1e3:g} mm"),
        ("spacing", f"{low * 1e3:g} to {high * 1e3:g} mm, {settings.spacings} values"),
        ("probe diameter", _values(settings.diameters, 1e3, "mm")),
        ("normal force", _values(settings.forces, 1.0, "N")),
        ("speed", _values(settings.speeds, 1e3, "mm/s")),
        (
            "hand (Eq. 7)",
            f"m = {hand.mass:g} kg, k = {hand.stiffness:g} N/m, b = {hand.damping:g} N s/m",
        ),
    ]


def _values(values: Sequence[float], scale: float, unit: str) -> str:
    return ", ".join(f"{value * scale:g}" for value in values) + f" {unit}"


def _verdicts(claims: list[Claim], study: str) -> list[dict[str, Any]]:
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
            "verdicts": [
                (by_metric[key]["holds"], _main_number(by_metric[key])) for key in METRICS
            ],
        }
        for by_metric in rows.values()
    ]


def _main_number(claim: Claim) -> str:
    """Return the number of a claim that decides it."""
    measured = claim["measured"]
    _, name, metric = claim["id"].rsplit(".", 2)
    unit = "" if METRICS[metric].unit == "1" else f" {METRICS[metric].unit}"
    if name == "quadratic":
        # Near the threshold of 0.9 the third digit decides.
        return "R² " + _numbers(measured["r_squared"], 3)
    if name == "peak_scales":
        return f"ratios {_numbers(measured['ratio'], 2)}; spread {_percent(measured['spread'])}"
    if name == "more_everywhere":
        return "least ratio " + _numbers(measured["smallest_ratio_between_levels"], 2)
    if name == "peak_higher":
        return _numbers(measured["peak_value"], 3) + unit
    if name == "constant_at_small":
        return f"spread {_percent(measured['spread'])}"
    if "value" in measured:
        return _numbers(measured["value"], 3) + unit
    peaks = f"{_numbers(measured['peak_spacing_mm'], 3)} mm"
    return peaks + (f"; shift {_percent(measured['shift'])}" if "shift" in measured else "")


def _numbers(values: Any, digits: int) -> str:
    return " / ".join("-" if value is None else f"{value:.{digits}g}" for value in values)


def _percent(value: float | None) -> str:
    if value is None:
        return "-"
    return f"{100 * value:.0f} %" if abs(value) >= 0.1 else f"{100 * value:.2g} %"


def _surfaces_title(results: Results) -> str:
    measured = [origin.startswith("Measured") for origin in results.remarks.values()]
    if all(measured):
        return "Real surfaces"
    if any(measured):
        return "Real surfaces, and stand-ins where the measured file is missing"
    return "Rough surfaces that stand in for measured ones"


def _run_numbers(results: Results, scene: str) -> list[str]:
    """Return the main numbers of the run of a scene."""
    summary, tick_us = results.runs[scene].summary, results.tick_us[scene]
    status, aliasing = summary["status"], summary["anti_alias"]
    contacts, depths = summary["contacts"], sum(status.values())
    share = 100.0 * status["certified"] / max(depths, 1)
    numbers = [
        described(summary),
        f"{summary['ticks']} ticks of 1 ms, {contacts['ticks_in_contact']} in contact",
        f"contacts per tick: {contacts['mean']:.2g}, at most {contacts['largest']}",
        f"certified: {status['certified']} of {depths} depths ({share:.3g} %)",
        f"at most {summary['largest_force_n']:.3g} N, "
        f"{summary['largest_torque_n_m'] * 1e3:.3g} mN m",
        f"tick time {tick_us[0] * 1e-3:.2g} ms (median), {tick_us[1] * 1e-3:.2g} ms (99 %)",
    ]
    if status["budget_spent"]:
        numbers.append(
            "where a depth is not certified, the search reached its budget, and the force is that "
            "of the deepest point found"
        )
    if aliasing["ticks_active"]:
        numbers.append(f"anti-aliased over sub-poses in {aliasing['ticks_active']} ticks")
    if aliasing["ticks_too_fast_and_off"]:
        numbers.append(
            "texture too fast for the tick rate, without anti-aliasing, in "
            f"{aliasing['ticks_too_fast_and_off']} ticks"
        )
    return numbers
