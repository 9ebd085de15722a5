"""The surfaces of the studies by name, and files of heights as stimuli."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, SurfaceError, require_choice
from asperity.geometry.offsets.analytic import Grating, Sinusoid
from asperity.geometry.offsets.dots import DotPlate
from asperity.geometry.offsets.sampled import HeightMap, SampledProfile
from asperity.geometry.offsets.surface import Profile
from asperity.texture.files.reading import read_heights
from asperity.texture.patterns.random_surfaces import self_affine

SURFACES = ("sinusoid", "trapezoid", "square", "dots", "self-affine")
_LOG = logging.getLogger(__name__)
_AFFINE_SAMPLES = 2048
_AFFINE_ROLLOFFS = 16


@dataclass(frozen=True)
class StimulusOptions:
    """Shape of the stimuli. The seed paper prints none of these; the defaults are asperity's."""

    amplitude: float = 0.1e-3
    """Amplitude of the sinusoid [m], half of peak to peak."""
    element_height: float = 0.4e-3
    """Height of ridges and dots [m]."""
    element_width: float = 0.5e-3
    """Width of a ridge's top, diameter of a dot's [m]."""
    flank: float = 0.05e-3
    """Horizontal width of the sloping sides of ridges and dots [m]; of at most half a gap."""
    jitter: float = 0.5
    """Jitter of the dots, as a fraction of half the spacing."""
    hurst: float = 0.8
    """Hurst exponent of self-affine roughness, 0 to 1."""
    rms_slope: float = 0.3
    """RMS slope of self-affine roughness."""
    height_range: float | None = None
    """Peak to peak of a height map without a vertical scale [m]."""
    missing: str = "refuse"
    """What to do with gaps in a height map, as for `asperity.read_heights`: refuse or fill."""
    seed: int = 0
    """Seed of jitter and roughness."""


def surface_maker(name: str, options: StimulusOptions) -> Callable[[float], Profile]:
    """Return the function that makes a surface of a given spacing [m].

    `spacing` is the wavelength of a sinusoid; the gap between the edges of neighbouring ridges
    or dots; the roll-off wavelength of self-affine roughness; for a file of heights, the length
    to which the map's dominant wavelength is stretched (heights stay).

    Parameters
    ----------
    name : str
        One of `SURFACES`, or the path of a file that `asperity.read_heights` reads.
    options : StimulusOptions
    """
    if name not in SURFACES and (Path(name).suffix or os.path.exists(name)):
        return _from_file(name, options)
    require_choice("surface", name, [*SURFACES, "a file of heights"])
    makers: dict[str, Callable[[float], Profile]] = {
        "sinusoid": lambda spacing: Sinusoid(options.amplitude, spacing),
        "trapezoid": lambda spacing: _grating(spacing, options, min(options.flank, 0.5 * spacing)),
        "square": lambda spacing: _grating(spacing, options, 0.0),
        "dots": lambda spacing: _dots(spacing, options),
        "self-affine": lambda spacing: _self_affine(spacing, options),
    }
    return makers[name]


def _grating(spacing: float, options: StimulusOptions, flank: float) -> Grating:
    return Grating(options.element_height, spacing, options.element_width, flank)


def _dots(spacing: float, options: StimulusOptions) -> DotPlate:
    return DotPlate(
        spacing, options.element_height, options.element_width, options.flank, options.jitter,
        options.seed,
    )  # fmt: skip


def _self_affine(spacing: float, options: StimulusOptions) -> SampledProfile:
    pixel = spacing * _AFFINE_ROLLOFFS / _AFFINE_SAMPLES
    heights = self_affine(
        _AFFINE_SAMPLES, pixel, hurst=options.hurst, rms_slope=options.rms_slope,
        rolloff=spacing, cutoff=8.0 * pixel, seed=options.seed,
    )  # fmt: skip
    return SampledProfile(heights, pixel, "wrap", spacing)


def _from_file(path: str, options: StimulusOptions) -> Callable[[float], Profile]:
    # Each spacing sets the pixel size; any value will do for reading.
    heights = read_heights(
        path, pixel_size=1e-5, height_range=options.height_range, missing=options.missing
    )
    for note in heights.notes:
        _LOG.info("%s: %s", path, note)
    samples = heights.samples
    if not np.ptp(samples) > 0.0:
        raise SurfaceError(f"{path}: a constant map has no spacing to vary; give one with relief")
    pixels = dominant_wavelength(samples)

    def make(spacing: float) -> Profile:
        pixel = spacing / pixels
        if samples.ndim == 1:
            return SampledProfile(samples, pixel, "mirror", spacing)
        return HeightMap(samples, pixel, "mirror", spacing=spacing)

    return make


def dominant_wavelength(samples: NDArray[np.float64]) -> float:
    """Return the wavelength along u that carries most of the heights' power [samples].

    The spectrum is averaged over the rows, under a Hann window, and weighted by frequency, so
    that equal octaves count equally; wavelengths above a third of the map are left out.
    """
    rows = np.atleast_2d(samples)
    n = rows.shape[1]
    if n < 12:
        raise AsperityError(f"a map needs 12 samples along u to have a wavelength, got {n}")
    window = np.hanning(n)
    centred = (rows - rows.mean(axis=1, keepdims=True)) * window
    power = np.mean(np.abs(np.fft.rfft(centred, axis=1)) ** 2, axis=0)
    frequency = np.arange(power.size)
    return n / int(np.argmax(np.where(frequency >= 3, power * frequency, 0.0)))
