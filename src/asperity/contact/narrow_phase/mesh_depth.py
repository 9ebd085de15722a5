"""Depths of one contact between bodies of facets: charts, pairs of charts, patches, searches."""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, kernel, small_kernel
from asperity._core.records import copy_record
from asperity._core.stack import stack_array
from asperity.contact.broad_phase.facet_pairs import between_bodies, facing_pairs
from asperity.contact.manifold.overlap_region import piece
from asperity.contact.manifold.split import bound_by, split_lines
from asperity.contact.narrow_phase.best_first import sieve
from asperity.contact.narrow_phase.bounds.texture import sideways
from asperity.contact.narrow_phase.branch_and_bound import TIE
from asperity.contact.narrow_phase.facet_patch import facet_chart
from asperity.contact.narrow_phase.geom_depth import frame_round, geom_charts
from asperity.contact.narrow_phase.incumbent import BEST, TIES, UPPER
from asperity.contact.narrow_phase.overlap import OVERLAP_SIZE, F
from asperity.contact.narrow_phase.penetration import LOOK_COVERS, PAIR, begin, fill_result
from asperity.contact.narrow_phase.surface_patch import COVERS, FLATTEST, ROWS, TEXTURE, C
from asperity.contact.narrow_phase.warm_start import depths_before, from_lines, keep_promising

_ANYWHERE = 1e3


@inner_kernel
def _turn_into(frame, body, turn_out, shift_out):
    """Fill the way from a body's frame into the contact frame."""
    for i in range(3):
        shift_out[i] = 0.0
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += frame[i, k] * body[k, j]
            turn_out[i, j] = total
            shift_out[i] += frame[i, j] * body[j, 3]


@inner_kernel
def _slots_of(
    table, geometry, f, side, frame, body, turn, shift, made, charts, space
):  # fmt: skip
    """Return first chart, number of charts, of what a facet stands for, and how many are made.

    Charts are made when they are first asked for. Without room for them there are none.
    """
    clock, geom = space.clock[0], table.geom[f]
    if geom >= 0:
        if space.geom_slots[2, geom] != clock:
            if made + 3 > charts.shape[0]:
                return made, made, made, False
            after = geom_charts(geometry, geom, frame, body, charts, made)
            space.geom_slots[0, geom], space.geom_slots[1, geom] = made, after - made
            space.geom_slots[2, geom] = clock
            made = after
        first = space.geom_slots[0, geom]
        return first, first + space.geom_slots[1, geom], made, True
    if space.slots[2 + side, f] != clock:
        if made == charts.shape[0]:
            return made, made, made, False
        owner = table.body[f]
        facet_chart(
            table, f, turn, shift, geometry.texture[owner], table.mapping[owner],
            geometry.origin[owner], charts[made],
        )  # fmt: skip
        space.slots[side, f], space.slots[2 + side, f] = made, clock
        made += 1
    first = space.slots[side, f]
    return first, first + 1, made, True


@small_kernel
def _seen(table, facings, i, n, space):
    """Return whether both facets of a pair are seen along n (B's frame)."""
    g, f = facings[i, 1], facings[i, 0]
    along_a = along_b = 0.0
    for k in range(3):
        along_b += table.axes[g, 2, k] * n[k]
        along_a -= space.footprint.facing.normals[f, k] * n[k]
    # Exact charts of round geoms decide for themselves.
    return (along_b >= FLATTEST or table.geom[g] >= 0) and (
        along_a >= FLATTEST or table.geom[f] >= 0
    )


@small_kernel
def _apart(textures, cx, cy):
    """Return whether two facets, seen along n, lie beside each other."""
    shift = sideways(textures, cx) + sideways(textures, cy)
    return (
        cx[COVERS] > cy[COVERS + 1] + shift
        or cx[COVERS + 1] < cy[COVERS] - shift
        or cx[COVERS + 2] > cy[COVERS + 3] + shift
        or cx[COVERS + 3] < cy[COVERS + 2] - shift
    )


@small_kernel
def _note_covers(cx, cy, look_out):
    """Fill where, in (u, v), both charts may be, if they are planes and one is rough; else nan."""
    rough = cx[TEXTURE] >= 0.0 or cy[TEXTURE] >= 0.0
    planes = cx[C] == 0.0 and cy[C] == 0.0
    for i in range(0, 4, 2):
        low, high = -np.inf, np.inf
        for chart in (cx, cy):
            if chart[COVERS + 1] > chart[COVERS]:  # else it is no facet's
                low, high = max(low, chart[COVERS + i]), min(high, chart[COVERS + i + 1])
        look_out[LOOK_COVERS + i] = low if planes and rough else np.nan
        look_out[LOOK_COVERS + i + 1] = high


