r"""The texture force of Otaduy & Lin (2004, Eqs 4-6): the gradient of penetration depth.

For a probe pressed on the surface with normal force `F_n > 0`,

    F_u = F_n d(delta)/du ,

where delta is the directional penetration depth, which for a disk or sphere is the height of its
offset surface. Positive F_u resists motion along +u, as it does uphill.

*Sign.* Taken literally, Eq. 4 has F_n = -k delta < 0, and Eq. 7 would then push the hand uphill.
With F_n the magnitude of the normal force, the texture resists climbing, as in Eq. 2.

Limits: there are no dynamics along the normal; the probe never lifts off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_positive
from asperity.geometry.offsets.piecewise import PiecewiseCubic, mirrored, tabulate
from asperity.geometry.offsets.surface import Profile, Tracer


def slope_table(
    surface: Profile, diameter: float, *, tolerance: float = 1e-6, trace: Tracer | None = None
) -> PiecewiseCubic:
    """Return d(delta)/du over one period of the surface for a probe of `diameter` [m].

    Parameters
    ----------
    surface : Profile
    diameter : float
        [m]
    tolerance : float
        Relative to the largest slope.
    trace : Tracer, optional
        The surface's tracer for that probe, if it exists already.
    """
    trace = trace or surface.tracer(diameter)

    def slope(u: NDArray[np.float64]) -> NDArray[np.float64]:
        return trace(u).slope

    if surface.mirrored:
        half = tabulate(slope, 0.5 * surface.period, cells=surface.cells // 2, tolerance=tolerance)
        return mirrored(half)
    return tabulate(slope, surface.period, cells=surface.cells, tolerance=tolerance)


def texture_force(surface: Profile, diameter: float, normal_force: float) -> PiecewiseCubic:
    """Return F_u [N] over one period of the surface.

    Parameters
    ----------
    surface : Profile
        The surface under the probe.
    diameter : float
        Diameter of the probe [m], above 0.
    normal_force : float
        Magnitude of the normal force on the probe [N], above 0.
    """
    require_positive("normal_force", normal_force, "[N]")
    return slope_table(surface, diameter).scaled(normal_force)  # Eq. 6
