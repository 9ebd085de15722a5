"""Plates of jittered raised dots, the stimuli of the perceptual studies, with exact offsets."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity._core.kernels import inner_kernel, kernel
from asperity.errors import AsperityError, SurfaceError, require_not_negative, require_positive
from asperity.geometry.offsets.analytic import touch_segment
from asperity.geometry.offsets.surface import Tracer, exact_tracer


class DotLattice(NamedTuple):
    """A tile of truncated cones on a jittered square lattice; lengths in metres."""

    centres: Array
    """Axes of the dots (u, v) within the tile, less the lattice position, (rows, columns, 2)."""
    pitch: float
    """Of the lattice."""
    top: float
    """Radius of a flat top."""
    flank: float
    """Horizontal width of the sloping side."""
    height: float


@inner_kernel
def _touch_dots(lattice, u, v, radius):
    """Return (offset height, contact u, contact v) of a sphere above (u, v).

    A dot is a solid of revolution, so the sphere touches it in the plane through the dot's axis
    and the sphere's centre, where it is a disk on the dot's outline. The axis of a dot lies within
    its lattice cell, so only cells within the radii of dot and sphere matter.
    """
    centres, pitch, top, flank, height = lattice
    reach = radius + top + flank
    rows, columns = centres.shape[0], centres.shape[1]
    best, best_u, best_v = 0.0, u, v
    row = math.floor((v - reach) / pitch)
    while row <= math.floor((v + reach) / pitch):
        column = math.floor((u - reach) / pitch)
        while column <= math.floor((u + reach) / pitch):
            cu = centres[row % rows, column % columns, 0] + column * pitch
            cv = centres[row % rows, column % columns, 1] + row * pitch
            away = math.sqrt((cu - u) ** 2 + (cv - v) ** 2)
            if away <= top:
                touched, at = height, away
            else:
                touched, at = touch_segment(top, height, top + flank, 0.0, away, radius)
            if touched > best:
                best = touched
                share = (away - at) / away if away > 0.0 else 0.0
                best_u, best_v = u + (cu - u) * share, v + (cv - v) * share
            column += 1
        row += 1
    return best, best_u, best_v


@kernel
def _trace_dots(places, lattice, line, radius, heights_out, slopes_out, contacts_out):
    """Fill heights, slopes and contacts of a sphere at `places` along `v = line` [m]."""
    for i in range(places.size):
        u = places[i]
        best, x, y = _touch_dots(lattice, u, line, radius)
        heights_out[i] = best
        slopes_out[i] = (x - u) / math.sqrt(radius**2 - (x - u) ** 2 - (y - line) ** 2)
        contacts_out[i] = x


@dataclass(frozen=True)
class DotPlate:
    """A plate of raised dots (truncated cones) on a jittered square lattice.

    The tile of `rows` x `columns` dots repeats; a probe is dragged along `v = line`. The defaults
    of height, diameter and jitter were chosen for this package; Otaduy & Lin (2004) give none.

    Parameters
    ----------
    spacing : float
        Mean gap between the top edges of neighbouring dots along the lattice [m].
    height : float
        Height of the dots [m], above 0.
    diameter : float
        Diameter of a dot's flat top [m], above 0.
    flank : float
        Horizontal width of the sloping side [m]; 0 gives cylinders.
    jitter : float
        Each dot is moved by up to this fraction of half the spacing along u and v, 0 to 1;
        uniformly distributed.
    seed : int
        Of the jitter.
    rows, columns : int
        Dots in a tile.
    line : float or None
        Place of the probe's path across the rows [m]; None leads it over the first row.
    """

    spacing: float
    height: float = 0.4e-3
    diameter: float = 0.5e-3
    flank: float = 0.05e-3
    jitter: float = 0.5
    seed: int = 0
    rows: int = 8
    columns: int = 24
    line: float | None = None

    mirrored = False

    def __post_init__(self) -> None:
        for name in ("spacing", "height", "diameter"):
            require_positive(name, getattr(self, name), "[m]")
        require_not_negative("flank", self.flank, "[m]")
        if not 0.0 <= self.jitter <= 1.0:
            raise AsperityError(f"jitter must lie between 0 and 1, got {self.jitter!r}")
        if self.rows < 1 or self.columns < 1:
            raise AsperityError(
                f"rows and columns must be at least 1, got {self.rows} and {self.columns}"
            )

    @property
    def pitch(self) -> float:
        """Mean distance between the centres of neighbouring dots [m]."""
        return self.spacing + self.diameter

    @property
    def period(self) -> float:
        """Length of the tile along u [m]."""
        return self.columns * self.pitch

    @property
    def cells(self) -> int:
        """Number of intervals in which a table of one period should begin."""
        return 32 * self.columns

    def centres(self) -> Array:
        """Return the place of each dot within its lattice cell [m], shape (rows, columns, 2)."""
        shift = np.random.default_rng(self.seed).uniform(-1, 1, (self.rows, self.columns, 2))
        return 0.5 * self.pitch + 0.5 * self.spacing * self.jitter * shift

    def _line(self) -> float:
        return 0.5 * self.pitch if self.line is None else self.line

    def heights(self, u: ArrayLike, v: ArrayLike | None = None) -> Array:
        """Return the heights [m] at places `u` [m] along the line, or at (u, v)."""
        away, _ = self._nearest(u, v)
        return np.interp(away, *self._outline())

    def slopes(self, u: ArrayLike, v: ArrayLike | None = None) -> Array:
        """Return dh/du at places `u` [m] along the line, or at (u, v); flank 0 is refused."""
        if self.flank == 0.0:
            raise SurfaceError("dots with walls have no slope; give a flank above 0 m")
        away, along = self._nearest(u, v)
        top, base = self._outline()[0]
        on_flank = (away > top) & (away < base)
        return np.where(on_flank, -self.height / self.flank * along / np.maximum(away, top), 0.0)

    def _outline(self) -> tuple[list[float], list[float]]:
        """Return distances from the axis [m] and the heights there [m]: the edges of the flank."""
        top = 0.5 * self.diameter
        return [top, top + self.flank], [self.height, 0.0]

    def _nearest(self, u: ArrayLike, v: ArrayLike | None) -> tuple[Array, Array]:
        """Return the distance to the nearest dot's axis, and how far it lies behind along u [m]."""
        places_v = self._line() if v is None else np.asarray(v, dtype=np.float64)
        u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), places_v)
        column, row = np.floor(u / self.pitch).astype(int), np.floor(v / self.pitch).astype(int)
        centres, nearest = self.centres(), np.full(u.shape, np.inf)
        along = np.zeros(u.shape)
        for r in (-1, 0, 1):
            for c in (-1, 0, 1):
                at = centres[(row + r) % self.rows, (column + c) % self.columns]
                du = u - at[..., 0] - (column + c) * self.pitch
                dv = v - at[..., 1] - (row + r) * self.pitch
                away = np.hypot(du, dv)
                along = np.where(away < nearest, du, along)
                nearest = np.minimum(nearest, away)
        return nearest, along

    def tracer(self, diameter: float) -> Tracer:
        """Return the function that traces a sphere of `diameter` [m] along the line."""
        radius = 0.5 * require_positive("diameter", diameter, "[m]")
        if self.flank == 0.0 and self.height >= radius:
            raise SurfaceError(
                f"dots with walls of height {self.height * 1e3:g} mm stop a probe of diameter "
                f"{diameter * 1e3:g} mm: give a height below {radius * 1e3:g} mm, or a flank"
            )
        lattice = DotLattice(
            self.centres(), self.pitch, 0.5 * self.diameter, float(self.flank), float(self.height)
        )
        return exact_tracer(_trace_dots, lattice, self._line(), radius)
