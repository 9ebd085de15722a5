"""The compiled tick of contact between geoms: from a pose to contacts and their wrench."""

from __future__ import annotations

from asperity._core.kernels import clear, inner_kernel, kernel
from asperity._core.stack import stack_array
from asperity.contact.body_arrays import Geometry
from asperity.contact.contacts import NO_ROOM
from asperity.contact.manifold.geom_manifold import (
    collect_pairs,
    geoms_of_patch,
    group_pairs,
    hold_depth,
    recall_patch,
    remember,
    steady_normals,
)
from asperity.contact.narrow_phase.geom_depth import (
    BodyGeoms,
    DepthQuery,
    SearchLimits,
    fill_depth_along,
)
from asperity.contact.response.contact_forces import (
    Bristle,
    ToolFrames,
    add_at_point,
    add_friction,
    add_texture_force,
    write_contact,
)
from asperity.contact.response.grid_gradient import depth_on_grid
from asperity.contact.response.point_laws import PointQuery, advance_noise, point_force
from asperity.geometry.frames import (
    depth_tolerance,
    fill_relative_frame,
    fill_tool_frame,
    material_displacement,
    to_body,
    to_world,
)


@inner_kernel
def _search_patch(model, parameters, grid, point_law, p, centre, memory, workspace):
    """Fill the depth of patch `p`; mark the patch as one that does not touch if it is not deep."""
    geometry, patch, result = model.geometry, memory.patches[p], memory.results[p]
    tool_frame, body_frame = model.frames[model.tool], model.frames[patch.body]
    frame_a, frame_b = stack_array((3, 4)), stack_array((3, 4))
    n, guess = stack_array((3,)), stack_array((3,))
    fill_relative_frame(centre, tool_frame, frame_a)
    fill_relative_frame(centre, body_frame, frame_b)
    recall_patch(memory, p)
    to_world(body_frame, patch.normal, n)
    to_world(body_frame, patch.point, guess)
    for i in range(3):
        guess[i] += frame_b[i, 3]
    count_a, count_b = geoms_of_patch(memory, p)
    tolerance = depth_tolerance(
        model.textures, geometry, model.tool, patch.body, parameters.tolerance
    )
    shape = geometry
    if point_law is not None:
        # Point laws take the depth of the smooth bodies.
        shape = Geometry(
            geometry.kind, geometry.size, geometry.position, geometry.rotation, geometry.body,
            geometry.no_texture, geometry.mapping, geometry.origin, geometry.around,
            geometry.no_texture,
        )  # fmt: skip
    a, b = (
        BodyGeoms(memory.geoms[0], count_a, frame_a),
        BodyGeoms(memory.geoms[1], count_b, frame_b),
    )
    depth_query = DepthQuery(a, b, n, guess)
    limits = SearchLimits(tolerance, parameters.max_nodes)
    fill_depth_along(model.textures, shape, depth_query, limits, workspace, result)
    if grid is not None:
        depth_on_grid(model, grid, depth_query, workspace, result)
    for i in range(memory.state[0].pairs):
        pair = memory.pairs[i]
        if pair.patch == p:
            held = result.depth > hold_depth(model, pair.geom_a, pair.geom_b)
            pair.deep = 1 if held else 0
    if not result.depth > 0.0:
        patch.body = -1


@inner_kernel
def _share_of_stiffness(memory, p):
    """Return the weight of patch `p` [-]: its depth over that of all patches of its body."""
    total = 0.0
    for q in range(memory.state[0].patches):
        if memory.patches[q].body == memory.patches[p].body:
            total += memory.results[q].depth
    return memory.results[p].depth / total


