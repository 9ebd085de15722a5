"""Contact where a mesh is involved: footprints, patches, depths, and the stiffness they share.

For each body of the scene that the tool is near, the footprint (`contact.footprint`) is summed for
six directions of that body's frame. A direction in which there is some has a normal (the mean of
B's, by how deep it is), and one to four patches (`contact.regions`) whose depths are searched.

A contact has to begin at the surface: a direction comes in only where its depth was about zero at
the last pose, so that pushing through a thin plate does not meet the far side. It is
believed while it lasts, however deep it gets.

Stiffness is shared. With delta_p the depths of the patches of a direction, of which there are m,
and delta their mean, a patch has the weight

    w_p = W s v delta / (m sum of s v delta over directions),

s the part that a direction has of those with about the same normal, so that a plane that counts
for two directions counts once. Where a tool lies across an edge of B, the
same overlap is seen from two sides: v is 0 where another direction accounts for it (`_weigh`). And
W fades from 1 to 0 over the last of a footprint that slides off an edge.
"""

from __future__ import annotations

import math

import numpy as np

from asperity.compiled import clear, inner_kernel
from asperity.contact.deepest import DEPTH, POINT_X
from asperity.contact.facet_search import pairs_of_charts, patch_depths
from asperity.contact.facet_space import MAX_PATCHES, WINDOWS
from asperity.contact.facet_table import BINS
from asperity.contact.footprint import (
    DEEPEST,
    MASS,
    MEAN,
    NORMAL,
    WHERE,
    add_piece,
    between_bodies,
    cut_deep,
    deepest_of,
    facing_pairs,
    piece,
    sliver,
    steady_normal,
    way_out,
)
from asperity.contact.patch import frame_round
from asperity.engine.frames import out_of

_BIRTH = 2e-4
"""A contact may begin this deep, and the motion of a tick besides [m]."""
_NEAR_ZERO = 1e-4
"""A depth that counts as none when a contact begins, besides the motion of a tick [m]."""
_BESIDE = 2e-4
"""How much deeper than a contact may be facets are looked for [m]."""
_EXPLAINED, _OWN = 1.2, 2.0
"""A place is out, and surely not, after this many depths of the other direction."""
_ON_SURFACE = 1e-6
"""A place this deep is on the surface [m]."""
_ALIKE, _SAME = 0.75, 0.95
"""Directions whose normals agree to this cosine begin to share their part, and do share it."""

# Columns of `FacetSpace.directions`.
_N, _FADE, _DEPTH, _ROWS, _FIRST, _PART, _TWIN, _VALID, _MOST = 0, 3, 4, 5, 6, 7, 8, 9, 10
_IS_EXPLAINED, _SEEN = 11, 12  # by another direction, and so not searched; had its turn


@inner_kernel
def moved_since(memory_pose, body, size):
    """Return how far a point of the tool has moved at most since the last pose [m]."""
    turned = away = 0.0
    for i in range(3):
        away += (body[i, 3] - memory_pose[i, 3]) ** 2
        for k in range(3):
            turned += (body[i, k] - memory_pose[i, k]) ** 2
    return math.sqrt(away) + math.sqrt(turned) * size


@inner_kernel
def _limits(memory, b, reach, hollow, moved, pressed, limit_out):
    """Fill how deep the smooth bodies may overlap in each direction; return the largest.

    Where they overlap by more than the textures are hollow, the textured surfaces do.
    """
    most = 0.0
    for d in range(BINS):
        if memory.active[b, d] == 1:
            limit_out[d] = max(memory.deepest[b, d], 0.0) + hollow + _BIRTH + 2.0 * moved
        elif memory.known[b] == 1:
            limit_out[d] = hollow + _BIRTH + 2.0 * moved
        else:
            limit_out[d] = 1.5 * max(pressed, 0.0) + reach + _BIRTH
        most = max(most, limit_out[d])
    return most


