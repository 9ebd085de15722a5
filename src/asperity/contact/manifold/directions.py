"""The six directions of contact with one body: their order, validity and share of stiffness.

A plane may count for two directions, and across a convex edge the same overlap is seen from two
sides. A direction may therefore have a twin, be accounted for by another one, or count in part;
`mesh_manifold` searches them.
"""

from __future__ import annotations

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.manifold.overlap_region import distance_to_surface
from asperity.contact.manifold.separation import cosine

_EXPLAINED, _OWN = 1.2, 2.0
"""A point that leaves B within the first multiple of another direction's depth is accounted for by
that direction; one that needs more than the second is not."""
_ON_SURFACE = 1e-6
"""A point this deep is taken to be on the surface [m]."""
_ALIKE, _SAME = 0.75, 0.95
"""Cosines between two normals from which on their directions begin to share their stiffness, and
are one direction."""


@inner_kernel
def reset_directions(directions):
    """Set all directions to: not visited, no contact."""
    for d in range(DIRECTIONS):
        direction = directions[d]
        direction.depth = direction.deepest = -np.inf
        direction.first = direction.patches = 0
        direction.share, direction.twin = 0.0, d
        direction.explained = direction.visited = 0


@inner_kernel
def next_direction(memory, b, space):
    """Return the direction to visit next: contacts first, then by the volume of the overlap."""
    sums, directions, first = space.region.sums, space.directions, -1
    for d in range(DIRECTIONS):
        if directions[d].visited == 1:
            continue
        ahead = first < 0 or memory.active[b, d] > memory.active[b, first]
        if ahead or (
            memory.active[b, d] == memory.active[b, first] and sums[d].volume > sums[first].volume
        ):
            first = d
    directions[first].visited = 1
    return first


@inner_kernel
def is_explained(table, count, d, space):
    """Return whether another direction accounts for one that might become a contact.

    It is the rule of `validate_directions` before the search. A contact begins near B's surface,
    so that the point where the smooth bodies overlap most is near the deepest point. And a region
    that counts for both directions does not touch along the one if it does not along the other.
    """
    sums, direction = space.region.sums, space.directions[d]
    for c in range(DIRECTIONS):
        other = space.directions[c]
        if other.patches == 0 or sums[c].volume < sums[d].volume:
            continue
        if cosine(direction, other) > _ALIKE:
            continue
        depth = _EXPLAINED * max(other.depth, 0.0) + _ON_SURFACE
        out = distance_to_surface(
            table, count, c, other.normal, sums[d].deepest_point, space.region
        )
        if out <= depth:
            return True
    return False


@inner_kernel
def _deepest_point(manifold, direction, near_b, point_out):
    """Fill the deepest point of a direction's patches in B's frame (3,) [m]."""
    deepest = direction.first
    for p in range(deepest, direction.first + direction.patches):
        if manifold.result[p].depth > manifold.result[deepest].depth:
            deepest = p
    found = manifold.result[deepest]
    for i in range(3):
        point_out[i] = 0.0
        for k in range(3):
            point_out[i] += near_b[k, i] * (found.point[k] - near_b[k, 3])


@inner_kernel
def validate_directions(table, count, near_b, space):
    """Fill `valid` of all directions.

    Across a convex edge the same overlap is seen from two sides. A direction does not count if its
    deepest point would be outside B once the tool were moved out along another direction, with a
    larger region, by the depth of that direction.
    """
    sums, point = space.region.sums, stack_array((3,))
    for d in range(DIRECTIONS):
        direction = space.directions[d]
        direction.valid = 1.0
        if direction.depth <= 0.0 or direction.patches == 0:
            continue
        _deepest_point(space.manifold, direction, near_b, point)
        for c in range(DIRECTIONS):
            other = space.directions[c]
            if c == d or other.depth <= 0.0 or other.patches == 0:
                continue
            if sums[c].volume < sums[d].volume or (sums[c].volume == sums[d].volume and c > d):
                continue
            along = cosine(direction, other)
            if along > _SAME:
                continue  # they share their stiffness already
            out = distance_to_surface(table, count, c, other.normal, point, space.region)
            counts = (out / other.depth - _EXPLAINED) / (_OWN - _EXPLAINED)
            shared = max((along - _ALIKE) / (_SAME - _ALIKE), 0.0)
            direction.valid *= shared + (1.0 - shared) * min(max(counts, 0.0), 1.0)


@inner_kernel
def find_twin(space, d):
    """Return a searched direction whose region is the same but for its share; -1 if none is."""
    sums = space.region.sums
    for c in range(DIRECTIONS):
        if c == d or space.directions[c].patches == 0:
            continue
        same = True
        for k in range(3):
            normals = space.directions[c].normal[k], space.directions[d].normal[k]
            same = same and abs(normals[0] - normals[1]) < 1e-12
            one = sums[c].first_moment[k] / sums[c].volume
            two = sums[d].first_moment[k] / sums[d].volume
            same = same and abs(one - two) < 1e-12
        if same:
            return c
    return -1


@inner_kernel
def share_stiffness(space):
    """Fill the weights of a body's patches; see `mesh_manifold` for the rule."""
    manifold, sums = space.manifold, space.region.sums
    total = 0.0
    for d in range(DIRECTIONS):
        direction = space.directions[d]
        if direction.depth <= 0.0:
            continue
        direction.valid = space.directions[direction.twin].valid
        alike = 0.0
        for c in range(DIRECTIONS):
            other = space.directions[c]
            if other.depth > 0.0:
                along = cosine(direction, other)
                alike += sums[c].volume * max((along - _ALIKE) / (1.0 - _ALIKE), 0.0)
        share = direction.valid * direction.depth * sums[d].volume / alike
        space.directions[direction.twin].share += share
        total += share
    if total == 0.0:
        total = 1.0
    for d in range(DIRECTIONS):
        direction = space.directions[d]
        for p in range(direction.first, direction.first + direction.patches):
            live = manifold.result[p].depth > 0.0
            weight = direction.fade * direction.share / (total * direction.patches)
            manifold.patches[p].weight = weight if live else 0.0
