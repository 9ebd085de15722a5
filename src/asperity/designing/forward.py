r"""From a height map to the numbers that a design aims at, and back: values and their gradients.

    heights --> offset lines under each probe --> periodic motions of the hand --> numbers

Each arrow has an adjoint. Of an offset height it is the envelope theorem: H is the highest of
`h(x) + sphere(x - u)`, so that its derivative by a sample is the spline's weight of that sample at
the contact. The motion's is in `motion`, the numbers' in `measures`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from asperity._core.arrays import Array
from asperity.designing.line import OffsetLine, spline_gain, spline_weights
from asperity.designing.measures import VibrationMeasure
from asperity.designing.motion import heights_gradient, periodic_lag
from asperity.dynamics.dragged_hand.hand import Hand
from asperity.errors import require_positive
from asperity.geometry.offsets.sampled import HeightMap

FINER = 2
"""Samples of an offset line for each of the map."""


@dataclass(frozen=True)
class Demand:
    """A number that a surface is to have under a probe.

    Parameters
    ----------
    measure : VibrationMeasure
    value : float
        Wanted [unit of the measure], above 0.
    diameter, force, speed : float
        Of the probe [m], normal to the surface [N], along it [m/s].
    spacing : float, optional
        The pattern's pitch at which this is wanted [m], for curves over spacing.
    """

    measure: VibrationMeasure
    value: float
    diameter: float = 3e-3
    force: float = 0.58
    speed: float = 0.083
    spacing: float | None = None

    def __post_init__(self) -> None:
        require_positive("value", self.value, f"[{self.measure.unit}]")
        require_positive("diameter", self.diameter, "[m]")
        require_positive("force", self.force, "[N]")
        require_positive("speed", self.speed, "[m/s]")
        if self.spacing is not None:
            require_positive("spacing", self.spacing, "[m]")

    @property
    def label(self) -> str:
        """The conditions, for tables."""
        at = "" if self.spacing is None else f"pitch {self.spacing * 1e3:.3g} mm, "
        return (
            f"{self.measure.label}; {at}probe {self.diameter * 1e3:.3g} mm, {self.force:.3g} N, "
            f"{self.speed * 1e3:.4g} mm/s"
        )


@dataclass(frozen=True, eq=False)
class TracedLines:
    """Offset lines over a map, and where the probe touches it [m], (lines, n)."""

    lines: list[OffsetLine]
    contact_u: Array
    contact_v: Array
    pixel: float
    shape: tuple[int, int]

    def adjoint(self, by_heights: Array) -> Array:
        """Return the gradient by the map's samples from that by the lines' heights (lines, n)."""
        rows, columns = self.shape
        x, y = self.contact_u.ravel() / self.pixel + 0.5, self.contact_v.ravel() / self.pixel + 0.5
        column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        along, across = spline_weights(x - column), spline_weights(y - row)
        out = np.zeros(rows * columns)
        given = by_heights.ravel()
        for a in range(4):
            for b in range(4):
                at = (row + a - 2) % rows * columns + (column + b - 2) % columns
                out += np.bincount(at, given * across[a] * along[b], rows * columns)
        waves = np.fft.rfft2(out.reshape(self.shape))
        waves /= spline_gain(np.fft.fftfreq(rows))[:, None]
        waves /= spline_gain(np.fft.rfftfreq(columns))
        return np.asarray(np.fft.irfft2(waves, s=self.shape))


def stroke_places(width: float, strokes: int, shift: float = 0.0) -> Array:
    """Return the v [m] of strokes evenly spread over a map; `shift` in distances of strokes."""
    return np.asarray(np.mod((np.arange(strokes) + 0.5 + shift) / strokes * width, width))


def trace_lines(samples: Array, pixel: float, diameter: float, places: Array) -> TracedLines:
    """Return the offset lines along u at `places` [m] of a map that repeats both ways."""
    rows, columns = samples.shape
    length = columns * pixel
    u = np.arange(FINER * columns) * (length / (FINER * columns))
    us, vs = np.broadcast_arrays(u[None, :], np.asarray(places)[:, None])
    surface = HeightMap(samples, pixel, "wrap")
    heights, along, across = surface.contacts(diameter, us, vs)
    lines = [OffsetLine(row, length) for row in heights]
    return TracedLines(lines, us + along, vs + across, pixel, (rows, columns))


@dataclass
class TouchBench:
    """Evaluates demands on height maps for one hand.

    Parameters
    ----------
    demands : tuple of Demand
    hand : Hand
    strokes : int
        Strokes over the map, evenly spread across it.
    shift : float
        By how much the strokes are moved, in their distances: 0.5 for strokes that a design has
        not seen.
    """

    demands: tuple[Demand, ...]
    hand: Hand = field(default_factory=Hand)
    strokes: int = 3
    shift: float = 0.0
    _starts: dict[tuple[float, float, float, int], Array] = field(default_factory=dict, repr=False)

    def values(self, samples: Array, pixel: float) -> Array:
        """Return the numbers of the demands (m,) for a map (rows, columns) [m]."""
        return self._run(samples, pixel, None)[0]

    def values_and_gradient(
        self, samples: Array, pixel: float, weights_of: Callable[[Array], Array]
    ) -> tuple[Array, Array]:
        """Return the numbers (m,), and the gradient by the samples of their weighted sum.

        `weights_of` is a function from the numbers to the weights (m,).
        """
        values, gradient = self._run(samples, pixel, weights_of)
        assert gradient is not None
        return values, gradient

    def _run(
        self, samples: Array, pixel: float, weights_of: Callable[[Array], Array] | None
    ) -> tuple[Array, Array | None]:
        values = np.zeros(len(self.demands))
        places = stroke_places(samples.shape[0] * pixel, self.strokes, self.shift)
        pending = []
        for diameter in sorted({demand.diameter for demand in self.demands}):
            traced = trace_lines(samples, pixel, diameter, places)
            touches = sorted({(d.force, d.speed) for d in self.demands if d.diameter == diameter})
            for force, speed in touches:
                lags = []
                for i, line in enumerate(traced.lines):
                    key = (diameter, force, speed, i)
                    lag = periodic_lag(line, self.hand, force, speed, self._starts.get(key))
                    self._starts[key] = lag.values
                    lags.append(lag)
                for j, demand in enumerate(self.demands):
                    if (demand.diameter, demand.force, demand.speed) == (diameter, force, speed):
                        values[j], by_lags = demand.measure.value_and_gradients(lags)
                        pending.append((j, traced, lags, by_lags))
        if weights_of is None:
            return values, None
        weights = weights_of(values)
        gradient = np.zeros(samples.shape)
        for j, traced, lags, by_lags in pending:
            by_heights = np.stack(
                [
                    heights_gradient(lag, line, weights[j] * by_lag)
                    for lag, line, by_lag in zip(lags, traced.lines, by_lags, strict=True)
                ]
            )
            gradient += traced.adjoint(by_heights)
        return values, gradient
