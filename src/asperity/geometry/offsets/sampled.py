"""Measured or synthesised heights, in one or two dimensions, as surfaces for a probe to trace."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity.errors import AsperityError, SurfaceError, require_choice, require_positive
from asperity.geometry.offsets import disk_search, sphere_search
from asperity.geometry.offsets.surface import OffsetTrace, Tracer, slope_of
from asperity.texture.bounds import pyramid_of
from asperity.texture.files.checks import checked_heights
from asperity.texture.spline import BORDERS, spline_along, spline_coefficients

_Found = tuple[Array, Array, Array]
"""Height of a probe, and its contact relative to it along u and v [m]."""
_LineSearch = Callable[[Array], _Found]

CERTIFIED_TO = 1e-12
"""An offset height is at most this far below the true maximum [m]."""

STEEPEST = 50.0
"""Largest slope between samples accepted as a surface: 89 degrees."""


def check_steepness(samples: Array, pixel_size: float) -> None:
    """Raise `SurfaceError` if neighbouring samples are steeper than a probe can follow."""
    for axis in range(samples.ndim):
        slope = float(np.max(np.abs(np.diff(samples, axis=axis)))) / pixel_size
        if slope > STEEPEST:
            raise SurfaceError(
                f"heights are too steep: slope {slope:.3g} between neighbouring samples, at most "
                f"{STEEPEST:g} is valid; are heights and pixel_size both in metres?"
            )


def _fold(u: Array, length: float, border: str) -> tuple[Array, Array]:
    """Return `u` folded into [0, length], and -1 where the map is reversed there, else 1."""
    if border == "wrap":
        return np.mod(u, length), np.ones_like(u)
    place = np.mod(u, 2.0 * length)
    back = place > length
    return np.where(back, 2.0 * length - place, place), np.where(back, -1.0, 1.0)


@dataclass(frozen=True)
class _Sampled:
    """Properties along u that a profile and a map of samples share."""

    samples: Array
    pixel_size: float
    border: str = "mirror"

    def _check(self, dimensions: int) -> None:
        object.__setattr__(self, "samples", checked_heights(self.samples, (dimensions,)))
        require_positive("pixel_size", self.pixel_size, "[m]")
        require_choice("border", self.border, BORDERS)
        check_steepness(self.samples, self.pixel_size)

    @property
    def length(self) -> float:
        """Extent of the samples along u [m]."""
        return self.samples.shape[-1] * self.pixel_size

    @property
    def period(self) -> float:
        """Distance after which the surface repeats [m]: the length, twice that if mirrored."""
        return self.length * (2.0 if self.border == "mirror" else 1.0)

    @property
    def mirrored(self) -> bool:
        """Whether the second half of the period is the first, run backwards."""
        return self.border == "mirror"

    @property
    def cells(self) -> int:
        """Number of intervals in which a table of one period should begin."""
        return round(self.period / self.pixel_size)

    def heights(self, u: ArrayLike) -> Array:
        """Return the heights [m] of the spline at places `u` [m]."""
        return self._along(u)

    def slopes(self, u: ArrayLike) -> Array:
        """Return dh/du of the spline at places `u` [m]."""
        return self._along(u, 1)

    def _along(self, u: ArrayLike, order: int = 0) -> Array:
        """Return the derivative of an order, or the heights themselves, at places `u`."""
        place, sign = _fold(np.asarray(u, dtype=np.float64), self.length, self.border)
        values = spline_along(self._line_coefficients())(place / self.pixel_size, nu=order)
        return np.asarray(values * (sign / self.pixel_size) ** order)

    def _line_coefficients(self) -> Array:
        """Return the coefficients of the spline along u."""
        return spline_coefficients(self.samples, self.border)

    def tracer(self, diameter: float) -> Tracer:
        """Return the function that traces a probe of `diameter` [m] over this surface."""
        search, radius = self._line_search(diameter), 0.5 * diameter

        def trace(u: ArrayLike) -> OffsetTrace:
            u = np.asarray(u, dtype=np.float64)
            folded, sign = _fold(u, self.length, self.border)
            heights, along, across = search(folded)
            slopes = slope_of(along, along**2 + across**2, radius)
            return OffsetTrace(heights, sign * slopes, u + sign * along)

        return trace

    def _padded(self, diameter: float) -> tuple[Array, float, int]:
        """Return coefficients for a probe, its radius and the cells beyond each end [samples]."""
        extent = min(self.samples.shape) * self.pixel_size
        if require_positive("diameter", diameter, "[m]") > extent:
            raise SurfaceError(
                f"a probe of diameter {diameter * 1e3:g} mm is wider than the surface; "
                f"valid: at most {extent * 1e3:g} mm"
            )
        radius = 0.5 * diameter / self.pixel_size
        margin = int(radius) + 2
        coefficients = spline_coefficients(self.samples, self.border, margin)
        return coefficients / self.pixel_size, radius, margin

    def _line_search(self, diameter: float) -> _LineSearch:
        """Return the search along u for a probe of `diameter`."""
        raise NotImplementedError


@dataclass(frozen=True)
class SampledProfile(_Sampled):
    """Heights along one line, with a cubic spline between the samples.

    Parameters
    ----------
    samples : (n,) array
        Heights [m] at `(i + 1/2) * pixel_size`.
    pixel_size : float
        Distance between samples [m], above 0.
    border : {"mirror", "wrap"}
        How the profile goes on beyond its ends.
    spacing : float
        Distance between neighbouring elements [m], if there is one; for labels only.
    """

    spacing: float = float("nan")

    def __post_init__(self) -> None:
        self._check(1)

    def _line_search(self, diameter: float) -> _LineSearch:
        pixel, (coefficients, radius, margin) = self.pixel_size, self._padded(diameter)
        pyramid = pyramid_of(coefficients)

        def search(u: Array) -> _Found:
            places = (u / pixel + 0.5 + margin).ravel()
            heights, contacts = np.empty(places.size), np.empty(places.size)
            disk_search.search_many(
                coefficients, pyramid, places, radius, CERTIFIED_TO / pixel, heights, contacts
            )
            along = (contacts - places).reshape(u.shape) * pixel
            return heights.reshape(u.shape) * pixel, along, np.zeros_like(along)

        return search


@dataclass(frozen=True)
class HeightMap(_Sampled):
    """Heights on a square grid, with a bicubic spline between the samples.

    Parameters
    ----------
    samples : (nv, nu) array
        Heights [m] at `(i + 1/2) * pixel_size`, row 0 at v = 0.
    pixel_size : float
        Distance between samples along both axes [m], above 0.
    border : {"mirror", "wrap"}
        How the map goes on beyond its ends.
    line : float or None
        The v [m] at which a probe is dragged along u; None is half-way up.
    spacing : float
        Distance between neighbouring elements [m], if there is one; for labels only.
    """

    line: float | None = None
    spacing: float = float("nan")

    def __post_init__(self) -> None:
        self._check(2)
        width = self.samples.shape[0] * self.pixel_size
        if self.line is None:
            object.__setattr__(self, "line", 0.5 * width)
        elif not 0.0 <= self.line <= width:
            raise AsperityError(f"line must lie on the map, 0 to {width:g} m, got {self.line!r}")

    def _line_coefficients(self) -> Array:
        assert self.line is not None
        across = spline_along(super()._line_coefficients())
        return np.asarray(across(self.line / self.pixel_size))

    def _line_search(self, diameter: float) -> _LineSearch:
        assert self.line is not None
        line = self.line
        search = self._search(diameter, line=line)
        return lambda u: search(u, np.full_like(u, line))

    def contacts(self, diameter: float, u: Array, v: Array) -> _Found:
        """Return offset heights over (u, v), and contacts relative to them along u and v [m]."""
        return self._search(diameter)(u, v)

    def offset(self, diameter: float) -> Array:
        """Return the offset surface [m] for a sphere of `diameter` [m], at every sample."""
        v, u = (np.indices(self.samples.shape) + 0.5) * self.pixel_size
        return self._search(diameter)(u, v)[0]

    def _search(self, diameter: float, line: float | None = None) -> Callable[..., _Found]:
        """Return a function of (u, v) [m] that gives height and contact along u and v [m].

        For places on one `line` only, the strip that the sphere can touch is searched.
        """
        coefficients, radius, margin = self._padded(diameter)
        first_row = 0
        if line is not None:
            first_row = int(line / self.pixel_size)
            coefficients = np.ascontiguousarray(
                coefficients[first_row : first_row + 2 * margin + 4]
            )
        pyramid = pyramid_of(coefficients)
        tolerance = CERTIFIED_TO / self.pixel_size

        def search(u: Array, v: Array) -> _Found:
            places_u = np.atleast_1d(u / self.pixel_size + 0.5 + margin).ravel()
            places_v = np.atleast_1d(v / self.pixel_size + 0.5 + margin - first_row).ravel()
            heights, contacts = np.empty(places_u.size), np.empty((places_u.size, 2))
            sphere_search.search_many(
                coefficients, pyramid, places_u, places_v, radius, tolerance, heights, contacts
            )
            return (
                heights.reshape(u.shape) * self.pixel_size,
                (contacts[:, 0] - places_u).reshape(u.shape) * self.pixel_size,
                (contacts[:, 1] - places_v).reshape(u.shape) * self.pixel_size,
            )

        return search


def offset_surface(
    heights: ArrayLike, pixel_size: float, diameter: float, *, border: str = "mirror"
) -> Array:
    """Return the offset surface of sampled heights: where the lowest point of a probe goes.

    Between the samples the surface is their interpolating cubic spline, and the result is the
    maximum over that surface, certified to `CERTIFIED_TO`, not over the samples.

    Parameters
    ----------
    heights : (n,) or (nv, nu) array
        Heights [m] at `(i + 1/2) * pixel_size`. One-dimensional heights meet a disk,
        two-dimensional ones a sphere.
    pixel_size : float
        Distance between samples [m], above 0.
    diameter : float
        Diameter of the probe [m], above 0 and at most the extent of the heights.
    border : {"mirror", "wrap"}
        How the surface goes on beyond its ends.

    Returns
    -------
    array of the shape of `heights`
        Height [m] of the probe's lowest point when its centre is above the sample.

    Raises
    ------
    AsperityError
        Heights that are not finite, not 1-D or 2-D, or smaller than the probe.

    References
    ----------
    Otaduy & Lin (2004), section 3.2 and Figure 1.
    """
    array = checked_heights(heights)
    if array.ndim == 2:
        return HeightMap(array, pixel_size, border).offset(diameter)
    profile = SampledProfile(array, pixel_size, border)
    places = (np.arange(array.size) + 0.5) * profile.pixel_size
    return profile.tracer(diameter)(places).height
