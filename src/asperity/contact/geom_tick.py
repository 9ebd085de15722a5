"""The compiled tick of contact between geoms: from a pose to contacts and their wrench."""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import clear, inner_kernel, kernel
from asperity._core.records import copy_record
from asperity._core.stack import stack_array
from asperity.contact.contacts import NO_ROOM
from asperity.contact.manifold.geom_manifold import (
    collect_pairs,
    find_parts,
    geoms_of_part,
    recall_patch,
    remember,
)
from asperity.contact.manifold.separation import (
    FACE_A,
    FACE_B,
    FARTHEST,
    LONGEST,
    MAX_PARTS,
    is_same_way,
    is_stood_for,
)
from asperity.contact.narrow_phase.friction import contact_friction
from asperity.contact.narrow_phase.geom_depth import (
    BodyGeoms,
    DepthQuery,
    SearchLimits,
    fill_depth_along,
)
from asperity.contact.narrow_phase.incumbent import TIE
from asperity.contact.narrow_phase.penetration import may_touch
from asperity.contact.response.contact_forces import (
    Bristle,
    ToolFrames,
    add_at_point,
    add_friction,
    add_texture_force,
    damped_push,
    write_contact,
)
from asperity.contact.response.grid_gradient import depth_on_grid
from asperity.contact.response.point_laws import PointQuery, advance_noise, point_force
from asperity.contact.response.potential import fill_potential
from asperity.geometry.frames import (
    depth_tolerance,
    fill_relative_frame,
    fill_tool_frame,
    material_displacement,
    to_body,
    to_world,
)

_LEVER = 0.01
"""Length that makes rotations of the tool comparable to translations [m]."""
_LEAST_SHARE = 1e-9
"""Smallest share in the way out of a direction that is a contact."""


@inner_kernel
def _search(model, parameters, grid, i, stretch, centre, memory, workspace):
    """Fill the depth along separation `i`; its face is extended by `stretch` beyond its edges."""
    found, result = memory.separations[i], memory.results[i]
    shape = model.geometry
    body = shape.body[found.geom_b]
    body_frame, patch = model.frames[body], memory.patches[0]
    frame_a, frame_b = stack_array((3, 4)), stack_array((3, 4))
    n, guess = stack_array((3,)), stack_array((3,))
    fill_relative_frame(centre, model.frames[model.tool], frame_a)
    fill_relative_frame(centre, body_frame, frame_b)
    to_body(body_frame, found.normal, n)
    recall_patch(memory, body, n, patch)
    to_world(body_frame, patch.point, guess)
    for k in range(3):
        guess[k] += frame_b[k, 3]
        n[k] = found.normal[k]
    count_a, count_b = geoms_of_part(memory, found.part)
    surfaces = (shape.surface[found.geom_a], shape.surface[found.geom_b])
    tolerance = depth_tolerance(model.textures, shape, surfaces, parameters.tolerance)
    over_a = stretch if found.kind == FACE_A else 0.0
    over_b = stretch if found.kind == FACE_B else 0.0
    query = DepthQuery(
        BodyGeoms(memory.geoms[0], count_a, frame_a, over_a),
        BodyGeoms(memory.geoms[1], count_b, frame_b, over_b),
        n, guess,
    )  # fmt: skip
    limits = SearchLimits(tolerance, parameters.max_nodes)
    workspace.search[0].usual = 1.0 / parameters.stiffness
    fill_depth_along(model.textures, shape, query, limits, workspace, result)
    if grid is not None:
        depth_on_grid(model, grid, query, workspace, result)
    found.depth = result.depth
    if may_touch(result):
        memory.state[0].dropped += 1
    if result.scale > 0.0:
        found.scale = result.scale
    result.friction = contact_friction(result, parameters.friction, found.friction)


@inner_kernel
def _search_part(model, parameters, grid, first, past, centre, memory, workspace):
    """Fill the depths of one part's separations, in the order of their gaps.

    Returns whether the part touches. Separations without weight get a depth of -inf.
    """
    rows, least = memory.separations, np.inf
    if past == first + 1:
        _search(model, parameters, grid, first, rows[first].reach, centre, memory, workspace)
        return rows[first].depth > 0.0
    for i in range(first, past):
        rows[i].depth = np.nan
    for turn in range(past - first):
        at = np.int64(-1)
        for i in range(first, past):
            if rows[i].depth != rows[i].depth and (at < 0 or rows[i].gap < rows[at].gap):
                at = i
        is_far = rows[at].gap - rows[at].rough >= LONGEST * FARTHEST * least
        if is_far or is_stood_for(rows, first, at, least):
            rows[at].depth = -np.inf
            continue
        _search(model, parameters, grid, at, rows[at].rough, centre, memory, workspace)
        depth = rows[at].depth
        if not depth > 0.0 and (turn == 0 or depth > -np.inf):
            return False
        if depth > 0.0:
            least = min(least, depth * (rows[at].scale / rows[at].gap_scale))
    return True


