"""Kernels that project smooth bodies with their textures along a direction, onto a grid.

As the graphics hardware of Otaduy & Lin (2004): each sample takes the surface of the low-resolution
model that is seen first along its ray, looks up the texture's height t there, and stores

    height along n = base . n + t (w . n),      w the unit normal of the smooth surface,

without the sideways shift of a displaced point where w is not n. Simple solids are met by rays in
closed form, meshes triangle by triangle with a depth buffer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, small_kernel
from asperity._core.stack import stack_array
from asperity._core.structures import by_reference
from asperity.contact.body_arrays import Geometry, flatten_bodies
from asperity.geometry.bodies import Body
from asperity.geometry.mesh.texture_coordinates import places_on_map
from asperity.texture.packed import PackedTextures, texture_at

PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = range(6)
CYLINDRICAL, TRIPLANAR = 1, 2
"""Indices into `geometry.bodies.KINDS` and `MAPPINGS`."""
_FLAT = 1e-3
"""Least cosine between a triangle's normal and the direction in which it is seen."""


@by_reference
class Triangles(NamedTuple):
    """The triangles of all meshes among some bodies, each in its body's frame."""

    corners: NDArray[np.float64]
    """[m], (m, 3, 3)."""
    normals: NDArray[np.float64]
    """Unit, at the corners, (m, 3, 3)."""
    places: NDArray[np.float64]
    """Texture coordinates of the corners [m], (m, 3, 2); unused by triplanar maps."""
    body: NDArray[np.int64]
    """(m,)."""


@by_reference
class Shapes(NamedTuple):
    """Smooth bodies and their textures."""

    textures: PackedTextures
    geometry: Geometry
    triangles: Triangles
    surface: NDArray[np.int64]
    """Number of each body's surface in `geometry`, (bodies,)."""


class View(NamedTuple):
    """A square of samples, seen against its z axis."""

    half: float
    """Half its side [m]."""
    cells: int
    """Samples along a side, at the middles of cells."""
    top: float
    """Surfaces above this are not seen [m]."""


def shapes_of(bodies: Sequence[Body]) -> Shapes:
    """Return bodies, each with one surface, for `project`."""
    textures, geometry = flatten_bodies(bodies)
    rows: list[tuple[NDArray, NDArray, NDArray, NDArray]] = []
    for number, body in enumerate(bodies):
        if body.mesh is None:
            continue
        corners = body.mesh.vertices[body.mesh.faces]
        places = places_on_map(body, body.texture)
        empty = np.zeros((len(corners), 3, 2))
        rows.append((
            corners, body.mesh.normals, empty if places is None else places,
            np.full(len(corners), number),
        ))  # fmt: skip
    none = (np.zeros((0, 3, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3, 2)), np.zeros(0, np.int64))
    columns = (np.concatenate(column) for column in zip(none, *rows, strict=True))
    triangles = Triangles(*map(np.ascontiguousarray, columns))
    surface = [_surface(geometry, number) for number in range(len(bodies))]
    return Shapes(textures, geometry, triangles, np.array(surface, dtype=np.int64))


def _surface(geometry: Geometry, body: int) -> int:
    return int(geometry.surface[np.flatnonzero(geometry.body == body)[0]])


@small_kernel
def _height(shapes, surface, x, y, z, n):
    """Return the texture's height [m] at a point of the body's frame with the unit normal n."""
    k, mapping = shapes.geometry.texture[surface], shapes.geometry.mapping[surface]
    if k < 0:
        return 0.0
    u0, v0 = shapes.geometry.origin[surface, 0], shapes.geometry.origin[surface, 1]
    if mapping != TRIPLANAR:
        return texture_at(shapes.textures, k, x - u0, y - v0)[0]
    a, b, c = n[0] ** 4, n[1] ** 4, n[2] ** 4
    total = a * texture_at(shapes.textures, k, y - u0, z - v0)[0]
    total += b * texture_at(shapes.textures, k, z - u0, x - v0)[0]
    total += c * texture_at(shapes.textures, k, x - u0, y - v0)[0]
    return total / (a + b + c)


@inner_kernel
def _enter_round(o, d, axes, n_out):
    """Return where a ray enters an ellipsoid, infinite if it does not; fill its normal there."""
    a = b = 0.0
    c = -1.0
    for k in range(3):
        p, q = o[k] / axes[k], d[k] / axes[k]
        a, b, c = a + q * q, b + p * q, c + p * p
    square = b * b - a * c
    if square < 0.0:
        return math.inf
    s = -(b + math.sqrt(square)) / a
    length = 0.0
    for k in range(3):
        n_out[k] = (o[k] + s * d[k]) / (axes[k] * axes[k])
        length += n_out[k] * n_out[k]
    for k in range(3):
        n_out[k] /= math.sqrt(length)
    return s


