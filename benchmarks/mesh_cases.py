"""What `bench_meshes.py` times: poses of tools on parts, bodies that grow, and what is beside them.

The *paper's method* here is what its graphics card did, in compiled code: the facets round the
contact are drawn along n into two grids of 50 x 50 heights, each line of a facet's box once, at
full detail (the same splines, points moved sideways as asperity moves them); the depth is the
largest overlap of the grids, and the gradient comes from ten more drawings with the tool moved by
20 um along u and v, and turned by that over a lever of 10 mm. In its favour: which facets lie
within the grid is found outside the time that is taken, the scene's side, which does not move, is
drawn once for all eleven, and a contact that asperity splits into patches has one grid.

*python-fcl* is given both bodies' surfaces at full detail: triangles halved until there are about
as many as the paper's table of models says, displaced along their interpolated normals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel
from asperity.contact.narrow_phase.displaced_surface import height_at
from asperity.contact.narrow_phase.facet_patch import fill_facet_patch
from asperity.contact.narrow_phase.records import PATCH, POINT
from asperity.contact.narrow_phase.smooth_base import parameters_at
from asperity.contact.narrow_phase.steep_plane import FLATTEST
from asperity.contact.solver import ContactSolver
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.convex.pieces import convex_pieces
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.geometry.mesh.texture_coordinates import places_on_map
from asperity.geometry.poses import rotated
from asperity.scene.builtin.file_cad import BOSS_TOP, YAW
from asperity.scene.scene import Scene
from asperity.simulation.simulation import Simulation
from asperity.texture.height_field import HeightField
from asperity.texture.packed import texture_at
from asperity.texture.patterns.random_surfaces import self_affine
from peers import now

DT, SPEED = 1e-3, 0.083
LEAD = (1e-3, 7.5e-4, 5e-4, 2.5e-4, 0.0)
"""From how far above a perturbed path is met, tick by tick [m]."""
SEGMENTS = 8
"""Stretches of a path, spread over it, that are timed tick by tick."""
KNOT, _LOOKS = 50, 6
"""Ticks from one pose whose depth is set to the next, and looks that setting it takes at most."""
ASTRAY = 3e-3
"""No contact here is so deep: one that is said to be is false [m]."""
GRID, STEP, LEVER = 50, 20e-6, 10e-3
FULL_DETAIL = {"hammer": 433_152, "file": 285_824, "part": 658_432, "block-1": 400_000}
"""Triangles: the paper's; of the block ours, its texels would ask for 9.5 million."""
Array = NDArray[np.float64]


# Poses.


def families(scene: Scene, simulation: Simulation) -> dict[str, Array]:
    """Return the scene's own path (n, 7), and three of it perturbed, whose height is not set."""
    own = np.array(simulation.trajectory().poses, dtype=np.float64)
    s = np.linspace(0.0, 1.0, len(own))
    wave = np.sin(40.0 * s)
    up = np.array([0.0, 0.0, 1.0])
    blade = np.array([math.cos(YAW), math.sin(YAW), 0.0])
    # Tilted about the contact: the hammer's is the middle of its face, the file's over the boss.
    if scene.tool == "hammer":
        pivots, azimuth = own[:, :3], 2.0 * math.pi * s
        edges = np.radians(35.0 + 3.0 * wave)[:, None] * [0.0, 1.0, 0.0]
    else:
        pivots = np.tile([0.0, 0.0, BOSS_TOP], (len(own), 1))
        azimuth = YAW + np.radians(30.0) * wave
        edges = np.radians(45.0 + 3.0 * wave)[:, None] * blade
    axes = np.stack([np.cos(azimuth), np.sin(azimuth), 0.0 * s], axis=1)
    turns = {
        "flat, turned": np.radians(40.0) * s[:, None] * up,
        "tilted by 1 to 10 degrees": np.radians(1.0 + 9.0 * s)[:, None] * axes,
        "on an edge": edges,
    }
    return {"own path": own} | {
        name: np.array([about(*row) for row in zip(own, pivots, turn, strict=True)])
        for name, turn in turns.items()
    }


