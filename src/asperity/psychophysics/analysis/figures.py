"""Figures of experiments, in the style of the others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from asperity._core.arrays import Array
from asperity.drawing.figure_style import (
    COLOURS,
    MARKERS,
    PAGE_WIDTH,
    SHADE,
    SMALLEST,
    log_scale,
    style,
)
from asperity.psychophysics.analysis.magnitudes import Magnitudes
from asperity.psychophysics.analysis.scales import Scale
from asperity.psychophysics.design import ExperimentDesign

if TYPE_CHECKING:
    from asperity.psychophysics.analysis.thresholds import ThresholdAnalysis

_FACTORS = {"m": (1e3, "mm")}
"""What a reader sees in place of an SI unit."""
_NAMES = {"bradley-terry": "Bradley-Terry [logit]", "thurstone": "Thurstone, case V [SD]"}


def value_axis(design: ExperimentDesign) -> tuple[float, str]:
    """Return the factor and label of the axis of an experiment's values."""
    levels = design.stimuli.levels
    label, unit = ("value", "") if levels is None else (levels.label or levels.key, levels.unit)
    factor, shown = _FACTORS.get(unit, (1.0, unit))
    return factor, f"{label} [{shown}]" if shown else label


def level_axis(design: ExperimentDesign) -> tuple[float, str]:
    """Return the factor and label of the axis of a forced choice's levels."""
    settings = design.forced_choice
    factor, label = value_axis(design)
    if settings.level == "weber":
        name = label.partition(" [")[0]
        return 100.0, f"{name}: comparison {settings.direction} from the standard [%]"
    return factor, label if settings.level == "value" else f"difference in {label}"


def _log_range(axes: Axes, low: float, high: float, which: str) -> None:
    """Set a logarithmic axis from low to high with plain numbers at readable places."""
    getattr(axes, f"set_{which}lim")(low, high)
    log_scale(axes, x=which == "x", y=which == "y")


def magnitude_figure(found: Magnitudes, design: ExperimentDesign) -> Figure:
    """Return normalised magnitudes over the axis, log-log, with the quadratic fit."""
    factor, label = value_axis(design)
    x = found.values * factor
    on_axis = bool(np.isfinite(x).all() and np.all(x > 0.0))
    place = x if on_axis else np.arange(len(x), dtype=np.float64)
    with style():
        figure = Figure(figsize=(5.6, 3.9))
        axes = figure.subplots()
        for i, (name, row) in enumerate(zip(found.sessions, found.by_session, strict=True)):
            axes.plot(
                place, row, MARKERS[i % 6] + "-", color=COLOURS[i % 6], ms=3.0, lw=0.7, alpha=0.45,
                label=name if len(found.sessions) <= 6 else None,
            )  # fmt: skip
        spread = np.abs(np.stack([found.mean - found.low, found.high - found.mean]))
        axes.errorbar(
            place, found.mean, yerr=spread, fmt="o", color="black", ms=5, capsize=2.5,
            elinewidth=1.0, label="geometric mean", zorder=5,
        )  # fmt: skip
        everything = np.concatenate([found.by_session.ravel(), found.low, found.high])
        low, high = np.nanmin(everything), np.nanmax(everything)
        if on_axis:
            if found.fit is not None:
                fine = np.geomspace(found.values[0], found.values[-1], 200)
                axes.plot(
                    fine * factor, found.fit(fine), color="black", lw=1.2,
                    label=f"quadratic in log-log (R² {found.fit.r_squared:.2f})",
                )  # fmt: skip
                top = found.fit.peak_spacing
                if found.peak is not None and found.values[0] < top < found.values[-1]:
                    axes.axvspan(
                        max(found.peak[0] * factor, x[0]), min(found.peak[1] * factor, x[-1]),
                        color=SHADE, zorder=0, label="interval of its peak",
                    )  # fmt: skip
            reach = (x[-1] / x[0]) ** 0.05
            _log_range(axes, x[0] / reach, x[-1] * reach, "x")
            axes.set_xlabel(label)
        else:
            axes.set_xticks(place, found.names)
        _log_range(axes, low / (high / low) ** 0.1, high * (high / low) ** 0.25, "y")
        axes.set_ylabel("magnitude, normalised")
        axes.set_title(f"{design.name}: magnitude estimates")
        axes.legend(loc="upper left", ncols=2)
        figure.tight_layout()
    return figure


