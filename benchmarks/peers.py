"""What `bench_contact.py` puts beside asperity: an uncertified search, MuJoCo's and fcl's fields.

The *uncertified search* is what one writes who needs no proof, for this one case: a sphere over a
level texture. It uses asperity's own spline, and a pyramid of the spline's highest coefficients
(each cell: the sixteen that it depends on). Blocks of the pyramid are divided best first, and
dropped when the highest coefficient plus the sphere's highest point over the block stays under
the best place so far. A cell ends the division: if its
middle is deeper than the best place so far, Newton's method climbs from there, and the cell is
closed, though it may hold a deeper place. The last query's place is climbed from first. None of
asperity's generality (charts, borders, ties, other shapes and normals) costs it anything.
Since cells grow in number with the map's resolution, there is a second variant that divides no
further than to blocks of about 80 um, a twentieth of the sphere's radius, whatever the map.
The sharper bounds that asperity makes for its proofs speed this search up, too: given them instead
of coefficients (`sharper_pyramid`), it is told apart.
"""

from __future__ import annotations

import math
import time

import mujoco
import numpy as np
from numba.core import types
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel
from asperity.texture.height_field import HeightField
from asperity.texture.packed import PackedTextures, texture_at

_CLOCK = int(time.CLOCK_MONOTONIC)
_clock_gettime = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.voidptr))
_FACING = 0.98  # of the radius: beyond it the sphere faces away from n too much (w.n < 0.2)
_STEPS = 40


@inner_kernel
def now(stamp):
    """Return the time [ns] in compiled code; `stamp` (2,) int64 is written to. Takes 20 ns."""
    _clock_gettime(_CLOCK, stamp.ctypes)
    return stamp[0] * 1000000000 + stamp[1]


@inner_kernel
def _overlap(textures, radius, centre, x, y):
    """Return the overlap of sphere and texture at (x, y) from its centre, and its derivatives."""
    h, h_u, h_v, h_uu, h_uv, h_vv = texture_at(textures, 0, centre[0] + x, centre[1] + y)
    root = math.sqrt(radius * radius - x * x - y * y)
    r_x, r_y = -x / root, -y / root
    return (
        h + root - centre[2], h_u + r_x, h_v + r_y,
        h_uu - (1.0 + r_x * r_x) / root, h_uv - r_x * r_y / root, h_vv - (1.0 + r_y * r_y) / root,
    )  # fmt: skip


@inner_kernel
def _climb(textures, radius, centre, x, y, stride):
    """Return the local maximum (depth, x, y) uphill of a place, by damped Newton steps."""
    limit = (_FACING * radius) ** 2
    f, g_x, g_y, h_xx, h_xy, h_yy = _overlap(textures, radius, centre, x, y)
    for _ in range(_STEPS):
        # Shifted where the overlap is not concave, so that the step leads uphill.
        middle, half = 0.5 * (h_xx + h_yy), math.hypot(0.5 * (h_xx - h_yy), h_xy)
        shift = max(middle + half + 0.1 * (half + abs(middle)), 0.0) if middle + half >= 0 else 0.0
        a, b = h_xx - shift, h_yy - shift
        det = a * b - h_xy * h_xy
        dx, dy = -(b * g_x - h_xy * g_y) / det, -(a * g_y - h_xy * g_x) / det
        size = math.hypot(dx, dy)
        if size > stride:
            dx, dy = dx * stride / size, dy * stride / size
        if size < 1e-14 or stride < 1e-14:
            break
        new_x, new_y = x + dx, y + dy
        if new_x * new_x + new_y * new_y > limit:
            stride = 0.25 * min(size, stride)
            continue
        new = _overlap(textures, radius, centre, new_x, new_y)
        if new[0] < f:
            stride = 0.25 * min(size, stride)
            continue
        gain = new[0] - f
        x, y = new_x, new_y
        f, g_x, g_y, h_xx, h_xy, h_yy = new
        if gain < 1e-17 and size < 1e-11:
            break
    return f, x, y


def coefficient_pyramid(field: HeightField) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the highest coefficient of every block, and where each level begins.

    The map wraps and has 2**k cells a side.
    """
    windows = np.lib.stride_tricks.sliding_window_view(field.coefficients, (4, 4))
    cells = len(field.samples)
    return _pyramid(windows[:cells, :cells].max(axis=(2, 3)))


def sharper_pyramid(textures: PackedTextures) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return what `coefficient_pyramid` does, of asperity's own bounds of the cells' heights."""
    first, columns, _ = textures.windows[0]
    width, parts = int(textures.maps["columns"][0]), int(textures.maps["parts"][0])
    # The smallest windows are parts of cells; a wrapped map repeats the first at its end.
    high = textures.tops[first : textures.windows["first"][1]].reshape(-1, columns)
    high = high[: width * parts, : width * parts].reshape(width, parts, width, parts)
    return _pyramid(high.max(axis=(1, 3)))


