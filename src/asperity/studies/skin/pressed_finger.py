r"""A bare finger pressed on a surface: compliant skin on a Winkler foundation.

A finger codes coarse roughness by how unevenly its skin is pressed, not by vibration alone. The
skin is a bed of independent springs, of `stiffness` per area, on a fingertip whose undeformed shape
is a paraboloid of radius `radius`. Pressed to the height g, it has the pressure

    p(x, y) = K max( h(x, y) - g - (x^2 + y^2) / 2 R , 0 ) ,

and g follows from the force, the integral of p. On a flat surface the closed form is

    F = pi K R d^2 ,   a = sqrt(2 R d) ,   p_max = K d ,

with d the indentation and a the radius of the contact.

The measure of roughness is spatial: how much the *difference* of pressure between places 2 mm apart
(the distance after Connor et al. 1990, recalled) varies as the texture passes below, over the mean
pressure. It knows no speed and no vibration, and is 0 on a flat surface. Stiffness and radius are
asperity's: a fingertip under 0.6 N flattens to a contact about 10 mm wide.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, require_positive

_ROUNDS = 60
_WIDEST = 0.95
"""Largest radius of a contact, as a part of the patch's half width."""


@dataclass(frozen=True)
class PressedFinger:
    """A fingertip with compliant skin."""

    radius: float = 10e-3
    """Of the fingertip's curvature [m]."""
    stiffness: float = 1.2e7
    """Of the skin, pressure per indentation [Pa/m]."""
    reach: float = 2e-3
    """Distance over which pressures are compared [m]."""

    def __post_init__(self) -> None:
        require_positive("radius", self.radius, "[m]")
        require_positive("stiffness", self.stiffness, "[Pa/m]")
        require_positive("reach", self.reach, "[m]")

    def flat_contact(self, force: float) -> tuple[float, float]:
        """Return indentation and contact radius [m] on a flat surface, in closed form."""
        depth = float(np.sqrt(force / (np.pi * self.stiffness * self.radius)))
        return depth, float(np.sqrt(2.0 * self.radius * depth))

    def pressure(
        self, heights: NDArray[np.float64], pixel: float, force: float
    ) -> NDArray[np.float64]:
        """Return the pressure [Pa] over a patch under the finger's middle.

        Parameters
        ----------
        heights : (rows, columns) array
            Of the surface [m], with the finger's axis in the middle of the patch.
        pixel : float
            [m]
        force : float
            [N], above 0.
        """
        require_positive("force", force, "[N]")
        rows, columns = heights.shape
        y = (np.arange(rows) - 0.5 * (rows - 1)) * pixel
        x = (np.arange(columns) - 0.5 * (columns - 1)) * pixel
        away = (y[:, None] ** 2 + x[None, :] ** 2) / (2.0 * self.radius)
        gap = heights - away
        area, top = pixel**2, float(np.max(gap))

        def load(level: float) -> float:
            return float(self.stiffness * area * np.sum(np.maximum(gap - level, 0.0)))

        low, step = top, 1e-6
        while load(low) < force:
            low, step = low - step, 2.0 * step
        high = top
        for _ in range(_ROUNDS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if load(middle) > force else (low, middle)
        pressure = self.stiffness * np.maximum(gap - low, 0.0)
        edge = max(abs(y[0]), abs(x[0])) * _WIDEST
        if np.any(pressure[np.hypot(*np.meshgrid(y, x, indexing="ij")) > edge]):
            raise AsperityError(
                f"the patch of {columns * pixel * 1e3:.3g} mm is too small for the contact under "
                f"{force:g} N; give a larger one"
            )
        return np.asarray(pressure)

    def unevenness(
        self, patches: Iterable[NDArray[np.float64]], pixel: float, force: float
    ) -> float:
        """Return the spatial measure of roughness: see the module.

        Parameters
        ----------
        patches : iterable of (rows, columns) arrays
            Heights under the finger at successive places of its path [m].
        pixel, force
            As for `pressure`.
        """
        pressures = np.array([self.pressure(patch, pixel, force) for patch in patches])
        shift = max(round(self.reach / pixel), 1)
        differences = pressures[:, :, shift:] - pressures[:, :, :-shift]
        touched = pressures.max(axis=0) > 0.0
        varied = np.std(differences, axis=0)[touched[:, shift:] & touched[:, :-shift]]
        return float(np.sqrt(np.mean(varied**2)) / np.mean(pressures[:, touched]))