def psychometric_figure(threshold: ThresholdAnalysis) -> Figure:
    """Return the proportion right over the level, the fitted function and its threshold."""
    result, fit = threshold.result, threshold.fit
    assert fit is not None
    design = result.design
    log = design.forced_choice.scale == "log"
    factor, label = level_axis(design)
    unit = label.partition(" [")[2].rstrip("]")
    x = np.array([answered.trial.intensity for answered in result.answers])
    right = np.array([bool(answered.hit) for answered in result.answers])
    signed = design.forced_choice.signed
    places, inverse = np.unique(np.round(x, 9), return_inverse=True)
    count = np.bincount(inverse)
    part = np.bincount(inverse, weights=right) / count
    low, high = min(places[0], fit.threshold.low), max(places[-1], fit.threshold.high)
    reach = 0.06 * max(high - low, 1e-12)
    fine = np.linspace(low - reach, high + reach, 300)

    def shown(intensity: Any) -> Array:
        levels = 10.0 ** np.asarray(intensity) if log else np.asarray(intensity)
        return np.asarray(levels * factor)

    with style():
        figure = Figure(figsize=(5.4, 3.7))
        axes = figure.subplots()
        axes.axvspan(
            float(shown(fit.threshold.low)), float(shown(fit.threshold.high)), color=SHADE,
            zorder=0,
        )  # fmt: skip
        axes.plot(shown(fine), fit.function(fine), color=COLOURS[0])
        axes.scatter(
            shown(places), part, s=9.0 + 4.0 * count, color=COLOURS[1], alpha=0.75,
            edgecolors="black", linewidths=0.5, zorder=4,
        )  # fmt: skip
        at = float(shown(fit.function.threshold))
        axes.plot([at, at], [0.0, float(fit.function(fit.function.threshold))], color="black",
                  lw=0.9, ls=(0, (3, 2)))  # fmt: skip
        axes.axhline(design.forced_choice.guess or 0.5, color="#999999", lw=0.8, ls=(0, (1, 2)))
        if log:
            _log_range(axes, float(shown(fine[0])), float(shown(fine[-1])), "x")
        else:
            axes.set_xlim(float(shown(fine[0])), float(shown(fine[-1])))
        axes.set_ylim(-0.04 if signed else min(0.4, float(part.min()) - 0.06), 1.04)
        axes.set_xlabel(label)
        kind = "larger" if signed else "right"
        axes.set_ylabel(f"proportion {kind} (area: trials)")
        axes.set_title(
            f"{result.name}: threshold {at:.3g} "
            f"({shown(fit.threshold.low):.3g} to {shown(fit.threshold.high):.3g}"
            f"{' ' * bool(unit)}{unit}), "
            f"{len(x)} trials" + ("; simulated" if result.simulated else "")
        )
        figure.tight_layout()
    return figure


