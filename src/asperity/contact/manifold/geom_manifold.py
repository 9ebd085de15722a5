"""Pairs of geoms that may touch, their normals, and the patches that they form."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity._core.records import copy_record
from asperity._core.stack import stack_array
from asperity.contact.manifold.normals import normal_under
from asperity.geometry.frames import to_body

_STEADY = 0.85
"""A held normal does not turn by more than the angle of this cosine in one tick."""
_TOGETHER = 0.9
"""Pairs belong to one patch if the cosine between their normals is above this."""
_SAME_PATCH = 0.5
"""A patch continues a remembered one if the cosine between their normals is above this."""
_LEAST_BLEND = 1e-4
_LEAST_WEIGHT = 1e-12


@inner_kernel
def _blend_width(scene, g, h):
    """Return the distance from an edge within which normals are blended [m].

    It is about the radius of the contact between the geoms `g` of the tool and `h` of the scene.
    """
    geometry, reach = scene.geometry, 2e-5
    for geom in (g, h):
        texture = geometry.texture[geometry.body[geom]]
        if texture >= 0:
            reach += scene.textures.maps[texture].max_abs_height
    size = geometry.size[g]
    least = size[0]
    for i in range(1, 3):
        if size[i] > 0.0:
            least = min(least, size[i])
    return max(math.sqrt(2.0 * max(least, 1e-4) * reach), _LEAST_BLEND)


@inner_kernel
def hold_depth(scene, g, h):
    """Return the depth from which on the normal of a pair is held [m].

    The normal of a shallower pair may turn round an edge.
    """
    geometry, least = scene.geometry, np.inf
    for i in range(3):
        if geometry.size[h, i] > 0.0 and geometry.kind[h] > 0:
            least = min(least, geometry.size[h, i])
    return min(_blend_width(scene, g, h), 0.25 * least)


@inner_kernel
def _find_pair(memory, count, g, h):
    """Return the row of the pair of geoms `g` and `h` among the first `count`; -1 if none is."""
    for i in range(count):
        if memory.pairs[i].geom_a == g and memory.pairs[i].geom_b == h:
            return i
    return -1


@inner_kernel
def _candidate_geoms(scene, candidates, c):
    """Return the geoms of the tool and of the scene of a candidate; -1, -1 for one to ignore."""
    geometry, tool = scene.geometry, scene.tool
    g, h = scene.geom_number[candidates.geoms[c, 0]], scene.geom_number[candidates.geoms[c, 1]]
    if g < 0 or h < 0:
        return np.int64(-1), np.int64(-1)
    if geometry.body[h] == tool:
        g, h = h, g
    if geometry.body[g] != tool or geometry.body[h] == tool:
        return np.int64(-1), np.int64(-1)
    return g, h


@inner_kernel
def collect_pairs(scene, candidates, memory):
    """Fill `memory.pairs` with the pairs of geoms that MuJoCo found.

    The normal of a pair is the sum of those of its candidate points, weighted by their overlap.
    """
    count = 0
    point, n = stack_array((3,)), stack_array((3,))
    for c in range(candidates.count):
        g, h = _candidate_geoms(scene, candidates, c)
        if g < 0:
            continue
        # Weighted by their overlap, candidates come and go smoothly.
        weight = max(candidates.margins[c] - candidates.distances[c], 0.0) + _LEAST_WEIGHT
        body = scene.frames[scene.geometry.body[h]]
        for i in range(3):
            n[i] = candidates.points[c, i] - body[i, 3]
        to_body(body, n, point)
        normal_under(scene.geometry, h, point, _blend_width(scene, g, h), n)
        at = _find_pair(memory, count, g, h)
        if at < 0:
            if count == memory.pairs.size:
                memory.state[0].dropped += 1
                continue
            at = count
            pair = memory.pairs[at]
            pair.geom_a, pair.geom_b, pair.deep, pair.weight = g, h, 0, 0.0
            clear(pair.normal)
            count += 1
        pair = memory.pairs[at]
        pair.weight += weight
        for i in range(3):
            pair.normal[i] += weight * n[i]
    memory.state[0].pairs = count


@inner_kernel
def steady_normals(memory):
    """Keep the normals of deep pairs steady; append deep pairs that MuJoCo no longer finds."""
    count, remembered = memory.state[0].pairs, memory.state[0].last_pairs
    for j in range(remembered):
        memory.last_pairs[j].seen = 0
    for i in range(count):
        pair = memory.pairs[i]
        n = pair.normal
        size = math.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
        if size > 0.0:
            for k in range(3):
                n[k] /= size
        for j in range(remembered):
            last = memory.last_pairs[j]
            if last.geom_a == pair.geom_a and last.geom_b == pair.geom_b:
                old = last.normal
                turned = n[0] * old[0] + n[1] * old[1] + n[2] * old[2] < _STEADY
                if turned and last.deep == 1:
                    for k in range(3):
                        n[k] = old[k]
                last.seen = 1
    for j in range(remembered):
        last = memory.last_pairs[j]
        if last.deep == 1 and last.seen == 0 and count < memory.pairs.size:
            copy_record(memory.pairs[count], last)
            memory.pairs[count].deep = 0
            memory.pairs[count].weight = _LEAST_WEIGHT
            count += 1
    memory.state[0].pairs = count


@inner_kernel
def _patch_of(memory, patches, body, n):
    """Return the first patch of a body whose mean normal is near `n`; -1 if none is."""
    for j in range(patches):
        if memory.patches[j].body != body:
            continue
        total = memory.patches[j].normal
        size = math.sqrt(total[0] ** 2 + total[1] ** 2 + total[2] ** 2)
        along = n[0] * total[0] + n[1] * total[1] + n[2] * total[2]
        if along > _TOGETHER * size:
            return j
    return -1


@inner_kernel
def group_pairs(geometry, memory):
    """Assign every pair to a patch, filling `memory.patches` with their bodies and normals."""
    patches = 0
    for i in range(memory.state[0].pairs):
        pair = memory.pairs[i]
        body = geometry.body[pair.geom_b]
        patch = _patch_of(memory, patches, body, pair.normal)
        if patch < 0:
            if patches == memory.patches.size:
                memory.state[0].dropped += 1
                pair.patch = -1
                continue
            patch = patches
            memory.patches[patch].body = body
            clear(memory.patches[patch].normal)
            patches += 1
        pair.patch = patch
        for k in range(3):
            memory.patches[patch].normal[k] += pair.weight * pair.normal[k]
    for j in range(patches):
        n = memory.patches[j].normal
        size = math.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
        for k in range(3):
            n[k] /= size
    memory.state[0].patches = patches


@inner_kernel
def recall_patch(memory, p):
    """Copy deepest point and bristle from the remembered patch that patch `p` continues."""
    patch = memory.patches[p]
    n = patch.normal
    best, which = _SAME_PATCH, -1
    for j in range(memory.state[0].last_patches):
        last = memory.last_patches[j]
        if last.body != patch.body:
            continue
        along = n[0] * last.normal[0] + n[1] * last.normal[1] + n[2] * last.normal[2]
        if along > best:
            best, which = along, j
    for k in range(3):
        patch.point[k] = memory.last_patches[which].point[k] if which >= 0 else np.nan
        patch.bristle[k] = memory.last_patches[which].bristle[k] if which >= 0 else 0.0


@inner_kernel
def _add_geom(geoms, count, g):
    """Append a geom unless it is among the first `count`; return how many there are."""
    for j in range(count):
        if geoms[j] == g:
            return count
    geoms[count] = g
    return count + 1


@inner_kernel
def geoms_of_patch(memory, p):
    """Fill the geoms of patch `p`, each once; return how many of the tool and of the scene."""
    count_a = count_b = 0
    for i in range(memory.state[0].pairs):
        pair = memory.pairs[i]
        if pair.patch == p:
            count_a = _add_geom(memory.geoms[0], count_a, pair.geom_a)
            count_b = _add_geom(memory.geoms[1], count_b, pair.geom_b)
    return count_a, count_b


@inner_kernel
def remember(memory, frame):
    """Store pairs, patches that touch, and the tool's frame (3, 4) for the next tick."""
    state, kept = memory.state[0], 0
    for p in range(state.patches):
        if memory.patches[p].body >= 0:
            copy_record(memory.last_patches[kept], memory.patches[p])
            kept += 1
    for i in range(state.pairs):
        copy_record(memory.last_pairs[i], memory.pairs[i])
    state.last_pairs, state.last_patches, state.has_frame = state.pairs, kept, 1
    for i in range(3):
        for j in range(4):
            memory.frame[i, j] = frame[i, j]
