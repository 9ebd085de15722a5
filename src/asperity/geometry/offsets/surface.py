r"""Offset surfaces: the path of the lowest point of a probe dragged over a surface.

A sphere (in one dimension a disk) of diameter D = 2 R above `u` rests on the surface `h` with
its lowest point at

    H(u) = max_x [ h(x) + sqrt(R^2 - (x - u)^2) ] - R .

For a probe whose lowest point moves along the height zero this is the directional penetration
depth delta of Otaduy & Lin (2004, section 3.2). By the envelope theorem its slope is that of
the term in brackets at the maximiser `x*`, the point of contact:

    dH/du = (x* - u) / sqrt(R^2 - (x* - u)^2) .
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity.errors import AsperityError, require_positive


class OffsetTrace(NamedTuple):
    """Offset heights, slopes and contacts at given positions."""

    height: Array
    """Height H of the probe's lowest point [m]."""
    slope: Array
    """dH/du, one-sided where two contacts tie."""
    contact: Array
    """Position of the contact along u [m]."""


Tracer = Callable[[ArrayLike], OffsetTrace]
"""Function from positions u [m] to an `OffsetTrace` of the same shape."""


class Profile(Protocol):
    """A surface over which a probe can be dragged along a straight line."""

    @property
    def period(self) -> float:
        """Distance along u after which the surface repeats [m]."""

    @property
    def spacing(self) -> float:
        """Distance between neighbouring elements [m], the variable of the studies."""

    @property
    def mirrored(self) -> bool:
        """Whether the second half of the period is the first, reversed."""

    @property
    def cells(self) -> int:
        """Number of intervals in which a table of one period should begin."""

    def heights(self, u: ArrayLike) -> Array:
        """Return the heights [m] at places `u` [m]."""

    def slopes(self, u: ArrayLike) -> Array:
        """Return dh/du of the bare surface at places `u` [m]."""

    def tracer(self, diameter: float) -> Tracer:
        """Return the function that traces a probe of `diameter` [m] over this surface."""


def exact_tracer(fill: Callable[..., None], *shape: Any) -> Tracer:
    """Return the tracer of a kernel `fill(places, *shape, heights, slopes, contacts)`."""

    def trace(u: ArrayLike) -> OffsetTrace:
        places = np.asarray(u, dtype=np.float64)
        out = [np.empty(places.size) for _ in range(3)]
        fill(places.ravel(), *shape, *out)
        return OffsetTrace(*(part.reshape(places.shape) for part in out))

    return trace


def slope_of(across: Array, distance_squared: Array, radius: float) -> Array:
    """Return dH/du for a contact `across` away along u, on a sphere of `radius`."""
    return across / np.sqrt(radius**2 - distance_squared)


def drop_point(
    diameter: float, *, height: float | None = None, amplitude: float | None = None
) -> float:
    r"""Return the spacing at which a probe first touches the bottom between elements [m].

    Give one of the two:

    height
        Flat-topped elements of this height [m] with a gap `s` between their edges (gratings;
        between raised dots the gap's own geometry decides):
        `s = 2 sqrt(h (D - h))` for `h <= D / 2`, else `s = D`.
    amplitude
        A sinusoid `a cos(2 pi u / L)` of this amplitude [m]: `L = pi sqrt(2 a D)`, where the
        radius of curvature of the trough is the probe's.

    Source: the term is Klatzky, Lederman, Hamilton, Grindley & Swendsen (2003); the formulas
    follow from the geometry.
    """
    require_positive("diameter", diameter, "[m]")
    if (height is None) == (amplitude is None):
        raise AsperityError("drop_point needs exactly one of height and amplitude")
    if height is not None:
        require_positive("height", height, "[m]")
        reach = min(height, 0.5 * diameter)
        return 2.0 * math.sqrt(reach * (diameter - reach))
    assert amplitude is not None
    require_positive("amplitude", amplitude, "[m]")
    return math.pi * math.sqrt(2.0 * amplitude * diameter)
