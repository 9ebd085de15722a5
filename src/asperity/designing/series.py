"""A series of stimuli, evenly spaced in a metric: one pattern that differs in its height alone.

The stimuli look alike, and differ in what is felt. How even a series is for another hand depends
on how alike the metric grows with height for all of them; `evenness` measures that. Of the pitches
that reach all values the one is taken whose series is the most even over an ensemble of hands, and
the heights between its ends are moved, within the tolerance, to make it more so.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import minimize

from asperity._core.arrays import Array, Mask
from asperity.designing.candidate import DesignedSurface, DesignSettings, bench_of
from asperity.designing.forward import Demand
from asperity.designing.judge import JudgedTile
from asperity.designing.pattern_search import at_parameters, search_pattern
from asperity.designing.process import facet_slopes
from asperity.designing.unknowns import HEIGHTS, PITCHES, PatternUnknown, square_samples
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import AsperityError
from asperity.texture.height_field import HeightField

_PITCHES = 15
"""Pitches that are tried, if the pitch is free."""
_HEIGHT_SAMPLES = 24
"""Heights at which the metric of one hand is evaluated, over the range that is allowed."""
_CURVE = 12
"""Heights at which that of all hands is."""
_UNEVEN, _SOFT = 0.046, 0.003
"""Unevenness beyond which a hand counts, and over which the count rises."""
_RESTARTS = 3


class Evenness(NamedTuple):
    """How even a series is for each hand."""

    monotonic: Mask
    """(hands,) whether each stimulus has more than the one before."""
    uneven: Array
    """(hands,) largest deviation of a step from the mean step, relative."""

    def share(self, limit: float = 0.05) -> float:
        """Return the share of hands for which the series rises and is even within `limit`."""
        return float(np.mean(self.monotonic & (self.uneven <= limit)))


def evenness(values: Array, *, log: bool = False) -> Evenness:
    """Return how even a series is.

    Parameters
    ----------
    values : (stimuli, hands) array
        Of the metric; NaN for a hand that cannot be dragged, which counts as not even.
    log : bool
        Whether steps are ratios.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        steps = np.diff(np.log(values) if log else values, axis=0)
        mean = steps.mean(axis=0)
        uneven = np.max(np.abs(steps / mean - 1.0), axis=0)
    monotonic = np.all(steps > 0.0, axis=0)
    return Evenness(monotonic, np.where(np.isfinite(uneven), uneven, np.inf))


def height_alone(unknown: PatternUnknown, parameters: Mapping[str, float]) -> PatternUnknown:
    """Return the unknown with only its height free; the others are fixed at `parameters`."""
    name = next((name for name in HEIGHTS if name in unknown.free), None)
    if name is None:
        raise AsperityError(
            f"a series varies the height of a pattern: leave one of {', '.join(HEIGHTS)} free"
        )
    fixed = {key: value for key, value in parameters.items() if key != name}
    return PatternUnknown(unknown.kind, {name: unknown.free[name]}, {**unknown.fixed, **fixed})


def search_series(
    unknown: PatternUnknown,
    values: list[float],
    base: Demand,
    settings: DesignSettings,
    *,
    hands: Sequence[Hand] = (),
    log: bool = False,
    tell: Callable[[str, float], None] | None = None,
) -> tuple[list[DesignedSurface], PatternUnknown]:
    """Return a surface for each value of a series, and the unknown that they share.

    Parameters
    ----------
    unknown : PatternUnknown
        With a free height. If its pitch is free too, that of several is taken whose series is the
        most even over the hands.
    values : list of float
        Wanted, rising.
    base : Demand
        Measure and conditions.
    settings : DesignSettings
    hands : sequence of Hand
        Over which the series is to be even, besides that of the settings. The first and the last
        stimulus are exact for that one, and those between within the tolerance.
    log : bool
        Whether equal ratios are wanted.
    tell : callable, optional
        Called with what is done and the share of hands for which the best series is uneven.

    Raises
    ------
    UnreachableError
        The largest value cannot be had; with the nearest surface.
    """
    pitch = next((name for name in PITCHES if name in unknown.free), None)
    places = [0.5] if pitch is None else list(np.linspace(0.0, 1.0, _PITCHES))
    best: tuple[float, PatternUnknown, Array] | None = None
    for place in places:
        given = np.full(len(unknown.names), 0.5)
        if pitch is not None:
            given[unknown.names.index(pitch)] = place
        alone = height_alone(unknown, unknown.parameters(given))
        span = _nominal_heights(alone, values, base, settings)
        if span is None:
            continue
        uneven, heights = _even_heights(alone, span, values, base, settings, hands, log)
        if best is None or uneven < best[0]:
            best = uneven, alone, heights
        if tell is not None:
            tell("series", best[0])
    if best is None:
        # Refused, with the nearest: by the search that has all parameters free.
        largest = (replace(base, value=values[-1]),)
        search_pattern(unknown, largest, replace(settings, candidates=1))
        raise AsperityError(
            f"{unknown.kind}: {values[-1]:g} can be had, but not with one pitch for the whole "
            "series; narrow the range of the pitch, or fix it"
        )
    _, alone, heights = best
    surfaces = [
        at_parameters(alone, {alone.names[0]: float(h)}, (replace(base, value=value),), settings)
        for h, value in zip(heights, values, strict=True)
    ]
    return surfaces, alone


