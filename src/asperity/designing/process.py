r"""Processes of manufacture: what they can make, and what they make of a height map.

A map to be made is limited in its waves (`feature`, the narrowest ridge or groove, is half of the
shortest wave), its slope and its relief. The process then blurs it, by a Gaussian of standard
deviation `blur`, and rounds it to layers. A height map has no overhangs.

The presets are round figures of desk-top machines as their makers state them, and asperity's; a
machine's own come from a printed calibration patch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_choice, require_not_negative, require_positive

_LEFT = 0.03
"""What a map to be made keeps of its shortest wave. A Gaussian leads there: it does not ring, as a
sharper filter does at the edge of a dot."""


@dataclass(frozen=True)
class ManufactureProcess:
    """What a machine can make.

    Parameters
    ----------
    pixel : float
        Distance between the samples of the map that it gets [m], above 0.
    feature : float
        Width of the narrowest ridge or groove [m], a pixel or more.
    slope : float
        Largest slope, above 0.
    relief : float
        Largest height from the lowest to the highest place [m], above 0.
    layer : float
        Thickness of a layer [m]; 0 for a process without layers.
    blur : float
        Standard deviation of the blur [m], 0 or above.
    """

    name: str = "none"
    pixel: float = 50e-6
    feature: float = 50e-6
    slope: float = 10.0
    relief: float = 2e-3
    layer: float = 0.0
    blur: float = 0.0

    def __post_init__(self) -> None:
        for name in ("pixel", "feature", "slope", "relief"):
            require_positive(name, getattr(self, name))
        for name in ("layer", "blur"):
            require_not_negative(name, getattr(self, name), "[m]")
        if self.feature < self.pixel * (1.0 - 1e-9):
            raise AsperityError(
                f"feature must be a pixel ({self.pixel:g} m) or more, got {self.feature:g} m"
            )

    @property
    def shortest(self) -> float:
        """Shortest wave of a map to be made [m]."""
        return 2.0 * self.feature

    def passed(self, wavenumbers: Array) -> Array:
        """Return the share of each wave [1/m] that a map to be made keeps."""
        share = wavenumbers * self.shortest
        return np.where(share <= 1.0, np.exp(math.log(_LEFT) * share**2), 0.0)

    def blurred(self, wavenumbers: Array) -> Array:
        """Return the share of each wave [1/m] that the process keeps."""
        return np.asarray(np.exp(-2.0 * (math.pi * self.blur * wavenumbers) ** 2))

    def to_make(self, samples: Array, pixel: tuple[float, float]) -> Array:
        """Return a map that repeats without the waves that are too short to be made."""
        return _filtered(samples, self.passed(wavenumbers(samples.shape, pixel)))

    def made(self, samples: Array, pixel: tuple[float, float], *, steps: bool = True) -> Array:
        """Return what the process makes of a map that repeats."""
        out = samples
        if steps and self.layer > 0.0:
            low = float(samples.min())
            out = low + self.layer * np.round((samples - low) / self.layer)
        if self.blur == 0.0:
            return out
        return _filtered(out, self.blurred(wavenumbers(samples.shape, pixel)))


class MapLimits(NamedTuple):
    """What a height map asks of a process."""

    slope: float
    """Largest slope of the triangles between samples."""
    relief: float
    """[m]"""
    feature: float
    """Half of the shortest wave [m]; infinite for a flat map."""


def map_limits(samples: Array, pixel: tuple[float, float], *, wraps: bool = True) -> MapLimits:
    """Return slope, relief and smallest feature of a map, `pixel` [m] along u and v."""
    from asperity.texture.height_field import HeightField

    waves = samples - samples.mean()
    if not wraps:
        # Without a window a border is a step, which has short waves that are not the map's.
        waves = waves * np.hanning(len(waves))[:, None] * np.hanning(waves.shape[1])
    shortest = HeightField(waves, pixel, "wrap").shortest_wavelength
    slope = float(np.max(facet_slopes(samples, pixel, wraps=wraps)))
    return MapLimits(slope, float(np.ptp(samples)), 0.5 * shortest)


def facet_slopes(samples: Array, pixel: tuple[float, float], *, wraps: bool) -> Array:
    """Return the slopes (2, rows, columns) of both triangles of each square of samples."""
    h = np.pad(samples, ((0, 1), (0, 1)), mode="wrap") if wraps else samples
    along, across = np.diff(h, axis=1) / pixel[0], np.diff(h, axis=0) / pixel[1]
    lower = np.hypot(along[:-1], across[:, 1:])
    upper = np.hypot(along[1:], across[:, :-1])
    return np.stack([lower, upper])


def wavenumbers(shape: tuple[int, ...], pixel: tuple[float, float]) -> Array:
    """Return the wavenumbers [1/m] of a real transform of a map."""
    rows, columns = shape
    return np.asarray(
        np.hypot(np.fft.fftfreq(rows, pixel[1])[:, None], np.fft.rfftfreq(columns, pixel[0]))
    )


def _filtered(samples: Array, gain: Array) -> Array:
    waves = np.fft.rfft2(samples) * gain
    return np.asarray(np.fft.irfft2(waves, s=samples.shape))


PRESETS = {
    one.name: one
    for one in (
        ManufactureProcess("none"),
        ManufactureProcess("sla", 50e-6, 150e-6, 2.0, 1.5e-3, 25e-6, 30e-6),
        ManufactureProcess("fdm", 100e-6, 400e-6, 1.0, 3e-3, 50e-6, 150e-6),
        ManufactureProcess("mill", 50e-6, 200e-6, 1.5, 2e-3, 0.0, 20e-6),
        ManufactureProcess("laser", 25e-6, 100e-6, 1.5, 0.4e-3, 0.0, 25e-6),
    )
}
"""By name: nothing but a fine pixel, a resin printer, a filament printer, a mill with a ball of
0.4 mm, laser engraving. Values are asperity's."""


def process_of(preset: str, **changed: float) -> ManufactureProcess:
    """Return one of `PRESETS`, with some of its values changed [m]."""
    from dataclasses import fields, replace

    require_choice("process", preset, PRESETS)
    valid = [one.name for one in fields(ManufactureProcess) if one.name != "name"]
    for name in changed:
        require_choice("value of a process", name, valid)
    return replace(PRESETS[preset], **changed)  # type: ignore[arg-type]
