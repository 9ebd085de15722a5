"""Where a ray leaves a textured mesh.

Each facet is a sheet (`facet_sheets`). At a hard edge, where neighbours are displaced along
different normals or by different heights, a facet reaches over its border, so that no crack opens.
Where the edge is convex the body is behind both sheets: what is in front of a neighbour's is no
exit. Where it is concave the body is behind either, and the last exit counts, as everywhere.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.soft.exits import PARALLEL, STEPS, advance
from asperity.contact.soft.facet_sheets import (
    BEYOND,
    NEAR,
    OUTSIDE,
    WITHIN,
    facet_sheet,
    fill_local,
    where_on,
)

_ROOM = 24
"""Exits near hard edges along one ray; of more the first are kept."""
_BEHIND = 1e-12
"""How far an exit may be in front of a neighbour's sheet [m]: where two meet it is on both."""


@small_kernel
def _meets_box(node, x, over, grow, end):
    """Return whether a ray meets a box within `end`; `over` (3,) is one over its direction."""
    low, high = 0.0, end
    for i in range(3):
        middle = (node.middle[i] - x[i]) * over[i]
        half = (node.reach[i] + grow) * abs(over[i])
        low, high = max(low, middle - half), min(high, middle + half)
    return low <= high


@inner_kernel
def _over_rectangle(facet, q, e, aside):
    """Return where a ray comes over a facet's rectangle, `aside` wider, and where it leaves it."""
    low, high = -np.inf, np.inf
    for i in range(2):
        half = facet.half[i] + aside
        if abs(e[i]) < PARALLEL:
            if abs(q[i]) > half:
                return np.inf, -np.inf
            continue
        middle, half = -q[i] / e[i], half / abs(e[i])
        low, high = max(low, middle - half), min(high, middle + half)
    return low, high


@inner_kernel
def _leave_facet(solids, g, facet, q, e, foot_out):
    """Return the last s at which a ray leaves a facet's sheet, -inf without one; fill its foot.

    `q`, `e`: start and direction in the facet's axes, whose third part is above 0.
    """
    lowest, highest = solids.reach[g].lowest, solids.reach[g].highest
    low, high = (lowest - q[2]) / e[2], (highest - q[2]) / e[2]
    begins, ends = _over_rectangle(facet, q, e, max(-lowest, highest))
    if begins > high or ends < low:
        return -np.inf
    aside = math.sqrt(max(1.0 - e[2] * e[2], 0.0))
    steep = facet.slope * (aside + facet.lean) + facet.lean
    is_bracket = e[2] > steep
    search = (is_bracket, facet.bend * aside * aside, e[2] + steep)
    if not facet.is_level:
        search = (is_bracket, facet.bend, 1.1 * (1.0 + facet.slope))
    if not is_bracket:
        low, high = max(low, begins), min(high, ends)
    at, gradient = stack_array((3,)), stack_array((3,))
    s, floor = 0.5 * (low + high) if is_bracket else high, low
    for step in range(STEPS):
        for i in range(3):
            at[i] = q[i] + s * e[i]
        value = facet_sheet(solids, g, facet, at, gradient, foot_out)
        if step == 0 and not is_bracket and value < 0.0:
            return -np.inf  # it is still inside where it has passed the facet
        rate = gradient[0] * e[0] + gradient[1] * e[1] + gradient[2] * e[2]
        s, low, high, is_found = advance(s, value, rate, low, high, search)
        if is_found:
            break
        if s < floor:
            return -np.inf
    for i in range(3):
        at[i] = q[i] + s * e[i]
    facet_sheet(solids, g, facet, at, gradient, foot_out)
    return s


