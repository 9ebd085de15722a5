r"""The texture force of Minsky (1995): proportional to the slope of the height map at a point.

    F_u = K dh/du ,     K = F_n here,

which opposes motion uphill. M. Minsky, *Computational Haptics: The Sandpaper System for
Synthesizing Texture for a Force-Feedback Display*, PhD thesis, MIT. The gain K [N] is free in
the original; set to the normal force, it makes the model the limit of Otaduy & Lin's for a probe
of zero size, which is the fairest comparison.

Limits: the probe is a point, so the force does not depend on its diameter.
"""

from __future__ import annotations

from asperity.errors import require_positive
from asperity.geometry.offsets.piecewise import PiecewiseCubic, tabulate
from asperity.geometry.offsets.surface import Profile


def texture_force(surface: Profile, normal_force: float) -> PiecewiseCubic:
    """Return F_u [N] over one period of the surface, for gain K = `normal_force` [N]."""
    require_positive("normal_force", normal_force, "[N]")
    return tabulate(surface.slopes, surface.period, cells=surface.cells).scaled(normal_force)
