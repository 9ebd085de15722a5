r"""Metrics of a drag, computed so that a hundred of them take little longer than one.

A drag is kept as its `DragRecord`: the Fourier series of the hand's lag `u - v t`, and the
extremes of u''. Every signal of Eq. 7 is the lag times a factor that depends on frequency alone:

    position 1,  velocity i w,  acceleration -w^2,  force  -(k + i b w - m w^2) .

A metric is then a band-pass (second-order Butterworth, without its phase) and a norm over time:

    M_p = ( mean |y|^p )^(1/p) ,     p = 2 is the RMS, p = infinity the peak.

Metrics with p other than 2 are asperity's. They were added because a texture's events become rarer
as its spacing grows: the RMS falls with their rate, the peak does not, and other p lie between.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.dynamics.dragged_hand.hand import Hand, Motion, MotionStatus
from asperity.errors import AsperityError, require_choice
from asperity.runs.vibration_metrics import DEFAULT_BAND, band_gain, threshold_weighted_power
from asperity.studies.skin.channels import CHANNELS, channel_level
from asperity.studies.skin.pooling import Pooling
from asperity.studies.skin.transmission import transmissibility

HIGHEST = 2000.0
"""Highest frequency that a record keeps [Hz]; people feel up to about 1000 Hz."""
_LEAST_HARMONICS = 64
_HANN_SQUARED = 8.0 / 3.0
"""Factor by which a Hann window reduces power."""
SIGNALS = ("acceleration", "force", "velocity", "position")
KINDS = ("largest", "largest_abs", "norm", "threshold", *CHANNELS, "pooled", "summed")
_ALL_CHANNELS = {"pooled": "channels pooled", "summed": "channels summed"}
_UNITS = {"acceleration": "m/s²", "force": "N", "velocity": "m/s", "position": "m"}


class DragRecord(NamedTuple):
    """The spectrum and extremes of one drag, from which metrics are computed."""

    frequencies: NDArray[np.float64]
    """[Hz], above 0, shape (m,)."""
    lag: NDArray[np.complex128]
    """One-sided Fourier coefficients of u - v t [m]: `sum Re(lag e^(i w t))`."""
    largest: float
    """Largest u'' [m/s^2]."""
    smallest: float
    """Smallest u'' [m/s^2]."""
    hand: Hand
    window: bool
    """Whether the motion is aperiodic and the lag has a Hann window."""


def record_of(motion: Motion, hand: Hand) -> DragRecord:
    """Return the record of a motion."""
    lag = motion.lag - np.mean(motion.lag)
    window = motion.status == MotionStatus.APERIODIC
    if window:
        lag = lag * np.hanning(lag.size)
    series = 2.0 * np.fft.rfft(lag) / lag.size
    frequencies = np.fft.rfftfreq(lag.size, motion.step).astype(np.float64)
    kept = max(int(np.searchsorted(frequencies, HIGHEST)), _LEAST_HARMONICS + 1)
    kept = min(kept, frequencies.size - 1)
    return DragRecord(
        frequencies[1:kept], series[1:kept], motion.largest, motion.smallest, hand, window
    )


STILL = DragRecord(np.ones(1), np.zeros(1, dtype=np.complex128), 0.0, 0.0, Hand(), False)
"""The record of a probe over a flat surface."""


@dataclass(frozen=True)
class Measure:
    """A metric: one number of one or several records."""

    kind: str = "norm"
    """One of `KINDS`: max u'', max |u''|, a norm, threshold-weighted power of u'', the response of
    one of the skin's channels to u - v t, or all three pooled, with saturation or summed as they
    are."""
    signal: str = "acceleration"
    """One of `SIGNALS`, for a norm."""
    band: tuple[float, float] | None = None
    """Band [Hz]; None for no filter."""
    power: float = 2.0
    """p of the norm, 2 or above; infinity is the peak."""
    transmission: bool = False
    """Whether the vibration reaches the skin through the fingertip's tissue, for channels."""

    def __post_init__(self) -> None:
        require_choice("kind", self.kind, KINDS)
        require_choice("signal", self.signal, SIGNALS)
        if self.band is not None and not 0.0 < self.band[0] < self.band[1] < math.inf:
            raise AsperityError(f"band must rise from above 0 Hz and be finite, got {self.band}")
        if not self.power >= 2.0:
            raise AsperityError(f"power of a norm must be 2 or above, got {self.power!r}")

    @property
    def name(self) -> str:
        """A short name, for tables."""
        if self.kind in (*CHANNELS, *_ALL_CHANNELS):
            what = _ALL_CHANNELS.get(self.kind, f"{self.kind.upper()} channel")
            return f"{what}, through tissue" if self.transmission else what
        if self.kind != "norm":
            return {"largest": "max u''", "largest_abs": "max |u''|"}.get(
                self.kind, "threshold power"
            )
        what = "RMS" if self.power == 2.0 else f"L{self.power:g}"
        what = "peak" if math.isinf(self.power) else what
        band = f" {self.band[0]:g}-{self.band[1]:g} Hz" if self.band else ""
        return f"{what} {self.signal}{band}"

    @property
    def unit(self) -> str:
        """Unit of the value."""
        if self.kind in ("threshold", *CHANNELS, *_ALL_CHANNELS):
            return "1"
        return _UNITS["acceleration" if self.kind != "norm" else self.signal]

    def __call__(self, records: Sequence[DragRecord]) -> float:
        """Return the metric of records taken as consecutive strokes."""
        return float(evaluate_all(records, [self])[0])

    def together(self, values: ArrayLike) -> NDArray[np.float64]:
        """Return the metric of consecutive equal strokes from their values (first axis)."""
        strokes = np.asarray(values, dtype=np.float64)
        if self.kind in ("threshold", *_ALL_CHANNELS):
            return np.asarray(np.mean(strokes, axis=0))
        if self.kind in CHANNELS:
            return np.asarray(np.sqrt(np.mean(strokes**2, axis=0)))
        if self.kind != "norm" or math.isinf(self.power):
            return np.asarray(np.max(strokes, axis=0))
        return np.asarray(np.mean(strokes**self.power, axis=0) ** (1.0 / self.power))


