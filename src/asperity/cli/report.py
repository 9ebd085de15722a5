"""The report of `asperity demo`: one HTML file that contains its figures and sounds.

The text of the page is the template `demo_report.html`; here are the numbers that fill it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from asperity import __version__
from asperity._core.digits import plain_number
from asperity.cli.claims_table import measured_text, verdict_rows
from asperity.cli.demo_pipeline import PROBES, SOUND_PROBES, Results
from asperity.drawing.pages import render
from asperity.runs.run_scene import described
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.otaduy_lin_2004.claims import count_reproduced
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
        verdicts=partial(verdict_rows, results.claims),
        measured_text=measured_text,
        surfaces_title=_surfaces_title(results),
        origins=[(results.rubs[name].attrs["title"], of) for name, of in results.remarks.items()],
        rub_numbers=_rub_numbers(results),
        sound_level=f"{next(iter(results.sounds.values()))[0].level:.1f}".replace("-", "−"),
        sound_probes=[f"{PROBES[place] * 1e3:g} mm" for place in SOUND_PROBES],
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
            f"mass m = {hand.mass:g} kg, stiffness k = {hand.stiffness:g} N/m, "
            f"damping b = {hand.damping:g} N s/m",
        ),
    ]


def _values(values: Sequence[float], scale: float, unit: str) -> str:
    return ", ".join(f"{value * scale:g}" for value in values) + f" {unit}"


def _surfaces_title(results: Results) -> str:
    if all(_measured(results)):
        return "Real surfaces"
    if any(_measured(results)):
        return "Real surfaces, and stand-ins where the measured file is missing"
    return "Stand-ins for real surfaces"


def _measured(results: Results) -> list[bool]:
    """Return for each real surface whether it was measured."""
    return [origin.startswith("Measured") for origin in results.remarks.values()]


def _rub_numbers(results: Results) -> list[tuple[str, list[str]]]:
    """Return a row for each surface and probe: their names, and its metrics."""
    rows = []
    for data in results.rubs.values():
        for i, diameter in enumerate(data["diameter"].values):
            values = [plain_number(float(data[name][i])) for name in METRICS]
            rows.append((f"{data.attrs['title']}, probe of {diameter * 1e3:g} mm", values))
    return rows


def _run_numbers(results: Results, scene: str) -> list[tuple[str, str]]:
    """Return names and values of the main numbers of the run of a scene."""
    summary, tick_us = results.runs[scene].summary, results.tick_us[scene]
    status, aliasing = summary["status"], summary["anti_alias"]
    contacts, depths = summary["contacts"], sum(status.values())
    share = 100.0 * status["certified"] / max(depths, 1)
    numbers = [
        ("motion", described(summary)),
        ("ticks", f"{summary['ticks']} of {1e3 * summary['tick_seconds']:g} ms, "
                  f"{contacts['ticks_in_contact']} of them in contact"),
        ("contacts in a tick", f"{contacts['mean']:.2g} on average, at most {contacts['largest']}"),
        ("certified depths", f"{status['certified']} of {depths} ({share:.3g} %)"),
        ("largest force", f"{summary['largest_force_n']:.3g} N"),
        ("largest torque", f"{summary['largest_torque_n_m'] * 1e3:.3g} mN m"),
        ("computing time of a tick",
         f"{tick_us[0] * 1e-3:.2g} ms (median), {tick_us[1] * 1e-3:.2g} ms (99 % are faster)"),
    ]  # fmt: skip
    if status["budget_spent"]:
        numbers.append((
            "not certified",
            "there the search reached its budget; the force is that of the deepest point found",
        ))  # fmt: skip
    if aliasing["ticks_active"]:
        numbers.append(("anti-aliased", f"over several poses in {aliasing['ticks_active']} ticks"))
    if aliasing["ticks_too_fast_and_off"]:
        count = aliasing["ticks_too_fast_and_off"]
        numbers.append(
            ("texture too fast for the ticks, and not anti-aliased", f"in {count} ticks")
        )
    return numbers
