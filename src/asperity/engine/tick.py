"""One tick, compiled: pairs, their normals, patches, depths, forces, and their sum."""

from __future__ import annotations

import math

import numpy as np

from asperity.compiled import clear, inner_kernel, kernel
from asperity.contact.normals import normal_under
from asperity.contact.patch import (
    COUNT_NODES,
    COUNT_TIES,
    DEPTH,
    GAP,
    M_X,
    MOMENT,
    POINT_X,
    STATUS,
    Geometry,
    depth_along,
)
from asperity.engine.alternatives import advance_noise, baseline_force, depth_on_grid
from asperity.forces.laws import bristle_force

NO_ROOM = 2
_STEADY = 0.85
"""A pair's normal that turns by more than this cosine in one tick is not believed."""
_TOGETHER = 0.9
"""Pairs whose normals agree to this cosine are one patch."""
_LEAST_BLEND = 1e-4


@inner_kernel
def _rotation(pose, out):
    """Fill the rotation (3, 3) of a pose (7,)."""
    w, x, y, z = pose[3], pose[4], pose[5], pose[6]
    out[0, 0], out[0, 1], out[0, 2] = (
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    )  # fmt: skip
    out[1, 0], out[1, 1], out[1, 2] = (
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    )  # fmt: skip
    out[2, 0], out[2, 1], out[2, 2] = (
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    )  # fmt: skip


@inner_kernel
def _into(body, v, out):
    """Fill a direction (3,) of world axes in a body's frame."""
    for i in range(3):
        out[i] = body[0, i] * v[0] + body[1, i] * v[1] + body[2, i] * v[2]


@inner_kernel
def _out_of(body, v, out):
    """Fill a direction (3,) of a body's frame in world axes."""
    for i in range(3):
        out[i] = body[i, 0] * v[0] + body[i, 1] * v[1] + body[i, 2] * v[2]


@inner_kernel
def _blend(geometry, textures, g, h):
    """Return how near an edge the faces are mixed: about the radius of the contact [m]."""
    reach = 2e-5
    for geom in (g, h):
        texture = geometry.texture[geometry.body[geom]]
        if texture >= 0:
            reach += textures.scales[texture, 2]
    size = geometry.size[g]
    least = size[0]
    for i in range(1, 3):
        if size[i] > 0.0:
            least = min(least, size[i])
    return max(math.sqrt(2.0 * max(least, 1e-4) * reach), _LEAST_BLEND)


@inner_kernel
def _held_below(geometry, textures, g, h):
    """Return the depth [m] from which a pair's normal is held: a shallower one may turn an edge."""
    least = np.inf
    for i in range(3):
        if geometry.size[h, i] > 0.0 and geometry.kind[h] > 0:
            least = min(least, geometry.size[h, i])
    return min(_blend(geometry, textures, g, h), 0.25 * least)


@inner_kernel
def _collect_pairs(
    textures, geometry, tool, poses, number, met, geoms, places, distances, margins, memory
):  # fmt: skip
    """Fill `memory.now_*` with the pairs that MuJoCo found; return how many."""
    count = 0
    point, n = np.empty(3), np.empty(3)
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
        _into(body, point, n)
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
def _steady_normals(memory, count):
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
def _group(geometry, memory, count):
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
def _recall(memory, patch):
    """Copy deepest place and bristle of the remembered patch that this one goes on from.

    Returns whether there is one.
    """
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
    return which >= 0


@inner_kernel
def _geoms_of(memory, count, patch):
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


@inner_kernel
def _tolerance(textures, geometry, a, b, wanted):
    """Return the gap that counts as certified: a thousandth of the finer texture's rms height."""
    if wanted > 0.0:
        return wanted
    rms = np.inf
    for body in (a, b):
        if geometry.texture[body] >= 0:
            rms = min(rms, textures.scales[geometry.texture[body], 5])
    return max(1e-9, 1e-3 * rms) if rms < np.inf else 1e-9


