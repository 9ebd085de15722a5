"""The boxes that a branch-and-bound search starts from."""

from __future__ import annotations

import math

from asperity._core.kernels import inner_kernel
from asperity.contact.narrow_phase.surface_patch import PLANAR

_ALIGNED = 1e-12
"""Off-diagonal entry below which texture axes are parallel to a patch's axes."""


@inner_kernel
def start_boxes(textures, patch, window, boxes_out):
    """Fill boxes (9, 4) that cover a window, if possible blocks of the texture's pyramid.

    A bound over a whole block takes one look-up and is sharper than over other boxes. Returns the
    number of boxes.
    """
    x0, x1, y0, y1 = window
    boxes_out[0, 0], boxes_out[0, 1], boxes_out[0, 2], boxes_out[0, 3] = x0, x1, y0, y1
    if not patch.is_level or patch.texture < 0 or patch.mapping != PLANAR:
        return 1
    k, at = patch.texture, patch.texture_origin
    by_x, by_y, sides = patch.texture_from_x, patch.texture_from_y, patch.rectangle
    is_along = abs(by_x[1]) < _ALIGNED and abs(by_y[0]) < _ALIGNED
    if not is_along and not (abs(by_x[0]) < _ALIGNED and abs(by_y[1]) < _ALIGNED):
        return 1
    a, b = (0, 1) if is_along else (1, 0)
    # Cells of the texture along x and y: start + step * x.
    scale = textures.maps[k].cells_per_metre
    step_x, step_y = by_x[a] * scale[a], by_y[b] * scale[b]
    start_x = at[a] * scale[a] + 0.5
    start_y = at[b] * scale[b] + 0.5
    size = max(abs(step_x) * (x1 - x0), abs(step_y) * (y1 - y0))
    block = 1.0
    while 2.0 * block < size:
        block *= 2.0
    low_x = min(start_x + step_x * x0, start_x + step_x * x1)
    low_y = min(start_y + step_y * y0, start_y + step_y * y1)
    first_x, first_y = math.floor(low_x / block) * block, math.floor(low_y / block) * block
    count = 0
    for i in range(3):
        for j in range(3):
            c0, r0 = first_x + i * block, first_y + j * block
            p0, p1 = (c0 - start_x) / step_x, (c0 + block - start_x) / step_x
            q0, q1 = (r0 - start_y) / step_y, (r0 + block - start_y) / step_y
            p0, p1 = max(min(p0, p1), sides[0]), min(max(p0, p1), sides[1])
            q0, q1 = max(min(q0, q1), sides[2]), min(max(q0, q1), sides[3])
            if p0 < x1 and p1 > x0 and q0 < y1 and q1 > y0:
                boxes_out[count, 0], boxes_out[count, 1] = p0, p1
                boxes_out[count, 2], boxes_out[count, 3] = q0, q1
                count += 1
    return count
