r"""Random surfaces with a given power spectrum.

A surface is a sum of plane waves. Its power spectral density C(q), with the wavenumber q in radians
per metre, is the power of each wave: `mean(h^2)` is the integral of C over q (over both components
of q in two dimensions). A *self-affine* surface looks equally rough at every magnification between
a longest and a shortest wavelength; there C is a power law whose exponent is set by the Hurst
exponent H, small for jagged and large for rolling surfaces. Ground, fractured, blasted and worn
surfaces are approximately self-affine (Jacobs, Junge & Pastewka 2017).

All surfaces made here are periodic, so they tile without a seam (border "wrap").
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity._core.arrays import Array
from asperity.errors import AsperityError, SurfaceError, require_not_negative, require_positive
from asperity.texture.files.checks import MAX_SAMPLES, checked_heights

DEFAULT_CUTOFF = 8.0
"""Shortest wavelength [samples]: a cubic spline's slope errs by 0.3 % there, by 4 % at 4."""


def self_affine(
    shape: int | Sequence[int],
    pixel_size: float,
    *,
    hurst: float,
    rms_slope: float,
    rolloff: float | None = None,
    cutoff: float | None = None,
    seed: int = 0,
) -> Array:
    r"""Return a periodic, isotropic, self-affine random surface or profile.

    With `q_r = 2 pi / rolloff` and `q_c = 2 pi / cutoff` the spectral density of a surface is

        C(q) ~ max(q, q_r)^(-2 (H + 1))  for 0 < q <= q_c,  and 0 beyond,

    and that of a profile `max(q, q_r)^(-(2 H + 1))`, as if cut from such a surface. Phases and
    amplitudes are those of filtered Gaussian noise, so the heights are Gaussian. The result is
    scaled so that its rms slope, from the exact derivative of the sum of waves, is `rms_slope`.

    Parameters
    ----------
    shape : int, (n,) or (nv, nu)
        Number of samples, 16 or more along each axis, 2**27 at most in all.
    pixel_size : float
        Distance between samples [m], above 0.
    hurst : float
        Hurst exponent H, 0 to 1.
    rms_slope : float
        Root mean square slope, 0 or above: of dh/du for a profile, of |grad h| for a surface.
    rolloff : float, optional
        Wavelength [m] above which the spectrum is flat; the shorter side of the map if not given.
    cutoff : float, optional
        Shortest wavelength present [m], more than 2 pixels and at most `rolloff`; 8 pixels if
        not given, which a cubic spline follows closely.
    seed : int
        Seed of `numpy.random.default_rng`, 0 or above.

    Returns
    -------
    (n,) or (nv, nu) array
        Heights [m] with zero mean.

    Raises
    ------
    AsperityError
        A value outside its range; the message gives the range.

    References
    ----------
    Jacobs, Junge & Pastewka (2017), "Quantitative characterization of surface topography using
    spectral analysis", Surf. Topogr.: Metrol. Prop. 5, 013001 (the spectrum and its exponents).
    """
    sizes = _sizes(shape)
    require_positive("pixel_size", pixel_size, "[m]")
    require_not_negative("rms_slope", rms_slope)
    if not 0.0 <= hurst <= 1.0:
        raise AsperityError(f"hurst must be 0 to 1, got {hurst!r}")
    extent = min(sizes) * pixel_size
    rolloff = extent if rolloff is None else require_positive("rolloff", rolloff, "[m]")
    cutoff = min(DEFAULT_CUTOFF * pixel_size, rolloff) if cutoff is None else cutoff
    longest = min(rolloff, extent)
    if not 2.0 * pixel_size < cutoff <= longest:
        raise AsperityError(
            f"cutoff must lie above 2 pixels ({2.0 * pixel_size:g} m) and be at most rolloff and "
            f"the shorter side of the map ({longest:g} m), got {cutoff!r}"
        )
    q = _wavenumbers(sizes, pixel_size)
    exponent = -(hurst + 0.5 * len(sizes))  # of the amplitude, the square root of C
    amplitude = np.maximum(q, 2.0 * math.pi / rolloff) ** exponent
    # A wave exactly at the cut-off is kept, whatever the rounding of q.
    amplitude[q > 2.0 * math.pi / cutoff * (1.0 + 1e-9)] = 0.0
    amplitude[(0,) * len(sizes)] = 0.0
    waves = amplitude * np.fft.rfftn(_generator(seed).standard_normal(sizes))
    heights = np.fft.irfftn(waves, s=sizes, axes=range(len(sizes)))
    # Parseval: the slope of a wave is q times its height.
    slopes = np.fft.irfftn(waves * q, s=sizes, axes=range(len(sizes)))
    return heights * (rms_slope / math.sqrt(np.mean(slopes**2)))


