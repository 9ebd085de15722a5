"""Bodies, textures and poses for the tests of contact."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize
from scipy.spatial.transform import Rotation

from asperity.contact import body_arrays as flat
from asperity.contact.narrow_phase.geom_depth import (
    BodyGeoms,
    DepthQuery,
    SearchLimits,
    depth_along,
)
from asperity.contact.narrow_phase.records import PENETRATION
from asperity.contact.narrow_phase.workspace import workspace
from asperity.geometry.bodies import Body, Geom
from asperity.texture.height_field import HeightField

if TYPE_CHECKING:
    from asperity.contact.solver import ContactSolver

Array = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


def turn(axis: ArrayLike, angle: float) -> Array:
    """Return the quaternion (wxyz) of a turn by `angle` [rad] about `axis`."""
    axis = np.asarray(axis, dtype=np.float64)
    return np.append(math.cos(angle / 2), math.sin(angle / 2) * axis / np.linalg.norm(axis))


def pose(x: float, y: float, z: float, quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> Array:
    return np.concatenate([[x, y, z], np.asarray(quaternion, dtype=np.float64)])


AT_REST = pose(0.0, 0.0, 0.0)


def ripple(
    amplitude: float, wavelength: float, samples: int = 128, crest: float = 0.0
) -> HeightField:
    """Return `amplitude * cos(2 pi (u - crest) / wavelength)`, the same all along v."""
    pixel = wavelength / samples
    u = (np.arange(samples) + 0.5) * pixel
    row = amplitude * np.cos(2.0 * np.pi * (u - crest) / wavelength)
    return HeightField(np.tile(row, (4, 1)), pixel, "wrap")


def rough(seed: int, rms: float, size: float = 2e-3, shortest: float = 0.25e-3) -> HeightField:
    """Return a smooth random map of waves no shorter than `shortest`, 16 samples to each."""
    count = round(16 * size / shortest)
    waves = np.fft.fftfreq(count, size / count)
    power = np.hypot(waves[:, None], waves[None, :])
    kept = (power > 0.0) & (power <= 1.0 / shortest)
    noise = np.random.default_rng(seed).standard_normal((count, count))
    heights = np.fft.ifft2(np.fft.fft2(noise) * np.where(kept, 1.0, 0.0)).real
    return HeightField(heights * rms / heights.std(), size / count, "wrap")


def solid(
    kind: str, name: str = "tool", texture: HeightField | None = None, **more: object
) -> Body:
    """Return a body of one geom of a few millimetres, whose middle is the body's origin."""
    sizes = {
        "plane": (0.0, 0.0, 0.1),
        "sphere": (1.5e-3,),
        "capsule": (1.2e-3, 1.5e-3),
        "ellipsoid": (2e-3, 1.5e-3, 1.2e-3),
        "cylinder": (1.5e-3, 1.2e-3),
        "box": (2e-3, 1.5e-3, 1.2e-3),
    }
    return Body(name, [Geom(kind, sizes[kind])], texture, **more)


def plate(texture: HeightField | None = None, half: float = 8e-3, pieces: int = 1) -> Body:
    """Return a plate whose top lies at z = 0, of `pieces` x `pieces` boxes."""
    side = half / pieces
    middles = side * (2.0 * np.arange(pieces) + 1.0) - half
    boxes = [Geom("box", (side, side, 2e-3), (x, y, -2e-3)) for x in middles for y in middles]
    return Body("plate", boxes, texture)


def moved(at: Array, axis: int, step: float) -> Array:
    """Return a pose moved along (0 to 2) or turned about (3 to 5) an axis of the world."""
    out = at.copy()
    if axis < 3:
        out[axis] += step
    else:
        turned = Rotation.from_rotvec(step * np.eye(3)[axis - 3])
        turned = turned * Rotation.from_quat(np.roll(at[3:], -1))
        out[3:] = np.roll(turned.as_quat(), 1)
    return out


ROUND = ("sphere", "capsule", "ellipsoid", "cylinder", "box")


class Meeting(NamedTuple):
    """Two bodies that overlap along n by something like a millimetre."""

    a: Body
    pose_a: Array
    b: Body
    pose_b: Array
    n: Array


def meeting(kind_a: str, kind_b: str, seed: int, textured: str = "ab") -> Meeting:
    """Return two bodies in random poses; n is a normal of B, somewhere on it.

    `textured` names those that are; mappings follow from the seed.
    """
    rng = np.random.default_rng(seed)
    bodies = []
    for letter, kind, name in (("a", kind_a, "tool"), ("b", kind_b, "ground")):
        mapping = "triplanar" if seed % 3 == 0 else "planar"
        if kind in ("capsule", "cylinder") and seed % 2:
            mapping = "cylindrical"
        texture = rough(2 * seed + len(bodies), 8e-6) if letter in textured else None
        offset = (0.0, 0.0) if mapping == "triplanar" else (3e-4, -2e-4)
        bodies.append(solid(kind, name, texture, mapping=mapping, offset=offset))
    turn_b = Rotation.random(random_state=rng)
    normal = rng.standard_normal(3)
    if kind_b in ("box", "plane") or (kind_b == "cylinder" and seed % 2):
        normal = UP
    elif kind_b == "cylinder":
        normal[2] = 0.0
    n = turn_b.apply(normal / np.linalg.norm(normal))
    aside = 4e-4 * rng.standard_normal(3)
    aside -= n * (n @ aside)
    free = rng.random() < 0.5
    tilt = Rotation.from_rotvec(0.1 * rng.standard_normal(3))
    turn_a = Rotation.random(random_state=rng) if free else turn_b * tilt
    return Meeting(
        bodies[0], np.append(2e-3 * n + aside, np.roll(turn_a.as_quat(), 1)),
        bodies[1], np.append(np.zeros(3), np.roll(turn_b.as_quat(), 1)), n,
    )  # fmt: skip