def about(pose: Array, pivot: Array, turn: Array) -> Array:
    """Return a pose turned about a place of the world."""
    out = rotated(pose, turn)
    arm = rotated(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), turn)
    out[:3] = pivot + rotation(arm) @ (pose[:3] - pivot)
    return out


def rotation(pose: Array) -> Array:
    """Return the rotation matrix of a pose."""
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, pose[3:])
    return out.reshape(3, 3)


def stretches(path: Array, count: int) -> list[tuple[int, int]]:
    """Return from where to where to time `count` poses of a path, in `SEGMENTS` stretches."""
    size = max(count // SEGMENTS, 1) + 1
    starts = np.linspace(0, len(path) - size, SEGMENTS).astype(int)
    return [(int(a), int(a) + size) for a in starts]


def pressed(engine: ContactSolver, path: Array, depths: Array) -> Array:
    """Return a path moved up or down, so that it is about as deep as wanted [m]."""
    knots = np.unique([*range(0, len(path), KNOT), len(path) - 1])
    heights, start = [], math.nan
    for i in knots:
        start = _level(engine, path[i], depths[i], start)
        heights.append(start)
    out = path.copy()
    out[:, 2] = np.interp(np.arange(len(path)), knots, heights)
    return out


def _level(engine: ContactSolver, pose: Array, depth: float, start: float) -> float:
    """Return the height at which a pose is so deep; `start` is a guess, or nan."""
    pose = pose.copy()
    near = math.nan if start == start else _first_near(engine, pose)
    pose[2] = start if start == start else near - depth
    met = False
    for look in range(_LOOKS):
        engine.reset()
        engine.wrench(pose, 0.0)
        k = engine.contacts.count[0]
        if k == 0 and met:
            break
        met = k > 0
        # Along n a tool that is lifted is less deep by just as much.
        off = float(engine.contacts.depth[:k].max()) - depth if met else -1e-4 * (1 + look)
        if abs(off) < 5e-5:
            break
        pose[2] += min(max(off, -1e-3), 1e-3)
    # Where it starts on its own, an engine may find nothing: then as deep as MuJoCo has it.
    return float(pose[2]) if met or start == start else near - depth


def _first_near(engine: ContactSolver, pose: Array) -> float:
    """Return the height at which MuJoCo, from above, first says that something is near."""
    pose = pose.copy()
    low, high = pose[2] - 0.03, pose[2] + 0.03
    while high - low > 1e-6:
        pose[2] = 0.5 * (low + high)
        if engine.candidates(pose)[0] > 0:
            low = pose[2]
        else:
            high = pose[2]
    return float(low)


# Full detail, and python-fcl.


def full_detail(body: Body, count: int) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and faces of a body's displaced surface, of about `count` triangles."""
    mesh = body.mesh
    assert mesh is not None
    assert body.texture is not None
    corners = mesh.vertices[mesh.faces]
    parts = np.concatenate([corners, mesh.normals, places_on_map(body, body.texture)], axis=2)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * float(np.linalg.norm(across, axis=1).sum())
    limit, halved = 2.3 * math.sqrt(2.0 * area / count), parts
    for _ in range(3):
        halved = _halved(parts, limit)
        if abs(len(halved) / count - 1.0) < 0.1:
            break
        limit *= math.sqrt(len(halved) / count)
    w = halved[..., 3:6] / np.linalg.norm(halved[..., 3:6], axis=2)[..., None]
    t = body.texture.heights(halved[..., 6], halved[..., 7])
    points = (halved[..., :3] + t[..., None] * w).reshape(-1, 3)
    # One vertex where triangles meet; torn places, where textures do not agree, stay torn.
    keys = np.ascontiguousarray(np.round(points / 1e-9).astype(np.int64))
    _, first, inverse = np.unique(
        keys.view([("", np.int64)] * 3).ravel(), return_index=True, return_inverse=True
    )
    return points[first], inverse.reshape(-1, 3)


def _halved(parts: Array, limit: float) -> Array:
    """Return triangles (n, 3, d), places first, cut in the middle of sides longer than `limit`.

    Both triangles at a side cut it, so that no gaps open.
    """
    done = []
    while len(parts):
        sides = np.roll(parts[..., :3], -1, axis=1) - parts[..., :3]
        long = np.sum(sides**2, axis=2) > limit**2
        number = long.sum(axis=1)
        done.append(parts[number == 0])
        # Turned so that the first side is long, and of two long ones the second too.
        first = np.where(number == 1, long.argmax(axis=1), (np.argmin(long, axis=1) + 1) % 3)
        turn = (first[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(parts, turn[..., None], axis=1), 1, 0)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        into = {
            1: [(a, ab, c), (ab, b, c)],
            2: [(ab, b, bc), (a, ab, bc), (a, bc, c)],
            3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
        }
        parts = np.concatenate(
            [
                np.stack([corner[number == k] for corner in triangle], axis=1)
                for k, triangles in into.items()
                for triangle in triangles
            ]
        )
    return np.concatenate(done)


class FclPair:
    """Two triangle meshes in python-fcl's hierarchies, the first of which moves."""

    def __init__(
        self, tool: tuple[Array, Any], part: tuple[Array, Any], fixed: Array, asked: Sequence[int]
    ) -> None:
        import fcl

        self._fcl = fcl
        self.tool, self._part = (self._object(*mesh) for mesh in (tool, part))
        self._part.setTransform(fcl.Transform(fixed[:, :3], fixed[:, 3]))
        self._requests = {
            most: fcl.CollisionRequest(num_max_contacts=most, enable_contact=True) for most in asked
        }

    def _object(self, vertices: Array, faces: NDArray[np.int64]) -> Any:
        mesh = self._fcl.BVHModel()
        mesh.beginModel(len(vertices), len(faces))
        mesh.addSubModel(vertices, faces)
        mesh.endModel()
        return self._fcl.CollisionObject(mesh, self._fcl.Transform())

    def query(self, pose: Array, most: int) -> int:
        """Do what is timed; return how many pairs of triangles are reported."""
        self.tool.setTransform(self._fcl.Transform(pose[3:], pose[:3]))
        found = self._fcl.CollisionResult()
        self._fcl.collide(self.tool, self._part, self._requests[most], found)
        return len(found.contacts)


# The paper's method.


class Where(NamedTuple):
    """A contact that asperity has found, for the paper's method to look at."""

    pose: Array
    body: int
    normal: Array
    middle: Array
    spread: float
    """How far its patches lie from their middle at most [m]."""
    depth: float


def contact_of(engine: ContactSolver, pose: Array) -> Where | None:
    """Return the contact of the last pose that pushes most; None without, or if one is false."""
    c = engine.contacts
    k = c.count[0]
    if k == 0 or c.depth[:k].max() > ASTRAY:
        return None
    main = int(np.argmax(c.weight[:k] * c.depth[:k]))
    same = (c.body[:k] == c.body[main]) & (c.normal[:k] @ c.normal[main] > 0.99)
    points = c.point[:k][same]
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    spread = float(np.abs(points - middle).max())
    deepest = float(c.depth[:k][same].max())
    return Where(pose.copy(), int(c.body[main]), c.normal[main].copy(), middle, spread, deepest)


@inner_kernel
def _outside(patch, x, y, margin):
    """Return whether parameters lie beyond a patch's borders by more than `margin`."""
    if x < patch.rectangle[0] - margin or x > patch.rectangle[1] + margin:
        return True
    if y < patch.rectangle[2] - margin or y > patch.rectangle[3] + margin:
        return True
    for i in range(patch.border_count):
        border = patch.borders[i]
        if border.constant + border.from_x * x + border.from_y * y > margin:
            return True
    return False


@inner_kernel
def _height_over(textures, patch, u, v, margin):
    """Return the height of a plane patch over (u, v), textured through a flat map; or -inf.

    `margin`: how far apart in parameters a point and what is drawn there may be.
    """
    x, y = parameters_at(patch, u, v)
    if _outside(patch, x, y, margin):
        return -np.inf
    t = w_z = 0.0
    if patch.texture >= 0:
        k = patch.texture
        w_z = 1.0
        # The point that is moved sideways to (u, v): its base lies where that takes it back to.
        for _ in range(1 if patch.is_level else 3):
            bu = patch.texture_origin[0] + patch.texture_from_x[0] * x + patch.texture_from_y[0] * y
            bv = patch.texture_origin[1] + patch.texture_from_x[1] * x + patch.texture_from_y[1] * y
            t = texture_at(textures, k, bu, bv)[0]
            if patch.is_level:
                break
            w_u = patch.normal[0] + patch.normal_from_x[0] * x + patch.normal_from_y[0] * y
            w_v = patch.normal[1] + patch.normal_from_x[1] * x + patch.normal_from_y[1] * y
            w_z = patch.normal[2] + patch.normal_from_x[2] * x + patch.normal_from_y[2] * y
            if not patch.is_unit:
                size = 1.0 / math.sqrt(w_u * w_u + w_v * w_v + w_z * w_z)
                w_u, w_v, w_z = w_u * size, w_v * size, w_z * size
            x, y = parameters_at(patch, u - t * w_u, v - t * w_v)
    if margin > 0.0 and _outside(patch, x, y, 0.0):
        return -np.inf
    return patch.origin[2] + patch.slope[0] * x + patch.slope[1] * y + t * w_z


@inner_kernel
def _shift(textures, patch):
    """Return how far a patch's texture moves points sideways at most [m]."""
    if patch.texture < 0 or patch.is_level:
        return 0.0
    return patch.normal_lateral * textures.maps[patch.texture].max_abs_height


@inner_kernel
def _draw(textures, patch, cu, cv, window, heights):
    """Raise `heights` (GRID, GRID) to a patch's surface where that is higher."""
    pitch = window / GRID
    hx = 0.5 * (patch.rectangle[1] - patch.rectangle[0])
    hy = 0.5 * (patch.rectangle[3] - patch.rectangle[2])
    shift = _shift(textures, patch)
    reach_u = abs(patch.lateral[0, 0]) * hx + abs(patch.lateral[0, 1]) * hy + shift
    reach_v = abs(patch.lateral[1, 0]) * hx + abs(patch.lateral[1, 1]) * hy + shift
    start_u, start_v = cu - 0.5 * window + 0.5 * pitch, cv - 0.5 * window + 0.5 * pitch
    i0 = max(math.ceil((patch.origin[0] - reach_u - start_u) / pitch), 0)
    i1 = min(math.floor((patch.origin[0] + reach_u - start_u) / pitch), GRID - 1)
    j0 = max(math.ceil((patch.origin[1] - reach_v - start_v) / pitch), 0)
    j1 = min(math.floor((patch.origin[1] + reach_v - start_v) / pitch), GRID - 1)
    margin = shift / patch.lateral_min
    for i in range(i0, i1 + 1):
        for j in range(j0, j1 + 1):
            z = _height_over(textures, patch, start_u + i * pitch, start_v + j * pitch, margin)
            heights[i, j] = max(heights[i, j], z)


@inner_kernel
def _into(frame, body, sign, turn, shift):
    """Fill the way from a body's frame into (u, v, sign n)."""
    for i in range(3):
        s = sign if i == 2 else 1.0
        shift[i] = 0.0
        for j in range(3):
            turn[i, j] = 0.0
            shift[i] += s * frame[i, j] * body[j, 3]
            for k in range(3):
                turn[i, j] += s * frame[i, k] * body[k, j]


@inner_kernel
def _moved(frame, body, axis, by, out):
    """Fill a body's pose moved along axis 0, 1 of `frame`, or turned about axis 0, 1, 2 (2..4)."""
    for i in range(3):
        for j in range(4):
            out[i, j] = body[i, j]
    if axis < 2:
        for i in range(3):
            out[i, 3] += by * frame[axis, i]
        return
    e = frame[axis - 2]
    c, s = math.cos(by), math.sin(by)
    for j in range(4):
        along = e[0] * body[0, j] + e[1] * body[1, j] + e[2] * body[2, j]
        for i in range(3):
            one, two = (i + 1) % 3, (i + 2) % 3
            across = e[one] * body[two, j] - e[two] * body[one, j]
            out[i, j] = c * body[i, j] + s * across + (1.0 - c) * along * e[i]


@inner_kernel
def _side(textures, table, geometry, facets, turn, shift, cu, cv, window, patch, heights):
    """Draw facets of one body."""
    for i in range(GRID):
        for j in range(GRID):
            heights[i, j] = -np.inf
    for f in facets:
        fill_facet_patch(table, geometry, f, turn, shift, patch)
        _draw(textures, patch, cu, cv, window, heights)


@kernel
def paper_depths(
    textures, table, geometry, facets_a, facets_b, body_a, body_b, frame, cu, cv, window, room,
    patches, depths_out,
):  # fmt: skip
    """Fill the eleven depths [m] of the paper's method; return the time that took [ns].

    `body_a`, `body_b` (3, 4) are seen from the tool's centre of mass, `frame` has u, v, n in
    rows, (cu, cv) is the grid's middle. `room` (2, GRID, GRID) and `patches` (1,) are written to.
    """
    patch = patches[0]
    stamp = np.zeros(2, np.int64)
    begun = now(stamp)
    turn, shift, moved = np.empty((3, 3)), np.empty(3), np.empty((3, 4))
    _into(frame, body_b, 1.0, turn, shift)
    _side(textures, table, geometry, facets_b, turn, shift, cu, cv, window, patch, room[1])
    for k in range(11):
        axis = (k - 1) // 2
        by = STEP if k % 2 else -STEP
        if k == 0:
            axis, by = 0, 0.0
        elif axis > 1:
            by /= LEVER
        _moved(frame, body_a, axis, by, moved)
        _into(frame, moved, -1.0, turn, shift)
        _side(textures, table, geometry, facets_a, turn, shift, cu, cv, window, patch, room[0])
        best = -np.inf
        for i in range(GRID):
            for j in range(GRID):
                best = max(best, room[0, i, j] + room[1, i, j])
        depths_out[k] = best
    return now(stamp) - begun


@kernel
def heights_off(textures, table, geometry, facets, turn, shift, places, patches, off_out):
    """Fill by how much drawn heights are off asperity's over (u, v) `places`, nan beyond facets."""
    points, patch = np.empty(1, POINT), patches[0]
    for k in range(len(facets)):
        f = facets[k]
        fill_facet_patch(table, geometry, f, turn, shift, patch)
        margin = _shift(textures, patch) / patch.lateral_min
        for i in range(len(places)):
            z = _height_over(textures, patch, places[i, 0], places[i, 1], margin)
            other = height_at(textures, patch, places[i, 0], places[i, 1], points[0])[0]
            there = z > -np.inf and other > -np.inf
            off_out[k, i] = abs(z - other) if there else np.nan


class Paper:
    """The paper's method beside an engine."""

    def __init__(self, engine: ContactSolver) -> None:
        assert engine._mesh is not None
        self._engine, self._table = engine, engine._mesh.model.facets
        self._room, self._patches = np.empty((2, GRID, GRID)), np.zeros(1, PATCH)
        self.depths = np.empty(11)
        self.off: list[Array] = []
        """By how much drawn heights were off asperity's, where that was looked at [m]."""

    def looked(self, where: Where) -> Callable[[], float]:
        """Return what takes the eleven depths at a contact, and returns how long that took [us]."""
        e, table = self._engine, self._table
        turn = rotation(where.pose)
        origin = where.pose[:3] + turn @ e.centre
        body_a = np.column_stack([turn, where.pose[:3] - origin])
        body_b = e._collider.frames[where.body].copy()
        body_b[:, 3] -= origin
        n = where.normal
        u = np.cross(np.eye(3)[np.argmin(np.abs(n))], n)
        u /= np.linalg.norm(u)
        frame = np.stack([u, np.cross(n, u), n])
        cu, cv, _ = frame @ (where.middle - origin)
        window = 2.0 * where.spread + e.settings.window
        facets = []
        for number, body, sign in ((e._scene.tool, body_a, -1.0), (where.body, body_b, 1.0)):
            mine = np.flatnonzero(table.body == number)
            seen = sign * (table.axes[mine, 2] @ (n @ body[:, :3])) >= FLATTEST
            places = table.points[mine] @ body[:, :3].T @ frame[:2].T + frame[:2] @ body[:, 3]
            k = e._scene.geometry.texture[number]
            height = e._scene.textures.maps["max_abs_height"][k] if k >= 0 else 0.0
            reach = 0.5 * window + height + 2.0 * STEP
            near = (places.min(axis=1) <= [cu + reach, cv + reach]).all(axis=1)
            near &= (places.max(axis=1) >= [cu - reach, cv - reach]).all(axis=1)
            facets.append(mine[seen & near])
        scene = (e._scene.textures, table, e._scene.geometry)
        spread = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 2)) * window + [cu, cv]
        for number, body, sign in zip(facets, (body_a, body_b), (-1.0, 1.0), strict=True):
            into = frame * [[1.0], [1.0], [sign]]
            off = np.empty((len(number), len(spread)))
            heights_off(
                *scene, number, into @ body[:, :3], into @ body[:, 3], spread, self._patches, off
            )
            self.off.append(off[~np.isnan(off)])
        arguments = (
            *scene, *facets, body_a, body_b, frame, cu, cv, window, self._room, self._patches,
            self.depths,
        )  # fmt: skip
        return lambda: paper_depths(*arguments) * 1e-3


