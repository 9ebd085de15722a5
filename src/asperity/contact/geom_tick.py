"""One tick, compiled: pairs, their normals, patches, depths, forces, and their sum."""

from __future__ import annotations

import math

from asperity._core.kernels import clear, inner_kernel, kernel
from asperity._core.records import clear_record
from asperity._core.stack import stack_array
from asperity.contact.body_arrays import Geometry
from asperity.contact.manifold.geom_manifold import (
    collect_pairs,
    geoms_of,
    group,
    held_below,
    recall,
    steady_normals,
)
from asperity.contact.narrow_phase.geom_depth import (
    BodyGeoms,
    DepthQuery,
    SearchLimits,
    fill_depth_along,
)
from asperity.contact.response.baseline_methods import advance_noise, baseline_force, depth_on_grid
from asperity.contact.response.point_laws import bristle_force
from asperity.geometry.frames import (
    depth_tolerance,
    fill_relative_frame,
    fill_tool_frame,
    material_displacement,
    to_body,
    to_world,
)

NO_ROOM = 2


@inner_kernel
def _tick(
    textures, geometry, tool, poses, centre, number, met, geoms, places, distances, margins,
    pose, dt, parameters, grid, baseline, memory, space, contacts, wrench_out,
):  # fmt: skip
    """Fill contacts and wrench (6,) of one pose; see `Engine.wrench`.

    `grid` and `baseline` are None for exact gradients and Otaduy & Lin's law: Numba then leaves
    out what belongs to the others.
    """
    clear(wrench_out)
    body_a = poses[tool]
    vectors = space.vectors
    origin = vectors[3]
    fill_tool_frame(pose, centre, body_a, origin)
    count = collect_pairs(
        textures, geometry, tool, poses, number, met, geoms, places, distances, margins, memory
    )
    count = steady_normals(memory, count)
    patches = group(geometry, memory, count)
    # Seen from the tool's centre of mass.
    near_a, near_b = space.near[0], space.near[1]
    fill_relative_frame(origin, body_a, near_a)
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
        fill_relative_frame(origin, body_b, near_b)
        recall(memory, p)
        to_world(body_b, memory.new_patches[p], n)
        to_world(body_b, memory.new_patches[p, 3:], guess)
        for i in range(3):
            guess[i] += near_b[i, 3]
        count_a, count_b = geoms_of(memory, count, p)
        out = memory.results[p]
        clear_record(out)
        tolerance = depth_tolerance(textures, geometry, tool, b, parameters.tolerance)
        a = BodyGeoms(memory.geoms[0], count_a, near_a)
        query = DepthQuery(a, BodyGeoms(memory.geoms[1], count_b, near_b), n, guess)
        limits = SearchLimits(tolerance, parameters.max_nodes)
        fill_depth_along(textures, shape, query, limits, space, out)
        if grid is not None:
            depth_on_grid(textures, geometry, query, grid, space, out)
        deep = out.depth > 0.0
        for i in range(count):
            if memory.now_pairs[i, 3] == p:
                g, h = memory.now_pairs[i, 0], memory.now_pairs[i, 1]
                held = out.depth > held_below(geometry, textures, g, h)
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
                total += memory.results[q].depth
        depth = out.depth
        weight = depth / total
        push = parameters.stiffness * weight * depth
        body_b = poses[b]
        to_world(body_b, memory.new_patches[p], n)
        c = live
        live += 1
        contacts.body[c] = b
        contacts.depth[c], contacts.weight[c] = depth, weight
        contacts.gap[c], contacts.status[c] = out.gap, out.status
        contacts.nodes[c], contacts.ties[c] = out.nodes, out.ties
        for k in range(3):
            contacts.normal[c, k] = n[k]
            contacts.slope_normal[c, k] = out.slope_normal[k]
            contacts.point[c, k] = out.point[k] + origin[k]
            guess[k] = out.point[k]
        if baseline is None:
            for k in range(3):
                force[k] = push * out.slope_normal[k]
                wrench_out[3 + k] += push * out.moment[k]
        else:
            fill_relative_frame(origin, body_b, near_b)
            _, count_b = geoms_of(memory, count, p)
            material_displacement(memory.counts[2] == 1, memory.pose, body_a, guess, origin, moved)
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
            material_displacement(memory.counts[2] == 1, memory.pose, body_a, guess, origin, moved)
            to_body(body_b, moved, bristle)
            for k in range(3):
                moved[k] = bristle[k] if dt > 0.0 else 0.0
            across = stack_array((3,))
            to_body(body_b, contacts.slope_normal[c], across)
            size = math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
            held = memory.new_patches[p, 6:]
            drag = stack_array((3,))
            bristle_force(
                held, moved, across, parameters.bristle_stiffness, parameters.friction * size, drag
            )
            to_world(body_b, drag, bristle)
            for k in range(3):
                one, two = (k + 1) % 3, (k + 2) % 3
                force[k] += bristle[k]
                wrench_out[k] += bristle[k]
                wrench_out[3 + k] += guess[one] * bristle[two] - guess[two] * bristle[one]
        for k in range(3):
            contacts.force[c, k] = force[k]
            moved[k] = contacts.point[c, k] - body_b[k, 3]
        to_body(body_b, moved, bristle)
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
    contacts.count[1] = memory.counts[3]
    memory.counts[3] = 0
    if contacts.count[1] > 0 and live > 0:
        contacts.status[0] = NO_ROOM


@kernel
def tick(
    textures, geometry, tool, poses, centre, number, met, geoms, places, distances, margins,
    pose, dt, parameters, grid, baseline, memory, space, contacts, wrench_out,
):  # fmt: skip
    """Do what `_tick` does, called from Python: a way in counts references."""
    _tick(
        textures, geometry, tool, poses, centre, number, met, geoms, places, distances, margins,
        pose, dt, parameters, grid, baseline, memory, space, contacts, wrench_out,
    )  # fmt: skip