def _pyramid(high: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    levels = [high]
    while len(levels[-1]) > 1:
        quarter = levels[-1].reshape(len(levels[-1]) // 2, 2, -1, 2)
        levels.append(quarter.max(axis=(1, 3)))
    first = np.cumsum([0, *(level.size for level in levels)])
    return np.concatenate([level.ravel() for level in levels]), first


@inner_kernel
def _block_bound(textures, high, first, radius, centre, level, column, row):
    """Return how deep a block may be: by its highest height and the sphere over it."""
    texture = textures.maps[0]
    side, scale = float(1 << level), texture.cells_per_metre
    x0, y0 = (column - 0.5) / scale[0] - centre[0], (row - 0.5) / scale[1] - centre[1]
    x1, y1 = x0 + side / scale[0], y0 + side / scale[1]
    x, y = min(max(0.0, x0), x1), min(max(0.0, y0), y1)
    square = x * x + y * y
    if square > (_FACING * radius) ** 2:
        return -np.inf
    c, r = (column % texture.columns) >> level, (row % texture.rows) >> level
    width = texture.columns >> level
    return high[first[level] + r * width + c] + math.sqrt(radius * radius - square) - centre[2]


@inner_kernel
def uncertified_depth(textures, high, first, radius, centre, guess, finest, stack, out):
    """Fill `out` (4,): depth [m], place (x, y) from the centre, blocks looked at.

    `high` and `first` are a pyramid.

    `guess` (2,) is a place to climb from first, from the centre. Blocks of 2**finest cells a side
    are not divided. `stack` (100, 4) is written to. The texture has 2**k cells a side and wraps.
    """
    scale, reach = textures.maps[0].cells_per_metre[0], _FACING * radius
    cell = 1.0 / scale
    stride = 4.0 * cell * (1 << finest)
    best, best_x, best_y = _climb(textures, radius, centre, guess[0], guess[1], 0.2 * radius)
    top_level, level = len(first) - 2, 0
    while level < top_level and (1 << level) < 2.0 * reach * scale:
        level += 1
    column = math.floor((centre[0] - reach) * scale + 0.5) >> level
    row = math.floor((centre[1] - reach) * scale + 0.5) >> level
    top = looked = 0
    # The four blocks round the sphere first; then the four parts of the block on top.
    while True:
        start = top
        for child in range(4):
            c, r = (column + (child & 1)) << level, (row + (child >> 1)) << level
            bound = _block_bound(textures, high, first, radius, centre, level, c, r)
            looked += 1
            if bound <= best:
                continue
            place = top
            while place > start and stack[place - 1, 3] > bound:
                for j in range(4):
                    stack[place, j] = stack[place - 1, j]
                place -= 1
            stack[place, 0], stack[place, 1], stack[place, 2], stack[place, 3] = level, c, r, bound
            top += 1
        level = -1
        while top > 0:
            top -= 1
            if stack[top, 3] <= best:
                continue
            level = int(stack[top, 0])
            if level > finest:
                break
            half = 0.5 * (1 << level) - 0.5
            x = (stack[top, 1] + half) * cell - centre[0]
            y = (stack[top, 2] + half) * cell - centre[1]
            if x * x + y * y < reach * reach:
                value = texture_at(textures, 0, centre[0] + x, centre[1] + y)[0] - centre[2]
                if value + math.sqrt(radius * radius - x * x - y * y) > best:
                    best, best_x, best_y = _climb(textures, radius, centre, x, y, stride)
            level = -1
        if level < 0:
            break
        level -= 1
        column, row = int(stack[top, 1]) >> level, int(stack[top, 2]) >> level
    out[0], out[1], out[2], out[3] = best, best_x, best_y, looked


@kernel
def timed_uncertified(
    textures, high, first, radius, stiffness, finest, centres, ns_out, depth_out, wrench_out
):  # fmt: skip
    """Fill time [ns], depth and wrench (6,) of every place of the sphere's centre (n, 3)."""
    stamp, stack = np.zeros(2, np.int64), np.empty((100, 4))
    guess, found = np.zeros(2), np.zeros(4)
    for q in range(len(centres)):
        centre = centres[q]
        begun = now(stamp)
        uncertified_depth(textures, high, first, radius, centre, guess, finest, stack, found)
        depth, x, y = found[0], found[1], found[2]
        root = math.sqrt(radius * radius - x * x - y * y)
        push = stiffness * max(depth, 0.0)
        # m = (-s, 1), with the sphere's slope at the deepest place; the lever is its point.
        fx, fy, fz = -push * x / root, -push * y / root, push
        w = wrench_out[q]
        w[0], w[1], w[2] = fx, fy, fz
        w[3], w[4], w[5] = y * fz + root * fy, -root * fx - x * fz, x * fy - y * fx
        if q + 1 < len(centres):
            # The place stays where it is on the plate, as far as it is still under the sphere.
            guess[0] = x + centre[0] - centres[q + 1, 0]
            guess[1] = y + centre[1] - centres[q + 1, 1]
            if guess[0] ** 2 + guess[1] ** 2 > (0.9 * radius) ** 2:
                guess[0] = guess[1] = 0.0
        ns_out[q] = now(stamp) - begun
        depth_out[q] = depth


def nodes_of(field: HeightField) -> tuple[NDArray[np.float64], float]:
    """Return the heights at the map's own samples, with the map's corner in the middle.

    The other number is the distance from the middle to the outermost samples [m].
    """
    n = field.samples.shape[0]
    return np.roll(field.samples, (n // 2, n // 2), (0, 1)), 0.5 * (n - 1) * field.pixel_size[0]


class MujocoField:
    """A sphere on MuJoCo's height field: pose set, kinematics, collision; depth along z.

    Depth of a contact is its penetration along its normal over that normal's z.
    """

    def __init__(self, field: HeightField, radius: float) -> None:
        heights, half = nodes_of(field)
        low, span = float(heights.min()), float(np.ptp(heights))
        n = len(heights)
        model = mujoco.MjModel.from_xml_string(
            f"""<mujoco><asset><hfield name="plate" nrow="{n}" ncol="{n}"
            size="{half:.17g} {half:.17g} {span:.17g} 0.01"/></asset><worldbody>
            <geom type="hfield" hfield="plate" pos="0 0 {low:.17g}"/>
            <body name="tip"><freejoint/><geom type="sphere" size="{radius:.17g}" mass="0.01"/>
            </body></worldbody></mujoco>"""
        )
        model.hfield_data[:] = ((heights - low) / span).ravel()
        self._model, self._data = model, mujoco.MjData(model)

    def query(self, centre: NDArray[np.float64]) -> None:
        """Do what is timed."""
        self._data.qpos[:3] = centre
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)

    def depth(self, centre: NDArray[np.float64]) -> float:
        """Return the depth along z [m]; nan without contact."""
        self.query(centre)
        contact = self._data.contact
        up = np.abs(contact.frame[:, 2])
        return float(np.max(-contact.dist / up)) if contact.dist.size else math.nan


class FclField:
    """A sphere on triangles in python-fcl's hierarchy.

    `by="contacts"` asks for all contacts, which any shape can; the depth is the largest
    penetration over its normal's z. `by="distance"` asks how far the sphere's centre is, which
    spheres alone can; without a normal's z the depth is that along the nearest way out.
    """

    def __init__(self, field: HeightField, radius: float, *, by: str = "contacts") -> None:
        import fcl

        self._fcl, self._radius, self._by = fcl, radius, by
        heights, half = nodes_of(field)
        n = len(heights)
        x = np.linspace(-half, half, n)
        vertices = np.column_stack([np.tile(x, n), np.repeat(x, n), heights.ravel()])
        corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
        triangles = np.vstack(
            [
                np.column_stack([corner, corner + 1, corner + n + 1]),
                np.column_stack([corner, corner + n + 1, corner + n]),
            ]
        )
        mesh = fcl.BVHModel()
        mesh.beginModel(len(vertices), len(triangles))
        mesh.addSubModel(vertices, triangles)
        mesh.endModel()
        self._mesh = fcl.CollisionObject(mesh, fcl.Transform())
        size = radius if by == "contacts" else 1e-6 * radius
        self._ball = fcl.CollisionObject(fcl.Sphere(size), fcl.Transform())
        self._size = size
        self._request = fcl.CollisionRequest(num_max_contacts=1000, enable_contact=True)
        self._far = fcl.DistanceRequest(enable_nearest_points=True)

    def query(self, centre: NDArray[np.float64]):  # type: ignore[no-untyped-def]
        """Do what is timed."""
        self._ball.setTranslation(centre)
        if self._by == "contacts":
            found = self._fcl.CollisionResult()
            self._fcl.collide(self._mesh, self._ball, self._request, found)
        else:
            found = self._fcl.DistanceResult()
            self._fcl.distance(self._mesh, self._ball, self._far, found)
        return found

    def depth(self, centre: NDArray[np.float64]) -> float:
        """Return the depth along z [m]; nan without contact."""
        found = self.query(centre)
        if self._by == "contacts":
            # fcl's sign is not always the same.
            depths = [abs(c.penetration_depth) / max(abs(c.normal[2]), 0.2) for c in found.contacts]
            return max(depths, default=math.nan)
        gap = found.min_distance + self._size
        up = (centre[2] - found.nearest_points[0][2]) / gap
        return (self._radius - gap) / max(up, 0.2)