# Bodies that grow.


class Growing(NamedTuple):
    """A tool on a scene, and where it starts."""

    bodies: Sequence[Body]
    model: mujoco.MjModel
    start: Array
    depth: float


def rough(seed: int) -> HeightField:
    """Return a texture of 20 mm that wraps, waves of 0.64 to 2 mm, 0.1 mm high."""
    pixel = 8e-5
    heights = self_affine((256, 256), pixel, hurst=0.8, rms_slope=0.1, rolloff=2e-3, seed=seed)
    return HeightField(heights, pixel, "wrap")


def _plate() -> tuple[Body, str]:
    size, place = (0.05, 0.05, 0.01), (0.0, 0.0, -0.01)
    geom = '<geom type="box" size=".05 .05 .01" pos="0 0 -.01"/>'
    return Body("plate", [Geom("box", size, place)], rough(1)), f'<body name="plate">{geom}</body>'


def _growing(
    fixed: Sequence[tuple[Body, str]], mesh: Mesh, pieces: Sequence[Array], depth: float,
    assets: str = "",
) -> Growing:  # fmt: skip
    """Return a mesh in convex pieces, rough all over, above the bodies of a scene."""
    assets += "".join(_asset(f"tool-{i}", piece) for i, piece in enumerate(pieces))
    geoms = "".join(f'<geom type="mesh" mesh="tool-{i}"/>' for i in range(len(pieces)))
    body, z = _mesh_body("tool", mesh, pieces, 2), -float(mesh.vertices[:, 2].min())
    xml = (
        f"<mujoco><asset>{assets}</asset><worldbody>{''.join(text for _, text in fixed)}"
        f'<body name="tool" pos="0 0 {z}"><freejoint/>{geoms}</body></worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(xml)
    start = np.array([0.0, 0.0, z, 1.0, 0.0, 0.0, 0.0])
    return Growing((*(one for one, _ in fixed), body), model, start, depth)


def _asset(name: str, piece: Array) -> str:
    return f'<mesh name="{name}" vertex="{" ".join(f"{x:.9g}" for x in piece.ravel())}"/>'


def _mesh_body(name: str, mesh: Mesh, pieces: Sequence[Array], seed: int) -> Body:
    middles = [0.5 * (piece.min(axis=0) + piece.max(axis=0)) for piece in pieces]
    halves = [0.5 * np.ptp(piece, axis=0) for piece in pieces]
    geoms = [Geom("mesh", h, m) for h, m in zip(halves, middles, strict=True)]
    return Body(name, geoms, rough(seed), "triplanar", mesh=mesh)


def ball(level: int) -> Growing:
    """Return a ball of 15 mm on a plate: an icosahedron's triangles quartered `level` times."""
    import trimesh

    made = trimesh.creation.icosphere(subdivisions=level, radius=0.015)
    mesh = mesh_from_arrays(made.vertices, made.faces)
    return _growing([_plate()], mesh, convex_pieces(mesh), 3e-4)


def bumps(n: int) -> Growing:
    """Return a plate of 2 n^2 triangles with bumps of 0.5 mm each 10 mm, on one of each 8 mm."""
    under = _bumpy(n, 0.06, 0.008, 1.0)
    over = _bumpy(n, 0.03, 0.010, -1.0)
    box = _box(np.array([0.06, 0.06, 4.5e-3])) - np.array([0.0, 0.0, 1.75e-3])
    body = _mesh_body("plate", under, [box], 1)
    text = '<body name="plate"><geom type="mesh" mesh="plate"/></body>'
    upper = box * [0.5, 0.5, -1.0]
    return _growing([(body, text)], over, [upper], 3e-4, _asset("plate", box))


def _bumpy(n: int, side: float, wavelength: float, sense: float) -> Mesh:
    """Return a square sheet, seen from above (`sense` 1) or below (-1); smooth normals."""
    x = np.linspace(-0.5, 0.5, n + 1) * side
    x, y = np.meshgrid(x, x)
    k = 2.0 * math.pi / wavelength
    z = sense * 2.5e-4 * (np.cos(k * x) + np.cos(k * y))
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    one = np.stack([corner, corner + 1, corner + n + 2], axis=1)
    two = np.stack([corner, corner + n + 2, corner + n + 1], axis=1)
    faces = np.concatenate([one, two])
    points = np.stack([x, y, z], axis=2).reshape(-1, 3)
    return mesh_from_arrays(points, faces if sense > 0.0 else faces[:, ::-1])


def _box(size: Array) -> Array:
    return np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]) * 0.5 * size


