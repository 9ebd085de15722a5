"""The contact manifold between two convex polyhedra, whose way out is that of two geoms.

Each direction (`polyhedron_pair`) separates the bodies completely, so that the way out is the
smooth minimum of their depths (`response.potential`). A direction has one to four patches, as
between other meshes: see `directions`.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import clear, inner_kernel
from asperity._core.records import clear_record, copy_record
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_bvh import DIRECTIONS
from asperity.contact.manifold.direction_depth import DirectionTask, search_direction
from asperity.contact.manifold.overlap_region import add_piece, clip_piece
from asperity.contact.manifold.polyhedron_pair import (
    PolyhedronPair,
    fill_place_of_pair,
    fill_polyhedron_separations,
)
from asperity.contact.manifold.properties import (
    add_stiffness_rates,
    has_map,
    largest_scale,
    least_scale,
    properties_vary,
)
from asperity.contact.manifold.records import MAX_DIRECTIONS
from asperity.contact.manifold.region_gradient import add_moment_rates, add_piece_gradient
from asperity.contact.manifold.separation import (
    ABOUT,
    ALONG,
    EDGES,
    FARTHEST,
    cosine,
    is_beside_simpler,
    is_stood_for,
    smooth_step,
    smooth_step_slope,
)
from asperity.contact.response.potential import fill_potential
from asperity.contact.response.thinning import is_present, is_thinned_out
from asperity.contact.response.ways_out import RATIO
from asperity.geometry.frames import add_to_world, fill_origin

_LEVER = 0.01
"""Length that makes rotations of the tool comparable to translations [m]."""
_LONGEST = 1.1
"""Bound on the way out over the least depth: up to 1.02 among random polyhedra."""
_MIN_SHARE = 1e-6
"""Least share of a face in the region of a direction."""
_LEAST_COSINE = math.cos(math.radians(30.0))
"""Cosine to a direction below which a face has no more than that share."""


@inner_kernel
def _share(z, n):
    """Return the share of a face of B, normal z (3,), in a direction n (3,), and its derivative.

    It is positive for all faces, since at a sharp corner none may have a normal near n.
    """
    along = z[0] * n[0] + z[1] * n[1] + z[2] * n[2]
    x = (along - _LEAST_COSINE) / (1.0 - _LEAST_COSINE)
    return smooth_step(x) + _MIN_SHARE, smooth_step_slope(x) / (1.0 - _LEAST_COSINE)


@inner_kernel
def _fill_faces(table, query, count, region, faces_out):
    """Fill the integrals over the pieces on each face of B."""
    solids = table.polyhedra
    first = solids.first_face[query.second]
    for j in range(solids.first_face[query.second + 1] - first):
        clear_record(faces_out[j])
    for i in range(count):
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        piece = clip_piece(table, query, f, g, region)
        if piece[1] >= 3:
            sums = faces_out[solids.face_of[g] - first]
            add_piece(table, g, piece, query.raised, 1.0, region, sums)


@inner_kernel
def _fill_region(table, query, found, faces, sums_out):
    """Fill the integrals over the region of a separation: faces weighted by their shares.

    Two crossing edges, or a sphere, have a single deepest point: their region has no extent.
    """
    solids, deepest, at = table.polyhedra, sums_out.deepest, 0
    first = solids.first_face[query.second]
    clear_record(sums_out)
    sums_out.deepest = deepest
    for j in range(solids.first_face[query.second + 1] - first):
        share, sums = _share(solids.normals[first + j], found.normal)[0], faces[j]
        sums_out.volume += share * sums.volume
        for k in range(3):
            sums_out.first_moment[k] += share * sums.first_moment[k]
            sums_out.normal[k] += share * sums.normal[k]
        for k in range(6):
            sums_out.second_moment[k] += share * sums.second_moment[k]
    if found.kind >= EDGES:
        for j in range(3):
            for k in range(j, 3):
                moment = sums_out.first_moment[j] * sums_out.first_moment[k] / sums_out.volume
                sums_out.second_moment[at] = moment
                at += 1


@inner_kernel
def _rate_by_share(found, sums):
    """Return the derivative of the way out by the share of a face with these integrals."""
    total = found.volume_rate * sums.volume
    for k in range(3):
        total += found.first_rate[k] * sums.first_moment[k]
    for k in range(6):
        total += found.second_rate[k] * sums.second_moment[k]
    return total


@inner_kernel
def _free_slot(n, directions):
    """Return the number of the unused direction nearest to n (3,); -1 if all are used.

    Friction and the last deepest points are stored under this number.
    """
    best, most = np.int64(-1), -np.inf
    for d in range(MAX_DIRECTIONS):
        along = -2.0  # the others, after the six axes
        if d < DIRECTIONS:
            along = n[d // 2] if d % 2 == 0 else -n[d // 2]
        if directions[d].patches == 0 and along > most:
            best, most = d, along
    return best


@inner_kernel
def _nearest_unsearched(rows, used, least):
    """Return the row with the least separation of those to be searched yet; -1 for none."""
    at = np.int64(-1)
    for i in range(used):
        depth = rows[i].depth
        is_nearer = depth != depth and (at < 0 or rows[i].gap < rows[at].gap)
        if is_nearer and not is_thinned_out(rows, used, i, least):
            at = i
    return at


@inner_kernel
def _simpler(rows, used, at, least):
    """Return the nearest row of a simpler kind that may represent `at`, if unsearched; else `at`.

    A row that is thinned out represents none.
    """
    found, best = rows[at], np.int64(at)
    for j in range(at):
        other = rows[j]
        is_near = other.gap - other.rough <= ABOUT * (found.gap + found.rough)
        is_nearest = best == at or other.gap < rows[best].gap
        is_simpler = other.kind < found.kind and other.depth != -np.inf
        is_simpler = is_simpler and cosine(other, found) >= ALONG
        if is_simpler and is_near and is_nearest and not is_thinned_out(rows, used, j, least):
            best = np.int64(j)
    depth = rows[best].depth
    return best if depth != depth else np.int64(at)


@inner_kernel
def _depth_that_counts(rows, used, at, least):
    """Return the depth from which on row `at` does not count [m].

    Beyond the way out it is too deep; and beside a simpler direction that is about as deep, or not
    much deeper, it has no weight (`response.potential`).
    """
    found, most = rows[at], RATIO * _LONGEST * least
    for j in range(at):
        other = rows[j]
        is_simpler = other.kind < found.kind and other.depth > 0.0
        stands = is_simpler and cosine(other, found) >= ALONG and is_present(rows, used, j, least)
        if stands and not is_beside_simpler(rows, 0, j):
            most = min(most, other.depth / ABOUT)
    return most


@inner_kernel
def _keep_deep_rows(rows, used):
    """Move the rows with a positive depth to the front; return their number."""
    kept = 0
    for i in range(used):
        if rows[i].depth > 0.0:
            if kept != i:
                copy_record(rows[kept], rows[i])
            kept += 1
    return kept


@inner_kernel
def find_polyhedron_separations(table, query, usual, space):
    """Fill `space.polyhedra` with the directions in which one polyhedron may leave the other.

    Returns the largest overlap of facets along their own normals that can matter for a direction
    that counts [m]; 0 where the bodies are apart.
    """
    transform, centre = stack_array((3, 4)), stack_array((3,))
    fill_place_of_pair(query, transform, centre)
    a, b, rows = query.first, query.second, space.polyhedra.rows
    rough = max(table.raised[a], table.lowered[a]) + max(table.raised[b], table.lowered[b])
    wide = largest_scale(table, query, usual) / least_scale(table, query, usual)
    pair = PolyhedronPair(table.polyhedra, a, b, transform, centre, rough, wide)
    used, least = fill_polyhedron_separations(pair, space.polyhedra.edges, rows), np.inf
    space.polyhedra.used[0] = used
    for i in range(used):
        least = min(least, rows[i].gap)
    return _LONGEST * FARTHEST * wide * (least + rough) + rough if used > 0 else 0.0


@inner_kernel
def polyhedron_way_out(model, parameters, query, count, memory, space, workspace):
    """Return the way out of a convex polyhedron [m]; fill `space.directions` with their rates.

    Only those separations of `find_polyhedron_separations` that count are kept.

    Parameters
    ----------
    model : MeshModel
    parameters : ForceParameters
    query : BodyQuery
    count : int
        Number of facet pairs.
    memory : MeshMemory
        Only read.
    space : FacetSpace
    workspace : Workspace
    """
    table, rows, region = model.facets, space.polyhedra.rows, space.region
    used, least, rough = space.polyhedra.used[0], np.inf, rows[0].rough
    nearest, deepest = np.inf, -np.inf
    soft = least_scale(table, query, parameters.stiffness)
    for d in range(DIRECTIONS):
        deepest = max(deepest, region.sums[d].deepest)
    for d in range(MAX_DIRECTIONS):
        clear_record(space.directions[d])
        region.sums[d].deepest = deepest
    space.polyhedra.used[0] = 0
    if deepest == -np.inf:  # no facets are near each other
        return 0.0
    for i in range(used):
        rows[i].depth, rows[i].gap_scale = np.nan, soft
        nearest = min(nearest, (rows[i].gap - rough) * soft)
    _fill_faces(table, query, count, region, space.polyhedra.faces)
    at = _nearest_unsearched(rows, used, least)
    while at >= 0:
        for _ in range(2):  # from edges to a face of A, and from that to one of B
            at = _simpler(rows, used, at, least)
        found = rows[at]
        found.depth = -np.inf
        is_far = (found.gap - rough) * soft >= _LONGEST * FARTHEST * max(least, nearest)
        if not is_far and not is_stood_for(rows, 0, at, least):
            d = _free_slot(found.normal, space.directions)
            if d < 0:
                space.manifold.count[0].dropped += 1
                break  # all others are farther
            direction, found.owner = space.directions[d], d
            for k in range(3):
                direction.normal[k] = found.normal[k]
            _fill_region(table, query, found, space.polyhedra.faces, region.sums[d])
            ceiling = _depth_that_counts(rows, used, at, least)
            task = DirectionTask(d, count, ceiling, -1, False)
            counts = search_direction(model, parameters, query, task, memory, space, workspace)
            if direction.depth == 0.0 and (least == np.inf or counts):
                return 0.0
            if counts:
                found.depth = direction.depth
                least = min(least, direction.depth)
        at = _nearest_unsearched(rows, used, least)
    used = _keep_deep_rows(rows, used)
    if used == 0:
        return 0.0
    space.polyhedra.used[0] = used
    way_out = fill_potential(rows, used, 1, _LEVER, space.polyhedra.ways, space.polyhedra.rates)
    for i in range(used):
        space.directions[rows[i].owner].rate = rows[i].weight
    return way_out


@inner_kernel
def _add_share_rates(table, query, space):
    """Add the rates of the way out by the directions, through the shares of B's faces."""
    solids, faces = table.polyhedra, space.polyhedra.faces
    first = solids.first_face[query.second]
    for j in range(space.polyhedra.used[0]):
        direction = space.directions[space.polyhedra.rows[j].owner]
        if direction.volume_rate == 0.0:
            continue
        for f in range(solids.first_face[query.second + 1] - first):
            z = solids.normals[first + f]
            rate = _share(z, direction.normal)[1] * _rate_by_share(direction, faces[f])
            for k in range(3):
                direction.turn[k] += rate * z[k]


