"""Judges a designed surface by models other than the one that was optimised.

- By `drag`, which integrates the hand's motion over the exact offset surface: over the 36 hands of
  the ensemble, over strokes that the search did not see, and over other seeds of a pattern.
- By the 6-DoF contact solver, in which a simulated hand holds the probe on the plate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity.designing.forward import Demand, stroke_places, trace_lines
from asperity.designing.measures import VibrationMeasure
from asperity.designing.motion import periodic_lag
from asperity.designing.unknowns import square_samples
from asperity.dynamics.dragged_hand.hand import Hand, Motion
from asperity.errors import AsperityError
from asperity.geometry.offsets.piecewise import PiecewiseCubic, tabulate
from asperity.geometry.offsets.sampled import HeightMap
from asperity.runs.vibration_metrics import acceleration_spectrum, band_gain, evaluate
from asperity.studies.otaduy_lin_2004.drags import Condition, drag_over
from asperity.texture.height_field import HeightField

_TOLERANCE = 3e-3
"""Of slope tables, relative to the largest slope."""


def measured(measure: VibrationMeasure, motion: Motion, hand: Hand) -> float:
    """Return a measure of one motion."""
    if measure.quantity == "acceleration":
        return evaluate(measure.metric, motion, band=measure.band)
    frequencies, amplitudes = acceleration_spectrum(motion)
    turns = 2.0 * np.pi * frequencies
    gain = (hand.stiffness - hand.mass * turns**2) ** 2 + (hand.damping * turns) ** 2
    power = amplitudes**2 * gain / turns**4 * band_gain(frequencies, measure.band)
    return float(np.sqrt(0.5 * np.sum(power)))


class JudgedTile:
    """Slope tables of one surface along its strokes, shared by all hands."""

    def __init__(self, made: HeightField, strokes: int, shift: float = 0.0) -> None:
        self._samples, self._pixel = square_samples(made)
        self.places = stroke_places(self._samples.shape[0] * self._pixel, strokes, shift)
        self._tables: dict[tuple[float, int], PiecewiseCubic] = {}

    def _table(self, diameter: float, stroke: int) -> PiecewiseCubic:
        key = (diameter, stroke)
        if key not in self._tables:
            line = float(self.places[stroke])
            surface = HeightMap(self._samples, self._pixel, "wrap", line=line)
            trace = surface.tracer(diameter)
            self._tables[key] = tabulate(
                lambda u: trace(u).slope, surface.period, cells=surface.cells, tolerance=_TOLERANCE
            )
        return self._tables[key]

    def value(self, demand: Demand, hand: Hand) -> float:
        """Return what a demand is about, for a hand; NaN for a hand that stays in a notch."""
        values = []
        for one in range(self.places.size):
            force = self._table(demand.diameter, one).scaled(demand.force)
            try:
                motion = drag_over(force, demand.force, hand, demand.speed)
            except AsperityError:
                return math.nan
            values.append(0.0 if motion is None else measured(demand.measure, motion, hand))
        if demand.measure.metric == "max_acceleration":
            return float(np.max(values))
        power = 2.0 / demand.measure.degree
        return float(np.mean(np.power(values, power)) ** (1.0 / power))


class EnsembleValues(NamedTuple):
    """What the ensemble of hands has on a surface and its variants."""

    variants: tuple[str, ...]
    values: Array
    """(variants, hands, demands); NaN for a hand that cannot be dragged."""


def over_ensemble(
    variants: Sequence[tuple[str, HeightField, float]],
    demands: Sequence[Demand],
    hands: Sequence[Hand],
    strokes: int,
    tell: Callable[[float], None] | None = None,
) -> EnsembleValues:
    """Return what each hand has on each variant of a surface.

    Parameters
    ----------
    variants : sequence of (name, surface, shift)
        `shift` moves the strokes, in their distances.
    demands, hands : sequences
    strokes : int
    tell : callable, optional
        Called with the share that is done.
    """
    out = np.full((len(variants), len(hands), len(demands)), np.nan)
    for i, (_, field, shift) in enumerate(variants):
        tile = JudgedTile(field, strokes, shift)
        for j, hand in enumerate(hands):
            for k, demand in enumerate(demands):
                out[i, j, k] = tile.value(demand, hand)
            if tell is not None:
                tell((i + (j + 1) / len(hands)) / len(variants))
    return EnsembleValues(tuple(name for name, _, _ in variants), out)


class SixDofCheck(NamedTuple):
    """A demand on one stroke, in the 1-D model and in six degrees of freedom."""

    label: str
    line: float
    """v of the stroke [m]."""
    one_dimensional: float
    guided: float
    """6-DoF, a hand on a rail that presses with a constant force: the 1-D model's hand."""
    constant: float
    """6-DoF, without the rail: it also moves across the stroke."""
    full: float
    """6-DoF, a hand alike in all directions, which yields along the normal and in rotation."""

    @property
    def difference(self) -> float:
        """Of `guided` from the 1-D value, relative."""
        return self.guided / self.one_dimensional - 1.0


def check_in_six_dof(
    scene: Any, made: HeightField, demand: Demand, hand: Hand, strokes: int
) -> SixDofCheck | None:
    """Return a demand as the 6-DoF contact has it on the middle stroke; None for other measures.

    Parameters
    ----------
    scene : Scene
        Made as `probe-plate`, with the tile `made` as its texture that wraps.
    made : HeightField
    demand : Demand
        Of `band_rms` of acceleration, or of `max_acceleration`.
    hand : Hand
    strokes : int
        Of the design; the middle one is dragged over.
    """
    from asperity.studies.otaduy_lin_2004.six_dof import drag_over_plate

    if demand.measure.metric == "threshold_power" or demand.measure.quantity != "acceleration":
        return None
    samples, pixel = square_samples(made)
    line = float(stroke_places(samples.shape[0] * pixel, strokes)[strokes // 2])
    [traced] = trace_lines(samples, pixel, demand.diameter, np.array([line])).lines
    lag = periodic_lag(traced, hand, demand.force, demand.speed)
    one, _ = demand.measure.value_and_gradients([lag])
    condition = Condition(traced.period, demand.diameter, demand.force, demand.speed)
    found = {}
    for kind in ("guided", "constant", "full"):
        run = drag_over_plate(
            scene, condition, traced.period / demand.speed, kind=kind, hand=hand,
            band=demand.measure.band, across=line,
        )  # fmt: skip
        is_band = demand.measure.metric == "band_rms"
        found[kind] = run.band_rms if is_band else run.max_acceleration
    return SixDofCheck(demand.label, line, one, found["guided"], found["constant"], found["full"])
