"""Exit of a ray from a textured mesh.

Each facet is a sheet (`facet_sheets`). At a hard edge, where neighbours are displaced along
different normals or by different heights, a facet is extended beyond its border, so that there is
no gap. At a convex edge the body is behind both sheets: a point in front of the neighbour's sheet
is no exit. At a concave edge the body is behind either, and the last exit counts, as everywhere.
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
    along_axis,
    facet_sheet,
    fill_foot,
    from_origin,
    is_far,
    where_on,
)

_ROOM = 48
"""Maximum number of exits near hard edges along one ray."""
_BEHIND = 1e-12
"""Distance in front of a neighbour's sheet up to which an exit is on both sheets [m]."""


@small_kernel
def _meets_box(node, x, over, grow, end):
    """Return whether a ray meets a box within `end`; `over` is the reciprocal of its direction."""
    low, high = 0.0, end
    for i in range(3):
        middle = (node.middle[i] - x[i]) * over[i]
        half = (node.reach[i] + grow) * abs(over[i])
        low, high = max(low, middle - half), min(high, middle + half)
    return low <= high


@small_kernel
def _reciprocal(part):
    """Return the reciprocal of a direction's component, a large number for 0."""
    return 1.0 / part if abs(part) > 1e-300 else 1e300


@inner_kernel
def _clip_to_rectangle(facet, q, e, aside):
    """Return the range of a ray over a facet's rectangle, widened by `aside`."""
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
def _exit_facet(solids, g, facet, q, e, foot_out):
    """Return the last s at which a ray leaves a facet's sheet, -inf without one; fill its foot.

    `q` and `e` are start and direction in the facet's axes; e[2] is above 0.
    """
    lowest, highest = solids.reach[g].lowest, solids.reach[g].highest
    low, high = (lowest - q[2]) / e[2], (highest - q[2]) / e[2]
    aside = math.sqrt(max(1.0 - e[2] * e[2], 0.0))
    steep = facet.slope * (aside + facet.lean) + facet.lean
    is_bracket, s = e[2] > steep, -q[2] / e[2]
    most = max(-lowest, highest)
    # The last argument bounds the distance from the ray's point on the plane to the foot.
    if is_far(facet, q[0] + s * e[0], q[1] + s * e[1], most * (aside / e[2] + 2.0 * facet.lean)):
        return -np.inf
    search = (is_bracket, facet.bend * aside * aside, e[2] + steep)
    if not facet.is_level:
        search = (is_bracket, facet.bend, 1.1 * (1.0 + facet.slope))
    if not is_bracket:
        begins, ends = _clip_to_rectangle(facet, q, e, most)
        low, high = max(low, begins), min(high, ends)
        s = high
        if low > high:
            return -np.inf
    at, gradient, w = stack_array((3,)), stack_array((3,)), stack_array((3,))
    floor = low
    for step in range(STEPS):
        for i in range(3):
            at[i] = q[i] + s * e[i]
        value = facet_sheet(solids, g, facet, at, gradient, foot_out)
        if step == 0 and not is_bracket and value < 0.0:
            return -np.inf  # still inside at the end of the facet
        rate = gradient[0] * e[0] + gradient[1] * e[1] + gradient[2] * e[2]
        s, low, high, is_found = advance(s, value, rate, low, high, search)
        if is_found:
            break
        if s < floor:
            return -np.inf
    for i in range(3):
        at[i] = q[i] + s * e[i]
    foot_out[0], foot_out[1], _ = fill_foot(facet, at, w)
    return s


@inner_kernel
def _starts_in_front(meshes, solids, g, x, number):
    """Return whether a ray starts in front of a neighbour of a facet at a convex edge."""
    q, gradient, foot = stack_array((3,)), stack_array((3,)), stack_array((2,))
    own = meshes.facets[number]
    for k in range(own.first, own.last):
        neighbour = meshes.neighbours[k]
        if not neighbour.is_convex:
            continue
        facet = meshes.facets[neighbour.facet]
        for i in range(3):
            q[i] = from_origin(facet, i, x)
        front = facet_sheet(solids, g, facet, q, gradient, foot)
        if front > 0.0 and where_on(facet, foot[0], foot[1]) != OUTSIDE:
            return True
    return False


