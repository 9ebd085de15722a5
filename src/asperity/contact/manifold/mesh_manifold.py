"""The contact manifold between a tool and one body, of which at least one is a mesh.

The overlap region of the two smooth bodies is integrated for each of six directions of the body's
frame (`overlap_region`). A direction in which there is an overlap has a normal, the mean of the
body's facet normals weighted by the overlap, and one to four patches (`split`), whose depths are
searched (`narrow_phase`).

A contact must begin at the surface: a direction becomes a contact only if its depth was about zero
in the last tick, so that a tool that is pushed through a thin plate does not touch the far side.
It stays a contact however deep it gets. At a first pose, or after a jump, facets that lie behind
others only because there is a cavity between are left out (`inside`).

The patches share the stiffness of the body. With delta_p the depths of the m patches of a
direction and delta their mean, a patch has the weight

    w_p = W s v delta / (m sum of s v delta over directions).

s divides the weight between directions with nearly the same normal, so that a plane that counts
for two directions counts once. v is 0 where another direction accounts for the contact, since
across a convex edge the same overlap is seen from two sides (`directions`). W fades from 1 to 0 as
the last sliver of the region slides off an edge.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel
from asperity._core.records import clear_record
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.broad_phase.facet_pairs import half_diagonal, pair_limits, relative_transform
from asperity.contact.broad_phase.neighbour_list import RelativePose, neighbour_pairs
from asperity.contact.manifold.directions import (
    find_twin,
    is_explained,
    next_direction,
    reset_directions,
    share_stiffness,
    validate_directions,
)
from asperity.contact.manifold.inside import is_across_cavity
from asperity.contact.manifold.overlap_region import (
    add_piece,
    clip_depth,
    clip_pair,
    deepest_corner,
    robust_normal,
    sliver_thickness,
)
from asperity.contact.manifold.records import MAX_PARTS, MAX_PATCHES
from asperity.contact.narrow_phase.geom_depth import SearchLimits, frame_round
from asperity.contact.narrow_phase.mesh_depth import SplitRegion, region_depths
from asperity.contact.narrow_phase.mesh_patches import FacetQuery
from asperity.contact.narrow_phase.surface_patch import FLATTEST
from asperity.geometry.frames import depth_tolerance, to_world

_BIRTH = 2e-4
"""Overlap at which a contact may begin, in addition to the motion of a tick [m]."""
_NEAR_ZERO = 1e-4
"""Depth that counts as none when a contact begins, in addition to the motion of a tick [m]."""
_BESIDE = 2e-4
"""How much deeper than a contact facets are looked for [m]."""


class BodyQuery(NamedTuple):
    """The tool and one scene body at one pose; positions are relative to the tool's centre."""

    body: int
    """Number of the scene body."""
    frame_a: NDArray[np.float64]
    """The tool's frame, (3, 4) [m]."""
    frame_b: NDArray[np.float64]
    """The body's frame, (3, 4) [m]."""
    overlap: float
    """Largest overlap of the smooth bodies as MuJoCo finds it [m]; -inf if not known."""
    step: float
    """Distance that the tool has moved since the last tick [m]."""


@inner_kernel
def _texture_reach(model, b):
    """Return how much textures raise, and how much they lower, the tool and body `b` [m]."""
    table, tool = model.facets, model.scene.tool
    reach = 1e-7 + table.slack[tool] + table.slack[b]
    raised, lowered = table.raised, table.lowered
    return reach + raised[tool] + raised[b], reach + lowered[tool] + lowered[b]


@inner_kernel
def _limit_overlaps(memory, query, raised, lowered, limit_out):
    """Fill the largest smooth overlap that a contact may have in each direction; return the most.

    Where the smooth bodies overlap by more than the textures lower them, the textured ones do too.
    """
    b, most = query.body, 0.0
    for d in range(DIRECTIONS):
        if memory.active[b, d] == 1:
            limit_out[d] = max(memory.deepest[b, d], 0.0) + lowered + _BIRTH + 2.0 * query.step
        elif memory.known[b] == 1:
            limit_out[d] = lowered + _BIRTH + 2.0 * query.step
        else:
            limit_out[d] = 1.5 * max(query.overlap, 0.0) + raised + _BIRTH
        most = max(most, limit_out[d])
    return most


