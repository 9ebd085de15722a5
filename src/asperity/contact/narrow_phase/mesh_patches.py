"""Surface patches of facing facets, and the pairs of patches that may overlap."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_pairs import are_convex, flattest
from asperity.contact.narrow_phase.facet_patch import fill_facet_patch
from asperity.contact.narrow_phase.geom_depth import fill_geom_patches
from asperity.contact.narrow_phase.incumbent import TIE
from asperity.contact.narrow_phase.patch_pair import pair_shift
from asperity.contact.narrow_phase.steep_plane import STEEPEST
from asperity.contact.narrow_phase.warm_start import ON_BORDER


class FacetQuery(NamedTuple):
    """Facets of two bodies that may touch, and the direction in which their depth is searched."""

    facet_pairs: int
    """Number of facet pairs in the workspace."""
    direction: int
    """Direction whose facets of B are used; -1: all."""
    normal: NDArray[np.float64]
    """n in B's frame, (3,)."""
    frame: NDArray[np.float64]
    """Axes u, v, n of the contact frame in its rows, world axes, (3, 3)."""
    frame_a: NDArray[np.float64]
    """Rotation and translation of A from the contact's origin, world axes, (3, 4) [m]."""
    frame_b: NDArray[np.float64]
    """Rotation and translation of B, (3, 4) [m]."""


class CandidateFilter(NamedTuple):
    """Selection of the listed pairs of facets that become candidates."""

    listed: int
    """Number of listed pairs."""
    made_a: int
    """Number of patches of A that exist already."""
    made_b: int
    depth: float
    """Pairs that cannot be deeper are dropped [m]."""
    place: NDArray[np.float64]
    """Points (u, v) [m], (n, 2)."""
    places: int
    """Number of points, at least one of which a pair must cover; 0: no condition."""


class _View(NamedTuple):
    """One body relative to the contact frame."""

    side: int
    """0 for A, 1 for B."""
    frame: NDArray[np.float64]
    """Axes of the contact frame in its rows, world axes; the third points out of the body."""
    body: NDArray[np.float64]
    """Rotation and translation of the body, world axes, (3, 4)."""
    rotation: NDArray[np.float64]
    """From the body's frame to the contact frame, (3, 3)."""
    translation: NDArray[np.float64]
    """(3,) [m]."""
    fades: bool
    """Whether facets without a texture drop out gradually, unless both bodies are convex."""


@inner_kernel
def _fill_transform(frame, body, rotation_out, translation_out):
    """Fill the transform from a body's frame to the contact frame."""
    for i in range(3):
        translation_out[i] = 0.0
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += frame[i, k] * body[k, j]
            rotation_out[i, j] = total
            translation_out[i] += frame[i, j] * body[j, 3]


@inner_kernel
def _fill_transform_with_offset(frame, body, axes_out):
    """Fill the transform (3, 4) from a body's frame to the contact frame."""
    for i in range(3):
        axes_out[i, 3] = 0.0
        for j in range(3):
            axes_out[i, j] = 0.0
            for k in range(3):
                axes_out[i, j] += frame[i, k] * body[k, j]
            axes_out[i, 3] += frame[i, j] * body[j, 3]


@inner_kernel
def _patches_of_facet(table, geometry, f, view, made, patches, space):
    """Return the range of a facet's patches, the number made so far, and whether there was room.

    Patches are made at their first use in a query. A facet of a round geom has all patches of that
    geom.
    """
    query_number, geom = space.clock[0], table.geom[f]
    slot = space.geom_slots[geom] if geom >= 0 else space.slots[view.side, f]
    if slot.made == query_number:
        return slot.first, slot.end, made, True
    if made + (3 if geom >= 0 else 1) > patches.shape[0]:
        return made, made, made, False
    slot.first, slot.made = made, query_number
    if geom >= 0:
        made = fill_geom_patches(geometry, geom, view.frame, view.body, patches, made)
    else:
        rotation, translation = view.rotation, view.translation
        fill_facet_patch(table, geometry, f, rotation, translation, view.fades, patches[made])
        made += 1
    slot.end = made
    return slot.first, slot.end, made, True


@small_kernel
def _may_be_searched(table, f, cosine, least):
    """Return whether a facet at this cosine to the direction is searched.

    `least` is `flattest` of the bodies, for facets without a texture.
    """
    # Facets of round geoms are replaced by exact patches.
    has_texture = table.top[f] != 0.0
    return cosine >= (STEEPEST if has_texture else least) or table.geom[f] >= 0


