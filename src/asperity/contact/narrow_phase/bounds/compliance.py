"""Bounds of the lowering of a surface with a stiffness map; see `compliance`."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.bounds.texture import texture_over


@inner_kernel
def lowering_over(textures, patch, other, box, search):
    """Return bounds of L sqrt(c) over a box of the patch's parameters: least value, bend, slope.

    The bend bounds minus its second derivative along any unit direction of the parameters [1/m].
    """
    c = patch.compliance + other.compliance
    if patch.stiffness_map < 0:
        return search.load * math.sqrt(c if c > 0.0 else search.usual), 0.0, 0.0
    x0, x1, y0, y1 = box
    texture = patch.texture
    patch.texture = patch.stiffness_map
    over = texture_over(textures, patch, x0, x1, y0, y1)  # of minus the compliance
    patch.texture = texture
    if over.top == -np.inf:
        return np.inf, 0.0, 0.0
    least = math.sqrt(c - over.top)
    most = math.sqrt(c + 1.0 / textures.maps[patch.stiffness_map].lowest)
    bend = over.bend / (2.0 * (least if over.bend > 0.0 else most))
    bend += over.slope * over.slope / (4.0 * least * least * least)
    slope = over.slope / (2.0 * least)
    return search.load * least, search.load * bend, search.load * slope
