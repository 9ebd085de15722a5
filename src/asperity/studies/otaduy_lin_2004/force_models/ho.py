r"""The texture force of Ho, Basdogan & Srinivasan (1999): a perturbed surface normal.

Efficient point-based rendering techniques for haptic display of virtual objects, *Presence*
8(5), 477-491. With N the normal of the smooth surface, h >= 0 the height of the texture, K its
gain and d the depth of the point below the smooth surface,

    M = (N - grad h) / |N - grad h|
    F / k = (d - K h) N + K h M     if d >= K h,     else d M .

If the normal component of F equals the normal force F_n, d drops out, and the component along u,
as resistance, is

    F_u = min(k K h M_n, F_n) dh/du .

Unlike Minsky's, the force grows with the height and the stiffness, up to the same limit.

The formulas are quoted from other work and were not checked against the paper.

Limits: the probe is a point, so the force does not depend on its diameter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_positive
from asperity.geometry.offsets.piecewise import PiecewiseCubic, tabulate
from asperity.geometry.offsets.surface import Profile


def texture_force(
    surface: Profile, normal_force: float, *, stiffness: float = 1000.0, gain: float = 1.0
) -> PiecewiseCubic:
    """Return F_u [N] over one period of the surface.

    Parameters
    ----------
    surface : Profile
        The surface under the point; its lowest point has height 0.
    normal_force : float
        Normal force on the point [N], above 0.
    stiffness : float
        Stiffness of the smooth surface [N/m], above 0. The default is asperity's.
    gain : float
        K, 1 for the texture at its true height.
    """
    require_positive("normal_force", normal_force, "[N]")
    require_positive("stiffness", stiffness, "[N/m]")
    require_positive("gain", gain)
    lowest = float(np.min(surface.heights(np.linspace(0.0, surface.period, 16 * surface.cells))))

    def force(u: NDArray[np.float64]) -> NDArray[np.float64]:
        slope = surface.slopes(u)
        height = np.maximum(surface.heights(u) - lowest, 0.0)
        along_normal = 1.0 / np.sqrt(1.0 + slope**2)
        return np.minimum(stiffness * gain * height * along_normal, normal_force) * slope

    return tabulate(force, surface.period, cells=surface.cells)