@inner_kernel
def _counts(meshes, solids, g, ray, found, count, c):
    """Return whether exit `c` of those `found` (count, 3) near hard edges is on the surface."""
    x, d = ray
    s, number, place = found[c, 0], int(found[c, 1]), int(found[c, 2])
    point, q, e = stack_array((3,)), stack_array((3,)), stack_array((3,))
    gradient, foot = stack_array((3,)), stack_array((2,))
    for i in range(3):
        point[i] = x[i] + s * d[i]
    own = meshes.facets[number]
    for k in range(own.first, own.last):
        neighbour = meshes.neighbours[k]
        if neighbour.is_convex:
            facet = meshes.facets[neighbour.facet]
            fill_local(facet, point, d, q, e)
            if q[2] <= solids.reach[g].lowest:
                continue
            front = facet_sheet(solids, g, facet, q, gradient, foot)
            if front > _BEHIND and where_on(facet, foot[0], foot[1]) != OUTSIDE:
                return False
        elif place == BEYOND:
            # What lies over the edge has an exit of its own, as at the step between two textures.
            for other in range(count):
                if int(found[other, 1]) == neighbour.facet and found[other, 2] >= NEAR:
                    return False
    return True


@small_kernel
def _later(s, number, layer, best):
    """Return the last exit within a layer and the first beyond it: s, facet, s, facet."""
    last, by, first, by_first = best
    if s <= layer:
        if s > last:
            last, by = s, number
    elif s < first:
        first, by_first = s, number
    return last, by, first, by_first


@inner_kernel
def leave_mesh(meshes, solids, g, x, d, layer):
    """Return how far along a ray it leaves a mesh [m], and by which facet; 0 where it does not.

    Parameters
    ----------
    meshes : MeshFacets
        None where there is no mesh.
    solids : Solids
    g : int
        The geom.
    x, d : (3,) arrays
        Start of the ray and its unit direction, in the geom's frame.
    layer : float
        Thickness of the layer [m]. An exit beyond it counts only if the ray does not enter the body
        beyond its start: else the body came from behind.
    """
    if meshes is None:
        return 0.0, -1
    over, waiting = stack_array((3,)), stack_array((64,))
    q, e, foot = stack_array((3,)), stack_array((3,)), stack_array((2,))
    found, count = stack_array((_ROOM, 3)), 0
    for i in range(3):
        over[i] = 1.0 / d[i] if abs(d[i]) > 1e-300 else 1e300
    is_smooth = solids.geometry.texture[solids.geometry.surface[g]] < 0
    entered, best, end = np.inf, (0.0, -1, np.inf, -1), 2.0 * layer
    waiting[0], size = meshes.root[g], 1
    while size:
        size -= 1
        node = meshes.nodes[int(waiting[size])]
        if not _meets_box(node, x, over, meshes.grow[g], end):
            continue
        if node.child >= 0:
            waiting[size], waiting[size + 1] = node.child, node.child + 1
            size += 2
            continue
        for number in range(node.first, node.last):
            facet = meshes.facets[number]
            fill_local(facet, x, d, q, e)
            if abs(e[2]) <= PARALLEL:
                continue
            s, place = -q[2] / e[2], WITHIN
            if e[2] < 0.0 or is_smooth:
                if not 0.0 < s < end:
                    continue
                place = where_on(facet, q[0] + s * e[0], q[1] + s * e[1])
                if e[2] < 0.0:
                    if place >= NEAR:
                        entered = min(entered, s)
                    continue
            else:
                s = _leave_facet(solids, g, facet, q, e, foot)
                if not 0.0 < s < end:
                    continue
                place = where_on(facet, foot[0], foot[1])
            if place == OUTSIDE:
                continue
            if place == WITHIN and not facet.has_corners:
                best = _later(s, number, layer, best)
            elif count < _ROOM:
                found[count, 0], found[count, 1], found[count, 2] = s, number, place
                count += 1
    for c in range(count):
        if _counts(meshes, solids, g, (x, d), found, count, c):
            best = _later(found[c, 0], int(found[c, 1]), layer, best)
    last, by, first, by_first = best
    if first <= entered and by_first >= 0:
        return first, by_first
    return last, by


@inner_kernel
def normal_of_mesh(meshes, solids, g, number, x, normal_out):
    """Fill the normal (3,) of a mesh's textured surface at a point of it (3,), by a facet."""
    if meshes is None:
        return
    q, e, foot = stack_array((3,)), stack_array((3,)), stack_array((2,))
    facet = meshes.facets[number]
    fill_local(facet, x, x, q, e)
    facet_sheet(solids, g, facet, q, e, foot)
    for i in range(3):
        normal_out[i] = 0.0
        for j in range(3):
            normal_out[i] += e[j] * facet.axes[j, i]
