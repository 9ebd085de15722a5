"""Meshes made by code, and engines of scenes with meshes, for the tests of their contact."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from asperity.contact.response.settings import ForceSettings
from asperity.contact.solver import ContactSolver
from asperity.geometry.bodies import Body, Geom
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.texture.height_field import HeightField

Array = NDArray[np.float64]
TICK = 1e-3
STIFFNESS = 400.0
_HARD = 20.0
"""Edges that bend more are hard [degrees]."""

# Meshes.


def blocks(x: ArrayLike, y: ArrayLike, z: ArrayLike, empty: Iterable[Sequence[int]] = ()) -> Mesh:
    """Return the surface of the cells of a grid of planes, but for those that are `empty`."""
    lines = [np.asarray(line, dtype=np.float64) for line in (x, y, z)]
    full = np.zeros([len(line) + 1 for line in lines], dtype=bool)
    full[1:-1, 1:-1, 1:-1] = True
    for i, j, k in empty:
        full[i + 1, j + 1, k + 1] = False
    number = np.arange(math.prod(map(len, lines))).reshape([len(line) for line in lines])
    faces = []
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1, 1):
            cells = np.argwhere(full & ~np.roll(full, -sign, axis)) - 1
            corner = cells.copy()
            corner[:, axis] += sign > 0
            round_it = []
            for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))[::sign]:
                at = corner.copy()
                at[:, one] += a
                at[:, two] += b
                round_it.append(number[tuple(at.T)])
            a, b, c, d = round_it
            faces += [np.stack([a, b, c], 1), np.stack([a, c, d], 1)]
    vertices = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    return mesh_from_arrays(vertices, np.concatenate(faces), hard_angle=_HARD)


def block(half: Sequence[float], middle: Sequence[float] = (0, 0, 0), cuts: int = 1) -> Mesh:
    """Return a box whose faces are cut into `cuts` x `cuts` (along its height: one) pairs."""
    counts = (cuts, cuts, 1)
    return blocks(
        *(np.linspace(m - h, m + h, n + 1) for m, h, n in zip(middle, half, counts, strict=True))
    )


def ball_mesh(radius: float, cuts: int) -> Mesh:
    """Return an icosahedron cut in four `cuts` times, with normals from its middle."""
    g = (1 + math.sqrt(5)) / 2
    points = [(0, s, t * g) for s in (-1, 1) for t in (-1, 1)]
    points = np.array([np.roll(p, k) for k in range(3) for p in points], dtype=float)
    near = np.linalg.norm(points[:, None] - points, axis=-1) < 2.1
    faces = [
        (i, j, k)
        for i in range(12) for j in range(12) for k in range(12)
        if i < min(j, k) and near[i, j] and near[j, k] and near[k, i]
        and np.linalg.det(points[[i, j, k]]) > 0.1
    ]  # fmt: skip
    x = points[np.array(faces)]
    for _ in range(cuts):
        x = quartered(x)
        x *= np.linalg.norm(points[0]) / np.linalg.norm(x, axis=-1, keepdims=True)
    unit = x.reshape(-1, 3) / np.linalg.norm(points[0])
    unit, which = np.unique(unit.round(12), axis=0, return_inverse=True)
    return mesh_from_arrays(radius * unit, which.reshape(-1, 3), normals=unit)


def hull_mesh(points: Array) -> Mesh:
    """Return the convex hull of points as a mesh."""
    hull = ConvexHull(points)
    used = points[hull.vertices]
    number = {old: new for new, old in enumerate(hull.vertices)}
    faces = np.array([[number[i] for i in face] for face in hull.simplices])
    for face, plane in zip(faces, hull.equations, strict=True):
        a, b, c = used[face]
        if np.cross(b - a, c - a) @ plane[:3] < 0.0:
            face[[1, 2]] = face[[2, 1]]
    return mesh_from_arrays(used, faces, hard_angle=_HARD)


def quartered(corners: Array) -> Array:
    """Return the corners (4 n, 3, 3) of the four parts of triangles (n, 3, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(part, 1) for part in parts])


def roller(radius: float, half: float, sides: int) -> Mesh:
    """Return a prism of many sides round z: its sides smooth, its ends flat."""
    phi = 2 * math.pi * np.arange(sides) / sides
    rim = np.stack([radius * np.cos(phi), radius * np.sin(phi)], axis=-1)
    ends = [np.column_stack([rim, np.full(sides, z)]) for z in (-half, half)]
    vertices = np.concatenate([*ends, [[0, 0, -half], [0, 0, half]]])
    k, after = np.arange(sides), (np.arange(sides) + 1) % sides
    low, high = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    faces = [
        (k, after, after + sides), (k, after + sides, k + sides),
        (low, after, k), (high, k + sides, after + sides),
    ]  # fmt: skip
    faces = np.concatenate([np.stack(f, 1) for f in faces])
    return mesh_from_arrays(vertices, faces, hard_angle=40.0)