@inner_kernel
def _sum_footprint(table, count, reach, near, space):
    """Fill the sums of all directions; keep the pairs of facets that may touch, return how many."""
    sums, limit = space.sums, space.limit
    for d in range(BINS):
        clear(sums[d])
        sums[d, DEEPEST] = -np.inf
    kept = 0
    for i in range(count):
        f, g = space.facings[i, 0], space.facings[i, 1]
        here, corners = piece(table, f, g, reach, reach, near, space)
        if corners < 0:
            continue
        space.facings[kept, 0], space.facings[kept, 1] = f, g
        kept += 1
        masses = space.masses[kept - 1]
        clear(masses)
        if corners < 3:
            continue
        most, corner = deepest_of(space, here, corners)
        for d in range(BINS):
            share = table.shares[g, d]
            if share == 0.0:
                continue
            if most > sums[d, DEEPEST]:
                sums[d, DEEPEST] = most
                p = space.polygon[here, corner]
                for k in range(3):
                    place = table.origin[g, k] + p[0] * table.axes[g, 0, k]
                    sums[d, WHERE + k] = place + p[1] * table.axes[g, 1, k]
            if most <= limit[d]:
                masses[d] = add_piece(table, g, here, corners, reach, share, space, sums[d])
            else:
                there, left = cut_deep(space, here, corners, limit[d])
                if left >= 3:
                    masses[d] = add_piece(table, g, there, left, reach, share, space, sums[d])
    return kept


@inner_kernel
def _may_touch(memory, b, d, sums, moved, shallowest):
    """Return whether a direction is, or may become, a contact."""
    if sums[MASS] <= 0.0:
        return False
    if memory.active[b, d] == 1:
        return True
    if memory.known[b] == 0:
        return sums[DEEPEST] <= 2.0 * max(shallowest, 0.0) + _BIRTH
    return memory.depth[b, d] <= moved + _NEAR_ZERO


@inner_kernel
def touch(
    textures, table, geometry, tool, b, near_a, near_b, pressed, moved, radius, fade, tolerance,
    max_nodes, memory, space, work_space,
):  # fmt: skip
    """Add the patches between the tool and body b to `space.rows`, with their weights.

    Parameters
    ----------
    near_a, near_b : (3, 4) arrays
        The bodies as seen from the tool's centre of mass, world axes.
    pressed : float
        How deep MuJoCo finds the two [m].
    moved : float
        How far the tool has moved since the last pose [m].
    radius : float
        How far patches reach over the middle of the footprint [m].
    fade : float
        Thickness of a sliver below which its stiffness fades [m].
    """
    rows, foot = space.rows, space.footprint
    turn, shift = space.frames[3, :, :3], space.frames[3, :, 3]
    between_bodies(near_a, near_b, turn, shift)
    reach = hollow = 1e-7 + table.slack[tool] + table.slack[b]
    for body in (tool, b):
        if geometry.texture[body] >= 0:
            reach += textures.scales[geometry.texture[body], 2]
            hollow += max(-textures.scales[geometry.texture[body], 6], 0.0)
    most = _limits(memory, b, reach, hollow, moved, pressed, foot.limit)
    scan = most + moved + _BESIDE
    # Sideways textures move points no farther than they rise.
    count = facing_pairs(table, tool, b, turn, shift, math.hypot(scan, reach), reach, foot)
    if foot.clock[1] > 0:
        rows.count[1] += 1
    count = _sum_footprint(table, count, reach, scan, foot)
    shallowest = np.inf
    for d in range(BINS):
        if foot.sums[d, MASS] > 0.0:
            shallowest = min(shallowest, foot.sums[d, DEEPEST])
    frame = work_space.frame
    n, world = space.frames[4, 0, :3], space.frames[5, 0, :3]
    local = space.frames[6, :, :3]
    u, v = local[0], local[1]
    for d in range(BINS):
        way = space.directions[d]
        way[_DEPTH], way[_ROWS], way[_FIRST] = -np.inf, 0.0, 0.0
        way[_MOST], way[_PART], way[_TWIN] = -np.inf, 0.0, d
        way[_IS_EXPLAINED], way[_SEEN] = 0.0, 0.0
    for _ in range(BINS):
        d = _next(memory, b, space)
        beginning = memory.known[b] == 1 and memory.active[b, d] == 0
        way, sums = space.directions[d], foot.sums[d]
        way[_FIRST] = rows.count[0]
        if not _may_touch(memory, b, d, sums, moved, shallowest):
            continue
        if rows.count[0] + WINDOWS > MAX_PATCHES:
            rows.count[1] += 1
            continue
        size = math.sqrt(sums[NORMAL] ** 2 + sums[NORMAL + 1] ** 2 + sums[NORMAL + 2] ** 2)
        for k in range(3):
            n[k] = sums[NORMAL + k] / size
        steady_normal(table, count, d, foot, n)
        for k in range(3):
            way[_N + k] = n[k]
        twin = _twin(space, foot.sums, d)
        if twin >= 0:
            # The same plane counts for two directions: what is known of the one holds for both.
            way[_DEPTH], way[_TWIN] = space.directions[twin, _DEPTH], twin
            way[_MOST] = space.directions[twin, _MOST]
            continue
        if beginning and _is_explained(table, count, d, space):
            way[_IS_EXPLAINED] = 1.0
            continue
        # Axes that turn with B: what is split along them is the same wherever B is.
        frame_round(n, local)
        out_of(near_b, u, frame[0])
        out_of(near_b, v, frame[1])
        out_of(near_b, n, world)
        for k in range(3):
            frame[2, k] = world[k]
        pairs, made_a, stride, enough = pairs_of_charts(
            textures, table, geometry, count, d, n, frame, near_a, near_b, work_space, space
        )
        if not enough:
            rows.count[1] += 1
        start = rows.count[0]
        patches = patch_depths(
            textures, sums, pairs, made_a, stride, u, v, world, frame, near_a, near_b, radius,
            memory.guess[b, d], tolerance, max_nodes, work_space, space, rows.result[start:],
        )  # fmt: skip
        total = deepest = 0.0
        for p in range(patches):
            depth = rows.result[start + p, DEPTH]
            total += max(depth, 0.0)
            deepest = max(deepest, depth)
            rows.where[start + p, 0], rows.where[start + p, 1] = b, d
            rows.where[start + p, 2] = p
            for k in range(3):
                rows.normal[start + p, k] = world[k]
        depth = total / patches
        if memory.known[b] == 1 and memory.active[b, d] == 0 and depth > _NEAR_ZERO + 2.0 * moved:
            # It did not begin at the surface: a side that has come into view within the other body.
            continue
        thickness = sliver(sums)
        way[_ROWS], way[_DEPTH], way[_MOST] = patches, depth, deepest
        way[_FADE] = min(thickness / fade, 1.0) if fade > 0.0 else 1.0
        rows.count[0] += patches
    _weigh(table, count, near_b, space)
    _share(space)