def track_figure(threshold: ThresholdAnalysis) -> Figure:
    """Return the level of each trial, whether the answer was right, and the reversals' mean."""
    result, design = threshold.result, threshold.result.design
    log = design.forced_choice.scale == "log"
    factor, label = level_axis(design)
    with style():
        figure = Figure(figsize=(6.4, 3.5))
        axes = figure.subplots()
        tracks = sorted({answered.trial.track or 1 for answered in result.answers})
        first = result.answers[0].trial.number - 1
        for i in tracks:
            rows = [answered for answered in result.answers if (answered.trial.track or 1) == i]
            n = np.array([answered.trial.number - first for answered in rows])
            level = np.array([answered.trial.level for answered in rows], dtype=np.float64) * factor
            right = np.array([bool(answered.right) for answered in rows])
            colour = COLOURS[(i - 1) % 6]
            name = f" of track {i}" if len(tracks) > 1 else ""
            axes.plot(n, level, color=colour, lw=0.8)
            axes.plot(n[right], level[right], "o", color=colour, ms=3.6, label=f"right{name}")
            axes.plot(
                n[~right], level[~right], "o", mfc="white", mec=colour, ms=4.6, mew=1.1,
                label=f"wrong{name}",
            )  # fmt: skip
            if threshold.tracks:
                mean = threshold.tracks[i - 1].threshold()
                if np.isfinite(mean):
                    at = (10.0**mean if log else mean) * factor
                    axes.axhline(at, color=colour, lw=0.9, ls=(0, (3, 2)))
        if log:
            levels = [float(answered.trial.level or 0.0) for answered in result.answers]
            low, high = min(levels) * factor, max(levels) * factor
            reach = max((high / low) ** 0.08, 1.05)
            _log_range(axes, low / reach, high * reach, "y")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_xlabel("trial")
        axes.set_ylabel(label.replace(": ", ":\n"))
        dashed = "; dashed: mean of the reversals" if threshold.tracks else ""
        axes.set_title(f"{result.name}: level of each trial{dashed}")
        axes.legend(loc="upper right", ncols=max(len(tracks), 1))
        figure.tight_layout()
    return figure


def scale_figure(scales: list[Scale], design: ExperimentDesign) -> Figure:
    """Return the scales with their intervals, stimuli in the order of the first."""
    order = np.argsort(scales[0].values)
    with style():
        figure = Figure(figsize=(6.8, 1.4 + 0.32 * len(order)))
        axes = figure.subplots(1, len(scales), sharey=True)
        for i, (axis, scale) in enumerate(zip(np.atleast_1d(axes), scales, strict=True)):
            values = scale.values[order]
            spread = np.abs(np.stack([values - scale.low[order], scale.high[order] - values]))
            axis.errorbar(
                values, np.arange(len(order)), xerr=spread, fmt=MARKERS[i], color=COLOURS[i], ms=5,
                capsize=2.5, elinewidth=1.0,
            )  # fmt: skip
            axis.set_title(_NAMES[scale.model])
            axis.set_xlabel("scale value, mean 0")
        first = np.atleast_1d(axes)[0]
        first.set_yticks(np.arange(len(order)), [_shown(design, scales[0].names[k]) for k in order])
        figure.suptitle(f"{design.name}: {design.method}", x=0.01, ha="left", fontsize=10)
        figure.tight_layout()
    return figure


def wins_figure(summary: dict[str, Any], design: ExperimentDesign) -> Figure:
    """Return how often each stimulus was put before each other."""
    table = np.array(summary["wins"], dtype=np.float64)
    order = np.argsort(np.array(summary["scales"][0]["values"]))[::-1]
    names = [_shown(design, summary["stimuli"][k]) for k in order]
    both = table + table.T
    with np.errstate(invalid="ignore"):
        part = np.where(both > 0.0, table / both, np.nan)[np.ix_(order, order)]
    with style():
        size = min(2.2 + 0.5 * len(order), PAGE_WIDTH - 1.2)
        figure = Figure(figsize=(size + 1.2, size))
        axes = figure.subplots()
        image = axes.imshow(part, cmap="cividis", vmin=0.0, vmax=1.0)
        axes.grid(False)
        axes.set_xticks(range(len(order)), names, rotation=40, ha="right")
        axes.set_yticks(range(len(order)), names)
        for i, row in enumerate(order):
            for j, column in enumerate(order):
                if both[row, column] > 0.0:
                    axes.text(
                        j, i, f"{table[row, column]:g}", ha="center", va="center",
                        fontsize=SMALLEST, color="white" if part[i, j] < 0.55 else "black",
                    )  # fmt: skip
        axes.set_title("How often the row was put before the column")
        figure.colorbar(image, ax=axes, shrink=0.8, pad=0.03).ax.set_title(
            "part", fontsize=SMALLEST
        )
        figure.tight_layout()
    return figure