def _nominal_heights(
    alone: PatternUnknown, values: list[float], base: Demand, settings: DesignSettings
) -> Array | None:
    """Return the heights that have the values for the settings' hand; None if there are none."""
    low, high = alone.free[alone.names[0]]
    heights: list[float] = []
    curve: list[float] = []
    bench = bench_of((base,), settings)
    for x in np.linspace(0.0, 1.0, _HEIGHT_SAMPLES):
        try:
            samples, pixel = square_samples(alone.field(np.array([x])))
            samples = settings.process.to_make(samples, (pixel, pixel))
            slope = float(facet_slopes(samples, (pixel, pixel), wraps=True).max())
            if slope > settings.process.slope or np.ptp(samples) > settings.process.relief:
                break
            made = settings.process.made(samples, (pixel, pixel), steps=False)
            value = float(bench.values(made, pixel)[0])
        except AsperityError:
            break
        if curve and value <= curve[-1]:
            break  # Beyond its largest value, a height has no single number.
        heights.append(low * (high / low) ** x)
        curve.append(value)
        if value > values[-1]:
            break
    if len(curve) < 4 or not (curve[0] <= values[0] and curve[-1] >= values[-1]):
        return None
    return np.exp(PchipInterpolator(np.log(curve), np.log(heights))(np.log(values)))


def _even_heights(
    alone: PatternUnknown, span: Array, values: list[float], base: Demand,
    settings: DesignSettings, hands: Sequence[Hand], log: bool,
) -> tuple[float, Array]:  # fmt: skip
    """Return the share of hands for which the series is uneven, about, and its heights."""
    name = alone.names[0]
    # A little beyond both ends, so that the interpolation is never extended.
    heights = np.geomspace(span[0] * 0.97, min(span[-1] * 1.03, alone.free[name][1]), _CURVE)
    everybody = [settings.hand, *hands]
    curves = np.full((_CURVE, len(everybody)), np.nan)
    for i, height in enumerate(heights):
        samples, pixel = square_samples(alone.field(alone.unknowns({name: height})))
        samples = settings.process.to_make(samples, (pixel, pixel))
        made = settings.process.made(samples, (pixel, pixel), steps=False)
        tile = JudgedTile(HeightField(made, pixel, "wrap"), settings.strokes)
        curves[i] = [tile.value(base, hand) for hand in everybody]
    usable = np.all(np.isfinite(curves), axis=0)
    if not usable[0]:
        return np.inf, span
    splines = CubicSpline(np.log(heights), curves[:, usable])
    missing = int(np.count_nonzero(~usable))

    def spread(inner: Array) -> float:
        places = np.concatenate([[ends[0]], inner, [ends[1]]])
        if np.any(np.diff(places) <= 0.0):
            return 1e3
        found = splines(places)
        uneven = evenness(found[:, 1:] if hands else found, log=log).uneven
        # A smooth count of the hands that are not even, and how uneven the others are.
        beyond = 0.5 + 0.5 * np.tanh((uneven - _UNEVEN) / _SOFT)
        count = (float(np.sum(beyond)) + missing) / max(len(hands), 1)
        off = float(np.max(np.abs(found[:, 0] / values - 1.0)))
        return (
            count
            + float(np.mean(np.minimum(uneven, 0.2)))
            + 100.0 * max(off - settings.tolerance, 0.0)
        )

    fine = np.linspace(math.log(heights[0]), math.log(heights[-1]), 2001)
    nominal = np.interp(values, splines(fine)[:, 0], fine)
    ends = (nominal[0], nominal[-1])
    inner = nominal[1:-1]
    for _ in range(_RESTARTS):
        found = minimize(
            spread, inner, method="Nelder-Mead",
            options={"maxfev": 1500, "xatol": 1e-5, "fatol": 1e-6},
        )  # fmt: skip
        inner = found.x if found.fun < spread(inner) else inner
    return spread(inner), np.exp(np.concatenate([[ends[0]], inner, [ends[1]]]))