@inner_kernel
def _add_region_gradient(table, query, count, centre, space, gradient_io):
    """Add the gradient of the way out through the pieces of the regions.

    `centre` (3,) is the point about which the tool turns, B's frame [m].
    """
    region, q = space.region, stack_array((6,))
    for i in range(count):
        f, g = region.facets.pairs[i, 0], region.facets.pairs[i, 1]
        piece = clip_piece(table, query, f, g, region)
        if piece[1] < 3:
            continue
        clear(q)
        q[0] = region.rates[i]
        for j in range(space.polyhedra.used[0]):
            direction = space.directions[space.polyhedra.rows[j].owner]
            if direction.volume_rate != 0.0:
                share = _share(table.axes[g, 2], direction.normal)[0]
                add_moment_rates(table, g, share, direction, q)
        add_piece_gradient(table, (f, g), piece, query.raised, q, centre, region, gradient_io)


@inner_kernel
def add_polyhedron_rest(table, query, count, parameters, way_out, space, rest_io):
    """Add to `rest_io` (6,) the gradient but for the depths, that of k included, world axes.

    See `polyhedron_way_out`.
    """
    centre, gradient = stack_array((3,)), stack_array((6,))
    fill_origin(query.frame_b, centre)
    rows, rates, is_split = space.polyhedra.rows, space.region.rates, False
    for i in range(count):
        rates[i] = 0.0
    for e in range(6):
        gradient[e] = space.polyhedra.rates[e]
    for j in range(space.polyhedra.used[0]):
        is_split = is_split or space.directions[rows[j].owner].volume_rate != 0.0
    varies = properties_vary(table, query) and not has_map(table, query)
    if varies:
        stiffness = space.stiffness[query.body]
        add_stiffness_rates(table, count, parameters, stiffness, way_out, space.region)
    if is_split:
        _add_share_rates(table, query, space)
    if is_split or varies:
        _add_region_gradient(table, query, count, centre, space, gradient)
    for j in range(space.polyhedra.used[0]):
        turn = space.directions[rows[j].owner].turn
        for e in range(6):
            for k in range(3):
                gradient[e] += turn[k] * rows[j].normal_rate[k, e]
    add_to_world(query.frame_b, gradient, rest_io)
