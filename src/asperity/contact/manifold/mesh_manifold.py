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
for two directions counts once. Where a tool lies across an edge of B, the same overlap is seen from
two sides: v is 0 where another direction accounts for it (`directions`). And W fades from 1 to 0
over the last of a footprint that slides off an edge.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity.contact.broad_phase.facet_bvh import BINS
from asperity.contact.broad_phase.facet_pairs import between_bodies
from asperity.contact.broad_phase.neighbour_list import near_pairs
from asperity.contact.manifold.directions import (
    DEPTH_OF,
    FADE,
    FIRST,
    IS_EXPLAINED,
    MOST,
    PART,
    ROWS,
    SEEN,
    TWIN,
    VALID,
    N,
    is_explained,
    next_direction,
    share_stiffness,
    twin_of,
    weigh,
)
from asperity.contact.manifold.overlap_region import (
    DEEPEST,
    MASS,
    NORMAL,
    WHERE,
    add_piece,
    cut_deep,
    deepest_of,
    piece,
    sliver,
    steady_normal,
)
from asperity.contact.narrow_phase.geom_depth import SearchLimits, frame_round
from asperity.contact.narrow_phase.mesh_depth import SplitRegion, region_depths
from asperity.contact.narrow_phase.mesh_patches import FacetQuery, collect_candidates
from asperity.contact.narrow_phase.mesh_workspace import MAX_PATCHES, WINDOWS
from asperity.geometry.frames import to_world

_BIRTH = 2e-4
"""A contact may begin this deep, and the motion of a tick besides [m]."""
_NEAR_ZERO = 1e-4
"""A depth that counts as none when a contact begins, besides the motion of a tick [m]."""
_BESIDE = 2e-4
"""How much deeper than a contact may be facets are looked for [m]."""


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
        f, g = space.facing.pairs[i, 0], space.facing.pairs[i, 1]
        here, corners = piece(table, f, g, reach, reach, near, space)
        if corners < 0:
            continue
        space.facing.pairs[kept, 0], space.facing.pairs[kept, 1] = f, g
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
    textures, table, geometry, tool, b, near_a, near_b, pressed, moved, radius, fade,
    tolerance, max_nodes, memory, space, work_space,
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
            reach += textures.maps[geometry.texture[body]].max_abs_height
            hollow += max(-textures.maps[geometry.texture[body]].lowest, 0.0)
    most = _limits(memory, b, reach, hollow, moved, pressed, foot.limit)
    scan = most + moved + _BESIDE
    count = near_pairs(
        table, tool, b, space.frames[3], scan, reach, moved, memory.noted, foot.facing
    )
    if foot.facing.clock[1] > 0:
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
        way[DEPTH_OF], way[ROWS], way[FIRST] = -np.inf, 0.0, 0.0
        way[MOST], way[PART], way[TWIN] = -np.inf, 0.0, d
        way[IS_EXPLAINED], way[SEEN] = 0.0, 0.0
    for _ in range(BINS):
        d = next_direction(memory, b, space)
        beginning = memory.known[b] == 1 and memory.active[b, d] == 0
        way, sums = space.directions[d], foot.sums[d]
        way[FIRST] = rows.count[0]
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
            way[N + k] = n[k]
        twin = twin_of(space, foot.sums, d)
        if twin >= 0:
            # The same plane counts for two directions: what is known of the one holds for both.
            way[DEPTH_OF], way[TWIN] = space.directions[twin, DEPTH_OF], twin
            way[MOST] = space.directions[twin, MOST]
            continue
        if beginning and is_explained(table, count, d, space):
            way[IS_EXPLAINED] = 1.0
            continue
        # Axes that turn with B: what is split along them is the same wherever B is.
        frame_round(n, local)
        to_world(near_b, u, frame[0])
        to_world(near_b, v, frame[1])
        to_world(near_b, n, world)
        for k in range(3):
            frame[2, k] = world[k]
        query = FacetQuery(np.int64(count), np.int64(d), n, frame, near_a, near_b)
        candidates, made_a, has_room = collect_candidates(
            textures, table, geometry, query, work_space, space
        )
        if not has_room:
            rows.count[1] += 1
        start = rows.count[0]
        patches = region_depths(
            textures, SplitRegion(sums, u, v, radius, memory.guess[b, d]), (candidates, made_a),
            query, SearchLimits(tolerance, max_nodes), work_space, space, rows.result[start:],
        )  # fmt: skip
        total = deepest = 0.0
        for p in range(patches):
            depth = rows.result[start + p].depth
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
        way[ROWS], way[DEPTH_OF], way[MOST] = patches, depth, deepest
        way[FADE] = min(thickness / fade, 1.0) if fade > 0.0 else 1.0
        rows.count[0] += patches
    weigh(table, count, near_b, space)
    share_stiffness(space)


@inner_kernel
def remember(memory, space, b):
    """Note what the next pose has to know of body b."""
    sums = space.footprint.sums
    memory.known[b] = 1
    memory.held[b] = False
    for d in range(BINS):
        way = space.directions[d]
        searched = way[DEPTH_OF] > -np.inf
        buried = not searched and sums[d, DEEPEST] > 0.0
        memory.depth[b, d] = np.inf if buried else way[DEPTH_OF]
        if way[IS_EXPLAINED] == 1.0:
            memory.depth[b, d] = max(sums[d, DEEPEST], 0.0)
        memory.deepest[b, d] = way[MOST]
        # What does not count is let go: it has to begin at the surface again.
        memory.active[b, d] = 1 if way[DEPTH_OF] > 0.0 and way[VALID] > 0.0 else 0
        memory.held[b] = memory.held[b] or memory.active[b, d] == 1