@inner_kernel
def _weigh(table, count, near_b, space):
    """Fill how much each direction counts beside the others.

    Across a convex edge the same overlap is seen from two sides. A direction does not count whose
    deepest place would be out of B if the tool were moved out along another, with a larger
    footprint, by that one's depth.
    """
    rows, sums = space.rows, space.footprint.sums
    place = space.frames[7, 0, :3]
    for d in range(BINS):
        way = space.directions[d]
        way[_VALID] = 1.0
        if way[_DEPTH] <= 0.0 or way[_ROWS] == 0.0:
            continue
        deepest = int(way[_FIRST])
        for p in range(deepest, int(way[_FIRST] + way[_ROWS])):
            if rows.result[p, DEPTH] > rows.result[deepest, DEPTH]:
                deepest = p
        for i in range(3):
            place[i] = 0.0
            for k in range(3):
                place[i] += near_b[k, i] * (rows.result[deepest, POINT_X + k] - near_b[k, 3])
        for c in range(BINS):
            other = space.directions[c]
            if c == d or other[_DEPTH] <= 0.0 or other[_ROWS] == 0.0:
                continue
            if sums[c, MASS] < sums[d, MASS] or (sums[c, MASS] == sums[d, MASS] and c > d):
                continue
            along = way[0] * other[0] + way[1] * other[1] + way[2] * other[2]
            if along > _SAME:
                continue  # they share their part already
            out = way_out(table, count, c, other, place, space.footprint)
            counts = (out / other[_DEPTH] - _EXPLAINED) / (_OWN - _EXPLAINED)
            shared = max((along - _ALIKE) / (_SAME - _ALIKE), 0.0)
            way[_VALID] *= shared + (1.0 - shared) * min(max(counts, 0.0), 1.0)


