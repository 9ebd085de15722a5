"""Pairs of geoms that may touch, their normals, and the patches that they make."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.manifold.normals import normal_under
from asperity.geometry.frames import to_body

_STEADY = 0.85
"""A pair's normal that turns by more than this cosine in one tick is not believed."""
_TOGETHER = 0.9
"""Pairs whose normals agree to this cosine are one patch."""
_LEAST_BLEND = 1e-4


@inner_kernel
def _blend(geometry, textures, g, h):
    """Return how near an edge the faces are mixed: about the radius of the contact [m]."""
    reach = 2e-5
    for geom in (g, h):
        texture = geometry.texture[geometry.body[geom]]
        if texture >= 0:
            reach += textures.maps[texture].max_abs_height
    size = geometry.size[g]
    least = size[0]
    for i in range(1, 3):
        if size[i] > 0.0:
            least = min(least, size[i])
    return max(math.sqrt(2.0 * max(least, 1e-4) * reach), _LEAST_BLEND)


@inner_kernel
def held_below(geometry, textures, g, h):
    """Return the depth [m] from which a pair's normal is held: a shallower one may turn an edge."""
    least = np.inf
    for i in range(3):
        if geometry.size[h, i] > 0.0 and geometry.kind[h] > 0:
            least = min(least, geometry.size[h, i])
    return min(_blend(geometry, textures, g, h), 0.25 * least)


@inner_kernel
def collect_pairs(
    textures, geometry, tool, poses, number, met, geoms, places, distances, margins, memory
):  # fmt: skip
    """Fill `memory.now_*` with the pairs that MuJoCo found; return how many."""
    count = 0
    point, n = stack_array((3,)), stack_array((3,))
    for c in range(met):
        g, h = number[geoms[c, 0]], number[geoms[c, 1]]
        if g < 0 or h < 0:
            continue
        if geometry.body[h] == tool:
            g, h = h, g
        if geometry.body[g] != tool or geometry.body[h] == tool:
            continue
        # Contacts weigh by how deep they are, so that they come and go smoothly.
        weight = max(margins[c] - distances[c], 0.0) + 1e-12
        body = poses[geometry.body[h]]
        for i in range(3):
            point[i] = places[c, i] - body[i, 3]
        to_body(body, point, n)
        for i in range(3):
            point[i] = n[i]
        normal_under(geometry, h, point, _blend(geometry, textures, g, h), n)
        at = -1
        for i in range(count):
            if memory.now_pairs[i, 0] == g and memory.now_pairs[i, 1] == h:
                at = i
                break
        if at < 0:
            if count == memory.now_weights.size:
                memory.counts[3] += 1
                continue
            at = count
            memory.now_pairs[at, 0], memory.now_pairs[at, 1] = g, h
            memory.now_weights[at] = 0.0
            clear(memory.now_normals[at])
            count += 1
        memory.now_weights[at] += weight
        for i in range(3):
            memory.now_normals[at, i] += weight * n[i]
    return count


@inner_kernel
def steady_normals(memory, count):
    """Hold the normals of deep pairs to the remembered ones; take up deep pairs that are unseen."""
    for j in range(memory.counts[0]):
        memory.pairs[j, 2] &= 1  # whether it is deep; the bit above it: seen now
    for i in range(count):
        n = memory.now_normals[i]
        size = math.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
        if size > 0.0:
            for k in range(3):
                n[k] /= size
        for j in range(memory.counts[0]):
            if (
                memory.pairs[j, 0] == memory.now_pairs[i, 0]
                and memory.pairs[j, 1] == memory.now_pairs[i, 1]
            ):
                old = memory.normals[j]
                turned = n[0] * old[0] + n[1] * old[1] + n[2] * old[2] < _STEADY
                if turned and memory.pairs[j, 2] & 1:
                    for k in range(3):
                        n[k] = old[k]
                memory.pairs[j, 2] |= 2
    for j in range(memory.counts[0]):
        if memory.pairs[j, 2] == 1 and count < memory.now_weights.size:
            memory.now_pairs[count, 0] = memory.pairs[j, 0]
            memory.now_pairs[count, 1] = memory.pairs[j, 1]
            for k in range(3):
                memory.now_normals[count, k] = memory.normals[j, k]
            memory.now_weights[count] = 1e-12
            count += 1
    return count


@inner_kernel
def group(geometry, memory, count):
    """Give every pair the number of its patch in `now_pairs[:, 3]`; return how many patches."""
    patches = 0
    for i in range(count):
        body = geometry.body[memory.now_pairs[i, 1]]
        n = memory.now_normals[i]
        mine = -1
        for j in range(patches):
            if memory.new_bodies[j] != body:
                continue
            total = memory.new_patches[j]
            size = math.sqrt(total[0] ** 2 + total[1] ** 2 + total[2] ** 2)
            along = n[0] * total[0] + n[1] * total[1] + n[2] * total[2]
            if along > _TOGETHER * size:
                mine = j
                break
        if mine < 0:
            if patches == memory.new_bodies.size:
                memory.counts[3] += 1
                memory.now_pairs[i, 3] = -1
                continue
            mine = patches
            memory.new_bodies[mine] = body
            clear(memory.new_patches[mine])
            patches += 1
        memory.now_pairs[i, 3] = mine
        for k in range(3):
            memory.new_patches[mine, k] += memory.now_weights[i] * n[k]
    for j in range(patches):
        n = memory.new_patches[j]
        size = math.sqrt(n[0] ** 2 + n[1] ** 2 + n[2] ** 2)
        for k in range(3):
            n[k] /= size
    return patches


@inner_kernel
def recall(memory, patch):
    """Copy deepest place and bristle of the remembered patch that this one goes on from."""
    n = memory.new_patches[patch]
    best, which = 0.5, -1
    for j in range(memory.counts[1]):
        if memory.bodies[j] != memory.new_bodies[patch]:
            continue
        old = memory.patches[j]
        along = n[0] * old[0] + n[1] * old[1] + n[2] * old[2]
        if along > best:
            best, which = along, j
    for k in range(3, 9):
        n[k] = memory.patches[which, k] if which >= 0 else (np.nan if k < 6 else 0.0)


@inner_kernel
def geoms_of(memory, count, patch):
    """Fill the geoms of a patch, each once; return how many of the tool and of the scene."""
    count_a = count_b = 0
    for i in range(count):
        if memory.now_pairs[i, 3] != patch:
            continue
        g, h = memory.now_pairs[i, 0], memory.now_pairs[i, 1]
        known = False
        for j in range(count_a):
            known = known or memory.geoms[0, j] == g
        if not known:
            memory.geoms[0, count_a] = g
            count_a += 1
        known = False
        for j in range(count_b):
            known = known or memory.geoms[1, j] == h
        if not known:
            memory.geoms[1, count_b] = h
            count_b += 1
    return count_a, count_b