@small_kernel
def _faces_direction(table, f, g, n, space):
    """Return whether both facets of a pair face the direction n (B's frame)."""
    along_a = along_b = 0.0
    for k in range(3):
        along_b += table.axes[g, 2, k] * n[k]
        along_a -= space.region.facets.placed[f].normal[k] * n[k]
    least = flattest(table, table.body[f], table.body[g])
    return _may_be_searched(table, f, along_a, least) and _may_be_searched(table, g, along_b, least)


@small_kernel
def _are_apart(textures, patch, other):
    """Return whether the projections of two patches along n are disjoint."""
    shift, one, two = pair_shift(textures, patch, other), patch.extent, other.extent
    return (
        one[0] > two[1] + shift
        or one[1] < two[0] - shift
        or one[2] > two[3] + shift
        or one[3] < two[2] - shift
    )


@small_kernel
def _fill_common_extent(patch, other, candidate):
    """Fill the common extent in (u, v) of two planes, one of them rough; nan for other patches."""
    rough = patch.texture >= 0 or other.texture >= 0
    planes = patch.bulge == 0.0 and other.bulge == 0.0
    for i in range(0, 4, 2):
        low, high = -np.inf, np.inf
        for either in (patch, other):
            if either.extent[1] > either.extent[0]:  # set for facets only
                low, high = max(low, either.extent[i]), min(high, either.extent[i + 1])
        candidate.extent[i] = low if planes and rough else np.nan
        candidate.extent[i + 1] = high


@small_kernel
def _is_listed(candidates, count, number):
    """Return whether a pair of patches is among the candidates."""
    is_listed = False
    for j in range(count):
        is_listed = is_listed or candidates[j].number == number
    return is_listed


@inner_kernel
def _fill_extent(corners, sides, axes, sign, slot):
    """Fill the extent of a facet in the contact frame, and the height of its highest corner.

    `corners` are in B's frame, `axes` (3, 4) is the transform from there to the contact frame;
    `sign` is that of the outward z.
    """
    u0 = v0 = np.inf
    u1 = v1 = top = -np.inf
    for c in range(sides):
        x, y, z = corners[c, 0], corners[c, 1], corners[c, 2]
        u = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z + axes[0, 3]
        v = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z + axes[1, 3]
        w = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z + axes[2, 3]
        u0, u1, v0, v1 = min(u0, u), max(u1, u), min(v0, v), max(v1, v)
        top = max(top, sign * w)
    slot.extent[0], slot.extent[1], slot.extent[2], slot.extent[3] = u0, u1, v0, v1
    slot.top = top


@small_kernel
def _raise_by_texture(textures, table, texture, f, n, slot):
    """Raise a facet's top by its texture, and fill its shift; `n` (3,) is z in its body's frame."""
    slot.shift = 0.0
    if texture < 0:
        return
    w, half, axes = table.w[f], table.half[f], table.axes[f]
    along = lateral = 0.0
    least = -half[0] * abs(w[3] * n[0] + w[4] * n[1] + w[5] * n[2])
    least -= half[1] * abs(w[6] * n[0] + w[7] * n[1] + w[8] * n[2])
    for k in range(3):
        least += w[k] * n[k]
        along += axes[2, k] * n[k]
        lateral += abs(w[k] - axes[2, k])
    # Seen from behind, valleys are raised.
    slot.top += max(table.top[f], 0.0) if least >= 0.0 else np.inf
    if table.unit[f] == 1.0:
        lateral = min(lateral + math.sqrt(max(1.0 - along * along, 0.0)), 1.0)
    else:
        lateral = 1.0
    slot.shift = textures.maps[texture].max_abs_surface * lateral


@small_kernel
def _facets_are_apart(one, other):
    """Return whether the projections of two facets along n are clearly disjoint."""
    shift = one.shift + other.shift + ON_BORDER
    return (
        one.extent[0] > other.extent[1] + shift
        or one.extent[1] < other.extent[0] - shift
        or one.extent[2] > other.extent[3] + shift
        or one.extent[3] < other.extent[2] - shift
    )


@inner_kernel
def list_pairs(model, query, space):
    """Fill `space.listed` with the facet pairs that may touch along n; return their number.

    This needs no patches: most facets of a round tool are far from the deepest point.
    """
    textures, table, geometry = model
    space.clock[0] += 1
    number, axes, n_a = space.clock[0], stack_array((3, 4)), stack_array((3,))
    _fill_transform_with_offset(query.frame, query.frame_b, axes)
    for k in range(3):
        n_a[k] = 0.0
        for i in range(3):
            n_a[k] -= query.frame[2, i] * query.frame_a[i, k]
    facets, listed, count = space.region.facets, space.listed, np.int64(0)
    for i in range(query.facet_pairs):
        f, g = facets.pairs[i, 0], facets.pairs[i, 1]
        if not _faces_direction(table, f, g, query.normal, space):
            continue
        if query.direction >= 0 and table.shares[g, query.direction] == 0.0:
            continue
        if table.geom[f] < 0 and table.geom[g] < 0:
            one, other = space.slots[0, f], space.slots[1, g]
            if one.seen != number:
                one.seen = number
                _fill_extent(facets.corners[f], table.sides[f], axes, -1.0, one)
                texture = geometry.texture[table.surface[f]]
                _raise_by_texture(textures, table, texture, f, n_a, one)
            if other.seen != number:
                other.seen = number
                _fill_extent(table.points[g], table.sides[g], axes, 1.0, other)
                texture = geometry.texture[table.surface[g]]
                _raise_by_texture(textures, table, texture, g, query.normal, other)
            if _facets_are_apart(one, other):
                continue
        listed[count] = i
        count += 1
    return count