@inner_kernel
def _classify_exit(meshes, solids, g, ray, found, count, c):
    """Return whether exit `c` of those `found` (count, 3) near hard edges is on the surface.

    1: it is; 0: it is not; -1: it is in front of a neighbour, but the ray starts behind all of
    them.
    """
    x, d = ray
    s, number, place = found[c, 0], int(found[c, 1]), int(found[c, 2])
    point, q = stack_array((3,)), stack_array((3,))
    gradient, foot = stack_array((3,)), stack_array((2,))
    # An extension needs a neighbour below it; without one another surface is there.
    answer, is_met = 1, place != BEYOND
    for i in range(3):
        point[i] = x[i] + s * d[i]
    own = meshes.facets[number]
    for k in range(own.first, own.last):
        neighbour = meshes.neighbours[k]
        facet = meshes.facets[neighbour.facet]
        q[2] = from_origin(facet, 2, point)
        if place != BEYOND and not neighbour.is_convex:
            continue
        if is_met and neighbour.is_convex and q[2] <= solids.reach[g].lowest:
            continue
        for i in range(2):
            q[i] = from_origin(facet, i, point)
        front = facet_sheet(solids, g, facet, q, gradient, foot)
        if where_on(facet, foot[0], foot[1]) == OUTSIDE:
            continue
        is_met, exit_there, place_there = True, -1.0, OUTSIDE
        for other in range(count):
            if int(found[other, 1]) == neighbour.facet:
                exit_there, place_there = found[other, 0], int(found[other, 2])
        if not neighbour.is_convex:
            # The neighbour has its own exit, as at the step between two textures.
            if place_there >= NEAR:
                return 0
        elif exit_there > 0.0:  # earlier bumps of either sheet do not matter
            if exit_there < s:
                answer = -1
        elif front > _BEHIND:
            answer = -1
    if answer < 0 and _starts_in_front(meshes, solids, g, x, number):
        return 0
    return answer if is_met else 0


@small_kernel
def _merge_exit(s, number, layer, best):
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
    """Return the distance along a ray to its exit from a mesh [m], and the facet; 0 for none.

    Parameters
    ----------
    meshes : MeshFacets
        None if there is no mesh.
    solids : Solids
    g : int
        The geom.
    x, d : (3,) arrays
        Start of the ray and its unit direction, in the geom's frame.
    layer : float
        Thickness of the layer [m]. An exit beyond it counts only if the ray does not enter the body
        beyond its start: else the body is behind the layer.
    """
    if meshes is None:
        return 0.0, -1
    q, e, foot = stack_array((3,)), stack_array((3,)), stack_array((2,))
    found, count = stack_array((_ROOM, 3)), 0
    over = (_reciprocal(d[0]), _reciprocal(d[1]), _reciprocal(d[2]))
    is_smooth = solids.geometry.texture[solids.geometry.surface[g]] < 0
    entered, best, end = np.inf, (0.0, -1, np.inf, -1), 2.0 * layer
    at, grow = meshes.root[g], meshes.grow[g]
    stop = meshes.nodes[at].after
    while at < stop:
        node = meshes.nodes[at]
        if not _meets_box(node, x, over, grow, end):
            at = node.after
            continue
        at += 1
        for number in range(node.first, node.last):
            facet = meshes.facets[number]
            rate, gap = along_axis(facet, 2, d), from_origin(facet, 2, x)
            if abs(rate) <= PARALLEL:
                continue
            s, place = -gap / rate, WITHIN
            is_sheet = rate > 0.0 and not is_smooth
            slack = grow / rate if is_sheet else 0.0
            if not -slack < s < end + slack:
                continue
            for i in range(2):
                q[i], e[i] = from_origin(facet, i, x), along_axis(facet, i, d)
            if is_sheet:
                q[2], e[2] = gap, rate
                s = _exit_facet(solids, g, facet, q, e, foot)
                if not 0.0 < s < end:
                    continue
            else:
                foot[0], foot[1] = q[0] + s * e[0], q[1] + s * e[1]
            place = where_on(facet, foot[0], foot[1])
            if place == OUTSIDE:
                continue
            if rate < 0.0:
                if place >= NEAR:
                    entered = min(entered, s)
            elif place == WITHIN and not facet.has_corners:
                best = _merge_exit(s, number, layer, best)
            elif count < _ROOM:
                found[count, 0], found[count, 1], found[count, 2] = s, number, place
                count += 1
    nearest, by = np.inf, -1
    for c in range(count):
        s, number = found[c, 0], int(found[c, 1])
        answer = _classify_exit(meshes, solids, g, (x, d), found, count, c)
        if answer > 0:
            best = _merge_exit(s, number, layer, best)
        elif answer < 0 and s < nearest:
            nearest, by = s, number
    if by >= 0 and best[1] < 0 and best[3] < 0:
        # The sheets do not meet within their extensions: the first exit counts.
        best = _merge_exit(nearest, by, layer, best)
    last, by, first, by_first = best
    if by_first >= 0 and first <= entered:
        return first, by_first
    return last, by


@inner_kernel
def normal_of_mesh(meshes, solids, g, number, x, normal_out):
    """Fill the normal (3,) of a mesh's textured surface at a point (3,) on one of its facets."""
    if meshes is None:
        return
    q, e, foot = stack_array((3,)), stack_array((3,)), stack_array((2,))
    facet = meshes.facets[number]
    for i in range(3):
        q[i] = from_origin(facet, i, x)
    facet_sheet(solids, g, facet, q, e, foot)
    for i in range(3):
        normal_out[i] = 0.0
        for j in range(3):
            normal_out[i] += e[j] * facet.axes[j, i]
