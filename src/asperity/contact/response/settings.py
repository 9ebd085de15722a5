"""Parameters of the force laws, with their ranges."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

from asperity.errors import (
    AsperityError,
    require_between,
    require_choice,
    require_positive,
)

LAW_LABELS = {
    "otaduy-lin": "Otaduy & Lin 2004",
    "minsky": "Minsky 1995",
    "ho": "Ho et al. 1999",
    "siira-pai": "Siira & Pai 1996",
}
"""Labels of the force laws, by name."""
LAWS = tuple(LAW_LABELS)
GRADIENTS = ("exact", "differences", "soft")
_RANGES = {
    "stiffness": (1e-6, 1e9, "N/m"),
    "object_stiffness": (1e-6, 1e9, "N/m"),
    "bristle_stiffness": (1e-6, 1e9, "N/m"),
    "friction": (0.0, 100.0, ""),
    "dissipation": (0.0, 1e6, "s/m"),
    "step": (1e-9, 1e-2, "m"),
    "lever": (1e-6, 10.0, "m"),
    "window": (1e-7, 1.0, "m"),
    "patch_radius": (1e-5, 1.0, "m"),
    "edge_fade": (0.0, 1.0, "m"),
    "softness": (1e-9, 1e-2, "m"),
    "soft_area": (1e-15, 1.0, "m^2"),
    "ho_gain": (1e-6, 1e6, ""),
    "noise_level": (0.0, 100.0, ""),
    "noise_bandwidth": (1e-3, 1e6, "Hz"),
}
"""Smallest and largest values and units: wider than any useful range, and numerically safe."""


@dataclass(frozen=True)
class ForceSettings:
    """Parameters of the contact force.

    The defaults are asperity's; Otaduy & Lin (2004) print none.

    Parameters
    ----------
    stiffness : float
        k of Eq. 1 [N/m], 1e-6 to 1e9, without a coupling: limited by what a device can render, 400
        for a Touch.
    law : {"otaduy-lin", "minsky", "ho", "siira-pai"}
        Force law: Otaduy & Lin's, or a baseline that reads the texture at one point of the smooth
        bodies' contact (`response.point_laws`).
    friction : float
        Coulomb's coefficient [-], 0 to 100. The force of the texture already contains the effect
        of its slopes: the coefficient is that of the material alone.
    dissipation : float
        a of Hunt & Crossley (1975) [s/m], 0 to 1e6: the force of a contact whose depth grows at
        v m/s is 1 + a v times that without, and at least 0, so that contacts dissipate energy and
        never pull. The coefficient of restitution at a low speed v is about 1 - 2/3 a v.
    bristle_stiffness : float, optional
        Stiffness of the elastic bristle that holds a contact in place [N/m], 1e-6 to 1e9; k by
        default.
    object_stiffness : float, optional
        k with a virtual coupling between handle and tool [N/m], 1e-6 to 1e9: that of the objects,
        not limited by the device. By default `stiffness`, or more if a finger's force would press
        the textures flat; see `scene.Scene.acting_force`.
    gradient : {"exact", "differences", "soft"}
        Gradient of the depth: exact, by the envelope theorem; by the paper's central differences of
        depths on a grid, whose step acts as a low-pass; or that of a soft maximum. The last two are
        for the law "otaduy-lin".
    step : float
        Step of the central differences [m]. Rotations step by `step / lever` [rad].
    lever : float
        Length that converts a rotation to a distance [m].
    grid : int
        Samples along a side of the grid for "differences" and "soft", 4 to 1000.
    window : float
        Side of the square around the contact that the grid covers [m].
    softness : float
        1 / beta of the soft maximum [m]. Neighbouring samples should differ by less in height.
    soft_area : float
        A0, the reference area of the soft maximum [m^2].
    ho_gain : float
        K of Ho et al. [-].
    noise_level : float
        Standard deviation of Siira & Pai's noise over the normal force [-].
    noise_bandwidth : float
        Corner frequency of that noise [Hz].
    seed : int
        Seed of that noise.
    max_nodes : int
        Maximum number of boxes that a search evaluates, 100 or more; 8000 take about 4 ms.
    tolerance : float, optional
        Gap between the bounds of a depth at which it counts as certified [m]. By default a
        thousandth of the textures' rms height, but at least a nanometre.
    patch_radius : float, optional
        For meshes: how far the parts of a split contact extend beyond its centroid [m]. Contacts
        with a standard deviation of at most a third of it have one part. By default
        a third of the second largest standard deviation of the smaller body's surface: 2.3 mm for
        a file of 20 mm, 0.8 mm for a ball of 8 mm.
    edge_fade : float, optional
        Deprecated, without effect: at an edge the tool is pushed out by the shorter way.

    Raises
    ------
    AsperityError
        A value is outside its range; the message names it and the range.
    """

    stiffness: float = 400.0
    law: str = "otaduy-lin"
    friction: float = 0.0
    dissipation: float = 0.0
    bristle_stiffness: float | None = None
    gradient: str = "exact"
    step: float = 2e-5
    lever: float = 1e-2
    grid: int = 50
    window: float = 4e-3
    softness: float = 2e-6
    soft_area: float = 1e-6
    ho_gain: float = 1.0
    noise_level: float = 0.2
    noise_bandwidth: float = 300.0
    seed: int = 0
    max_nodes: int = 8000
    tolerance: float | None = None
    patch_radius: float | None = None
    edge_fade: float | None = None
    object_stiffness: float | None = None

    def __post_init__(self) -> None:
        if self.edge_fade is not None:
            warnings.warn(
                "force.edge_fade is without effect: leave it out", DeprecationWarning, stacklevel=3
            )
        require_choice("law", self.law, LAWS)
        require_choice("gradient", self.gradient, GRADIENTS)
        for name, (low, high, unit) in _RANGES.items():
            if getattr(self, name) is not None:
                require_between(name, getattr(self, name), low, high, unit)
        if self.tolerance is not None:
            require_positive("tolerance", self.tolerance, "[m]")
        for name, low, high in (("grid", 4, 1000), ("max_nodes", 100, 10**8), ("seed", 0, 2**63)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int):
                raise AsperityError(f"{name} must be a whole number, got {value!r}")
            require_between(name, value, low, high)
        if self.gradient != "exact" and self.law != "otaduy-lin":
            raise AsperityError(
                f"gradient {self.gradient!r} requires the law 'otaduy-lin', got law {self.law!r}"
            )