@inner_kernel
def _add_point_force(model, law, p, push, motion, memory, workspace, out):
    """Add the force of a point law on patch `p` to the last contact and to the wrench."""
    c, patch, result = out.contacts.count[0] - 1, memory.patches[p], memory.results[p]
    frame_b, moved, point = stack_array((3, 4)), stack_array((3,)), stack_array((3,))
    fill_relative_frame(motion.centre, model.frames[patch.body], frame_b)
    _, count_b = geoms_of_patch(memory, p)
    for k in range(3):
        point[k] = result.point[k]
    material_displacement(
        memory.state[0].has_frame == 1, motion.last_frame, motion.frame, point, motion.centre, moved
    )
    query = PointQuery(
        BodyGeoms(memory.geoms[1], count_b, frame_b), out.contacts.normal[c], point, moved, push,
        result.depth,
    )  # fmt: skip
    force = out.contacts.force[c]
    point_force(model, law, query, memory.noise[0], workspace, force)
    add_at_point(out.wrench, point, force)


@inner_kernel
def _add_contact(model, parameters, point_law, p, motion, memory, workspace, out):
    """Add the contact of patch `p` and its forces to the output."""
    contacts, patch, result = out.contacts, memory.patches[p], memory.results[p]
    body_frame, c = model.frames[patch.body], out.contacts.count[0]
    contacts.count[0] += 1
    weight = _share_of_stiffness(memory, p)
    push = parameters.stiffness * weight * result.depth
    write_contact(contacts, c, patch.body, weight, result, motion.centre)
    to_world(body_frame, patch.normal, contacts.normal[c])
    if point_law is None:
        add_texture_force(out, c, push, result)
    else:
        _add_point_force(model, point_law, p, push, motion, memory, workspace, out)
    bristle = Bristle(patch.bristle, parameters.bristle_stiffness, parameters.friction)
    add_friction(out, c, result.point, body_frame, bristle, motion)
    offset = stack_array((3,))
    for k in range(3):
        offset[k] = contacts.point[c, k] - body_frame[k, 3]
    to_body(body_frame, offset, patch.point)


@inner_kernel
def _report_dropped(memory, contacts):
    """Report what there was no room for in this tick."""
    contacts.count[1] = memory.state[0].dropped
    memory.state[0].dropped = 0
    if contacts.count[1] > 0 and contacts.count[0] > 0:
        contacts.status[0] = NO_ROOM


@inner_kernel
def _tick(model, parameters, grid, point_law, query, memory, workspace, out):
    """Fill the contacts and the wrench of one pose; see `tick`.

    `grid` and `point_law` are arguments, so that Numba leaves out what belongs to them where they
    are None.
    """
    centre, tool_frame = stack_array((3,)), model.frames[model.tool]
    clear(out.wrench)
    out.contacts.count[0] = 0
    fill_tool_frame(query.pose, model.centre, tool_frame, centre)
    collect_pairs(model, query.candidates, memory)
    steady_normals(memory)
    group_pairs(model.geometry, memory)
    if point_law is not None and query.dt > 0.0:
        advance_noise(memory.noise[0], point_law, query.dt)
    for p in range(memory.state[0].patches):
        _search_patch(model, parameters, grid, point_law, p, centre, memory, workspace)
    moves = memory.state[0].has_frame == 1 and query.dt > 0.0
    motion = ToolFrames(tool_frame, memory.frame, moves, centre)
    for p in range(memory.state[0].patches):
        if memory.patches[p].body >= 0:
            _add_contact(model, parameters, point_law, p, motion, memory, workspace, out)
    if query.dt > 0.0:
        remember(memory, tool_frame)
    _report_dropped(memory, out.contacts)


@kernel
def tick(model, law, query, memory, workspace, out):
    """Fill the contacts and the wrench of one pose.

    Parameters
    ----------
    model : SceneModel
    law : ForceLaw
    query : Query
    memory : GeomMemory
        Changed if `query.dt` is above 0.
    workspace : Workspace
        Of the search.
    out : Output
    """
    # The work is in an inner kernel, in which references are not counted.
    _tick(model, law.parameters, law.grid, law.point, query, memory, workspace, out)