@inner_kernel
def _enter_slabs(o, d, half, first, n_out):
    """Return where a ray enters and leaves the slabs of a box from axis `first` on."""
    low, high = -math.inf, math.inf
    for k in range(first, 3):
        if abs(d[k]) < 1e-14:
            if abs(o[k]) > half[k]:
                return math.inf, -math.inf
            continue
        side = half[k] if d[k] < 0.0 else -half[k]
        enters, leaves = (side - o[k]) / d[k], (-side - o[k]) / d[k]
        if enters > low:
            low = enters
            n_out[0] = n_out[1] = n_out[2] = 0.0
            n_out[k] = -1.0 if d[k] > 0.0 else 1.0
        high = min(high, leaves)
    return low, high


@inner_kernel
def _enter_side(o, d, radius, n_out):
    """Return where a ray enters and leaves an unbounded cylinder around z."""
    a = d[0] * d[0] + d[1] * d[1]
    b = o[0] * d[0] + o[1] * d[1]
    c = o[0] * o[0] + o[1] * o[1] - radius * radius
    if a < 1e-24:
        return (-math.inf, math.inf) if c <= 0.0 else (math.inf, -math.inf)
    square = b * b - a * c
    if square < 0.0:
        return math.inf, -math.inf
    root = math.sqrt(square)
    s = -(b + root) / a
    n_out[0], n_out[1], n_out[2] = (o[0] + s * d[0]) / radius, (o[1] + s * d[1]) / radius, 0.0
    return s, (root - b) / a


@inner_kernel
def _enter(kind, size, o, d, n_out):
    """Return where a ray o + s d enters a solid, and whether on the side of a cylinder or capsule.

    Infinite if it does not. `n_out` is filled with the outward normal there.
    """
    if kind == PLANE:
        s = -o[2] / d[2] if d[2] < 0.0 else math.inf
        for k in range(2):
            if size[k] > 0.0 and not abs(o[k] + s * d[k]) <= size[k]:
                s = math.inf
        n_out[0], n_out[1], n_out[2] = 0.0, 0.0, 1.0
        return s, False
    if kind == BOX:
        low, high = _enter_slabs(o, d, size, 0, n_out)
        return (low if low <= high else math.inf), False
    axes = stack_array((3,))
    if kind in (ELLIPSOID, SPHERE):
        for k in range(3):
            axes[k] = size[k] if kind == ELLIPSOID else size[0]
        return _enter_round(o, d, axes, n_out), False
    low, high = _enter_side(o, d, size[0], n_out)
    side = stack_array((3,))
    if kind == CYLINDER:
        axes[2] = size[1]
        enters, leaves = _enter_slabs(o, d, axes, 2, side)
        if enters > low:
            for k in range(3):
                n_out[k] = side[k]
        first = max(low, enters)
        return (first if first <= min(high, leaves) else math.inf), low >= enters
    if low < math.inf and abs(o[2] + low * d[2]) <= size[1]:
        return low, True
    best = math.inf
    moved = stack_array((3,))
    for end in range(2):
        moved[0], moved[1], moved[2] = o[0], o[1], o[2] + (size[1] if end else -size[1])
        axes[0] = axes[1] = axes[2] = size[0]
        s = _enter_round(moved, d, axes, side)
        if s < best:
            best = s
            for k in range(3):
                n_out[k] = side[k]
    return best, False


@inner_kernel
def _project_geom(shapes, g, frame, view, depth_io, height_io):
    """Project a geom of a body whose frame (3, 4) is given in that of the view."""
    geometry = shapes.geometry
    kind, size, surface = geometry.kind[g], geometry.size[g], geometry.surface[g]
    turn, at = stack_array((3, 3)), stack_array((3,))
    for i in range(3):
        at[i] = frame[i, 3]
        for j in range(3):
            at[i] += frame[i, j] * geometry.position[g, j]
            turn[i, j] = 0.0
            for k in range(3):
                turn[i, j] += frame[i, k] * geometry.rotation[g, k, j]
    o, d, n, q, w = (
        stack_array((3,)), stack_array((3,)), stack_array((3,)), stack_array((3,)),
        stack_array((3,)),
    )  # fmt: skip
    for k in range(3):
        d[k] = -turn[2, k]
    pitch = 2.0 * view.half / view.cells
    for i in range(view.cells):
        x = (i + 0.5) * pitch - view.half
        for j in range(view.cells):
            y = (j + 0.5) * pitch - view.half
            for k in range(3):
                o[k] = turn[0, k] * (x - at[0]) + turn[1, k] * (y - at[1]) - turn[2, k] * at[2]
            s, on_side = _enter(kind, size, o, d, n)
            z = -s
            if not (z > depth_io[i, j] and z <= view.top):
                continue
            depth_io[i, j] = z
            t = 0.0
            if geometry.texture[surface] >= 0:
                for k in range(3):
                    o[k] += s * d[k]
                if geometry.mapping[surface] == CYLINDRICAL:
                    if on_side:
                        u = size[0] * math.atan2(o[1], o[0]) * geometry.around[g]
                        t = _height(shapes, surface, u, o[2], 0.0, n)
                else:
                    for k in range(3):
                        q[k] = geometry.position[g, k]
                        w[k] = 0.0
                        for m in range(3):
                            q[k] += geometry.rotation[g, k, m] * o[m]
                            w[k] += geometry.rotation[g, k, m] * n[m]
                    t = _height(shapes, surface, q[0], q[1], q[2], w)
            rise = turn[2, 0] * n[0] + turn[2, 1] * n[1] + turn[2, 2] * n[2]
            height_io[i, j] = z + t * rise


