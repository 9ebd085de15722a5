r"""Penetration depth of two bodies along n, and its gradient.

Along `n`, B's low-resolution normal, the facing surface of each body consists of patches; the depth
is the largest overlap of any pair of them. Its gradient by the six coordinates of A's motion is, by
the envelope theorem, that of the overlap at the deepest point (n fixed in B's frame):

    d(delta)/d(translation) = -m,    d(delta)/d(rotation) = -(r x m),    m = n - s_u u - s_v v,

s the common slope of the two textured surfaces there and r the vector from A's centre to the point
on A's surface. See `slope_normal` for deepest points on edges.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import clear, inner_kernel, kernel, separate_kernel
from asperity._core.stack import stack_array
from asperity.contact.narrow_phase.displaced_surface import height_on
from asperity.contact.narrow_phase.incumbent import begin_search
from asperity.contact.narrow_phase.load import (
    FOUND,
    MOST_SEARCHES,
    patches_have_map,
    raise_load,
    settle_load,
)
from asperity.contact.narrow_phase.penetration import fill_penetration, search_candidates
from asperity.contact.narrow_phase.smooth_base import base_height_at, parameters_at, root_at
from asperity.contact.narrow_phase.surface_patch import entries, fill_patches, stretch_plane


class BodyGeoms(NamedTuple):
    """Geoms of one body that may touch, and the body's frame."""

    geoms: NDArray[np.int64]
    """Numbers of geoms, of which the first `number` are valid."""
    number: int
    frame: NDArray[np.float64]
    """Rotation of the body and position from the contact's origin, world axes, (3, 4) [m]."""
    stretch: float
    """How far to extend flat faces normal to n beyond their edges [m]."""


class DepthQuery(NamedTuple):
    """Two bodies and the direction along which their depth is searched."""

    a: BodyGeoms
    b: BodyGeoms
    normal: NDArray[np.float64]
    """n, unit normal of B towards A, world axes, (3,)."""
    guess: NDArray[np.float64]
    """The last deepest point, from the contact's origin, nan if unknown, (3,) [m]."""


class SearchLimits(NamedTuple):
    """Termination criteria of a search."""

    tolerance: float
    """Gap between lower and upper bound of the depth [m]."""
    max_nodes: int
    """Maximum number of boxes to evaluate."""


@inner_kernel
def fill_geom_patches(geometry, g, frame, body, patches_out, first):
    """Fill the patches of a geom from `first` on, seen along the third row of `frame` (3, 3).

    `body` (3, 4) is the frame of its body; see `BodyGeoms`. Returns the number of patches.
    """
    place, axes = stack_array((3,)), stack_array((3, 3))
    for i in range(3):
        place[i] = 0.0
        for k in range(3):
            world = body[k, 3]
            for j in range(3):
                world += body[k, j] * geometry.position[g, j]
            place[i] += frame[i, k] * world
    for i in range(3):
        for c in range(3):
            total = 0.0
            for k in range(3):
                world = 0.0
                for j in range(3):
                    world += body[k, j] * geometry.rotation[g, j, c]
                total += frame[i, k] * world
            axes[i, c] = total
    return fill_patches(geometry, g, place, axes, frame, body, patches_out, first)


@inner_kernel
def fill_body_patches(geometry, body, frame, patches_out):
    """Fill the patches of a `BodyGeoms`, seen along the third row of `frame`; return the number."""
    made = np.int64(0)
    for n in range(body.number):
        made = fill_geom_patches(geometry, body.geoms[n], frame, body.frame, patches_out, made)
    if body.stretch > 0.0:
        for i in range(made):
            if patches_out[i].is_level:
                stretch_plane(patches_out[i], body.stretch)
    return made


@inner_kernel
def fill_facing_patches(geometry, query, frame, memory):
    """Fill the facing patches of both bodies of a query; return their numbers of A and of B.

    `frame` (3, 3) is filled with the axes u, v and -n.
    """
    frame_round(query.normal, frame)
    made_b = fill_body_patches(geometry, query.b, frame, memory.patches_b)
    for i in range(3):
        frame[2, i] = -query.normal[i]
    made_a = fill_body_patches(geometry, query.a, frame, memory.patches_a)
    return made_a, made_b