@small_kernel
def _passes_filter(one, other, criteria):
    """Return whether two facets may be as deep as a filter demands, and cover one of its points."""
    if one.top + other.top <= criteria.depth - TIE:
        return False
    if criteria.places == 0:
        return True
    holds = False
    for p in range(criteria.places):
        u, v = criteria.place[p, 0], criteria.place[p, 1]
        holds = holds or (_is_over(one.extent, u, v) and _is_over(other.extent, u, v))
    return holds


@small_kernel
def _is_over(extent, u, v):
    """Return whether (u, v) is within an extent, or at its border."""
    within_u = extent[0] - ON_BORDER <= u and u <= extent[1] + ON_BORDER
    return within_u and extent[2] - ON_BORDER <= v and v <= extent[3] + ON_BORDER


@inner_kernel
def collect_candidates(model, query, criteria, memory, space):
    """Fill `memory.candidates` with the listed pairs that pass a filter, and their patches.

    Returns the numbers of candidates and of patches of A and of B, and whether there was room for
    all. A pair's number is A's patch times the room for patches, plus B's patch.
    """
    textures, table, geometry = model
    stride, query_number = memory.patches_b.shape[0], space.clock[0]
    frame, down = query.frame, stack_array((3, 3))
    rotation_a, translation_a = stack_array((3, 3)), stack_array((3,))
    rotation_b, translation_b = stack_array((3, 3)), stack_array((3,))
    for k in range(3):
        down[0, k], down[1, k], down[2, k] = frame[0, k], frame[1, k], -frame[2, k]
    _fill_transform(down, query.frame_a, rotation_a, translation_a)
    _fill_transform(frame, query.frame_b, rotation_b, translation_b)
    fades = False
    if criteria.listed > 0:
        first = space.listed[0]
        f, g = space.region.facets.pairs[first, 0], space.region.facets.pairs[first, 1]
        fades = not are_convex(table, table.body[f], table.body[g])
    view_a = _View(np.int64(0), down, query.frame_a, rotation_a, translation_a, fades)
    view_b = _View(np.int64(1), frame, query.frame_b, rotation_b, translation_b, fades)
    made_a, made_b, count = criteria.made_a, criteria.made_b, np.int64(0)
    has_room = True
    candidates, facets = memory.candidates, space.region.facets.pairs
    for i in range(criteria.listed):
        f, g = facets[space.listed[i], 0], facets[space.listed[i], 1]
        of_geom = table.geom[f] >= 0 or table.geom[g] >= 0
        # Most patches exist already; this avoids a call with hundreds of arguments.
        slot_a, slot_b = space.slots[0, f], space.slots[1, g]
        if of_geom:
            if criteria.places > 0:
                continue
        elif not _passes_filter(slot_a, slot_b, criteria):
            continue
        first_a, end_a, first_b, end_b = slot_a.first, slot_a.end, slot_b.first, slot_b.end
        if table.geom[f] >= 0 or slot_a.made != query_number:
            first_a, end_a, made_a, fits = _patches_of_facet(
                table, geometry, f, view_a, made_a, memory.patches_a, space
            )
            has_room = has_room and fits
        if table.geom[g] >= 0 or slot_b.made != query_number:
            first_b, end_b, made_b, fits = _patches_of_facet(
                table, geometry, g, view_b, made_b, memory.patches_b, space
            )
            has_room = has_room and fits
        for a in range(first_a, end_a):
            for b in range(first_b, end_b):
                number = a * stride + b
                if of_geom and _is_listed(candidates, count, number):
                    continue
                patch, other = memory.patches_a[a], memory.patches_b[b]
                if not of_geom and _are_apart(textures, patch, other):
                    continue
                if count == candidates.shape[0]:
                    has_room = False
                    continue
                candidates[count].number = number
                _fill_common_extent(patch, other, candidates[count])
                count += 1
    return count, made_a, made_b, has_room