def highest(function: Callable[[Array], Array], low: float, high: float, count: int) -> float:
    """Return the largest value of a smooth function of one number, ends included."""
    places = np.linspace(low, high, count)
    best = int(np.argmax(function(places)))
    ends = places[max(best - 1, 0)], places[min(best + 1, count - 1)]
    found = optimize.minimize_scalar(
        lambda x: -float(function(np.array(x))), bounds=ends, method="bounded",
        options={"xatol": 1e-13},
    )  # fmt: skip
    return max(-float(found.fun), float(np.max(function(places))))


class Pair:
    """Two bodies and the kernel that finds their depth along a given n.

    Parameters
    ----------
    a, b : Body
        Tool and scene.
    """

    def __init__(self, a: Body, b: Body) -> None:
        self.bodies = a, b
        self._textures, self._geometry = flat.flatten_bodies((a, b))
        most = len(a.geoms) + len(b.geoms)
        self._space = workspace(3 * most, 9 * most * most)
        self._geoms = [np.flatnonzero(self._geometry.body == i) for i in (0, 1)]

    def along(
        self, pose_a: Array, pose_b: Array, n: Array, tolerance: float = 1e-9, nodes: int = 20_000
    ) -> Along:
        """Return the depth of A in B along n, and its gradient about A's origin."""
        placed = [
            np.column_stack([flat.rotation_of(at[3:]), at[:3] - pose_a[:3]])
            for at in (pose_a, pose_b)
        ]
        out = np.zeros(1, PENETRATION)
        bodies = (
            BodyGeoms(geoms, geoms.size, frame, 0.0)
            for geoms, frame in zip(self._geoms, placed, strict=True)
        )
        query = DepthQuery(*bodies, np.asarray(n, dtype=np.float64), np.full(3, np.nan))
        limits = SearchLimits(tolerance, nodes)
        depth_along(self._textures, self._geometry, query, limits, self._space, out)
        found = out[0]
        return Along(
            found["depth"], found["gap"], int(found["status"]), int(found["ties"]),
            found["point"] + pose_a[:3], found["slope_normal"],
            -np.concatenate([found["slope_normal"], found["moment"]]),
        )  # fmt: skip


class Along(NamedTuple):
    """What `Pair.along` finds: `gradient` (6,) is d(depth)/d(translation, rotation)."""

    depth: float
    gap: float
    status: int
    ties: int
    point: Array
    m: Array
    gradient: Array


def engine_of(tool: Body, ground: Body, **settings: object) -> ContactSolver:
    """Return the engine of a scene in which `ground` stands at the origin and `tool` is free."""
    from asperity.contact.response.settings import ForceSettings
    from asperity.contact.solver import ContactSolver

    def geoms(body: Body) -> str:
        return "".join(
            f'<geom type="{g.kind}" size="{_spaced(g.size)}" pos="{_spaced(g.position)}" '
            f'quat="{_spaced(g.quaternion)}"/>'
            for g in body.geoms
        )

    xml = (
        f'<mujoco><worldbody><body name="{ground.name}">{geoms(ground)}</body>'
        f'<body name="{tool.name}"><freejoint/>{geoms(tool)}</body></worldbody></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(xml)
    return ContactSolver(model, [ground, tool], tool.name, ForceSettings(**settings))


def _spaced(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


class Touch(NamedTuple):
    """One query of the engine: the wrench, the energy, and copies of the contacts' rows."""

    wrench: Array
    energy: float
    depth: Array
    normal: Array
    slope_normal: Array
    point: Array
    weight: Array
    force: Array
    status: NDArray[np.int64]


def touch(engine: ContactSolver, at: Array, stiffness: float = 400.0) -> Touch:
    """Ask the engine once; U = k/2 sum of w delta^2 over the contacts."""
    wrench = np.array(engine.wrench(at, 1e-3))
    found = engine.contacts
    count = int(found.count[0])
    rows = [
        np.array(getattr(found, name)[:count])
        for name in ("depth", "normal", "slope_normal", "point", "weight", "force", "status")
    ]
    depth, weight = rows[0], rows[4]
    energy = 0.5 * stiffness * float(np.sum(weight * np.maximum(depth, 0.0) ** 2))
    return Touch(wrench, energy, *rows)
