"""The compiled tick of contact with meshes: from a pose to contacts and their wrench."""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import clear, inner_kernel, kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_pairs import largest_displacement
from asperity.contact.contacts import NO_ROOM
from asperity.contact.manifold.both_roles import add_convex_or_mesh_manifold
from asperity.contact.manifold.mesh_manifold import (
    BodyQuery,
    in_order,
    remember,
    texture_reach,
)
from asperity.contact.manifold.properties import least_scale
from asperity.contact.manifold.records import MAX_PARTS
from asperity.contact.narrow_phase.friction import contact_friction
from asperity.contact.response.contact_forces import (
    Bristle,
    ToolFrames,
    add_friction,
    add_texture_force,
    damped_push,
    write_contact,
)
from asperity.geometry.frames import fill_relative_frame, fill_tool_frame

_SAME_DEPTH, _SAME_POINT = 1e-9, 1e-9
"""Relative difference of depths, and distance [m], up to which two deepest points are one."""
_JUMP = 1e-2
"""Motion in one tick above which the tool has been placed elsewhere [m]."""


@inner_kernel
def _forget_contacts(memory):
    """Forget the contacts of a tool that has jumped.

    Returns whether MuJoCo's candidates are missing for a body that was in contact; then only
    `in_contact` is cleared.
    """
    missing = False
    for b in range(memory.known.size):
        missing, memory.in_contact[b] = missing or memory.in_contact[b], False
    if missing:
        return True
    for b in range(memory.known.size):
        memory.known[b], memory.way_out[b] = 0, 0.0
    return False


@inner_kernel
def _candidate_overlap(scene, candidates, b):
    """Return the largest overlap of the tool's and a body's geoms [m]; -inf if none is close."""
    overlap = -np.inf
    for c in range(candidates.count):
        g, h = scene.geom_number[candidates.geoms[c, 0]], scene.geom_number[candidates.geoms[c, 1]]
        if g < 0 or h < 0:
            continue
        one, two = scene.geometry.body[g], scene.geometry.body[h]
        if (one == scene.tool and two == b) or (one == b and two == scene.tool):
            overlap = max(overlap, -candidates.distances[c])
    return overlap


@inner_kernel
def _fill_manifold(model, parameters, query, motion, step, memory, space, workspace):
    """Fill `space.manifold` with the patches between the tool and all bodies with facets.

    Fills `space.way_out` and `space.rest` for each body. `step` is the distance that the tool has
    moved [m].
    """
    scene = model.scene
    frame_a, frame_b = stack_array((3, 4)), stack_array((3, 4))
    count = space.manifold.count[0]
    count.patches = count.dropped = 0
    for b in range(model.by_facets.size):
        space.way_out[b] = space.energy[b] = 0.0
        if model.by_facets[b] == 0 or b == scene.tool:
            continue
        overlap = _candidate_overlap(scene, query.candidates, b)
        if overlap == -np.inf and not (memory.known[b] == 1 and memory.in_contact[b]):
            if query.dt > 0.0:
                memory.known[b] = 0
            continue
        one, two = in_order(model.facets, scene.tool, b)
        fill_relative_frame(motion.centre, scene.frames[one], frame_a)
        fill_relative_frame(motion.centre, scene.frames[two], frame_b)
        raised, lowered = texture_reach(model.facets, one, two)
        pair = BodyQuery(b, one, two, frame_a, frame_b, step, 0.0, raised, lowered, 0)
        space.way_out[b] = add_convex_or_mesh_manifold(
            model, parameters, pair, overlap, memory, space, workspace, space.rest[b]
        )
        if query.dt > 0.0:
            soft = least_scale(model.facets, pair, parameters.stiffness)
            remember(memory, b, space.way_out[b] / soft)


@inner_kernel
def _clear_patch(memory, patch):
    """Forget bristle and deepest point of a patch without weight."""
    for k in range(3):
        memory.bristle[patch.body, patch.direction, patch.part, k] = 0.0
        memory.guess[patch.body, patch.direction, patch.part, k] = np.nan


@inner_kernel
def _is_same_point(manifold, p, q):
    """Return whether two patches are of one body and direction, with the same deepest point."""
    one, other = manifold.patches[p], manifold.patches[q]
    if one.body != other.body or one.direction != other.direction:
        return False
    found, known = manifold.result[p], manifold.result[q]
    same = abs(found.depth - known.depth) <= _SAME_DEPTH * abs(known.depth)
    for k in range(3):
        same = same and abs(found.point[k] - known.point[k]) <= _SAME_POINT
    return same


@inner_kernel
def _is_added(manifold, p):
    """Return whether a patch before `p` has the same deepest point: they are one contact."""
    is_added = False
    for q in range(p - manifold.patches[p].part, p):
        is_added = is_added or _is_same_point(manifold, p, q)
    return is_added


@inner_kernel
def _end_of_region(manifold, p):
    """Return one past the last patch that may belong to the region of patch `p`."""
    return min(p - manifold.patches[p].part + MAX_PARTS, manifold.count[0].patches)


@inner_kernel
def _fill_shared(manifold, memory, p, deflection_out):
    """Return the total weight of the patches with the deepest point of `p`, the first of them.

    Fills the mean deflection of their bristles (3,).
    """
    share = 0.0
    clear(deflection_out)
    for q in range(p, _end_of_region(manifold, p)):
        if _is_same_point(manifold, p, q):
            patch = manifold.patches[q]
            share += patch.weight
            for k in range(3):
                bent = memory.bristle[patch.body, patch.direction, patch.part, k]
                deflection_out[k] += patch.weight * bent
    for k in range(3):
        deflection_out[k] /= share
    return share