@inner_kernel
def _merge_bodies(memory, kept, i):
    """Merge the only direction of a part with that of another body; return whether there is one.

    Of bodies side by side the deepest counts, as of the geoms of one body. Two that are equally
    deep with equal friction and stiffness both count.
    """
    rows, found, result = memory.separations, memory.separations[i], memory.results[i]
    for j in range(kept):
        if not is_same_way(rows, kept, j, found):
            continue
        other = memory.results[j]
        ahead = result.depth * found.scale - other.depth * rows[j].scale
        is_same = rows[j].scale == found.scale and rows[j].friction == found.friction
        if abs(ahead) <= TIE and is_same:
            one, two = other.area, result.area
            if one + two == 0.0:
                one, two = float(other.ties), float(result.ties)
            share = two / (one + two)
            for k in range(3):
                other.point[k] += share * (result.point[k] - other.point[k])
                other.slope_normal[k] += share * (result.slope_normal[k] - other.slope_normal[k])
                other.moment[k] += share * (result.moment[k] - other.moment[k])
                other.turn[k] += share * (result.turn[k] - other.turn[k])
            other.friction += share * (result.friction - other.friction)
            other.ties += result.ties
            other.area += result.area
        elif ahead > 0.0:
            part = rows[j].part
            copy_record(rows[j], found)
            copy_record(other, result)
            rows[j].owner, rows[j].part = found.part, part
        return True
    return False


@inner_kernel
def _search_parts(model, parameters, grid, centre, memory, workspace):
    """Search all parts; move the separations of those that touch to the front."""
    kept = parts = first = np.int64(0)
    used = memory.state[0].separations
    while first < used:
        past = first
        while past < used and memory.separations[past].part == memory.separations[first].part:
            past += 1
        touches = _search_part(model, parameters, grid, first, past, centre, memory, workspace)
        if touches and past == first + 1 and _merge_bodies(memory, kept, first):
            touches = False
        if touches and parts == MAX_PARTS:
            memory.state[0].dropped += 1
            touches = False
        if touches:
            for i in range(first, past):
                if memory.separations[i].depth > 0.0:
                    if kept != i:
                        copy_record(memory.separations[kept], memory.separations[i])
                        copy_record(memory.results[kept], memory.results[i])
                    memory.separations[kept].owner = memory.separations[kept].part
                    memory.separations[kept].part = parts
                    kept += 1
            parts += 1
        first = past
    memory.state[0].separations, memory.state[0].parts = kept, parts


@inner_kernel
def _add_point_force(model, law, i, push, motion, memory, workspace, out):
    """Add the force of a point law at separation `i` to the last contact and to the wrench."""
    c, found, result = out.contacts.count[0] - 1, memory.separations[i], memory.results[i]
    frame_b, moved, point = stack_array((3, 4)), stack_array((3,)), stack_array((3,))
    fill_relative_frame(motion.centre, model.frames[out.contacts.body[c]], frame_b)
    _, count_b = geoms_of_part(memory, found.owner)
    for k in range(3):
        point[k] = result.point[k]
    material_displacement(
        memory.state[0].has_frame == 1, motion.last_frame, motion.frame, point, motion.centre, moved
    )
    query = PointQuery(
        BodyGeoms(memory.geoms[1], count_b, frame_b, 0.0), out.contacts.normal[c], point, moved,
        push, result.depth,
    )  # fmt: skip
    force = out.contacts.force[c]
    point_force(model, law, query, memory.noise[0], workspace, force)
    add_at_point(out.wrench, point, force)