def measure_of(stored: Mapping[str, Any]) -> Measure:
    """Return the metric that `fit.as_json` wrote as JSON values."""
    band = tuple(stored["band"]) if stored["band"] else None
    power = math.inf if stored["power"] is None else stored["power"]
    through = stored.get("transmission", False)
    return Measure(stored["kind"], stored["signal"], band, power, through)


def evaluate_all(records: Sequence[DragRecord], measures: Sequence[Measure]) -> NDArray[np.float64]:
    """Return several metrics of records at once, sharing transforms."""
    values = np.array([_of_one(record, measures) for record in records])
    return np.array([m.together(values[:, i]) for i, m in enumerate(measures)])


def _of_one(record: DragRecord, measures: Sequence[Measure]) -> list[float]:
    hann = _HANN_SQUARED if record.window else 1.0
    gain = cache(lambda band: 1.0 if band is None else band_gain(record.frequencies, band))

    @cache
    def lines(signal: str) -> NDArray[np.complex128]:
        return np.asarray(record.lag * _response(signal, record), dtype=np.complex128)

    @cache
    def squares(signal: str) -> NDArray[np.float64]:
        return np.square(lines(signal).real) + np.square(lines(signal).imag)

    @cache
    def squared_wave(signal: str, band: tuple[float, float] | None) -> NDArray[np.float64]:
        """Return the square of a signal at equal times; its lines are harmonics of the record."""
        kept = lines(signal) * np.sqrt(gain(band))
        samples = 3 * (kept.size + 1)
        series = np.zeros(samples // 2 + 1, dtype=np.complex128)
        series[1 : kept.size + 1] = (0.5 * samples) * kept
        return np.asarray(np.square(np.fft.irfft(series, samples)))

    @cache
    def response(channel: str, transmission: bool) -> float:
        moved = np.abs(record.lag)
        if transmission:
            moved = moved * np.abs(transmissibility(record.frequencies))
        return math.sqrt(hann) * channel_level(channel, record.frequencies, moved)

    def value(measure: Measure) -> float:
        signal, band, power = measure.signal, measure.band, measure.power
        if measure.kind == "largest":
            return record.largest
        if measure.kind == "largest_abs":
            return max(record.largest, -record.smallest)
        if measure.kind in CHANNELS:
            return response(measure.kind, measure.transmission)
        if measure.kind == "pooled":
            return POOLING.intensity({c: response(c, measure.transmission) for c in CHANNELS})
        if measure.kind == "summed":
            return sum(response(c, measure.transmission) for c in CHANNELS)
        if measure.kind == "threshold":
            lines_at = np.sqrt(squares(signal))
            return hann * threshold_weighted_power(record.frequencies, lines_at)
        if power == 2.0:
            return math.sqrt(0.5 * hann * float(np.sum(squares(signal) * gain(band))))
        wave = squared_wave(signal, band)
        if math.isinf(power):
            return math.sqrt(float(np.max(wave)))
        weight = 1.0 / float(np.mean(np.hanning(wave.size) ** power)) if record.window else 1.0
        return float((weight * np.mean(wave ** (0.5 * power))) ** (1.0 / power))

    return [value(measure) for measure in measures]


def _response(signal: str, record: DragRecord) -> NDArray[Any] | float:
    """Return the factor from the hand's lag to a signal, at each frequency of a record."""
    omega, hand = 2.0 * np.pi * record.frequencies, record.hand
    if signal == "velocity":
        return np.asarray(1j * omega)
    if signal == "acceleration":
        return -(omega**2)
    if signal == "force":
        return np.asarray(-(hand.stiffness + 1j * hand.damping * omega - hand.mass * omega**2))
    return 1.0


POOLING = Pooling()
"""How channels are pooled; fixed before any outcome was seen."""
SKIN_MEASURES = tuple(
    Measure(kind, transmission=through)
    for kind in (*CHANNELS, "pooled")
    for through in (False, True)
)
"""Responses of the skin's channels, each with and without the tissue between grip and skin."""
PAPER = Measure("largest")
"""The seed paper's metric."""
COLUMNS = {
    "max_acceleration": PAPER,
    "max_abs_acceleration": Measure("largest_abs"),
    "band_rms": Measure(band=DEFAULT_BAND),
    "threshold_power": Measure("threshold"),
}
"""The metrics that are compared with the literature, by their names in `METRICS`."""