@inner_kernel
def frame_round(n, frame_out):
    """Fill a right-handed frame with rows u, v, n."""
    # u lies in the plane of n and x, or n and y; for n along z, u and v are x and y.
    if abs(n[0]) < 0.9:
        x, y, z = 1.0 - n[0] * n[0], -n[0] * n[1], -n[0] * n[2]
    else:
        x, y, z = -n[1] * n[0], 1.0 - n[1] * n[1], -n[1] * n[2]
    size = math.sqrt(x * x + y * y + z * z)
    frame_out[0, 0], frame_out[0, 1], frame_out[0, 2] = x / size, y / size, z / size
    frame_out[1, 0] = (n[1] * z - n[2] * y) / size
    frame_out[1, 1] = (n[2] * x - n[0] * z) / size
    frame_out[1, 2] = (n[0] * y - n[1] * x) / size
    frame_out[2, 0], frame_out[2, 1], frame_out[2, 2] = n[0], n[1], n[2]


@separate_kernel
def fill_depth_along(textures, geometry, query, limits, memory, result_out):
    """Fill a `PENETRATION` record with the depth of A in B along n.

    Parameters
    ----------
    textures : Textures
    geometry : Geometry
    query : DepthQuery
    limits : SearchLimits
    memory : Workspace
    result_out : PENETRATION record
    """
    frame, guess, n = memory.frame, query.guess, query.normal
    made_a, made_b = fill_facing_patches(geometry, query, frame, memory)
    u = frame[0, 0] * guess[0] + frame[0, 1] * guess[1] + frame[0, 2] * guess[2]
    v = frame[1, 0] * guess[0] + frame[1, 1] * guess[1] + frame[1, 2] * guess[2]
    search = memory.search[0]
    search.load = 0.0
    _search_all(textures, (made_a, made_b), (u, v), limits, memory)
    if search.incumbent > 0.0 and patches_have_map(memory, made_a, made_b):
        _search_under_load(textures, (made_a, made_b), limits, memory)
    fill_penetration(textures, made_b, n, limits.tolerance, memory, result_out)
    search.load = 0.0


@inner_kernel
def _search_all(textures, made, guess, limits, memory):
    """Search all pairs of patches, starting from `guess` (u, v), nan if unknown."""
    made_a, made_b = made
    begin_search(memory.search[0], float(limits.max_nodes), -np.inf)
    for number in range(made_a * made_b):
        # All pairs are initialised before one is searched.
        candidate = memory.candidates[number]
        candidate.bound, candidate.is_initialised, candidate.number = np.inf, False, number
    search_candidates(textures, made_b, made_a * made_b, guess, limits.tolerance, memory)


@inner_kernel
def _search_under_load(textures, made, limits, memory):
    """Find the load of two bodies, one with a stiffness map, by one or more searches."""
    search, nodes = memory.search[0], 0.0
    for _ in range(MOST_SEARCHES):
        raise_load(textures, made[1], memory)
        nodes += search.nodes
        guess = (search.at.point[0], search.at.point[1])
        _search_all(textures, made, guess, limits, memory)
        if search.best.pair < 0:
            return
        is_found = abs(search.incumbent) <= FOUND
        if is_found or search.nodes >= search.node_limit:
            break
    search.nodes += nodes
    settle_load(textures, made[1], memory)


@kernel
def depth_along(textures, geometry, query, limits, memory, result_out):
    """Call `fill_depth_along` from Python; `result_out` has one record."""
    fill_depth_along(textures, geometry, query, limits, memory, result_out[0])


@inner_kernel
def smooth_texture_under(textures, geometry, body, n, place, memory, gradient_out):
    """Return the height of B's texture at a point of its smooth surface, above its lowest [m].

    Fills the height's gradient (3,) normal to n, world axes. `body` is B's `BodyGeoms`; `place`
    (3,) is relative to the contact's origin.
    """
    clear(gradient_out)
    frame = stack_array((3, 3))
    frame_round(n, frame)
    made = fill_body_patches(geometry, body, frame, memory.patches_b)
    u = frame[0, 0] * place[0] + frame[0, 1] * place[1] + frame[0, 2] * place[2]
    v = frame[1, 0] * place[0] + frame[1, 1] * place[1] + frame[1, 2] * place[2]
    best, top = -np.inf, -1
    for i in range(made):
        z = base_height_at(memory.patches_b[i], u, v)[0]
        if z > best:
            best, top = z, i
    if top < 0 or memory.patches_b[top].texture < 0:
        return 0.0
    patch = memory.patches_b[top]
    x, y = parameters_at(patch, u, v)
    t, t_x, t_y, _, _, _ = height_on(textures, patch, patch.texture, x, y, root_at(patch, x, y))
    i, j, k, m = entries(patch.lateral_inverse)
    g1, g2 = i * t_x + k * t_y, j * t_x + m * t_y
    for axis in range(3):
        gradient_out[axis] = g1 * frame[0, axis] + g2 * frame[1, axis]
    return t - textures.maps[patch.texture].lowest
