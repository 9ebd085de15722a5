"""Friction that differs from place to place: Coulomb's coefficients on a grid.

Between the samples a map is linear, so that it is nowhere below its least or above its largest
sample: a spline would overshoot at the edges that such patterns are made of.
"""

from __future__ import annotations

from dataclasses import dataclass

from asperity.texture.property_map import PropertyMap

MOST_FRICTION = 100.0
"""Largest coefficient of friction [-]."""


@dataclass(frozen=True, eq=False, init=False)
class FrictionMap(PropertyMap):
    """Coulomb's coefficient of friction over a plane, linear between samples.

    Parameters
    ----------
    samples : (nv, nu) array
        Coefficients [-] at `(i + 1/2) * pixel_size`, row 0 at v = 0; 0 to 100, at least 4 along
        each axis. A read-only copy is kept.
    pixel_size : float or (pu, pv)
        Distance between samples along u and v [m], 1e-9 to 1; stored as a pair.
    border : {"clamp", "wrap"}
        Beyond its borders the map continues as its border does, or repeats.
    notes : sequence of str
        Choices made on the way here, one line each, to be shown to the user.

    Raises
    ------
    SurfaceError
        Invalid samples, pixel size or border; one line.
    """

    what = "friction"
    values = "coefficients of friction"
    limits = 0.0, MOST_FRICTION
