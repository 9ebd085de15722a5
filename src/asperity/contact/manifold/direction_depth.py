"""The depth of one direction in which the tool may leave a body.

The overlap region of a direction is split into one to four patches (`split`), whose depths are
searched (`narrow_phase`). The direction's depth is their root mean square, so that its patches have
the total stiffness k.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from asperity._core.kernels import inner_kernel
from asperity._core.stack import stack_array
from asperity.contact.manifold.records import MAX_PARTS, MAX_PATCHES
from asperity.contact.narrow_phase.geom_depth import SearchLimits, frame_round
from asperity.contact.narrow_phase.load import scale_of
from asperity.contact.narrow_phase.mesh_depth import SplitRegion, region_depths
from asperity.contact.narrow_phase.mesh_patches import FacetQuery
from asperity.contact.narrow_phase.penetration import may_touch
from asperity.contact.narrow_phase.records import BUDGET_SPENT
from asperity.geometry.frames import depth_tolerance, to_body, to_world

_BUDGET, _LEAST_BUDGET = 2.0, 0.05
"""Node budget of all directions of a body, and the least of one direction, in `max_nodes`."""
_RADIUS = 1.0 / 3.0
"""Default patch radius, over the width of the smaller body."""
_TRIAL = 8.0
"""Node budget of each patch in a trial."""


class DirectionTask(NamedTuple):
    """A direction to be searched."""

    number: int
    """Of the direction."""
    pairs: int
    """Number of facet pairs."""
    ceiling: float
    """Depth above which it does not count [m]."""
    source: int
    """The direction whose facets are searched, -1 for all."""
    is_trial: bool
    """Whether to search for a moment only: see `search_direction`."""


@inner_kernel
def _patch_radius(model, parameters, query):
    """Return the radius of the parts into which a region is split [m]."""
    if parameters.patch_radius > 0.0:
        return parameters.patch_radius
    width = model.facets.width
    return _RADIUS * min(width[query.first], width[query.second])


@inner_kernel
def _fill_guesses(query, d, memory, manifold, guess_out):
    """Fill the start points of the searches of direction `d`, A's frame (4, 3) [m].

    A part without one from the last tick gets the deepest point of the same part of the deepest
    direction searched in this tick, or of that direction: between two rough bodies a search without
    a start may spend its budget far from the deepest point, and its too small depth would be the
    least one.
    """
    deepest, at = 0.0, np.int64(-1)
    for p in range(manifold.count[0].patches):
        depth = manifold.result[p].depth
        patch = manifold.patches[p]
        is_known = patch.body == query.body and patch.direction >= query.offset
        if is_known and depth > deepest:
            deepest, at = depth, p
    for part in range(MAX_PARTS):
        same = at
        if at >= 0:
            beside = at - manifold.patches[at].part + part
            if beside < manifold.count[0].patches and manifold.patches[beside].part == part:
                same = beside if manifold.result[beside].depth > 0.0 else at
        for k in range(3):
            guess_out[part, k] = memory.guess[query.body, query.offset + d, part, k]
            if at >= 0 and guess_out[part, k] != guess_out[part, k]:
                guess_out[part, k] = manifold.patches[same].guess[k]


@inner_kernel
def _search_patches(model, parameters, query, task, memory, space, workspace):
    """Search the patches of a direction, and store them after those of the manifold.

    Returns their number, and whether there was room for all facets.
    """
    d, scene, manifold = task.number, model.scene, space.manifold
    direction, frame = space.directions[d], workspace.frame
    n, world, local = stack_array((3,)), stack_array((3,)), stack_array((3, 3))
    guess = stack_array((4, 3))
    _fill_guesses(query, d, memory, manifold, guess)
    for k in range(3):
        n[k] = direction.normal[k]
    # The axes turn with B, so that the split does not depend on B's pose.
    frame_round(n, local)
    for i in range(2):
        to_world(query.frame_b, local[i], frame[i])
    to_world(query.frame_b, n, world)
    for k in range(3):
        frame[2, k] = world[k]
    facets = FacetQuery(
        np.int64(task.pairs), np.int64(task.source), n, frame, query.frame_a, query.frame_b
    )
    start = manifold.count[0].patches
    first = model.facets.first_surface
    surfaces = (first[query.first], first[query.second])
    tolerance = depth_tolerance(scene.textures, scene.geometry, surfaces, parameters.tolerance)
    region = SplitRegion(
        space.region.sums[d], local[0], local[1], _patch_radius(model, parameters, query),
        task.ceiling, guess,
    )  # fmt: skip
    # A deep pose has many directions: together they get twice the budget of one.
    left = max(
        _BUDGET * parameters.max_nodes - space.spent[0], _LEAST_BUDGET * parameters.max_nodes
    )
    budget = _TRIAL if task.is_trial else float(parameters.max_nodes)
    limits = SearchLimits(tolerance, min(budget, left))
    patches, has_room = region_depths(
        (scene.textures, model.facets, scene.geometry), region, facets, limits, workspace, space,
        start,
    )  # fmt: skip
    place, base = stack_array((3,)), stack_array((3,))
    for p in range(patches):
        space.spent[0] += manifold.result[start + p].nodes
        patch = manifold.patches[start + p]
        patch.body, patch.direction = query.body, query.offset + d
        patch.part, patch.weight = p, 0.0
        for k in range(3):
            place[k] = manifold.result[start + p].point[k] - query.frame_a[k, 3]
        to_body(query.frame_a, place, patch.guess)
        for k in range(3):
            patch.normal[k] = world[k]
            place[k] = patch.base[2] * frame[2, k] - query.frame_b[k, 3]
            place[k] += patch.base[0] * frame[0, k] + patch.base[1] * frame[1, k]
        to_body(query.frame_b, place, base)
        for k in range(3):
            patch.base[k] = base[k]
    return patches, has_room


@inner_kernel
def _fill_bounds(direction, manifold):
    """Fill the bounds of a direction's depth; return whether all of its patches are certified.

    The lower bound is also its `depth`.
    """
    low = high = 0.0
    is_certified = True
    for p in range(direction.first, direction.first + direction.patches):
        result = manifold.result[p]
        depth, highest = scale_of(result) * max(result.depth, 0.0), result.depth + result.gap
        low += depth * depth
        if result.status == BUDGET_SPENT:
            is_certified = False
            # Without any point found, the upper bound is not known either.
            depth = max(highest, 0.0) if highest > -math.inf else math.inf
        high += depth * depth
    direction.depth = direction.lowest = math.sqrt(low / direction.patches)
    direction.highest = math.sqrt(high / direction.patches)
    return is_certified


@inner_kernel
def search_direction(model, parameters, query, task, memory, space, workspace):
    """Search the depth of a direction; return whether it counts.

    A trial is a short search. If the depth is not certified then, the direction is *deferred*: its
    patches are not kept, and bounds of its depth are known.
    """
    manifold, direction = space.manifold, space.directions[task.number]
    direction.is_deferred = False
    if manifold.count[0].patches + MAX_PARTS > MAX_PATCHES:
        manifold.count[0].dropped += 1
        return False
    direction.first = manifold.count[0].patches
    direction.patches, has_room = _search_patches(
        model, parameters, query, task, memory, space, workspace
    )
    is_certified = _fill_bounds(direction, manifold) and has_room
    if not has_room:
        direction.highest = math.inf
    if task.is_trial and not is_certified and direction.depth <= task.ceiling:
        direction.is_deferred, direction.patches = True, 0
        return False
    if not has_room:
        manifold.count[0].dropped += 1
    for p in range(direction.first, direction.first + direction.patches):
        if may_touch(manifold.result[p]):
            manifold.count[0].dropped += 1
    # Facets that overlap along their own normals may be side by side along the mean normal.
    is_none = direction.depth == 0.0 and space.region.sums[task.number].deepest > query.lowered
    if is_none or direction.depth > task.ceiling:
        direction.patches = 0
        return False
    manifold.count[0].patches += direction.patches
    return True
