"""Criteria of findings: rules on curves of a metric over spacing.

Thresholds are asperity's; those also used by the claims of the studies are imported from there.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.studies.literature.finding import Verdict
from asperity.studies.otaduy_lin_2004.claims import (
    LARGE_SPACING,
    LEAST_R_SQUARED,
    SAME_PLACE,
    plain,
)
from asperity.studies.otaduy_lin_2004.peak_fit import fit_quadratic

Curve = NDArray[np.float64]

SHIFT = 0.02
"""Least relative change of spacing by which a peak has moved."""
NEAR = 0.25
"""Largest relative distance of a peak that is near its drop point."""
LEVEL = 0.8
"""Least ratio of a curve's end to its maximum if it has levelled rather than fallen."""
RISE = 1.5
"""Least ratio of a curve's maximum to its beginning if it has risen."""
SLOPE = (0.5, 1.5)
"""Range of the slope of log peak over log drop point if the first follows the second."""
FOLLOWS = 0.8
"""Least R^2 of that fit."""
STRONGER = 1.05
"""Least ratio of two effects of which one is stronger."""


class CurveMaximum(NamedTuple):
    """The maximum of a sampled curve."""

    spacing: float
    """By the parabola in log-log through the largest sample and its neighbours [m]."""
    value: float
    inside: bool
    """Whether the largest sample has lower ones on both sides."""


def maximum_of(spacing: Curve, values: Curve) -> CurveMaximum:
    """Return the maximum of a curve over rising spacings [m]."""
    best = int(np.argmax(values))
    if best in (0, values.size - 1) or not np.all(values[best - 1 : best + 2] > 0.0):
        return CurveMaximum(float(spacing[best]), float(values[best]), False)
    x, y = np.log(spacing[best - 1 : best + 2]), np.log(values[best - 1 : best + 2])
    c = np.polyfit(x - x[1], y - y[1], 2)
    if not c[0] < 0.0:
        return CurveMaximum(float(spacing[best]), float(values[best]), True)
    at = float(np.clip(-0.5 * c[1] / c[0], x[0] - x[1], x[2] - x[1]))
    return CurveMaximum(float(np.exp(x[1] + at)), float(np.exp(y[1] + np.polyval(c, at))), True)


def peaks_fall_with(spacing: Curve, curves: Curve) -> Verdict:
    """Judge: each level's peak is lower than the one before; every peak inside the range."""
    tops = [maximum_of(spacing, row) for row in curves]
    values = np.array([top.value for top in tops])
    return _of_peaks(tops, np.all(np.diff(values) < 0.0), peak_value=values)


def peaks_move_right(spacing: Curve, curves: Curve) -> Verdict:
    """Judge: each level peaks at a larger spacing than the one before; every peak inside."""
    tops = [maximum_of(spacing, row) for row in curves]
    places = np.array([top.spacing for top in tops])
    return _of_peaks(tops, np.all(places[1:] > (1.0 + SHIFT) * places[:-1]))


def peaks_stay(spacing: Curve, curves: Curve) -> Verdict:
    """Judge: the peaks' places differ by less than 10 % of their mean, every peak inside."""
    tops = [maximum_of(spacing, row) for row in curves]
    places = np.array([top.spacing for top in tops])
    shift = float(np.ptp(places) / np.mean(places))
    return _of_peaks(tops, shift < SAME_PLACE, shift=shift)


def _of_peaks(tops: list[CurveMaximum], holds: bool | np.bool_, **measured: Any) -> Verdict:
    """Return a verdict on peaks, which holds only if every peak is inside the range."""
    inside = [top.inside for top in tops]
    places = np.array([top.spacing for top in tops]) * 1e3
    return _verdict(all(inside) and holds, **measured, peak_mm=places, inside=inside)


def _verdict(holds: bool | np.bool_, **measured: Any) -> Verdict:
    return Verdict(bool(holds), plain(measured))


def rises_everywhere(spacing: Curve, curves: Curve) -> Verdict:
    """Judge: each level gives more than the one before, at every spacing."""
    least = np.min(curves[1:] / np.maximum(curves[:-1], 1e-300), axis=1)
    return _verdict(np.all(least > 1.0), least_ratio=least)


def rises_at_large(spacing: Curve, curves: Curve) -> Verdict:
    """Judge: each level gives more than the one before, at 2.5 mm."""
    x = np.log(spacing)
    logs = [np.log(np.maximum(row, 1e-300)) for row in curves]
    at = np.exp([np.interp(np.log(LARGE_SPACING), x, row) for row in logs])
    reached = spacing[0] <= LARGE_SPACING <= spacing[-1]
    return _verdict(reached and np.all(np.diff(at) > 0.0), value=at)


def falls_at_small(spacing: Curve, curves: Curve) -> Verdict:
    """Judge: each level gives less than the one before, at the smallest spacing."""
    return _verdict(np.all(np.diff(curves[:, 0]) < 0.0), value=curves[:, 0])