def roof(slope: float, half: float = 2e-3, depth: float = 1.5e-3, below: float = 1e-3) -> Mesh:
    """Return a house: two slopes that meet at x = z = 0 with one normal there, walls, a floor."""
    eaves = -half * math.tan(slope)
    profile = [(-half, eaves), (0.0, 0.0), (half, eaves), (half, eaves - below),
               (-half, eaves - below)]  # fmt: skip
    vertices = np.array([(x, y, z) for y in (-depth, depth) for x, z in profile])
    around = [(i, (i + 1) % 5) for i in range(5)]
    faces = [t for i, j in around for t in ((i, j + 5, i + 5), (i, j, j + 5))]
    faces += [(0, 2, 1), (0, 3, 2), (0, 4, 3), (5, 6, 7), (5, 7, 8), (5, 8, 9)]
    # The ridge bends by twice the slope; the eaves by a right angle less the slope.
    return mesh_from_arrays(vertices, faces, hard_angle=math.degrees(2 * slope) + 1.0)


def with_uv(mesh: Mesh, texture: HeightField, seed: int) -> Mesh:
    """Return a mesh with six charts, by the axis each triangle faces: turned, some mirrored."""
    rng = np.random.default_rng(seed)
    points = mesh.vertices[mesh.faces]
    f = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    axis = np.argmax(np.abs(f), axis=1)
    chart = 2 * axis + (f[np.arange(len(f)), axis] > 0)
    uv = np.empty((len(f), 3, 2))
    for k in range(6):
        turn = Rotation.from_rotvec([0, 0, rng.uniform(0, 6)]).as_matrix()[:2, :2]
        turn = turn * [1.0, -1.0 if rng.random() < 0.5 else 1.0]
        flat = points[chart == k][:, :, [(k // 2 + 1) % 3, (k // 2 + 2) % 3]]
        uv[chart == k] = (flat @ turn + rng.uniform(0, 2e-3, 2)) / texture.size
    return mesh_from_arrays(mesh.vertices, mesh.faces, normals=mesh.normals, uv=uv)


# Bodies, and where they may touch.


class Thing(NamedTuple):
    """A body, and the corners of its convex pieces: none for one of simple geoms."""

    body: Body
    pieces: tuple[Array, ...] = ()


def thing(
    name: str,
    mesh: Mesh,
    texture: HeightField | None = None,
    mapping: str = "planar",
    pieces: Sequence[ArrayLike] | None = None,
    **more: object,
) -> Thing:
    """Return a body with a mesh, which is one piece if `pieces` are not given."""
    corners = [np.asarray(p, dtype=float) for p in ([mesh.vertices] if pieces is None else pieces)]
    geoms = [
        Geom("mesh", np.maximum(np.ptp(p, axis=0) / 2, 1e-6), 0.5 * (p.min(0) + p.max(0)))
        for p in corners
    ]
    return Thing(Body(name, geoms, texture, mapping, mesh=mesh, **more), tuple(corners))


def box_corners(low: Sequence[float], high: Sequence[float]) -> Array:
    """Return the eight corners of a box."""
    return np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), -1).reshape(-1, 3)


def slab(
    name: str = "plate", half: float = 15e-3, thick: float = 4e-3, cuts: int = 1, **more: object
) -> Thing:
    """Return a square plate whose top is at z = 0."""
    return thing(name, block((half, half, thick / 2), (0, 0, -thick / 2), cuts), **more)


def brick(half: Sequence[float], name: str = "tool", **more: object) -> Thing:
    """Return a box of triangles round the origin."""
    return thing(name, block(half), **more)


def holed_plate(hole: float, half: float = 10e-3, thick: float = 4e-3, **more: object) -> Thing:
    """Return a plate, top at z = 0, with a square hole through it; its pieces surround the hole."""
    lines = [-half, -hole, hole, half]
    mesh = blocks(lines, lines, [-thick, 0.0], empty=[(1, 1, 0)])
    pieces = [
        box_corners((a, c, -thick), (b, d, 0))
        for a, b, c, d in (
            (-half, -hole, -half, half), (hole, half, -half, half),
            (-hole, hole, -half, -hole), (-hole, hole, hole, half),
        )
    ]  # fmt: skip
    return thing("plate", mesh, pieces=pieces, **more)


def hook(gap: float = 3e-3, thick: float = 2e-3, name: str = "plate", **more: object) -> Thing:
    """Return a C: an arm with its top at z = 0, one a gap below it, and a back at x < 0."""
    x, y, z = [-4e-3, -2e-3, 10e-3], [-5e-3, 5e-3], [-2 * thick - gap, -thick - gap, -thick, 0.0]
    pieces = [
        box_corners((x[0], y[0], z[0]), (x[1], y[1], z[3])),
        box_corners((x[1], y[0], z[0]), (x[2], y[1], z[1])),
        box_corners((x[1], y[0], z[2]), (x[2], y[1], z[3])),
    ]
    return thing(name, blocks(x, y, z, empty=[(1, 0, 1)]), pieces=pieces, **more)


# Engines.


def engine_of(
    tool: Thing | Body,
    *grounds: Thing | Body,
    poses: Sequence[Array] = (),
    tool_first: bool = False,
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    **settings: object,
) -> ContactSolver:
    """Return the engine of a scene of fixed bodies and one free tool.

    `poses` are those of the grounds, at the origin if left out; `centre` is the tool's centre of
    mass in its frame [m].
    """
    model, bodies = model_of(tool, *grounds, poses=poses, centre=centre)
    name = bodies[-1].name
    if tool_first:
        bodies = [bodies[-1], *bodies[:-1]]
    return ContactSolver(model, bodies, name, ForceSettings(**settings))


def model_of(
    tool: Thing | Body,
    *grounds: Thing | Body,
    poses: Sequence[Array] = (),
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    joint: str = "",
) -> tuple[mujoco.MjModel, list[Body]]:
    """Return a model and its bodies, the tool as the last; `joint` is that of the grounds."""
    mass = '<inertial pos="{}" mass="0.1" diaginertia="1e-5 1e-5 1e-5"/>'
    at_rest = np.array([0.0, 0, 0, 1, 0, 0, 0])
    placed = list(poses) or [at_rest] * len(grounds)
    things = [t if isinstance(t, Thing) else Thing(t) for t in (*grounds, tool)]
    assets = "".join(
        f'<mesh name="{t.body.name}{i}" vertex="{_spaced(p.ravel())}" inertia="convex"/>'
        for t in things
        for i, p in enumerate(t.pieces)
    )
    parts = [
        f'<body name="{t.body.name}" pos="{_spaced(at[:3])}" quat="{_spaced(at[3:])}">'
        f"{joint}{mass.format('0 0 0')}{_geoms(t)}</body>"
        for t, at in zip(things[:-1], placed, strict=True)
    ]
    name = things[-1].body.name
    middle = mass.format(_spaced(centre))
    parts.append(f'<body name="{name}"><freejoint/>{middle}{_geoms(things[-1])}</body>')
    xml = (
        f'<mujoco><compiler inertiafromgeom="false"/><asset>{assets}</asset>'
        f"<worldbody>{''.join(parts)}</worldbody></mujoco>"
    )
    return mujoco.MjModel.from_xml_string(xml), [t.body for t in things]


def _geoms(of: Thing) -> str:
    if of.pieces:
        return "".join(
            f'<geom type="mesh" mesh="{of.body.name}{i}"/>' for i in range(len(of.pieces))
        )
    return "".join(
        f'<geom type="{g.kind}" size="{_spaced(g.size)}" pos="{_spaced(g.position)}" '
        f'quat="{_spaced(g.quaternion)}"/>'
        for g in of.body.geoms
    )


def _spaced(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


class Touch(NamedTuple):
    """One query: the wrench, and copies of the rows of the contacts."""

    wrench: Array
    body: NDArray[np.int64]
    depth: Array
    gap: Array
    point: Array
    normal: Array
    slope_normal: Array
    weight: Array
    force: Array
    status: NDArray[np.int64]

    @property
    def mean_depth(self) -> float:
        """Mean of the patches' depths by their weights, as the normal force has it [m]."""
        return float(np.sum(self.weight * self.depth))


def touch(engine: ContactSolver, at: ArrayLike, dt: float = TICK) -> Touch:
    wrench = np.array(engine.wrench(np.asarray(at, dtype=float), dt))
    count = int(engine.contacts.count[0])
    rows = [np.array(getattr(engine.contacts, name)[:count]) for name in Touch._fields[1:]]
    return Touch(wrench, *rows)


class Slide(NamedTuple):
    """What an engine says along a path of poses, a tick apart."""

    wrench: Array
    count: NDArray[np.int64]
    depth: Array

    @property
    def largest_change(self) -> float:
        """Change of the force per tick, relative to its largest size."""
        change = np.linalg.norm(np.diff(self.wrench[:, :3], axis=0), axis=1)
        return float(change.max() / np.linalg.norm(self.wrench[:, :3], axis=1).max())

    @property
    def largest_turn(self) -> float:
        """Change of the torque per tick, relative to its largest size."""
        change = np.linalg.norm(np.diff(self.wrench[:, 3:], axis=0), axis=1)
        return float(change.max() / np.linalg.norm(self.wrench[:, 3:], axis=1).max())


def slide(engine: ContactSolver, path: Iterable[ArrayLike]) -> Slide:
    """Follow a path tick by tick."""
    wrenches, counts, depths = [], [], []
    for at in path:
        found = touch(engine, at)
        wrenches.append(found.wrench)
        counts.append(len(found.depth))
        depths.append(found.mean_depth)
    return Slide(np.array(wrenches), np.array(counts), np.array(depths))
