"""Textures given as shapes: waves, ridges, grooves, steps, roughness.

Every function returns a `HeightField` that repeats without a seam (border "wrap"); lengths are in
metres, angles in radians from u. `pitch` and `wavelength` are distances from crest to crest,
`samples` the number of samples over one of them, `periods` the approximate number of them along
each side of the tile. The heights change along `direction`; ridges run across it. It is exact, by a
tile whose sides contain whole numbers of periods, unless it is within half a period of an axis over
the whole tile; then the pattern is rotated to that axis, with a note.

Edges are rounded over `fillet`, at least two samples, so that the spline through the samples
overshoots by at most 1 % of the relief. All default sizes were chosen for this package.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from asperity.errors import AsperityError, require_not_negative, require_positive
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.fillets import (
    FEWEST,
    checked_fillet,
    plane_wave,
    require_fits,
    require_whole,
    rounded,
    tile,
)
from asperity.texture.patterns.machined import brushed, cross_cut, jittered_dots, knurl
from asperity.texture.patterns.raised import tactile_map
from asperity.texture.patterns.random_surfaces import self_affine


def sinusoid(
    *,
    wavelength: float,
    amplitude: float,
    direction: float = 0.0,
    periods: int = 8,
    samples: int = 64,
) -> HeightField:
    """Return `amplitude * cos(2 pi s / wavelength)`, s the distance along `direction`.

    Parameters
    ----------
    wavelength : float
        From crest to crest [m], above 0; a crest lies at u = v = 0.
    amplitude : float
        Half the relief [m], 0 or above.
    direction : float
        In which the heights change [rad].
    periods, samples : int
        Wavelengths in the tile, 1 or more, and samples in each, 8 or more.
    """
    require_positive("wavelength", wavelength, "[m]")
    require_not_negative("amplitude", amplitude, "[m]")
    wave = plane_wave(wavelength, direction, periods, samples)
    heights = amplitude * np.cos(2.0 * math.pi * wave.phase)
    return HeightField(heights, wave.pixel_size, "wrap", wave.notes)


def sin_product(
    *, wavelength: float, amplitude: float, periods: int = 8, samples: int = 64
) -> HeightField:
    """Return `amplitude * sin(2 pi u / wavelength) * sin(2 pi v / wavelength)`: an egg box.

    Parameters
    ----------
    wavelength : float
        Along u and v [m], above 0.
    amplitude : float
        Half the relief [m], 0 or above.
    periods, samples : int
        Wavelengths along each side of the tile, 1 or more, and samples in each, 8 or more.
    """
    require_positive("wavelength", wavelength, "[m]")
    require_not_negative("amplitude", amplitude, "[m]")
    require_whole("periods", periods, 1)
    require_whole("samples", samples, FEWEST)
    side = periods * wavelength
    (u, v), pixel_size = tile((side, side), wavelength / samples)
    turns = 2.0 * math.pi / wavelength
    return HeightField(amplitude * np.sin(turns * u) * np.sin(turns * v), pixel_size, "wrap")


def grating(
    *,
    pitch: float,
    height: float,
    width: float | None = None,
    fillet: float | None = None,
    direction: float = 0.0,
    periods: int = 8,
    samples: int = 64,
) -> HeightField:
    """Return flat-topped ridges with filleted edges; the ground lies at 0.

    Parameters
    ----------
    pitch : float
        From ridge to ridge [m], above 0; the middle of a ridge lies at u = v = 0.
    height : float
        Of the ridges [m], 0 or above.
    width : float, optional
        Of a ridge at half its height [m]; half the pitch if not given. Ridges and gaps are wider
        than two fillets.
    fillet : float, optional
        Length of each rounding [m], 2 samples or more: an edge is two fillets long. A sixteenth
        of the pitch if not given.
    direction : float
        Across the ridges [rad].
    periods, samples : int
        Pitches in the tile, 1 or more, and samples in each, 8 or more.
    """
    require_not_negative("height", height, "[m]")
    wave = plane_wave(pitch, direction, periods, samples)
    fillet = checked_fillet(fillet, pitch, samples)
    width = require_fits("width", 0.5 * pitch if width is None else width, pitch, 2.0 * fillet)
    top, foot = 0.5 * (width - fillet) / pitch, 0.5 * (width + fillet) / pitch
    corners = [(-foot, 0.0), (-top, height), (top, height), (foot, 0.0)]
    heights = rounded(wave.phase, corners, fillet / pitch)
    return HeightField(heights, wave.pixel_size, "wrap", wave.notes)


def stripes(
    *,
    pitch: float,
    depth: float,
    width: float | None = None,
    fillet: float | None = None,
    direction: float = 0.0,
    periods: int = 8,
    samples: int = 64,
) -> HeightField:
    """Return a flat plate, at 0, with round-bottomed grooves, as a ball-nosed cutter leaves them.

    Parameters
    ----------
    pitch : float
        From groove to groove [m], above 0; the middle of a groove lies at u = v = 0.
    depth : float
        Of the grooves [m], 0 or above; the rounding of the edges does not reduce it.
    width : float, optional
        Of a groove [m]; 0.6 pitches, or what the fillets leave, if not given. Grooves and lands
        are wider than two fillets.
    fillet : float, optional
        Length of the rounding of a groove's edges [m], 2 samples or more. A sixteenth of the
        pitch if not given.
    direction : float
        Across the grooves [rad].
    periods, samples : int
        Pitches in the tile, 1 or more, and samples in each, 8 or more.
    """
    require_not_negative("depth", depth, "[m]")
    wave = plane_wave(pitch, direction, periods, samples)
    fillet = checked_fillet(fillet, pitch, samples)
    width = min(0.6 * pitch, pitch - 2.0 * fillet) if width is None else width
    require_fits("width", width, pitch, 2.0 * fillet)
    across = np.linspace(-1.0, 1.0, 65)
    # The moving average raises the bottom of the parabola by its mean over the fillet.
    bottom = depth / (1.0 - (fillet / width) ** 2 / 3.0)
    profile = bottom * (across**2 - 1.0)
    corners = list(zip(0.5 * width / pitch * across, profile, strict=True))
    heights = rounded(wave.phase, corners, fillet / pitch)
    return HeightField(heights, wave.pixel_size, "wrap", wave.notes)


def step(
    *, height: float, size: float, fillet: float | None = None, samples: int = 256
) -> HeightField:
    """Return a plate with a step: the half around u = 0 lies `height` above the other, at 0.

    Parameters
    ----------
    height : float
        Of the step [m], 0 or above.
    size : float
        Side of the tile [m], above 0; the edges lie at a quarter and three quarters of it.
    fillet : float, optional
        Length of each rounding [m], 2 samples or more and under a quarter of the size; 4 samples
        if not given. The edge is two fillets long.
    samples : int
        Along each side, 16 or more.
    """
    require_positive("size", size, "[m]")
    require_whole("samples", samples, 2 * FEWEST)
    fillet = checked_fillet(4.0 * size / samples if fillet is None else fillet, size, samples)
    return grating(pitch=size, height=height, fillet=fillet, periods=1, samples=samples)


def rough(
    *,
    size: float,
    pixel_size: float,
    hurst: float,
    rms_slope: float,
    rolloff: float | None = None,
    cutoff: float | None = None,
    seed: int = 0,
) -> HeightField:
    """Return self-affine random roughness: see `random_surfaces.self_affine`.

    Parameters
    ----------
    size : float
        Side of the tile [m], rounded to whole pixels, 16 or more.
    pixel_size : float
        Distance between samples [m], above 0.
    hurst : float
        Hurst exponent, 0 (jagged) to 1 (rolling).
    rms_slope : float
        Root mean square slope, 0 or above.
    rolloff, cutoff : float, optional
        Wavelengths [m] above which the spectrum is flat, and below which there is nothing.
    seed : int
        0 or above.
    """
    require_positive("size", size, "[m]")
    require_positive("pixel_size", pixel_size, "[m]")
    if size / pixel_size > 2**14:
        raise AsperityError(f"size must be at most 16384 pixels, got {size / pixel_size:.6g}")
    samples = round(size / pixel_size)
    spectrum = {"hurst": hurst, "rms_slope": rms_slope, "rolloff": rolloff, "cutoff": cutoff}
    heights = self_affine((samples, samples), pixel_size, **spectrum, seed=seed)  # type: ignore[arg-type]
    return HeightField(heights, pixel_size, "wrap")


_PATTERNS: tuple[tuple[Callable[..., HeightField], dict[str, Any]], ...] = (
    (sinusoid, {"wavelength": 2e-3, "amplitude": 1e-4}),
    (sin_product, {"wavelength": 2e-3, "amplitude": 1e-4}),
    (grating, {"pitch": 2.5e-3, "height": 4e-4}),
    (stripes, {"pitch": 3e-3, "depth": 3e-4}),
    (step, {"height": 2e-4, "size": 1e-2}),
    (jittered_dots, {"pitch": 2e-3, "height": 4e-4, "diameter": 8e-4}),
    (cross_cut, {"pitch": 1e-3, "height": 2e-4}),
    (knurl, {"pitch": 1.5e-3, "height": 3e-4}),
    (tactile_map, {"height": 5e-4, "scale": 1.0, "line": 1.2e-3, "pixel_size": 1e-4}),
    (
        brushed,
        {"size": 0.0128, "pixel_size": 5e-5, "rms": 4e-6, "length": 2e-3, "width": 3.2e-4},
    ),
    (
        rough,
        {"size": 0.0128, "pixel_size": 5e-5, "hurst": 0.8, "rms_slope": 0.2, "cutoff": 2e-4},
    ),
)
PATTERNS = {maker.__name__: maker for maker, _ in _PATTERNS}
"""All patterns by name, as in `scene.toml`."""
EXAMPLES = {maker.__name__: example for maker, example in _PATTERNS}
"""A usual texture of each pattern, with which the page begins: parameters by name."""
