"""How depth becomes force: the parameters of all force laws, with their ranges."""

from __future__ import annotations

from dataclasses import dataclass

from asperity.errors import (
    AsperityError,
    require_between,
    require_choice,
    require_positive,
)

LAWS = ("otaduy-lin", "minsky", "ho", "siira-pai")
GRADIENTS = ("exact", "differences", "soft")
_RANGES = {
    "stiffness": (1e-6, 1e9, "N/m"),
    "bristle_stiffness": (1e-6, 1e9, "N/m"),
    "friction": (0.0, 100.0, ""),
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
"""Far beyond what is of use, and far from what numbers cannot hold."""


@dataclass(frozen=True)
class ForceSettings:
    """Parameters of the contact force.

    All defaults are asperity's; the paper prints none.

    Parameters
    ----------
    stiffness : float
        k of Eq. 1 [N/m]; 400 is what a Touch can do.
    law : {"otaduy-lin", "minsky", "ho", "siira-pai"}
        Otaduy & Lin's, or a baseline that takes the texture at one point of the smooth contact.
    friction : float
        Coulomb's coefficient, 0 or above. The texture's force carries the slope already: this is
        the material's alone.
    bristle_stiffness : float, optional
        Of the elastic bristle that holds a contact in place [N/m]; `stiffness` if not given.
    gradient : {"exact", "differences", "soft"}
        Of the depth: by the envelope theorem; by the paper's central differences of depths on a
        grid, whose step is a low-pass; or of a soft maximum. For "otaduy-lin" alone.
    step : float
        Of the central differences [m]. Rotations step by `step / lever`.
    lever : float
        Arm that turns a rotation into a length [m].
    grid : int
        Samples a side of the grid for "differences" and "soft", 4 to 1000.
    window : float
        Side of the square that the grid covers, round the contact [m].
    softness : float
        1 / beta of the soft maximum [m]; samples should be finer than that in height.
    soft_area : float
        A0, the fixed reference area of the soft maximum [m^2].
    ho_gain : float
        K of Ho et al.
    noise_level, noise_bandwidth : float
        Of Siira & Pai: standard deviation over the normal force; corner of its low-pass [Hz].
    seed : int
        Of that noise.
    max_nodes : int
        Most boxes that a search looks at, 100 or more; 4000 take about 2 ms.
    tolerance : float, optional
        Gap between the bounds of a depth that counts as certified [m]. If not given, a thousandth
        of the textures' rms height, and a nanometre at least.
    patch_radius : float
        Where a mesh is involved: how far the parts into which a wide contact is split reach over
        its middle [m]. Contacts with a standard deviation of a third of it or less have one part.
    edge_fade : float
        Where a mesh is involved: thickness of the overlap [m] below which a tool that slides off
        an edge loses its force, in proportion. 0: it drops at once.

    Raises
    ------
    AsperityError
        A value outside its range, one line.
    """

    stiffness: float = 400.0
    law: str = "otaduy-lin"
    friction: float = 0.0
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
    max_nodes: int = 4000
    tolerance: float | None = None
    patch_radius: float = 2.5e-3
    edge_fade: float = 2.6e-3

    def __post_init__(self) -> None:
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
                f"gradient {self.gradient!r} is for the law 'otaduy-lin', got law {self.law!r}"
            )