@inner_kernel
def _project_triangle(shapes, f, frame, view, depth_io, height_io):
    """Project a triangle of a body whose frame (3, 4) is given in that of the view."""
    triangles = shapes.triangles
    corners, normals, places = triangles.corners[f], triangles.normals[f], triangles.places[f]
    p, e1, e2 = stack_array((3, 3)), stack_array((3,)), stack_array((3,))
    for c in range(3):
        for i in range(3):
            p[c, i] = frame[i, 3]
            for k in range(3):
                p[c, i] += frame[i, k] * corners[c, k]
    for k in range(3):
        e1[k], e2[k] = corners[1, k] - corners[0, k], corners[2, k] - corners[0, k]
    # The normal is turned, not computed anew: the frame of a view from below is a mirrored one.
    facing = size = 0.0
    for k in range(3):
        one, two = (k + 1) % 3, (k + 2) % 3
        cross = e1[one] * e2[two] - e1[two] * e2[one]
        facing += frame[2, k] * cross
        size += cross * cross
    if facing <= _FLAT * math.sqrt(size):
        return
    pitch = 2.0 * view.half / view.cells
    area = (p[1, 0] - p[0, 0]) * (p[2, 1] - p[0, 1]) - (p[2, 0] - p[0, 0]) * (p[1, 1] - p[0, 1])
    low_x, high_x = min(p[0, 0], p[1, 0], p[2, 0]), max(p[0, 0], p[1, 0], p[2, 0])
    low_y, high_y = min(p[0, 1], p[1, 1], p[2, 1]), max(p[0, 1], p[1, 1], p[2, 1])
    if low_x > view.half or high_x < -view.half or low_y > view.half or high_y < -view.half:
        return
    surface = shapes.surface[triangles.body[f]]
    w, q = stack_array((3,)), stack_array((3,))
    first_i = max(math.ceil((low_x + view.half) / pitch - 0.5 - 1e-9), 0)
    first_j = max(math.ceil((low_y + view.half) / pitch - 0.5 - 1e-9), 0)
    last_i = min(math.floor((high_x + view.half) / pitch - 0.5 + 1e-9), view.cells - 1)
    last_j = min(math.floor((high_y + view.half) / pitch - 0.5 + 1e-9), view.cells - 1)
    for i in range(first_i, last_i + 1):
        x = (i + 0.5) * pitch - view.half
        for j in range(first_j, last_j + 1):
            y = (j + 0.5) * pitch - view.half
            b = (x - p[0, 0]) * (p[2, 1] - p[0, 1]) - (p[2, 0] - p[0, 0]) * (y - p[0, 1])
            c = (p[1, 0] - p[0, 0]) * (y - p[0, 1]) - (x - p[0, 0]) * (p[1, 1] - p[0, 1])
            b, c = b / area, c / area
            a = 1.0 - b - c
            if a < -1e-9 or b < -1e-9 or c < -1e-9:
                continue
            z = a * p[0, 2] + b * p[1, 2] + c * p[2, 2]
            if not (z > depth_io[i, j] and z <= view.top):
                continue
            depth_io[i, j] = z
            length = rise = 0.0
            for k in range(3):
                w[k] = a * normals[0, k] + b * normals[1, k] + c * normals[2, k]
                q[k] = a * corners[0, k] + b * corners[1, k] + c * corners[2, k]
                length += w[k] * w[k]
                rise += frame[2, k] * w[k]
            length = math.sqrt(length)
            for k in range(3):
                w[k] /= length
            t = 0.0
            texture = shapes.geometry.texture[surface]
            if texture >= 0 and shapes.geometry.mapping[surface] == TRIPLANAR:
                t = _height(shapes, surface, q[0], q[1], q[2], w)
            elif texture >= 0:
                u = a * places[0, 0] + b * places[1, 0] + c * places[2, 0]
                v = a * places[0, 1] + b * places[1, 1] + c * places[2, 1]
                t = texture_at(shapes.textures, texture, u, v)[0]
            height_io[i, j] = z + t * rise / length


@inner_kernel
def project(shapes, frames, view, depth, height_out):
    """Fill the heights of the surfaces that are seen in a view, -inf where none is.

    Parameters
    ----------
    shapes : Shapes
    frames : (bodies, 3, 4) array
        Frames of the bodies in that of the view [m].
    view : View
    depth : (cells, cells) array
        Scratch: heights of the smooth surfaces.
    height_out : (cells, cells) array
        [m].
    """
    for i in range(view.cells):
        for j in range(view.cells):
            depth[i, j] = height_out[i, j] = -math.inf
    for g in range(len(shapes.geometry.kind)):
        if shapes.geometry.kind[g] <= BOX:
            _project_geom(shapes, g, frames[shapes.geometry.body[g]], view, depth, height_out)
    for f in range(len(shapes.triangles.body)):
        _project_triangle(shapes, f, frames[shapes.triangles.body[f]], view, depth, height_out)