@inner_kernel
def pairs_of_charts(
    textures, table, geometry, count, direction, n, frame, body_a, body_b, work_space, space
):  # fmt: skip
    """Make the charts of all facing facets as seen along n, and note which pairs of them meet.

    Fills their numbers, and what they cover, in `work_space.looks`; returns how many pairs, the
    number of charts of A and the stride of the pairs' numbers, and whether there was room for all.

    Parameters
    ----------
    count : int
        How many rows of `space.footprint.facing.pairs` there are.
    direction : int
        Facets of B count that count for this direction; -1: all.
    n : (3,) array
        In B's frame.
    frame : (3, 3) array
        Rows u, v, n in world axes.
    body_a, body_b : (3, 4) arrays
        As seen from the contact's origin.
    """
    space.clock[0] += 1
    stride = work_space.charts_b.shape[0]
    turn_a, shift_a = space.frames[0, :, :3], space.frames[0, :, 3]
    turn_b, shift_b = space.frames[1, :, :3], space.frames[1, :, 3]
    down = space.frames[2, :, :3]
    for k in range(3):
        down[0, k], down[1, k], down[2, k] = frame[0, k], frame[1, k], -frame[2, k]
    _turn_into(down, body_a, turn_a, shift_a)
    _turn_into(frame, body_b, turn_b, shift_b)
    made_a = made_b = pairs = 0
    enough = True
    facings = space.footprint.facing.pairs
    for i in range(count):
        if not _seen(table, facings, i, n, space):
            continue
        f, g = facings[i, 0], facings[i, 1]
        if direction >= 0 and table.shares[g, direction] == 0.0:
            continue
        # Most have been made: a call hands over hundreds of numbers.
        first_a = space.slots[0, f]
        last_a = first_a + 1
        if table.geom[f] >= 0 or space.slots[2, f] != space.clock[0]:
            first_a, last_a, made_a, fits = _slots_of(
                table, geometry, f, 0, down, body_a, turn_a, shift_a, made_a, work_space.charts_a,
                space,
            )  # fmt: skip
            enough = enough and fits
        first_b = space.slots[1, g]
        last_b = first_b + 1
        if table.geom[g] >= 0 or space.slots[3, g] != space.clock[0]:
            first_b, last_b, made_b, fits = _slots_of(
                table, geometry, g, 1, frame, body_b, turn_b, shift_b, made_b,
                work_space.charts_b, space,
            )  # fmt: skip
            enough = enough and fits
        shared = table.geom[f] >= 0 or table.geom[g] >= 0
        for a in range(first_a, last_a):
            for b in range(first_b, last_b):
                number = a * stride + b
                known = False
                if shared:
                    for j in range(pairs):
                        known = known or work_space.looks[j, PAIR] == number
                if known:
                    continue
                cx, cy = work_space.charts_a[a], work_space.charts_b[b]
                if not shared and _apart(textures, cx, cy):
                    continue
                if pairs == work_space.looks.shape[0]:
                    enough = False
                    continue
                look = work_space.looks[pairs]
                look[PAIR] = number
                _note_covers(cx, cy, look)
                pairs += 1
    return pairs, made_a, stride, enough