_FACES = np.array([
    (0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 6, 7), (2, 7, 3),
    (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5),
])  # fmt: skip


def _spots(count: int) -> Array:
    """Return places (count, 2) of a square lattice of 10 mm."""
    side = math.ceil(math.sqrt(count))
    lattice = np.stack(np.divmod(np.arange(count), side), axis=1)
    return 0.01 * (lattice - lattice.mean(axis=0))


def feet(count: int) -> Growing:
    """Return a tool on so many square feet of 5 mm on one plate."""
    box = _box(np.array([5e-3, 5e-3, 5e-3]))
    pieces = [box + np.append(spot, 0.0) for spot in _spots(count)]
    return _growing([_plate()], _solids(pieces), pieces, 2e-4)


def blocks(count: int) -> Growing:
    """Return a flat tool on so many bodies, square blocks of 5 mm."""
    fixed = []
    for i, (x, y) in enumerate(_spots(count)):
        geom = '<geom type="box" size=".0025 .0025 .0025"/>'
        body = Body(f"block-{i}", [Geom("box", (2.5e-3, 2.5e-3, 2.5e-3))], rough(1))
        text = f'<body name="block-{i}" pos="{x} {y} -.0025">{geom}</body>'
        fixed.append((body, text))
    box = _box(np.array([0.1, 0.1, 0.01]))
    return _growing(fixed, _solids([box]), [box], 2e-4)


def _solids(boxes: Sequence[Array]) -> Mesh:
    faces = np.concatenate([_FACES + 8 * i for i in range(len(boxes))])
    return mesh_from_arrays(np.concatenate(boxes), faces, hard_angle=30.0)


def dragged(engine: ContactSolver, growing: Growing, count: int) -> Array:
    """Return a straight drag of `count` poses."""
    path = np.tile(growing.start, (count, 1))
    # No farther than feet stay on their blocks.
    way = 1.2e-3 * np.sin(SPEED * DT * np.arange(count) / 1.2e-3)
    path[:, 0] += way * math.cos(0.37)
    path[:, 1] += way * math.sin(0.37)
    return pressed(engine, path, np.full(count, growing.depth))
