"""The deepest overlap among many pairs of patches, by best-first branch and bound.

Wide contact of two textured bodies has thousands of points that are almost equally deep. Boxes of
all pairs of plane patches are kept in one heap, ordered by a bound that costs two look-ups in the
textures' pyramids. A box is quartered until it is about as small as the textures' finest waves;
only then is it evaluated with second-order bounds and Newton ascents (over a smooth plane, a little
earlier, with second-order bounds alone). So the budget is spent where the deepest point may be, and
the top of the heap bounds the rest. Pairs with a curved patch are searched depth first when they
reach the top.
"""

from __future__ import annotations

import math

import numpy as np

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.bounds.compliance import lowering_over
from asperity.contact.narrow_phase.bounds.plane_pairs import quarter_bounds
from asperity.contact.narrow_phase.bounds.planes import box_under, planes_of
from asperity.contact.narrow_phase.bounds.rough_on_smooth import rough_bound
from asperity.contact.narrow_phase.branch_and_bound import (
    FINEST_TIE,
    SMALLEST,
    evaluate_node,
    initialise_pair,
    resolve_leaf,
    search_pair,
)
from asperity.contact.narrow_phase.incumbent import is_spent, pruning_threshold, record_maximum
from asperity.contact.narrow_phase.leaves import resolve_once
from asperity.contact.narrow_phase.newton_ascent import newton_ascent
from asperity.contact.narrow_phase.node_queue import MAX_NODES, pop, push
from asperity.contact.narrow_phase.patch_pair import (
    PLANES,
    PatchPair,
    pair_shift,
    searches_a,
    sides_of,
)
from asperity.contact.narrow_phase.plane_boxes import beyond_straight_borders
from asperity.contact.narrow_phase.smooth_base import parameters_over

_LAST, _LAST_CUT = 16, 2
"""Number of ascents from open boxes once the node budget, or the time, is spent."""
_LEAF = 2.0
"""Size of boxes evaluated with second-order bounds [length scales of the finer texture]."""
_FINE = 2.0
"""Size at which boxes of a rough and a smooth plane get a second-order bound [length scales]."""
_RESOLVED = 1.5
"""Size below which certified boxes are not divided [length scales]."""
_CHEAP = 0.1
"""Cost of a bound by the pyramids alone [nodes]."""
_INITIAL = 2.0
"""Cost of the first ascent in a pair [nodes]."""


@small_kernel
def _length_scale(textures, patch):
    """Return a texture's length scale in patch parameters [m]: sqrt(height / curvature).

    For a sinusoid this is its wavelength over 2 pi.
    """
    if patch.texture < 0:
        return np.inf
    k = patch.texture
    return (
        math.sqrt(textures.maps[k].max_abs_height / max(textures.maps[k].max_curvature, 1e-300))
        / patch.map_max
    )


@small_kernel
def _is_beyond_added(textures, a, b, box, added):
    """Return whether a box is beyond one of the last `added` borders of B's patch."""
    x0, x1, y0, y1 = box
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    half_x, half_y = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    first = b.border_count - added
    if not searches_a(a, b):
        return beyond_straight_borders(b, first, x, y, half_x, half_y)
    shift = pair_shift(textures, a, b) / b.lateral_min
    under = box_under(parameters_over(a, b), (x, y, half_x, half_y), shift)
    return beyond_straight_borders(b, first, *under)