@inner_kernel
def patch_depths(
    textures, sums, pairs, made_a, stride, u, v, n, frame, body_a, body_b, radius, guess, tolerance,
    max_nodes, work_space, space, results_out,
):  # fmt: skip
    """Search the patches of one direction; fill a row of `results_out` for each.

    Returns how many patches there are: 1, 2 or 4. One that does not touch has a depth of -inf.

    Parameters
    ----------
    u, v : (3,) arrays
        Axes of the tangent plane in B's frame;
    n : (3,) array
        the normal in world axes.
    guess : (4, 3) array
        Last deepest places in A's frame, nan if unknown: they move with its peaks.
    """
    charts, lines = work_space.charts_a, space.lines
    first, second = split_lines(sums, u, v, radius, lines)
    ways_1, ways_2 = (2 if first else 1), (2 if second else 1)
    off_u = off_v = 0.0
    for k in range(3):
        off_u += frame[0, k] * body_b[k, 3]
        off_v += frame[1, k] * body_b[k, 3]
    for k in range(2):
        lines[k, 2] -= lines[k, 0] * off_u + lines[k, 1] * off_v
    places, parts, depths = stack_array((4, 2)), stack_array((4, 2)), stack_array((4,))
    ways = ways_1 * ways_2
    for which in range(ways):
        places[which, 0], places[which, 1] = _guess(guess[which], frame, body_a)
        parts[which, 0] = _side(first, which % ways_1)
        parts[which, 1] = _side(second, which // ways_1)
    depths_before(
        textures, pairs, stride, places[:ways], parts[:ways], lines, radius, work_space, depths
    )  # fmt: skip
    best, enough = np.int64(0), depths[0]
    for which in range(1, ways):
        enough = min(enough, depths[which])
        best = which if depths[which] > depths[best] else best
    pairs = keep_promising(textures, pairs, stride, max(enough, 0.0), work_space)
    # The deepest place of all is that of every part that it lies in.
    _begin(work_space, max_nodes, enough)
    sieve(
        textures, stride, pairs, places[best, 0], places[best, 1], tolerance, work_space, space,
        np.int64(0),
    )  # fmt: skip
    fill_result(textures, stride, n, tolerance, work_space, results_out[0])
    if ways == 1 or results_out[0].depth == -math.inf:
        return 1
    single, at_1, at_2 = _single_place(work_space, stride, lines)
    for which in range(ways - 1, -1, -1):
        sign_1, sign_2 = parts[which, 0], parts[which, 1]
        within = sign_1 * at_1 >= -radius and sign_2 * at_2 >= -radius
        out = results_out[which]
        if single and within:
            copy_record(out, results_out[0])
            continue
        added = np.int64(0)
        for k in range(2):
            if (k == 0 and first) or (k == 1 and second):
                sign = sign_1 if k == 0 else sign_2
                for a in range(made_a):
                    bound_by(
                        charts[a], int(charts[a, ROWS]), sign * lines[k, 0], sign * lines[k, 1],
                        sign * lines[k, 2], radius,
                    )  # fmt: skip
                added += 1
        _begin(work_space, max_nodes / 2, enough)
        sieve(
            textures, stride, pairs, places[which, 0], places[which, 1], tolerance, work_space,
            space, added,
        )  # fmt: skip
        fill_result(textures, stride, n, tolerance, work_space, out)
        for a in range(made_a):
            charts[a, ROWS] -= added
    return ways


@small_kernel
def _side(split, which):
    """Return on which side of a line a part of a footprint is, 0 where it is not split there."""
    return (1.0 if which == 0 else -1.0) if split else 0.0


@inner_kernel
def _begin(work_space, max_nodes, enough):
    """Begin a search for places that touch, among pairs that may be deeper than `enough` [m]."""
    begin(work_space, max_nodes, 0.0)
    # What has been left out is no deeper.
    work_space.state[UPPER] = max(enough, 0.0)


@inner_kernel
def _guess(guess, frame, body):
    """Return where in the contact frame a place of a body's frame lies."""
    at_u = at_v = 0.0
    for i in range(3):
        world = body[i, 3]
        for k in range(3):
            world += body[i, k] * guess[k]
        at_u += frame[0, i] * world
        at_v += frame[1, i] * world
    return at_u, at_v


@inner_kernel
def _single_place(work_space, stride, lines):
    """Return whether one place is deepest, and how far it lies from the lines [m]."""
    best, ties, alone = work_space.best, work_space.ties, 0
    for t in range(int(work_space.state[TIES])):
        if ties[t, F] >= work_space.state[BEST] - TIE:
            alone += 1 if ties[t, OVERLAP_SIZE + 1] == 0.0 else 2
    if alone != 1:
        return False, 0.0, 0.0
    pair = int(best[OVERLAP_SIZE])
    a, b = work_space.charts_a[pair // stride], work_space.charts_b[pair % stride]
    first, second = from_lines(a, b, best, lines)
    return True, first, second


@kernel
def facets_along(
    textures, table, geometry, body_a, body_b, n, highest, tolerance, max_nodes, work_space, space,
    result_out,
):  # fmt: skip
    """Fill `result_out` (1,) with the depth of body 0 in body 1 along `n`; see `depth_along`.

    Facets count whose smooth overlap is less than `highest` [m]. Returns whether there was room
    for all of them.
    """
    foot, frame = space.footprint, work_space.frame
    turn, shift = space.frames[3, :, :3], space.frames[3, :, 3]
    between_bodies(body_a, body_b, turn, shift)
    count = facing_pairs(table, 0, 1, turn, shift, highest, _ANYWHERE, FLATTEST, foot.facing)
    kept = 0
    for i in range(count):
        f, g = foot.facing.pairs[i, 0], foot.facing.pairs[i, 1]
        if piece(table, f, g, highest, _ANYWHERE, highest, foot)[1] >= 0:
            foot.facing.pairs[kept, 0], foot.facing.pairs[kept, 1] = f, g
            kept += 1
    local = space.frames[4, 0, :3]
    for i in range(3):
        local[i] = 0.0
        for k in range(3):
            local[i] += body_b[k, i] * n[k]
    frame_round(n, frame)
    pairs, _, stride, enough = pairs_of_charts(
        textures, table, geometry, kept, np.int64(-1), local, frame, body_a, body_b, work_space,
        space,
    )  # fmt: skip
    pairs = keep_promising(textures, pairs, stride, -math.inf, work_space)
    begin(work_space, max_nodes, -math.inf)
    nowhere = np.nan
    sieve(textures, stride, pairs, nowhere, nowhere, tolerance, work_space, space, np.int64(0))
    fill_result(textures, stride, n, tolerance, work_space, result_out[0])
    return enough and foot.facing.clock[1] == 0
