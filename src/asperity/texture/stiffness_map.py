"""Stiffness that differs from place to place: stiffnesses of contact on a grid.

Between the samples it is smooth: its inverse, the compliance, is the cubic B-spline whose
coefficients are those of the samples. That is twice continuously differentiable, averages over
about a pixel to either side, and is nowhere beyond the least and the largest sample, as the spline
through the samples would be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asperity._core.arrays import Array
from asperity.texture.property_map import PropertyMap

STIFFNESSES = (1e-6, 1e9)
"""Least and largest stiffness of contact [N/m]."""


@dataclass(frozen=True, eq=False, init=False)
class StiffnessMap(PropertyMap):
    """Stiffness of contact over a plane, smooth between samples.

    Parameters
    ----------
    samples : (nv, nu) array
        Stiffnesses [N/m] at `(i + 1/2) * pixel_size`, row 0 at v = 0; 1e-6 to 1e9, at least 4 along
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

    what = "stiffness"
    values = "stiffnesses"
    limits = STIFFNESSES

    @property
    def coefficients(self) -> Array:
        """Those of the spline of minus the compliance [m/N], padded, (nv + 4, nu + 4)."""
        return -1.0 / super().coefficients

    @property
    def rms(self) -> float:
        """Root mean square of the samples' compliance about its mean [m/N]."""
        return float(np.std(1.0 / self.samples))
