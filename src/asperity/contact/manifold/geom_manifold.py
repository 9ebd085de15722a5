"""Pairs of geoms that may touch, the parts of a contact that they form, and the contact's memory.

A part is one or more pairs whose only way out is the same direction, or a single other pair.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity._core.records import copy_record
from asperity._core.stack import stack_array
from asperity.contact.body_arrays import pair_friction, pair_stiffness
from asperity.contact.manifold.separation import aligned_on, fill_geom_frame, is_same_way
from asperity.contact.manifold.separations import fill_separations

_SAME_PATCH = 0.5
"""Cosine between normals above which a contact continues one of the last tick."""


@inner_kernel
def _find_pair(memory, count, g, h):
    """Return the row of geoms `g` and `h` among the first `count` pairs; -1 if there is none."""
    for i in range(count):
        if memory.pairs[i].geom_a == g and memory.pairs[i].geom_b == h:
            return i
    return -1


@inner_kernel
def collect_pairs(scene, candidates, memory):
    """Fill `memory.pairs` with the pairs of geoms that MuJoCo found, without duplicates."""
    count, body = np.int64(0), scene.geometry.body
    for c in range(candidates.count):
        g, h = scene.geom_number[candidates.geoms[c, 0]], scene.geom_number[candidates.geoms[c, 1]]
        if g < 0 or h < 0:
            continue
        if body[h] == scene.tool:
            g, h = h, g
        if body[g] != scene.tool or body[h] == scene.tool or _find_pair(memory, count, g, h) >= 0:
            continue
        if count == memory.pairs.size:
            memory.state[0].dropped += 1
            continue
        memory.pairs[count].geom_a, memory.pairs[count].geom_b = g, h
        count += 1
    memory.state[0].pairs = count


@inner_kernel
def _bound_heights(textures, geometry, pair):
    """Return an upper bound on the sum of |height| of a pair's textures [m]."""
    total = 0.0
    for g in (pair.geom_a, pair.geom_b):
        texture = geometry.texture[geometry.surface[g]]
        if texture >= 0:
            total += textures.maps[texture].max_abs_height
    return total


@inner_kernel
def _bound_slopes(textures, geometry, pair):
    """Return an upper bound on the sum of the slopes of a pair's textures [-]."""
    steep = 0.0
    for g in (pair.geom_a, pair.geom_b):
        texture = geometry.texture[geometry.surface[g]]
        if texture >= 0:
            # Landau's inequality for |height| <= h and |curvature| <= c.
            found = textures.maps[texture]
            steep += math.sqrt(2.0 * found.max_abs_height * found.max_curvature)
    return steep


@inner_kernel
def _share_map(geometry, g, h):
    """Return whether two geoms have the same stiffness map, or both none."""
    maps, surface = geometry.stiffness_map, geometry.surface
    return maps[surface[g]] == maps[surface[h]]


@inner_kernel
def _stiffness_range(textures, geometry, surface):
    """Return the least and the largest stiffness of a surface [N/m]; nan if it has none."""
    k = geometry.stiffness_map[surface]
    if k >= 0:
        return textures.maps[k].lowest, -1.0 / textures.maps[k].highest
    return geometry.stiffness[surface], geometry.stiffness[surface]


@inner_kernel
def _same_part(geometry, memory, used, found):
    """Return the row of the only direction of a part that equals `found`'s, or -1.

    Body, stiffness and friction have to be equal too.
    """
    for i in range(used):
        other = memory.separations[i]
        is_same = geometry.body[other.geom_b] == geometry.body[found.geom_b]
        is_same = is_same and other.scale == found.scale and other.friction == found.friction
        is_same = is_same and _share_map(geometry, other.geom_a, found.geom_a)
        is_same = is_same and _share_map(geometry, other.geom_b, found.geom_b)
        if is_same and is_same_way(memory.separations, used, i, found):
            return i
    return -1