@inner_kernel
def _add_contact(model, parameters, point_law, i, motion, memory, workspace, out):
    """Add the contact of separation `i` and its forces to the output."""
    contacts, found, result = out.contacts, memory.separations[i], memory.results[i]
    c, body = out.contacts.count[0], model.geometry.body[found.geom_b]
    body_frame, patch, normal = model.frames[body], memory.patches[c], stack_array((3,))
    contacts.count[0] += 1
    weight = found.weight
    push = parameters.stiffness * weight * result.depth
    push = damped_push(push, parameters.dissipation, result, motion)
    write_contact(contacts, c, body, weight, result, motion.centre)
    for k in range(3):
        contacts.normal[c, k] = found.normal[k]
    to_body(body_frame, found.normal, normal)
    recall_patch(memory, body, normal, patch)
    if point_law is None:
        add_texture_force(out, c, push, result)
    else:
        _add_point_force(model, point_law, i, push, motion, memory, workspace, out)
    sticking = parameters.bristle_stiffness * min(weight, found.scale * found.scale)
    bristle = Bristle(patch.bristle, sticking, result.friction)
    add_friction(out, c, result.point, body_frame, bristle, motion)
    offset = stack_array((3,))
    for k in range(3):
        offset[k] = contacts.point[c, k] - body_frame[k, 3]
    to_body(body_frame, offset, patch.point)


@inner_kernel
def _add_rest(stiffness, way_out, rates, memory, out):
    """Add the parts of the wrench that belong to no contact.

    They are due to directions that turn with the tool, to the shares of directions, and to
    directions with a negative weight. `rates` (6,) is the derivative of the way out by the tool's
    motion with all depths fixed. The force is added to that of the contact with the largest weight.
    """
    contacts, largest = out.contacts, 0
    for c in range(1, contacts.count[0]):
        if contacts.weight[c] > contacts.weight[largest]:
            largest = c
    for e in range(6):
        push = -stiffness * way_out * rates[e]
        for i in range(memory.state[0].separations):
            found, m = memory.separations[i], memory.results[i].slope_normal
            along = 0.0
            for k in range(3):
                turn = memory.results[i].turn[k] - found.depth * m[k]
                along += turn * found.normal_rate[k, e]
            push -= stiffness * found.weight * found.depth * along
            if found.weight < 0.0:
                moment = memory.results[i].moment
                own = m[e] if e < 3 else moment[e - 3]
                push += stiffness * found.weight * found.depth * own
        out.wrench[e] += push
        if e < 3:
            contacts.force[largest, e] += push


@inner_kernel
def _add_contacts(model, parameters, point_law, motion, memory, workspace, out):
    """Add the contacts of all separations with a share in the way out, and their wrench."""
    state, rates = memory.state[0], stack_array((6,))
    rows, used = memory.separations, state.separations
    way_out = fill_potential(rows, used, state.parts, _LEVER, memory.ways, rates)
    state.way_out = way_out
    for i in range(used):
        is_contact = rows[i].weight * rows[i].depth > _LEAST_SHARE * way_out
        rows[i].weight *= way_out / rows[i].depth
        if is_contact and out.contacts.count[0] == memory.patches.size:
            state.dropped += 1
        elif is_contact:
            _add_contact(model, parameters, point_law, i, motion, memory, workspace, out)
    if point_law is None and out.contacts.count[0] > 0:
        _add_rest(parameters.stiffness, way_out, rates, memory, out)


@inner_kernel
def _tick(model, parameters, grid, point_law, query, memory, workspace, out):
    """Fill the contacts and the wrench of one pose; see `tick`.

    `grid` and `point_law` are arguments, so that Numba omits their branches where they are None.
    """
    centre, tool_frame = stack_array((3,)), model.frames[model.tool]
    state, contacts, smooth = memory.state[0], out.contacts, model
    if point_law is not None:
        smooth = point_law.smooth
    clear(out.wrench)
    contacts.count[0], state.way_out = 0, 0.0
    fill_tool_frame(query.pose, model.centre, tool_frame, centre)
    collect_pairs(model, query.candidates, memory)
    find_parts(smooth.textures, smooth.geometry, model.frames, centre, parameters, memory)
    if point_law is not None and query.dt > 0.0:
        advance_noise(memory.noise[0], point_law, query.dt)
    _search_parts(smooth, parameters, grid, centre, memory, workspace)
    moves = state.has_frame == 1 and query.dt > 0.0
    motion = ToolFrames(tool_frame, memory.frame, moves, centre, query.dt)
    if state.parts > 0:
        _add_contacts(model, parameters, point_law, motion, memory, workspace, out)
    if query.dt > 0.0:
        remember(memory, contacts.count[0], tool_frame)
    contacts.count[1] = state.dropped
    state.dropped = 0
    if contacts.count[1] > 0 and contacts.count[0] > 0:
        contacts.status[0] = NO_ROOM


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
    # In an inner kernel Numba does not count references.
    _tick(model, law.parameters, law.grid, law.point, query, memory, workspace, out)
