"""Surfaces given as shapes, with their exact offsets: sinusoids and gratings."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity._core.kernels import inner_kernel, kernel
from asperity.errors import SurfaceError, require_not_negative, require_positive
from asperity.geometry.offsets.surface import Tracer, exact_tracer


@kernel
def _trace_sinusoid(places, amplitude, wavenumber, radius, heights_out, slopes_out, contacts_out):
    """Fill the offset of a cos(w x) for a disk.

    By symmetry take u in [0, L/2] from the nearest crest. The contact then lies in [0, u], where
    f' falls from f'(0) >= 0, and after its only minimum rises to f'(u) <= 0: one root, found by
    Newton inside a bracket.
    """
    wavelength = 2.0 * math.pi / wavenumber
    for i in range(places.size):
        crest = math.floor(places[i] / wavelength + 0.5) * wavelength
        u = abs(places[i] - crest)
        low, high = max(0.0, u - radius), u
        x = max(low, u - min(u, radius) * 0.5)
        for _ in range(80):
            d = u - x
            inside = radius * radius - d * d
            root = math.sqrt(inside) if inside > 0.0 else 0.0
            slope = np.inf
            if root > 0.0:
                slope = -amplitude * wavenumber * math.sin(wavenumber * x) + d / root
            if slope > 0.0:
                low = x
            else:
                high = x
            step = np.inf
            if root > 0.0:
                curvature = -amplitude * wavenumber * wavenumber * math.cos(wavenumber * x)
                curvature -= radius * radius / (inside * root)
                if curvature < 0.0:
                    step = -slope / curvature
            target = x + step
            if not low <= target <= high:
                target = 0.5 * (low + high)
            if abs(target - x) <= 1e-15 * wavelength:
                x = target
                break
            x = target
        d = u - x
        root = math.sqrt(radius * radius - d * d)
        side = 1.0 if places[i] >= crest else -1.0
        heights_out[i] = amplitude * math.cos(wavenumber * x) + root - radius
        slopes_out[i] = -side * d / root
        contacts_out[i] = crest + side * x


@dataclass(frozen=True)
class Sinusoid:
    """The paper's plate: `h(u) = amplitude * cos(2 pi u / spacing)` (Otaduy & Lin 2004, 4.1).

    Parameters
    ----------
    amplitude : float
        Half the peak-to-peak height [m], above 0.
    spacing : float
        Wavelength [m], above 0.
    """

    amplitude: float
    spacing: float

    mirrored = False
    cells = 64

    def __post_init__(self) -> None:
        require_positive("amplitude", self.amplitude, "[m]")
        require_positive("spacing", self.spacing, "[m]")

    @property
    def period(self) -> float:
        """Distance after which the surface repeats [m]."""
        return self.spacing

    def heights(self, u: ArrayLike) -> Array:
        """Return the heights [m] at places `u` [m]."""
        phase = 2.0 * np.pi * np.asarray(u, dtype=np.float64) / self.spacing
        return self.amplitude * np.cos(phase)

    def slopes(self, u: ArrayLike) -> Array:
        """Return dh/du at places `u` [m]."""
        wavenumber = 2.0 * np.pi / self.spacing
        return -self.amplitude * wavenumber * np.sin(wavenumber * np.asarray(u, dtype=np.float64))

    def tracer(self, diameter: float) -> Tracer:
        """Return the function that traces a probe of `diameter` [m] over this surface."""
        radius = 0.5 * require_positive("diameter", diameter, "[m]")
        return exact_tracer(_trace_sinusoid, self.amplitude, 2.0 * np.pi / self.spacing, radius)


@inner_kernel
def touch_segment(x0, z0, x1, z1, u, radius):
    """Return (height, place) of the contact of a disk above `u` with a straight segment.

    Over the segment f is concave, so the contact is where the disk's slope equals the
    segment's, clipped to its ends; -inf where the disk does not reach it.
    """
    low, high = max(x0, u - radius), min(x1, u + radius)
    if low > high:
        return -np.inf, 0.0
    x = low
    if x1 > x0:
        steepness = (z1 - z0) / (x1 - x0)
        x = u + radius * steepness / math.sqrt(1.0 + steepness * steepness)
        x = min(max(x, low), high)
        z = z0 + steepness * (x - x0)
    else:
        z = max(z0, z1)
    return z + math.sqrt(max(radius * radius - (x - u) * (x - u), 0.0)) - radius, x


@kernel
def _trace_polyline(places, xs, zs, period, radius, heights_out, slopes_out, contacts_out):
    """Fill the offset of a periodic polyline, `xs` rising from 0 to `period`, for a disk."""
    for i in range(places.size):
        u = places[i]
        first = math.floor((u - radius) / period)
        last = math.floor((u + radius) / period)
        best, best_x = -np.inf, u
        tile = first
        while tile <= last:
            shift = tile * period
            for k in range(xs.size - 1):
                height, x = touch_segment(
                    xs[k] + shift, zs[k], xs[k + 1] + shift, zs[k + 1], u, radius
                )
                if height > best:
                    best, best_x = height, x
            tile += 1
        across = best_x - u
        heights_out[i] = best
        slopes_out[i] = across / math.sqrt(radius * radius - across * across)
        contacts_out[i] = best_x


@dataclass(frozen=True)
class Grating:
    """A grating of flat-topped ridges on a flat floor, trapezoidal or (flank 0) square.

    Parameters
    ----------
    height : float
        Height of the ridges above the floor [m], above 0.
    spacing : float
        Gap between the top edges of neighbouring ridges [m]: the inter-element spacing.
    ridge : float
        Width of a ridge's top [m], 0 or above.
    flank : float
        Horizontal width of each sloping side [m], at most half the spacing; 0 gives walls.
    """

    height: float
    spacing: float
    ridge: float = 0.25e-3
    flank: float = 0.0

    mirrored = False
    cells = 96

    def __post_init__(self) -> None:
        require_positive("height", self.height, "[m]")
        require_positive("spacing", self.spacing, "[m]")
        require_not_negative("ridge", self.ridge, "[m]")
        require_not_negative("flank", self.flank, "[m]")
        if 2.0 * self.flank > self.spacing:
            raise SurfaceError(
                f"flank must be at most half the spacing ({0.5 * self.spacing:g} m), "
                f"got {self.flank:g} m"
            )

    @property
    def period(self) -> float:
        """Distance after which the surface repeats [m]: one ridge and one gap."""
        return self.ridge + self.spacing

    def outline(self) -> tuple[Array, Array]:
        """Return the corners (x, z) [m] of one period, which begins amid a ridge's top."""
        half, period = 0.5 * self.ridge, self.period
        xs = np.array(
            [0, half, half + self.flank, period - half - self.flank, period - half, period]
        )
        return xs, self.height * np.array([1.0, 1.0, 0.0, 0.0, 1.0, 1.0])

    def heights(self, u: ArrayLike) -> Array:
        """Return the heights [m] at places `u` [m]."""
        return np.interp(np.mod(u, self.period), *self.outline())

    def slopes(self, u: ArrayLike) -> Array:
        """Return dh/du at places `u` [m]; walls have none, so flank 0 is refused."""
        if self.flank == 0.0:
            raise SurfaceError("a grating with walls has no slope; give a flank above 0 m")
        xs, zs = self.outline()
        segment = np.searchsorted(xs, np.mod(u, self.period), side="right") - 1
        return (np.diff(zs) / np.diff(xs))[np.clip(segment, 0, 4)]

    def tracer(self, diameter: float) -> Tracer:
        """Return the function that traces a probe of `diameter` [m] over this surface."""
        radius = 0.5 * require_positive("diameter", diameter, "[m]")
        if self.flank == 0.0 and self.height >= radius:
            raise SurfaceError(
                f"walls of height {self.height * 1e3:g} mm stop a probe of diameter "
                f"{diameter * 1e3:g} mm: give a height below {radius * 1e3:g} mm, or a flank"
            )
        return exact_tracer(_trace_polyline, *self.outline(), self.period, radius)