@kernel
def tick(
    textures, geometry, tool, poses, centre, number, met, geoms, places, distances, margins,
    pose, dt, parameters, grid, baseline, memory, space, contacts, wrench_out,
):  # fmt: skip
    """Fill contacts and wrench (6,) of one pose; see `Engine.wrench`.

    `grid` and `baseline` are None for exact gradients and Otaduy & Lin's law: Numba then leaves
    out what belongs to the others.
    """
    clear(wrench_out)
    body_a = poses[tool]
    _rotation(pose, body_a)
    vectors = space.vectors
    origin = vectors[3]
    for i in range(3):
        body_a[i, 3] = pose[i]
    for i in range(3):
        origin[i] = pose[i]
        for k in range(3):
            origin[i] += body_a[i, k] * centre[k]
    count = _collect_pairs(
        textures, geometry, tool, poses, number, met, geoms, places, distances, margins, memory
    )
    count = _steady_normals(memory, count)
    patches = _group(geometry, memory, count)
    # Seen from the tool's centre of mass.
    near_a, near_b = space.near[0], space.near[1]
    for i in range(3):
        for j in range(3):
            near_a[i, j] = body_a[i, j]
        near_a[i, 3] = body_a[i, 3] - origin[i]
    n, guess, force = vectors[4], vectors[5], vectors[6]
    shape = geometry
    if baseline is not None:
        # Smooth bodies: the texture comes in at one point of their contact.
        shape = Geometry(
            geometry.kind, geometry.size, geometry.position, geometry.rotation, geometry.body,
            geometry.no_texture, geometry.mapping, geometry.origin, geometry.around,
            geometry.no_texture,
        )  # fmt: skip
    if baseline is not None and dt > 0.0:
        advance_noise(memory.noise, baseline, dt)
    live = 0
    for p in range(patches):
        b = memory.new_bodies[p]
        body_b = poses[b]
        for i in range(3):
            for j in range(3):
                near_b[i, j] = body_b[i, j]
            near_b[i, 3] = body_b[i, 3] - origin[i]
        _recall(memory, p)
        _out_of(body_b, memory.new_patches[p], n)
        _out_of(body_b, memory.new_patches[p, 3:], guess)
        for i in range(3):
            guess[i] += near_b[i, 3]
        count_a, count_b = _geoms_of(memory, count, p)
        out = memory.results[p]
        clear(out)
        tolerance = _tolerance(textures, geometry, tool, b, parameters.tolerance)
        depth_along(
            textures, shape, memory.geoms[0], count_a, memory.geoms[1], count_b, near_a, near_b,
            n, guess, tolerance, parameters.max_nodes, space, out,
        )  # fmt: skip
        if grid is not None:
            depth_on_grid(
                textures, geometry, memory.geoms, count_a, count_b, near_a, near_b, n, grid,
                space, out,
            )  # fmt: skip
        deep = out[DEPTH] > 0.0
        for i in range(count):
            if memory.now_pairs[i, 3] == p:
                g, h = memory.now_pairs[i, 0], memory.now_pairs[i, 1]
                held = out[DEPTH] > _held_below(geometry, textures, g, h)
                memory.now_pairs[i, 2] = 1 if held else 0
        if not deep:
            memory.new_bodies[p] = -1
    # Patches on one body share its stiffness.
    moved, bristle = vectors[7], vectors[8]
    kept = 0
    for p in range(patches):
        b = memory.new_bodies[p]
        if b < 0:
            continue
        out = memory.results[p]
        total = 0.0
        for q in range(patches):
            if memory.new_bodies[q] == b:
                total += memory.results[q, DEPTH]
        depth = out[DEPTH]
        weight = depth / total
        push = parameters.stiffness * weight * depth
        body_b = poses[b]
        _out_of(body_b, memory.new_patches[p], n)
        c = live
        live += 1
        contacts.body[c] = b
        contacts.depth[c], contacts.weight[c] = depth, weight
        contacts.gap[c], contacts.status[c] = out[GAP], int(out[STATUS])
        contacts.nodes[c], contacts.ties[c] = int(out[COUNT_NODES]), int(out[COUNT_TIES])
        for k in range(3):
            contacts.normal[c, k] = n[k]
            contacts.slope_normal[c, k] = out[M_X + k]
            contacts.point[c, k] = out[POINT_X + k] + origin[k]
            guess[k] = out[POINT_X + k]
        if baseline is None:
            for k in range(3):
                force[k] = push * out[M_X + k]
                wrench_out[3 + k] += push * out[MOMENT + k]
        else:
            for i in range(3):
                for j in range(3):
                    near_b[i, j] = body_b[i, j]
                near_b[i, 3] = body_b[i, 3] - origin[i]
            _, count_b = _geoms_of(memory, count, p)
            _slid(memory, body_a, guess, origin, moved)
            baseline_force(
                textures, geometry, memory, count_b, near_b, n, guess, moved, push, depth,
                baseline, space, force,
            )  # fmt: skip
            for k in range(3):
                one, two = (k + 1) % 3, (k + 2) % 3
                wrench_out[3 + k] += guess[one] * force[two] - guess[two] * force[one]
        for k in range(3):
            wrench_out[k] += force[k]
        if parameters.friction > 0.0:
            _slid(memory, body_a, guess, origin, moved)
            _into(body_b, moved, bristle)
            for k in range(3):
                moved[k] = bristle[k] if dt > 0.0 else 0.0
            across = np.empty(3)
            _into(body_b, contacts.slope_normal[c], across)
            size = math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
            held = memory.new_patches[p, 6:]
            drag = np.empty(3)
            bristle_force(
                held, moved, across, parameters.bristle_stiffness, parameters.friction * size, drag
            )
            _out_of(body_b, drag, bristle)
            for k in range(3):
                one, two = (k + 1) % 3, (k + 2) % 3
                force[k] += bristle[k]
                wrench_out[k] += bristle[k]
                wrench_out[3 + k] += guess[one] * bristle[two] - guess[two] * bristle[one]
        for k in range(3):
            contacts.force[c, k] = force[k]
            moved[k] = contacts.point[c, k] - body_b[k, 3]
        _into(body_b, moved, bristle)
        for k in range(3):
            memory.new_patches[p, 3 + k] = bristle[k]
        if dt > 0.0:
            # Patches that are kept close ranks, in their old order.
            memory.bodies[kept] = b
            for k in range(9):
                memory.patches[kept, k] = memory.new_patches[p, k]
        kept += 1
    contacts.count[0] = live
    if dt > 0.0:
        memory.counts[0], memory.counts[1], memory.counts[2] = count, kept, 1
        for i in range(count):
            for k in range(3):
                memory.pairs[i, k] = memory.now_pairs[i, k]
                memory.normals[i, k] = memory.now_normals[i, k]
        for i in range(3):
            for j in range(4):
                memory.pose[i, j] = body_a[i, j]
    if memory.counts[3] > 0 and live > 0:
        contacts.status[0] = NO_ROOM
        memory.counts[3] = 0


@inner_kernel
def _slid(memory, body_a, point, origin, moved_out):
    """Fill how far the tool's material at `point` has moved since the last tick; return if so."""
    if memory.counts[2] == 0:
        clear(moved_out)
        return False
    square = 0.0
    for i in range(3):
        moved_out[i] = point[i] + origin[i] - memory.pose[i, 3]
    local = np.empty(3)
    for k in range(3):
        local[k] = 0.0
        for i in range(3):
            local[k] += body_a[i, k] * (point[i] + origin[i] - body_a[i, 3])
    for i in range(3):
        for k in range(3):
            moved_out[i] -= memory.pose[i, k] * local[k]
        square += moved_out[i] ** 2
    return square > 1e-24