@inner_kernel
def _store_shared(manifold, memory, p, deflection):
    """Store bristle and deepest point of all patches with the deepest point of `p`."""
    for q in range(p, _end_of_region(manifold, p)):
        if _is_same_point(manifold, p, q):
            patch = manifold.patches[q]
            for k in range(3):
                memory.bristle[patch.body, patch.direction, patch.part, k] = deflection[k]
                memory.guess[patch.body, patch.direction, patch.part, k] = patch.guess[k]


@inner_kernel
def _add_contact(scene, parameters, query, p, motion, memory, space, out):
    """Add the contact of patch `p` of the manifold and its forces to the output.

    Patches of a region that have the same deepest point are one contact, added with the first.
    """
    manifold, contacts = space.manifold, out.contacts
    patch, result = manifold.patches[p], manifold.result[p]
    b = patch.body
    if patch.weight <= 0.0:
        if query.dt > 0.0:
            _clear_patch(memory, patch)
        return
    if _is_added(manifold, p):
        return
    c = contacts.count[0]
    if c == contacts.body.size:
        manifold.count[0].dropped += 1
        return
    contacts.count[0] += 1
    deflection = stack_array((3,))
    share = _fill_shared(manifold, memory, p, deflection)
    weight = share * space.stiffness[b] / parameters.stiffness
    write_contact(contacts, c, b, weight, result, motion.centre)
    for k in range(3):
        contacts.normal[c, k] = patch.normal[k]
    push = parameters.stiffness * weight * result.depth
    add_texture_force(out, c, damped_push(push, parameters.dissipation, result, motion), result)
    stiffness = parameters.bristle_stiffness * weight
    friction = contact_friction(result, parameters.friction, space.friction[b])
    bristle = Bristle(deflection, stiffness, friction)
    add_friction(out, c, result.point, scene.frames[b], bristle, motion)
    if query.dt > 0.0:
        _store_shared(manifold, memory, p, deflection)


@inner_kernel
def _add_rest(b, space, out):
    """Add the part of the wrench with body `b` that belongs to no patch.

    The force is added to that of the contact with the largest weight.
    """
    contacts, largest = out.contacts, -1
    for c in range(contacts.count[0]):
        if contacts.body[c] == b and (largest < 0 or contacts.weight[c] > contacts.weight[largest]):
            largest = c
    space.energy[b] = 0.5 * space.stiffness[b] * space.way_out[b] ** 2
    for e in range(6):
        push = -space.stiffness[b] * space.way_out[b] * space.rest[b, e]
        out.wrench[e] += push
        if e < 3 and largest >= 0:
            contacts.force[largest, e] += push


@inner_kernel
def _remember_frame(memory, frame):
    """Store the tool's frame (3, 4) for the next tick."""
    memory.has_frame[0] = 1
    for i in range(3):
        for j in range(4):
            memory.frame[i, j] = frame[i, j]


@inner_kernel
def _mesh_tick(model, parameters, query, memory, space, workspace, out):
    """Add contacts and wrench of one pose; see `mesh_tick`."""
    scene, manifold, contacts = model.scene, space.manifold, out.contacts
    centre, tool_frame = stack_array((3,)), scene.frames[scene.tool]
    fill_tool_frame(query.pose, scene.centre, tool_frame, centre)
    known, step = memory.has_frame[0] == 1, 0.0
    if known:
        step = largest_displacement(model.facets, scene.tool, memory.frame, tool_frame)
    if step > _JUMP and query.dt == 0.0:
        step = _JUMP  # the memory may not be changed
    if step > _JUMP:
        known, step = False, 0.0
        if _forget_contacts(memory):
            return True
    moves = known and query.dt > 0.0
    motion = ToolFrames(tool_frame, memory.frame, moves, centre, query.dt)
    _fill_manifold(model, parameters, query, motion, step, memory, space, workspace)
    for p in range(manifold.count[0].patches):
        _add_contact(scene, parameters, query, p, motion, memory, space, out)
    for b in range(model.by_facets.size):
        if space.way_out[b] > 0.0:
            _add_rest(b, space, out)
    if query.dt > 0.0:
        _remember_frame(memory, tool_frame)
    contacts.count[1] += manifold.count[0].dropped
    if manifold.count[0].dropped > 0 and contacts.count[0] > 0:
        contacts.status[contacts.count[0] - 1] = NO_ROOM
    return False


@kernel
def mesh_tick(model, parameters, query, memory, space, workspace, out):
    """Add the contacts and the wrench of the tool with all bodies in contact by facets.

    Parameters
    ----------
    model : MeshModel
    parameters : ForceParameters
    query : Query
        Candidates of bodies that are `memory.in_contact` may be omitted.
    memory : MeshMemory
        Changed if `query.dt` is above 0.
    space : FacetSpace
        Scratch memory of contact between facets.
    workspace : Workspace
        Of the search.
    out : Output
        Added to.

    Returns
    -------
    bool
        Whether the omitted candidates are needed, since the tool has jumped. Then nothing has been
        added.
    """
    # In an inner kernel Numba does not count references.
    return _mesh_tick(model, parameters, query, memory, space, workspace, out)
