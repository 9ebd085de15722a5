"""The report of `asperity demo`: one HTML file that contains its figures and sounds.

The text of the page is the template `demo_report.html`; here are the values that fill it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from asperity import __version__
from asperity.cli.demo_pipeline import PROBES, SCENES, Results
from asperity.drawing.pages import render
from asperity.runs.run_scene import described
from asperity.runs.vibration_metrics import METRICS
from asperity.studies.otaduy_lin_2004.claims import Claim
from asperity.viewer.pictures import PICTURED, PICTURES

_STUDIES = {
    "diameter": (
        "Probe diameter",
        "A smaller probe feels a higher peak of roughness, and feels it at a smaller spacing "
        "(colour plate 1; Lederman et al. 2000).",
    ),
    "force": (
        "Normal force",
        "A larger normal force is rougher at every spacing and hardly moves the peak (colour "
        "plate 2; Lederman et al. 2000).",
    ),
    "speed": (
        "Speed",
        "A faster probe peaks at a larger spacing, feels rougher there, and smoother at small "
        "spacing (colour plate 3; Lederman et al. 1999). The paper's own metric misses the last "
        "of these, in the paper as here.",
    ),
}
"""Title and published finding of each study."""
_CAPTION = (
    "Points: simulated (hollow where the motion is not periodic with the surface). Lines: "
    "quadratic fits in log-log. Large marks: peaks found by refining the spacing, with their "
    "uncertainty."
)
_CAPTION_MORE = {
    "diameter": " Dotted: the drop point of each probe, where it first touches the bottom.",
}
_SPEED_FINDINGS = (
    "faster_rougher_at_large", "faster_rougher_at_largest", "slower_rougher_at_small",
    "peak_moves_right",
)  # fmt: skip
"""Claims on speed that people's judgements confirm, in the order of the template's columns."""
_SCENES = {
    "probe-plate-dots": (
        "A probe on raised dots (colour plate 4)",
        "A spherical tip of 3 mm on a handle is dragged over dots of 0.4 mm. The force tilts where "
        "the tip climbs a dot or leaves one.",
        "Left: the tool on the plate; the frame marks the detail. Right: the tip among the dots at "
        "the largest tangential force. The force acts at the deepest point, along the normal of "
        "the textured surface.",
    ),
    "hammer-blocks": (
        "A hammer on striped blocks (colour plate 5)",
        "A hammer of forged, worn steel is rubbed along the first of three blocks, across its "
        "stripes. The face is wide: the contact has up to four patches, which share one stiffness. "
        "Force and torque repeat with the stripes.",
        "Left: the hammer on the blocks. Right: its face, drawn translucent, on the stripes at the "
        "largest tangential force. Arrows: the normal and the force, at the points where they act; "
        "patches at the same point are drawn as one.",
    ),
    "file-cad": (
        "A file on a machined part (colour plate 6)",
        "A double-cut file lies on the boss of a flange and is pushed along its blade. Teeth meet "
        "tool marks all over a wide ring, where thousands of points are nearly equally deep: of "
        "the three scenes, this is the hardest to search.",
        "Left: the file on the part. Right: the blade, drawn translucent, over the boss and its "
        "bore at the largest tangential force. Arrows as above.",
    ),
}
"""Title, what happens, and what the picture shows, in the order of the page."""


def report_page(results: Results) -> str:
    """Return the report of a demo as HTML."""
    middle = results.settings.middle()
    return render(
        "demo_report.html",
        version=__version__,
        claims=results.claims,
        held=sum(claim["holds"] for claim in results.claims),
        settings=_settings(results),
        studies=[_study(results, name) for name in _STUDIES],
        metrics=[_metric(results.claims, key) for key in METRICS],
        models_figure=results.folder / "models.svg",
        surfaces_title=_surfaces_title(results),
        surfaces=[_surface(results, name) for name in results.rubs],
        probes=_values(PROBES, 1e3, "mm"),
        speed=f"{middle['speed'] * 1e3:g} mm/s",
        normal_force=f"{middle['normal_force']:g} N",
        scenes=[_scene(results, name) for name in _SCENES],
        view_pictures=[(name, PICTURES / f"{name}.jpg") for name in PICTURED],
        durations=results.watch.seconds,
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


def _study(results: Results, name: str) -> dict[str, Any]:
    """Return one study: text, figure, and a row for each claim with a verdict for each metric."""
    title, finding = _STUDIES[name]
    rows: dict[str, dict[str, Claim]] = {}
    for claim in results.claims:
        if claim["id"].startswith(f"{name}."):
            _, subject, metric = claim["id"].rsplit(".", 2)
            rows.setdefault(subject, {})[metric] = claim
    claims = []
    for by_metric in rows.values():
        first = next(iter(by_metric.values()))
        verdicts = [(by_metric[key]["holds"], _main_number(by_metric[key])) for key in METRICS]
        text = first["claim"].rsplit(" [", 1)[0]
        claims.append({"claim": text, "source": first["source"], "verdicts": verdicts})
    return {
        "title": title, "finding": finding, "claims": claims,
        "figure": results.folder / f"{name}_metrics.svg",
        "caption": _CAPTION + _CAPTION_MORE.get(name, ""),
    }  # fmt: skip


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


def _metric(claims: list[Claim], key: str) -> dict[str, Any]:
    """Return a metric and whether it reproduces each human finding on speed."""
    holding = {claim["id"] for claim in claims if claim["holds"]}
    return {
        "label": METRICS[key].label, "origin": METRICS[key].origin,
        "on_speed": [f"speed.{name}.{key}" in holding for name in _SPEED_FINDINGS],
    }  # fmt: skip


def _surfaces_title(results: Results) -> str:
    measured = [origin.startswith("Measured") for origin in results.remarks.values()]
    if all(measured):
        return "Real surfaces"
    if any(measured):
        return "Real surfaces, and stand-ins where the measured file is missing"
    return "Rough surfaces that stand in for measured ones"


def _surface(results: Results, name: str) -> dict[str, Any]:
    sound = results.sounds[name]
    return {
        "title": results.rubs[name].attrs["title"], "origin": results.remarks[name],
        "figure": results.folder / f"{name}.png", "sound": results.folder / f"{name}.wav",
        "sound_caption": f"{sound.source}; full scale is {sound.gain:.3g} m/s²",
    }  # fmt: skip


def _scene(results: Results, name: str) -> dict[str, Any]:
    title, what_happens, what_is_shown = _SCENES[name]
    prefix = next(scene.prefix for scene in SCENES if scene.name == name)
    files = {
        part: results.folder / f"{prefix}{part}{suffix}"
        for part, suffix in (("picture", ".png"), ("force", ".svg"), ("torque", ".svg"))
    }
    summary = results.runs[name].summary
    return files | {
        "title": title, "what_happens": what_happens, "what_is_shown": what_is_shown,
        "name": summary["scene"], "numbers": _run_numbers(summary, results.tick_us[name]),
    }  # fmt: skip


def _run_numbers(summary: dict[str, Any], tick_us: tuple[float, float]) -> list[str]:
    """Return the main numbers of a run."""
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