@inner_kernel
def find_parts(textures, geometry, frames, centre, parameters, memory):
    """Fill the directions along which each pair may separate, and assign each pair to a part.

    Parameters
    ----------
    frames : (bodies, 3, 4) array
        Of the bodies.
    centre : (3,) array
        The tool's centre of mass, the origin of all positions [m].
    parameters : ForceParameters
    """
    used, parts = np.int64(0), np.int64(0)
    frame = stack_array((2, 3, 4))
    for i in range(memory.state[0].pairs):
        pair = memory.pairs[i]
        pair.part = -1
        for k in range(2):
            g = pair.geom_a if k == 0 else pair.geom_b
            fill_geom_frame(geometry, g, frames[geometry.body[g]], frame[k])
            for j in range(3):
                frame[k, j, 3] -= centre[j]
        rough = _bound_heights(textures, geometry, pair)
        rows = memory.separations[used:]
        if rows.size < 2:
            memory.state[0].dropped += 1
            continue
        one, two = geometry.surface[pair.geom_a], geometry.surface[pair.geom_b]
        low_a, high_a = _stiffness_range(textures, geometry, one)
        low_b, high_b = _stiffness_range(textures, geometry, two)
        stiffness = pair_stiffness(low_a, low_b, parameters.stiffness)
        # Scaled by stiffness maps, a farther way out may be as short as a nearer one.
        wide = math.sqrt(pair_stiffness(high_a, high_b, parameters.stiffness) / stiffness)
        aligned = aligned_on(_bound_slopes(textures, geometry, pair))
        count = fill_separations(geometry, pair, frame, (rough, aligned), wide, rows)
        friction = pair_friction(
            geometry.friction[one], geometry.friction[two], parameters.friction
        )
        for j in range(count):
            rows[j].rough, rows[j].aligned, rows[j].friction = rough, aligned, friction
            rows[j].scale = rows[j].gap_scale = math.sqrt(stiffness / parameters.stiffness)
        if count == 1:
            same = _same_part(geometry, memory, used, rows[0])
            if same >= 0:
                other = memory.separations[same]
                pair.part, other.reach = other.part, max(other.reach, rows[0].reach)
                continue
        if count == 0:
            continue
        for j in range(count):
            rows[j].part = parts
        pair.part = parts
        used, parts = used + count, parts + 1
    memory.state[0].separations, memory.state[0].parts = used, parts


@inner_kernel
def recall_patch(memory, body, normal, patch_out):
    """Copy point and bristle of the last tick's patch that a contact with this normal continues.

    `normal` (3,) is in the body's frame. The point is nan if there is no such patch.
    """
    best, at = _SAME_PATCH, -1
    for j in range(memory.state[0].last_patches):
        last = memory.last_patches[j]
        if last.body != body:
            continue
        along = 0.0
        for k in range(3):
            along += normal[k] * last.normal[k]
        if along > best:
            best, at = along, j
    patch_out.body = body
    for k in range(3):
        patch_out.normal[k] = normal[k]
        patch_out.point[k] = memory.last_patches[at].point[k] if at >= 0 else math.nan
        patch_out.bristle[k] = memory.last_patches[at].bristle[k] if at >= 0 else 0.0


@inner_kernel
def _add_geom(geoms, count, g):
    """Append a geom unless it is among the first `count`; return the new count."""
    for j in range(count):
        if geoms[j] == g:
            return count
    geoms[count] = g
    return count + 1


@inner_kernel
def geoms_of_part(memory, part):
    """Fill the geoms of a part, without duplicates; return their numbers of tool and scene."""
    count_a = count_b = 0
    for i in range(memory.state[0].pairs):
        pair = memory.pairs[i]
        if pair.part == part:
            count_a = _add_geom(memory.geoms[0], count_a, pair.geom_a)
            count_b = _add_geom(memory.geoms[1], count_b, pair.geom_b)
    return count_a, count_b


@inner_kernel
def remember(memory, contacts, frame):
    """Store the first `contacts` patches, and the tool's frame (3, 4), for the next tick."""
    for c in range(contacts):
        copy_record(memory.last_patches[c], memory.patches[c])
    memory.state[0].last_patches, memory.state[0].has_frame = contacts, 1
    for i in range(3):
        for j in range(4):
            memory.frame[i, j] = frame[i, j]
