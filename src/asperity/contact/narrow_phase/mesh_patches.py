"""Surface patches of facets that face each other, and the pairs of them that may overlap."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.facet_patch import fill_facet_patch
from asperity.contact.narrow_phase.geom_depth import fill_geom_patches
from asperity.contact.narrow_phase.patch_pair import pair_shift
from asperity.contact.narrow_phase.surface_patch import FLATTEST


class FacetQuery(NamedTuple):
    """Facets of two bodies that may touch, and the direction in which their depth is searched."""

    facet_pairs: int
    """Number of pairs of facets in the workspace."""
    direction: int
    """Direction whose facets of B count; -1: all."""
    normal: NDArray[np.float64]
    """n in B's frame, (3,)."""
    frame: NDArray[np.float64]
    """Axes u, v, n of the contact frame in its rows, world axes, (3, 3)."""
    frame_a: NDArray[np.float64]
    """Rotation and translation of A from the contact's origin, world axes, (3, 4) [m]."""
    frame_b: NDArray[np.float64]
    """Rotation and translation of B, (3, 4) [m]."""


class _View(NamedTuple):
    """One body as seen from the contact frame."""

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
def _patches_of_facet(table, geometry, f, view, made, patches, space):
    """Return the range of a facet's patches, how many are made, and whether there was room.

    Patches are made when they are first needed in a query. A facet of a round geom stands for all
    patches of that geom.
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
        fill_facet_patch(table, geometry, f, view.rotation, view.translation, patches[made])
        made += 1
    slot.end = made
    return slot.first, slot.end, made, True


@small_kernel
def _faces_direction(table, f, g, n, space):
    """Return whether both facets of a pair face the direction n (B's frame)."""
    along_a = along_b = 0.0
    for k in range(3):
        along_b += table.axes[g, 2, k] * n[k]
        along_a -= space.region.facets.placed[f].normal[k] * n[k]
    # Exact patches of round geoms decide for themselves.
    return (along_b >= FLATTEST or table.geom[g] >= 0) and (
        along_a >= FLATTEST or table.geom[f] >= 0
    )


@small_kernel
def _are_apart(textures, patch, other):
    """Return whether two facets lie beside each other, as seen along n."""
    shift, one, two = pair_shift(textures, patch, other), patch.extent, other.extent
    return (
        one[0] > two[1] + shift
        or one[1] < two[0] - shift
        or one[2] > two[3] + shift
        or one[3] < two[2] - shift
    )


@small_kernel
def _fill_common_extent(patch, other, candidate):
    """Fill where in (u, v) both patches may be, if they are planes and one is rough; else nan."""
    rough = patch.texture >= 0 or other.texture >= 0
    planes = patch.bulge == 0.0 and other.bulge == 0.0
    for i in range(0, 4, 2):
        low, high = -np.inf, np.inf
        for either in (patch, other):
            if either.extent[1] > either.extent[0]:  # else it is no facet's
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
def collect_candidates(textures, table, geometry, query, memory, space):
    """Fill the patches of all facets of a query, and `memory.candidates` with pairs that may meet.

    Returns how many candidates there are, how many patches of A, and whether there was room for
    all. A pair's number is that of A's patch times the room for patches, plus that of B's.
    """
    space.clock[0] += 1
    stride, query_number = memory.patches_b.shape[0], space.clock[0]
    frame, down = query.frame, stack_array((3, 3))
    rotation_a, translation_a = stack_array((3, 3)), stack_array((3,))
    rotation_b, translation_b = stack_array((3, 3)), stack_array((3,))
    for k in range(3):
        down[0, k], down[1, k], down[2, k] = frame[0, k], frame[1, k], -frame[2, k]
    _fill_transform(down, query.frame_a, rotation_a, translation_a)
    _fill_transform(frame, query.frame_b, rotation_b, translation_b)
    view_a = _View(np.int64(0), down, query.frame_a, rotation_a, translation_a)
    view_b = _View(np.int64(1), frame, query.frame_b, rotation_b, translation_b)
    made_a = made_b = count = 0
    has_room = True
    candidates, facets = memory.candidates, space.region.facets.pairs
    for i in range(query.facet_pairs):
        f, g = facets[i, 0], facets[i, 1]
        if not _faces_direction(table, f, g, query.normal, space):
            continue
        if query.direction >= 0 and table.shares[g, query.direction] == 0.0:
            continue
        # Most patches exist already, and a call passes hundreds of numbers.
        slot_a, slot_b = space.slots[0, f], space.slots[1, g]
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
        of_geom = table.geom[f] >= 0 or table.geom[g] >= 0
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
    return count, made_a, has_room