def _shown(design: ExperimentDesign, name: str) -> str:
    """Return the name of a stimulus for a reader: a level in its unit."""
    if design.stimuli.levels is None:
        return name
    factor, label = value_axis(design)
    unit = label.partition(" [")[2].rstrip("]")
    return f"{float(name) * factor:.4g} {unit}".strip()


def detection_figure(sessions: Sequence[dict[str, Any]], design: ExperimentDesign) -> Figure:
    """Return d' and the criterion over the level, with intervals, a line for each session."""
    kind = getattr(design.settings, "level", "value")
    factor, label = (
        (100.0, "signal above the standard [%]") if kind == "weber" else value_axis(design)
    )
    if kind == "difference":
        label = f"difference in {label}"
    with style():
        figure = Figure(figsize=(6.8, 3.4))
        for axes, name, title in zip(
            figure.subplots(1, 2), ("d_prime", "criterion"), ("d'", "criterion c"), strict=True
        ):
            for i, session in enumerate(sessions):
                rows = session["levels"]
                x = np.array([row["level"] * factor for row in rows])
                y, low, high = (
                    np.array([row[f"{name}{end}"] for row in rows]) for end in ("", "_low", "_high")
                )
                axes.errorbar(
                    x, y, yerr=[y - low, high - y], fmt=MARKERS[i % 6] + "-", capsize=2.5,
                    color=COLOURS[i % 6], ms=4.5, lw=0.9,
                    label=session["session"] if len(sessions) <= 6 else None,
                )  # fmt: skip
            axes.axhline(0.0, color="#999999", lw=0.8, ls=(0, (1, 2)))
            axes.set_xlabel(label)
            axes.set_ylabel(title)
        figure.axes[0].legend(loc="best")
        figure.suptitle(f"{design.name}: yes/no", x=0.01, ha="left", fontsize=10)
        figure.tight_layout()
    return figure


def adjustments_figure(sessions: Sequence[dict[str, Any]], design: ExperimentDesign) -> Figure:
    """Return all settings of each standard, and the PSE with its interval for each session."""
    factor, label = value_axis(design)
    names = [standard.name for standard in design.standards()]
    values = [standard.value for standard in design.standards()]
    with style():
        figure = Figure(figsize=(min(2.6 + 1.1 * max(len(names), 2), PAGE_WIDTH), 3.7))
        axes = figure.subplots()
        for i, session in enumerate(sessions):
            room = 0.7 / (len(sessions) + 1)
            shift, beside = (i + 1) * room - 0.35, 0.2 * room
            colour, mark = COLOURS[i % 6], MARKERS[i % 6]
            for place, one in enumerate(session["standards"]):
                each = np.array(one["settings"]) * factor
                axes.plot(
                    np.full(len(each), place + shift - beside), each, mark, color=colour, ms=2.8,
                    alpha=0.4,
                )  # fmt: skip
                if one["pse_low"] is None:
                    continue
                low, mean, high = (factor * one[k] for k in ("pse_low", "pse", "pse_high"))
                axes.errorbar(
                    place + shift + beside, mean, yerr=[[mean - low], [high - mean]], fmt=mark,
                    color=colour, ms=5, capsize=2.5,
                    label=session["session"] if place == 0 and len(sessions) <= 6 else None,
                )  # fmt: skip
        if not design.stimuli.named:
            for place, value in enumerate(values):
                if value is not None:
                    axes.plot(
                        [place - 0.35, place + 0.35], [value * factor] * 2, color="black", lw=1.0,
                        ls=(0, (3, 2)), label="standard" if place == 0 else None,
                    )  # fmt: skip
            names = [f"{float(name) * factor:.4g}" for name in names]
        if design.matching.scale == "log":
            axes.set_yscale("log")
            log_scale(axes, x=False, y=True)
        axes.set_xticks(range(len(names)), names)
        axes.set_xlim(-0.6, len(names) - 0.4)
        axes.set_xlabel("standard")
        axes.set_ylabel(f"set: {label}")
        axes.set_title(f"{design.name}: settings, and PSE with its interval")
        axes.legend(loc="best")
        figure.tight_layout()
    return figure