@inner_kernel
def ascend_from_last(textures, stride, count, found, memory):
    """Ascend from the last deepest point, if any: pair number, x and y in `found`.

    Ascending in every pair would take most of the time.
    """
    search, number = memory.search[0], int(found[0])
    for row in range(count if number >= 0 else 0):
        candidate = memory.candidates[row]
        if candidate.number == number:
            a, b = memory.patches_a[number // stride], memory.patches_b[number % stride]
            patch, other = (a, b) if searches_a(a, b) else (b, a)
            x0, x1, y0, y1 = sides_of(patch)
            box = candidate.box
            step = 0.1 * max(box[1] - box[0], box[3] - box[2])
            search.nodes += _INITIAL
            if newton_ascent(
                textures, patch, other, (x0, x1, y0, y1), found[1], found[2], step, search
            ):
                record_maximum(search, number, 0.0)


@small_kernel
def _box_of(node, candidate):
    """Return x0, x1, y0, y1 of a node."""
    box = candidate.box
    if node.is_whole:
        return box[0], box[1], box[2], box[3]
    return node.x0, node.x1, node.y0, node.y1


@small_kernel
def _retire(queue, retired, number):
    """Keep a pruned or remaining node for later searches; return the number of retired nodes."""
    queue.retired[retired] = number
    return retired + 1


@inner_kernel
def _fill_heap(textures, stride, count, memory, queue, added):
    """Fill the heap; return the numbers of nodes in it, in use, and retired."""
    search, candidates, nodes = memory.search[0], memory.candidates, queue.nodes
    size, used, retired = np.int64(0), np.int64(0), np.int64(0)
    if added == 0:
        for row in range(count):
            node, bound = nodes[used], candidates[row].bound
            node.candidate, node.bound, node.is_whole, node.is_pruned = row, bound, True, False
            if bound <= pruning_threshold(search):
                retired = _retire(queue, retired, used)
            else:
                push(queue.heap, queue.keys, size, used, bound)
                size += 1
            used += 1
        return size, used, retired
    used = queue.state[0].stored
    for i in range(queue.state[0].retired):
        number = queue.retired[i]
        node = nodes[number]
        if node.bound <= pruning_threshold(search):
            continue
        candidate = candidates[node.candidate]
        a = memory.patches_a[candidate.number // stride]
        b = memory.patches_b[candidate.number % stride]
        are_planes, box = a.bulge == 0.0 and b.bulge == 0.0, _box_of(node, candidate)
        if are_planes and _is_beyond_added(textures, a, b, box, added):
            continue
        push(queue.heap, queue.keys, size, number, node.bound)
        size += 1
    return size, used, retired


@small_kernel
def _set_node(node, box, bound, row):
    """Fill a node with a box of a candidate."""
    node.x0, node.x1, node.y0, node.y1 = box
    node.bound, node.candidate, node.is_whole, node.is_pruned = bound, row, False, False


@small_kernel
def _bound_quarters(textures, planes, pair, node, row, relative_size, search, queue):
    """Bound the quarters of a node of two planes, and store them after the nodes in use.

    Returns the number of the best quarter, or -1, and its bound. Pruned quarters are marked.
    `relative_size` is the node's size over the texture's length scale.
    """
    nodes, used = queue.nodes, queue.state[0].used
    x0, x1, y0, y1, above = node
    bounds = stack_array((4,))
    best, highest = np.int64(-1), -np.inf
    cut_x, cut_y = 2.0 * (x1 - x0) > y1 - y0, 2.0 * (y1 - y0) > x1 - x0
    mx, my = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    is_leaf = relative_size <= _LEAF
    is_fine = relative_size <= _FINE and pair.patch.texture >= 0 and pair.other.texture < 0
    if not is_fine:
        quarter_bounds(
            textures, pair.patch, pair.other, planes, (x0, x1, y0, y1), pruning_threshold(search),
            bounds,
        )  # fmt: skip
    for child in range(4):
        if (child & 1 and not cut_x) or (child & 2 and not cut_y):
            continue
        p0, p1 = (mx if child & 1 else x0), (mx if cut_x and not child & 1 else x1)
        q0, q1 = (my if child & 2 else y0), (my if cut_y and not child & 2 else y1)
        search.nodes += _CHEAP
        threshold = pruning_threshold(search)
        if is_fine:
            x, y = 0.5 * (p0 + p1), 0.5 * (q0 + q1)
            box = (x, y, p1 - x, q1 - y)
            bounds[child] = rough_bound(textures, pair.patch, pair.other, planes, box)
        if search.load > 0.0:
            bounds[child] -= lowering_over(
                textures, pair.patch, pair.other, (p0, p1, q0, q1), search
            )[0]
        high = min(bounds[child], above)
        if high == -np.inf:
            continue
        quarter = nodes[used]
        _set_node(quarter, (p0, p1, q0, q1), high, row)
        used += 1
        if high > threshold and is_leaf:
            high = evaluate_node(textures, pair, (p0, p1, q0, q1), high, search)
            quarter.bound = min(quarter.bound, search.last_bound)
        elif high <= threshold:
            high = -np.inf
        if high == -np.inf:
            quarter.is_pruned = True
        elif high > highest:
            best, highest = used - 1, high
    queue.state[0].used = used
    return best, highest


@inner_kernel
def best_first_search(textures, stride, count, guess, tolerance, memory, queue, added):
    """Search the first `count` candidates of `memory` in the order of their bounds.

    Parameters
    ----------
    stride : int
        Of pair numbers: A's patch * stride + B's patch.
    guess : tuple (float, float)
        (u, v) of the last deepest point, nan if unknown.
    tolerance : float
        A box is not divided for a gain smaller than this [m].
    queue : NodeQueue
        Receives the retired nodes.
    added : int
        Borders added to B's patches since the last search with none added; if not 0, the search
        starts from the nodes which that search retired.
    """
    search, candidates, nodes = memory.search[0], memory.candidates, queue.nodes
    heap, keys = queue.heap, queue.keys
    for row in range(count):
        # Pairs of planes, one of them rough, need no initial ascent.
        candidates[row].is_initialised = candidates[row].extent[0] == candidates[row].extent[0]
    size, used, retired = _fill_heap(textures, stride, count, memory, queue, added)
    while size > 0:
        above, number = keys[0], heap[0]
        if above <= pruning_threshold(search) or search.incumbent > search.ceiling:
            break
        if is_spent(search) or used + 4 > MAX_NODES:
            search.upper_bound = max(search.upper_bound, above)
            _ascend_in_best(textures, stride, size, memory, queue)
            break
        pop(heap, keys, size)
        size -= 1
        row = nodes[number].candidate
        candidate = candidates[row]
        pair_number = candidate.number
        a = memory.patches_a[pair_number // stride]
        b = memory.patches_b[pair_number % stride]
        patch, other = (a, b) if searches_a(a, b) else (b, a)
        if not candidate.is_initialised:
            candidate.is_initialised = True
            initialise_pair(textures, patch, other, guess, search, candidate)
            search.nodes += _INITIAL
            # Two straight patches are solved by now, but not for a sub-region.
            push(heap, keys, size, number, min(above, candidate.bound))
            size += 1
            continue
        if patch.bulge > 0.0 or other.bulge > 0.0:
            search_pair(textures, patch, other, candidate, above, tolerance, search)
            if added == 0:
                retired = _retire(queue, retired, number)
            continue
        planes = planes_of(patch, other, candidate.lifts)
        pair = PatchPair(
            patch, other, pair_number, np.int64(PLANES), candidate.base_x, candidate.base_y,
            pair_shift(textures, patch, other), sides_of(patch),
        )  # fmt: skip
        length_scale = _length_scale(textures, other) * other.lateral_min / patch.lateral_max
        length_scale = min(_length_scale(textures, patch), length_scale)
        x0, x1, y0, y1 = _box_of(nodes[number], candidate)
        resolved = _RESOLVED * length_scale
        if patch.stiffness_map >= 0 and length_scale == np.inf:
            # Where a stiffness map is constant, the middle of that part represents it.
            sides = candidate.box
            resolved = FINEST_TIE * max(sides[1] - sides[0], sides[3] - sides[2])
        while True:
            large, box = max(x1 - x0, y1 - y0), (x0, x1, y0, y1)
            is_done = large < SMALLEST or used + 4 > MAX_NODES
            if above <= search.incumbent + tolerance and large <= resolved:
                is_done = True
                search.nodes += 1.0
                resolve_once(textures, pair, box, above, search)
            elif is_done:
                # Facets that share only an edge have a box without width, never divided before.
                if large < SMALLEST:
                    evaluate_node(textures, pair, box, above, search)
                    above = min(above, search.last_bound)
                search.upper_bound = max(search.upper_bound, above)
            if is_done:
                if added == 0:
                    retired = _retire(queue, retired, number)
                break
            relative_size, first = large / length_scale, used
            queue.state[0].used = used
            best, highest = _bound_quarters(
                textures, planes, pair, (x0, x1, y0, y1, above), row, relative_size, search, queue
            )
            used = queue.state[0].used
            # Dive into the best quarter until it is small: an incumbent found there prunes others.
            dives = highest > pruning_threshold(search) and relative_size > _LEAF
            for k in range(first, used):
                node = nodes[k]
                if node.is_pruned:
                    if added == 0:
                        retired = _retire(queue, retired, k)
                elif k != best or not dives:
                    push(heap, keys, size, k, node.bound)
                    size += 1
            if not dives:
                break
            x0, x1, y0, y1 = nodes[best].x0, nodes[best].x1, nodes[best].y0, nodes[best].y1
            above, number = highest, best
    if added == 0:
        for i in range(size):
            retired = _retire(queue, retired, heap[i])
        queue.state[0].retired, queue.state[0].stored = retired, used


@inner_kernel
def _ascend_in_best(textures, stride, size, memory, queue):
    """Ascend from the centres of the boxes with the largest bounds, of `size` in the heap.

    This improves the incumbent of a search that ends before dividing them.
    """
    search = memory.search[0]
    is_short = search.is_cut_short or search.node_limit < _LAST
    most = _LAST_CUT if is_short else _LAST
    for k in range(min(size, most)):
        node = queue.nodes[queue.heap[k]]
        candidate = memory.candidates[node.candidate]
        pair_number = candidate.number
        a = memory.patches_a[pair_number // stride]
        b = memory.patches_b[pair_number % stride]
        patch, other = (a, b) if searches_a(a, b) else (b, a)
        if patch.bulge == 0.0 and other.bulge == 0.0:
            pair = PatchPair(
                patch, other, pair_number, np.int64(PLANES), candidate.base_x, candidate.base_y,
                pair_shift(textures, patch, other), sides_of(patch),
            )  # fmt: skip
            resolve_leaf(textures, pair, _box_of(node, candidate), node.bound, search)