@inner_kernel
def _next(memory, b, space):
    """Return the direction whose turn it is: those in contact first, then by their footprint."""
    sums, ways, first = space.footprint.sums, space.directions, -1
    for d in range(BINS):
        if ways[d, _SEEN] == 1.0:
            continue
        ahead = first < 0 or memory.active[b, d] > memory.active[b, first]
        if ahead or (
            memory.active[b, d] == memory.active[b, first] and sums[d, MASS] > sums[first, MASS]
        ):
            first = d
    ways[first, _SEEN] = 1.0
    return first


@inner_kernel
def _is_explained(table, count, d, space):
    """Return whether another direction accounts for one that might become a contact.

    That is `_weigh`'s rule before anything is searched. Contact begins near B's surface, so where
    the smooth bodies overlap most is near the deepest place. And where what counts for both does
    not touch along the one, it does not along the other.
    """
    sums, place = space.footprint.sums, space.frames[7, 0, :3]
    way = space.directions[d]
    for k in range(3):
        place[k] = sums[d, WHERE + k]
    for c in range(BINS):
        other = space.directions[c]
        if other[_ROWS] == 0.0 or sums[c, MASS] < sums[d, MASS]:
            continue
        if way[0] * other[0] + way[1] * other[1] + way[2] * other[2] > _ALIKE:
            continue
        depth = _EXPLAINED * max(other[_DEPTH], 0.0) + _ON_SURFACE
        if way_out(table, count, c, other, place, space.footprint) <= depth:
            return True
    return False


@inner_kernel
def _twin(space, sums, d):
    """Return a direction that was searched whose footprint is the same but for its share, or -1."""
    for c in range(BINS):
        if c == d or space.directions[c, _ROWS] == 0.0:
            continue
        same = True
        for k in range(3):
            same = same and abs(space.directions[c, _N + k] - space.directions[d, _N + k]) < 1e-12
            one, two = sums[c, MEAN + k] / sums[c, MASS], sums[d, MEAN + k] / sums[d, MASS]
            same = same and abs(one - two) < 1e-12
        if same:
            return c
    return -1


@inner_kernel
def _share(space):
    """Fill the weights of a body's patches, and what is remembered of its directions."""
    rows, sums = space.rows, space.footprint.sums
    total = 0.0
    for d in range(BINS):
        way = space.directions[d]
        if way[_DEPTH] <= 0.0:
            continue
        way[_VALID] = space.directions[int(way[_TWIN]), _VALID]
        alike = 0.0
        for c in range(BINS):
            other = space.directions[c]
            if other[_DEPTH] > 0.0:
                along = way[0] * other[0] + way[1] * other[1] + way[2] * other[2]
                alike += sums[c, MASS] * max((along - _ALIKE) / (1.0 - _ALIKE), 0.0)
        part = way[_VALID] * way[_DEPTH] * sums[d, MASS] / alike
        space.directions[int(way[_TWIN]), _PART] += part
        total += part
    if total == 0.0:
        total = 1.0
    for d in range(BINS):
        way = space.directions[d]
        first, patches = int(way[_FIRST]), int(way[_ROWS])
        for p in range(first, first + patches):
            live = rows.result[p, DEPTH] > 0.0
            rows.weight[p] = way[_FADE] * way[_PART] / (total * patches) if live else 0.0


@inner_kernel
def remember(memory, space, b):
    """Note what the next pose has to know of body b."""
    sums = space.footprint.sums
    memory.known[b] = 1
    memory.held[b] = False
    for d in range(BINS):
        way = space.directions[d]
        searched = way[_DEPTH] > -np.inf
        buried = not searched and sums[d, DEEPEST] > 0.0
        memory.depth[b, d] = np.inf if buried else way[_DEPTH]
        if way[_IS_EXPLAINED] == 1.0:
            memory.depth[b, d] = max(sums[d, DEEPEST], 0.0)
        memory.deepest[b, d] = way[_MOST]
        # What does not count is let go: it has to begin at the surface again.
        memory.active[b, d] = 1 if way[_DEPTH] > 0.0 and way[_VALID] > 0.0 else 0
        memory.held[b] = memory.held[b] or memory.active[b, d] == 1