def synthesise_like(heights: ArrayLike, *, seed: int = 0) -> Array:
    """Return a periodic random surface with the power spectrum of another.

    A tilt or a swell makes opposite borders differ, and such a jump would count as roughness. So
    the heights are decomposed into a smooth field that contains the jumps and a periodic remainder,
    of which every wave keeps its amplitude and gets a random phase. The rms height and slope of the
    remainder and the direction and scales of the texture are preserved. What depends on the phases
    is lost: flat tops, sharp edges, single scratches and any skewness of the heights.

    Parameters
    ----------
    heights : (n,) or (nv, nu) array
        Heights [m], finite, 16 samples or more along each axis.
    seed : int
        Seed of `numpy.random.default_rng`, 0 or above.

    Returns
    -------
    array of the shape of `heights`
        Heights [m] with zero mean.

    Raises
    ------
    AsperityError
        Heights that are not finite, not 1-D or 2-D, or too few.

    References
    ----------
    Moisan (2011), "Periodic plus smooth image decomposition", J. Math. Imaging Vis. 39, 161-179.
    Galerne, Gousseau & Morel (2011), "Random phase textures: theory and synthesis", IEEE Trans.
    Image Process. 20, 257-267.
    """
    array = checked_heights(heights)
    sizes = _sizes(array.shape)
    noise = np.fft.rfftn(_generator(seed).standard_normal(sizes))
    phases = noise / np.maximum(np.abs(noise), np.finfo(np.float64).tiny)
    waves = np.abs(_periodic_waves(array)) * phases
    return np.fft.irfftn(waves, s=sizes, axes=range(len(sizes)))


def _periodic_waves(heights: Array) -> NDArray[np.complex128]:
    """Return the transform of `heights` minus the smooth field that contains the border jumps.

    The Laplacian of the field is the jumps, at the border samples (Moisan 2011).
    """
    jumps = np.zeros_like(heights)
    curvature = np.zeros(())
    for axis, n in enumerate(heights.shape):
        step = np.take(heights, -1, axis) - np.take(heights, 0, axis)
        lines = np.moveaxis(jumps, axis, 0)
        lines[0] += step
        lines[-1] -= step
        last = axis == heights.ndim - 1
        turns = np.fft.rfftfreq(n) if last else np.fft.fftfreq(n)
        curvature = np.add.outer(curvature, 2.0 * np.cos(2.0 * math.pi * turns) - 2.0)
    mean = (0,) * heights.ndim
    curvature[mean] = 1.0
    waves = np.fft.rfftn(heights) - np.fft.rfftn(jumps) / curvature
    waves[mean] = 0.0
    return waves


def _sizes(shape: int | Sequence[int]) -> tuple[int, ...]:
    try:
        given = np.atleast_1d(np.asarray(shape))
        whole = given.dtype.kind in "iu" and given.ndim == 1
        sizes = tuple(int(n) for n in given) if whole else ()
    except (TypeError, ValueError):
        sizes = ()
    if len(sizes) not in (1, 2) or min(sizes) < 16 or math.prod(sizes) > MAX_SAMPLES:
        raise SurfaceError(
            f"shape must be n or (nv, nu), 16 samples or more along each axis and {MAX_SAMPLES} "
            f"at most in all, got {shape!r}"
        )
    return sizes


def _generator(seed: int) -> np.random.Generator:
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError):
        raise AsperityError(f"seed must be a whole number, 0 or above, got {seed!r}") from None


def _wavenumbers(sizes: tuple[int, ...], pixel_size: float) -> Array:
    """Return |q| [rad/m] of every wave, in the order of `numpy.fft.rfftn`."""
    along_u = 2.0 * math.pi * np.fft.rfftfreq(sizes[-1], pixel_size).astype(np.float64)
    if len(sizes) == 1:
        return along_u
    along_v = 2.0 * math.pi * np.fft.fftfreq(sizes[0], pixel_size)
    return np.hypot(along_v[:, None], along_u[None, :])