@inner_kernel
def _listed_pairs(model, query, max_depth, reach, memory, space):
    """Fill `region.facets.pairs` with the facets that may touch; return how many pairs."""
    table, tool, facets = model.facets, model.scene.tool, space.region.facets
    transform = stack_array((3, 4))
    relative_transform(query.frame_a, query.frame_b, transform)
    pose = RelativePose(tool, query.body, transform, half_diagonal(table, tool), query.step)
    limits = pair_limits(max_depth, reach, FLATTEST)
    count = neighbour_pairs(table, pose, limits, memory.lists, facets)
    if facets.state[0].dropped > 0:
        space.manifold.count[0].dropped += 1
    return count


@inner_kernel
def _may_begin(table, memory, query, g):
    """Return whether a contact on facet `g` may begin, at an overlap that shows nothing of it."""
    if memory.known[query.body] == 1 and query.step <= _BIRTH:
        return False
    for d in range(DIRECTIONS):
        if table.shares[g, d] > 0.0 and memory.active[query.body, d] == 0:
            return True
    return False


@inner_kernel
def _integrate_region(table, query, count, max_depth, reach, memory, region):
    """Fill the sums of all directions; keep the pairs of facets that may touch, return how many."""
    sums, limit = region.sums, region.limit
    for d in range(DIRECTIONS):
        clear_record(sums[d])
        sums[d].deepest = -np.inf
    kept = 0
    for i in range(count):
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        piece = clip_pair(table, f, g, reach, reach, max_depth, region)
        if piece[1] < 0:
            continue
        tested = piece[1] >= 3 and _may_begin(table, memory, query, g)
        if tested and is_across_cavity(table, f, g, piece, query, region):
            continue
        region.facets.pairs[kept, 0], region.facets.pairs[kept, 1] = f, g
        kept += 1
        volumes = region.volumes[kept - 1]
        clear(volumes)
        if piece[1] < 3:
            continue
        deepest, corner = deepest_corner(region, piece)
        for d in range(DIRECTIONS):
            share = table.shares[g, d]
            if share == 0.0:
                continue
            if deepest > sums[d].deepest:
                sums[d].deepest = deepest
                p = region.polygon[piece[0], corner]
                for k in range(3):
                    place = table.origin[g, k] + p[0] * table.axes[g, 0, k]
                    sums[d].deepest_point[k] = place + p[1] * table.axes[g, 1, k]
            if deepest <= limit[d]:
                volumes[d] = add_piece(table, g, piece, reach, share, region, sums[d])
            else:
                part = clip_depth(region, piece, limit[d])
                if part[1] >= 3:
                    volumes[d] = add_piece(table, g, part, reach, share, region, sums[d])
    return kept


@inner_kernel
def _shallowest(region):
    """Return the least of the largest overlaps of all directions with an overlap [m]."""
    shallowest = np.inf
    for d in range(DIRECTIONS):
        if region.sums[d].volume > 0.0:
            shallowest = min(shallowest, region.sums[d].deepest)
    return shallowest


@inner_kernel
def _may_touch(memory, query, d, region):
    """Return whether a direction is, or may become, a contact."""
    b, sums = query.body, region.sums[d]
    if sums.volume <= 0.0:
        return False
    if memory.active[b, d] == 1:
        return True
    if memory.known[b] == 0:
        return sums.deepest <= 2.0 * max(_shallowest(region), 0.0) + _BIRTH
    return memory.depth[b, d] <= query.step + _NEAR_ZERO


@inner_kernel
def _fill_normal(table, count, d, region, normal_out):
    """Fill the unit normal (3,) of a direction in B's frame."""
    total = region.sums[d].normal
    size = math.sqrt(total[0] ** 2 + total[1] ** 2 + total[2] ** 2)
    for k in range(3):
        normal_out[k] = total[k] / size
    robust_normal(table, count, d, region, normal_out)


