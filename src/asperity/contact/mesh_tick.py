"""One tick of contact where a mesh is involved, compiled: see `touch`."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, kernel
from asperity.contact.broad_phase.facet_pairs import moved_since
from asperity.contact.manifold.mesh_manifold import remember, touch
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
_JUMP = 1e-2
"""No hand moves farther than this in a tick [m]."""


@inner_kernel
def _mesh_tick(
    textures, table, geometry, by_facets, tool, poses, centre, number, met, geoms, distances,
    pose, dt, parameters, memory, space, work_space, contacts, wrench_io,
):  # fmt: skip
    """Add contacts and wrench (6,) of the tool with the bodies that `by_facets` marks.

    Of bodies that are `memory.held` MuJoCo's contacts need not be there. Returns whether they are
    needed after all, as the tool is somewhere else; then nothing has been done.
    """
    body_a = poses[tool]
    vectors = work_space.vectors
    origin = vectors[3]
    fill_tool_frame(pose, centre, body_a, origin)
    near_a, near_b = work_space.near[0], work_space.near[1]
    fill_relative_frame(origin, body_a, near_a)
    known = memory.at[0] == 1
    moved = moved_since(table, tool, memory.pose, body_a) if known else 0.0
    if moved > _JUMP and dt == 0.0:
        moved = _JUMP  # only looking: what is known is kept
    if moved > _JUMP:
        # The tool is somewhere else: what was known of its contacts does not hold there.
        known, moved, missing = False, 0.0, False
        for b in range(by_facets.size):
            missing, memory.held[b] = missing or memory.held[b], False
        if missing:
            return True
        for b in range(by_facets.size):
            memory.known[b] = 0
            for d in range(memory.active.shape[1]):
                memory.active[b, d] = 0
    rows = space.rows
    rows.count[0], rows.count[1] = 0, 0
    for b in range(by_facets.size):
        if by_facets[b] == 0 or b == tool:
            continue
        pressed = -np.inf
        for c in range(met):
            g, h = number[geoms[c, 0]], number[geoms[c, 1]]
            if g < 0 or h < 0:
                continue
            one, two = geometry.body[g], geometry.body[h]
            if (one == tool and two == b) or (one == b and two == tool):
                pressed = max(pressed, -distances[c])
        held = 0
        for d in range(memory.active.shape[1]):
            held += memory.active[b, d]
        if pressed == -np.inf and held == 0:
            if dt > 0.0:
                memory.known[b] = 0
            continue
        fill_relative_frame(origin, poses[b], near_b)
        tolerance = depth_tolerance(textures, geometry, tool, b, parameters.tolerance)
        touch(
            textures, table, geometry, tool, b, near_a, near_b, pressed, moved,
            parameters.patch_radius, parameters.edge_fade, tolerance, parameters.max_nodes, memory,
            space, work_space,
        )  # fmt: skip
        if dt > 0.0:
            remember(memory, space, b)
    force, point, gone, bent = vectors[4], vectors[5], vectors[6], vectors[7]
    across, drag = vectors[8], vectors[9]
    for p in range(rows.count[0]):
        out = rows.result[p]
        b, d, which = rows.where[p, 0], rows.where[p, 1], rows.where[p, 2]
        bristle = memory.bristle[b, d, which]
        if rows.weight[p] <= 0.0:
            if dt > 0.0:
                for k in range(3):
                    bristle[k], memory.guess[b, d, which, k] = 0.0, np.nan
            continue
        if contacts.count[0] == contacts.body.size:
            rows.count[1] += 1
            continue
        c = contacts.count[0]
        contacts.count[0] += 1
        push = parameters.stiffness * rows.weight[p] * out.depth
        contacts.body[c], contacts.depth[c], contacts.weight[c] = b, out.depth, rows.weight[p]
        contacts.gap[c], contacts.status[c] = out.gap, out.status
        contacts.nodes[c], contacts.ties[c] = out.nodes, out.ties
        for k in range(3):
            point[k] = out.point[k]
            contacts.normal[c, k] = rows.normal[p, k]
            contacts.slope_normal[c, k] = out.slope_normal[k]
            contacts.point[c, k] = point[k] + origin[k]
            force[k] = push * out.slope_normal[k]
            wrench_io[k] += force[k]
            wrench_io[3 + k] += push * out.moment[k]
        body_b = poses[b]
        if parameters.friction > 0.0:
            material_displacement(known and dt > 0.0, memory.pose, body_a, point, origin, gone)
            to_body(body_b, gone, bent)
            to_body(body_b, contacts.slope_normal[c], across)
            most = parameters.friction * math.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
            stiffness = parameters.bristle_stiffness * rows.weight[p]
            before_x, before_y, before_z = bristle[0], bristle[1], bristle[2]
            bristle_force(bristle, bent, across, stiffness, most, drag)
            if dt == 0.0:
                bristle[0], bristle[1], bristle[2] = before_x, before_y, before_z
            to_world(body_b, drag, bent)
            for k in range(3):
                one, two = (k + 1) % 3, (k + 2) % 3
                force[k] += bent[k]
                wrench_io[k] += bent[k]
                wrench_io[3 + k] += point[one] * bent[two] - point[two] * bent[one]
        for k in range(3):
            contacts.force[c, k] = force[k]
            gone[k] = contacts.point[c, k] - body_a[k, 3]
        if dt > 0.0:
            to_body(body_a, gone, memory.guess[b, d, which])
    if dt > 0.0:
        memory.at[0] = 1
        for i in range(3):
            for j in range(4):
                memory.pose[i, j] = body_a[i, j]
    contacts.count[1] += rows.count[1]
    if rows.count[1] > 0 and contacts.count[0] > 0:
        contacts.status[contacts.count[0] - 1] = NO_ROOM
    return False


@kernel
def mesh_tick(
    textures, table, geometry, by_facets, tool, poses, centre, number, met, geoms, distances,
    pose, dt, parameters, memory, space, work_space, contacts, wrench_io,
):  # fmt: skip
    """Do what `_mesh_tick` does, called from Python: a way in counts references."""
    return _mesh_tick(
        textures, table, geometry, by_facets, tool, poses, centre, number, met, geoms, distances,
        pose, dt, parameters, memory, space, work_space, contacts, wrench_io,
    )  # fmt: skip