def inverted_u(spacing: Curve, curves: Curve) -> Verdict:
    """Judge: log-log, a quadratic with its top inside the range fits each curve (R^2 of 0.9)."""
    if not np.all(curves > 0.0):
        return Verdict(False, {}, "The metric is zero somewhere.")
    fits = [fit_quadratic(spacing, row) for row in curves]
    r_squared = np.array([f.r_squared for f in fits])
    tops = np.array([f.peak_spacing for f in fits])
    inside = (tops > spacing[0]) & (tops < spacing[-1])
    return _verdict(
        np.all(inside & (r_squared >= LEAST_R_SQUARED)),
        r_squared=r_squared, fitted_peak_mm=tops * 1e3,
    )  # fmt: skip


def follows(places: Curve, drops: Curve, inside: NDArray[np.bool_]) -> Verdict:
    """Judge: log peak follows log drop point with a slope near 1; every peak inside its range."""
    r_squared, slope = _line(drops, places)
    holds = SLOPE[0] <= slope <= SLOPE[1] and r_squared >= FOLLOWS
    return _at_drops(places, drops, np.all(inside) and holds, slope=slope, r_squared=r_squared)


def near(places: Curve, drops: Curve, inside: NDArray[np.bool_]) -> Verdict:
    """Judge: every peak lies inside its range and within a quarter of its drop point."""
    off = np.abs(places / drops - 1.0)
    return _at_drops(places, drops, np.all(inside) and np.all(off <= NEAR))


def above(places: Curve, drops: Curve, inside: NDArray[np.bool_]) -> Verdict:
    """Judge: every peak lies inside its range and above its drop point."""
    return _at_drops(places, drops, np.all(inside) and np.all(places > (1.0 + SHIFT) * drops))


def _at_drops(places: Curve, drops: Curve, holds: bool | np.bool_, **measured: Any) -> Verdict:
    mm = {"peak_mm": places * 1e3, "drop_point_mm": drops * 1e3}
    return _verdict(holds, **measured, **mm, ratio=places / drops)


def rises_then_levels(spacing: Curve, values: Curve) -> Verdict:
    """Judge: the curve rises by half or more, and at its end keeps four fifths of its top."""
    top = int(np.argmax(values))
    rise = float(values[top] / max(values[0], 1e-300))
    kept = float(values[-1] / max(values[top], 1e-300))
    return _verdict(
        rise >= RISE and kept >= LEVEL, rise=rise, kept=kept, top_mm=float(spacing[top] * 1e3)
    )


def linear_against_quadratic(spacing: Curve, finger: Curve, probe: Curve) -> Verdict:
    """Judge: the finger's curve is a rising line in log-log; the probe's a quadratic, no line."""
    if not (np.all(finger > 0.0) and np.all(probe > 0.0)):
        return Verdict(False, {}, "The metric is zero somewhere.")
    line_finger, slope = _line(spacing, finger)
    line_probe, _ = _line(spacing, probe)
    quadratic = fit_quadratic(spacing, probe)
    return _verdict(
        line_finger >= LEAST_R_SQUARED
        and slope > 0.0
        and quadratic.r_squared >= LEAST_R_SQUARED
        and spacing[0] < quadratic.peak_spacing < spacing[-1]
        and line_probe < LEAST_R_SQUARED,
        finger_line_r_squared=line_finger,
        finger_slope=slope,
        probe_line_r_squared=line_probe,
        probe_quadratic_r_squared=quadratic.r_squared,
        probe_peak_mm=quadratic.peak_spacing * 1e3,
    )


def ordered(values: Curve) -> Verdict:
    """Judge: each surface gives less than the coarser one before; one row a probe."""
    rows = np.atleast_2d(values)
    ratio = rows[:, :-1] / np.maximum(rows[:, 1:], 1e-300)
    return _verdict(np.all(ratio > 1.0), coarse_over_fine=ratio)


def stronger(one: float, other: float) -> Verdict:
    """Judge: the first effect is larger than the second by 5 % or more."""
    return _verdict(one >= STRONGER * other and one > 0.0, passive=one, active=other)


def size_of_effect(curves: Curve) -> float:
    """Return the mean over spacings of |log(last level / first level)|."""
    first, last = np.maximum(curves[0], 1e-300), np.maximum(curves[-1], 1e-300)
    return float(np.mean(np.abs(np.log(last / first))))


def _line(spacing: Curve, values: Curve) -> tuple[float, float]:
    """Return R^2 and slope of a line in log-log."""
    x, y = np.log(spacing), np.log(values)
    slope, offset = np.polyfit(x, y, 1)
    total = float(np.sum((y - np.mean(y)) ** 2))
    residual = float(np.sum((y - slope * x - offset) ** 2))
    return (1.0 - residual / total if total > 0.0 else 0.0), float(slope)