@inner_kernel
def _search_patches(model, parameters, query, d, count, memory, space, workspace):
    """Search the patches of direction `d`, appended to the manifold; return how many there are."""
    scene, manifold = model.scene, space.manifold
    direction, frame = space.directions[d], workspace.frame
    n, world, local = stack_array((3,)), stack_array((3,)), stack_array((3, 3))
    for k in range(3):
        n[k] = direction.normal[k]
    # The axes turn with B, so that a region is split the same way wherever B is.
    frame_round(n, local)
    for i in range(2):
        to_world(query.frame_b, local[i], frame[i])
    to_world(query.frame_b, n, world)
    for k in range(3):
        frame[2, k] = world[k]
    facets = FacetQuery(np.int64(count), np.int64(d), n, frame, query.frame_a, query.frame_b)
    start = manifold.count[0].patches
    first = model.facets.first_surface
    surfaces = (first[scene.tool], first[query.body])
    tolerance = depth_tolerance(
        scene.textures,
        scene.geometry,
        surfaces,
        parameters.tolerance,
    )
    region = SplitRegion(
        space.region.sums[d], local[0], local[1], parameters.patch_radius,
        memory.guess[query.body, d],
    )  # fmt: skip
    patches, has_room = region_depths(
        (scene.textures, model.facets, scene.geometry), region, facets,
        SearchLimits(tolerance, parameters.max_nodes), workspace, space, manifold.result[start:],
    )  # fmt: skip
    if not has_room:
        manifold.count[0].dropped += 1
    for p in range(patches):
        patch = manifold.patches[start + p]
        patch.body, patch.direction, patch.part = query.body, d, p
        for k in range(3):
            patch.normal[k] = world[k]
    return patches


@inner_kernel
def _search_direction(model, parameters, query, d, count, memory, space, workspace):
    """Find whether direction `d` is a contact; append its patches to the manifold if it is."""
    b, table, region, manifold = query.body, model.facets, space.region, space.manifold
    direction, begins = space.directions[d], memory.known[b] == 1 and memory.active[b, d] == 0
    direction.first = manifold.count[0].patches
    if not _may_touch(memory, query, d, region):
        return
    if direction.first + MAX_PARTS > MAX_PATCHES:
        manifold.count[0].dropped += 1
        return
    _fill_normal(table, count, d, region, direction.normal)
    twin = find_twin(space, d)
    if twin >= 0:
        # The same plane counts for two directions; it is searched once.
        direction.depth, direction.twin = space.directions[twin].depth, twin
        direction.deepest = space.directions[twin].deepest
        return
    if begins and is_explained(table, count, d, space):
        direction.explained = 1
        return
    patches = _search_patches(model, parameters, query, d, count, memory, space, workspace)
    total = deepest = 0.0
    for p in range(patches):
        depth = manifold.result[direction.first + p].depth
        total += max(depth, 0.0)
        deepest = max(deepest, depth)
    depth = total / patches
    if begins and depth > _NEAR_ZERO + 2.0 * query.step:
        # Rejected: the direction first appears at a non-zero depth, so it is a back face.
        return
    fade, thickness = parameters.edge_fade, sliver_thickness(region.sums[d])
    direction.patches, direction.depth, direction.deepest = patches, depth, deepest
    direction.fade = min(thickness / fade, 1.0) if fade > 0.0 else 1.0
    manifold.count[0].patches += patches


@inner_kernel
def add_mesh_manifold(model, parameters, query, memory, space, workspace):
    """Append the patches between the tool and one body to `space.manifold`, with their weights.

    Parameters
    ----------
    model : MeshModel
    parameters : ForceParameters
    query : BodyQuery
    memory : MeshMemory
        Only read, but for the neighbour lists: see `remember`.
    space : FacetSpace
    workspace : Workspace
    """
    raised, lowered = _texture_reach(model, query.body)
    most = _limit_overlaps(memory, query, raised, lowered, space.region.limit)
    max_depth = most + query.step + _BESIDE
    count = _listed_pairs(model, query, max_depth, raised, memory, space)
    count = _integrate_region(model.facets, query, count, max_depth, raised, memory, space.region)
    reset_directions(space.directions)
    for _ in range(DIRECTIONS):
        d = next_direction(memory, query.body, space)
        _search_direction(model, parameters, query, d, count, memory, space, workspace)
    validate_directions(model.facets, count, query.frame_b, space)
    share_stiffness(space)


@inner_kernel
def remember(memory, space, b):
    """Store the state of contact with body `b` for the next tick."""
    sums = space.region.sums
    memory.known[b] = 1
    memory.in_contact[b] = False
    for d in range(DIRECTIONS):
        direction = space.directions[d]
        searched = direction.depth > -np.inf
        buried = not searched and sums[d].deepest > 0.0
        memory.depth[b, d] = np.inf if buried else direction.depth
        if direction.explained == 1:
            memory.depth[b, d] = max(sums[d].deepest, 0.0)
        memory.deepest[b, d] = direction.deepest
        # A direction that does not count ends, and must begin at the surface again.
        memory.active[b, d] = 1 if direction.depth > 0.0 and direction.valid > 0.0 else 0
        memory.in_contact[b] = memory.in_contact[b] or memory.active[b, d] == 1
