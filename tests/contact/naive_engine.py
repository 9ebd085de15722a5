"""Scenes for the tests of the engine, and the baselines' forces written out in NumPy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from asperity.contact.response.settings import ForceSettings
from asperity.contact.solver import ContactSolver
from asperity.geometry.bodies import Body, Geom
from asperity.texture.height_field import HeightField

Array = NDArray[np.float64]
AT_REST = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
TICK = 1e-3
STIFFNESS = 400.0


def pose(x: float, y: float, z: float, quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> Array:
    return np.concatenate([[x, y, z], np.asarray(quaternion, dtype=np.float64)])


def turn(axis: ArrayLike, angle: float) -> Array:
    """Return the quaternion (wxyz) of a turn by `angle` [rad] about `axis`."""
    axis = np.asarray(axis, dtype=np.float64)
    return np.append(math.cos(angle / 2), math.sin(angle / 2) * axis / np.linalg.norm(axis))


def rotation(at: Array) -> Rotation:
    return Rotation.from_quat(np.roll(at[3:], -1))


def ball(radius: float = 1.5e-3, texture: HeightField | None = None) -> Body:
    return Body("tool", [Geom("sphere", (radius,))], texture)


def plate(texture: HeightField | None = None, thick: float = 4e-3, half: float = 15e-3) -> Body:
    """Return a plate whose top is at z = 0."""
    return Body("plate", [Geom("box", (half, half, thick / 2), (0, 0, -thick / 2))], texture)


def waves(amplitude: float, length: float, samples: int = 64) -> HeightField:
    """Return a sinusoid along u, with a cosine along v of half its height."""
    x = 2.0 * np.pi * (np.arange(samples) + 0.5) / samples
    heights = amplitude * (np.sin(x)[None, :] + 0.5 * np.cos(x)[:, None]) / 1.5
    return HeightField(heights, length / samples, "wrap")


def engine_for(
    tool: Body,
    *grounds: Body,
    poses: Sequence[Array] = (),
    tool_first: bool = False,
    centre: Sequence[float] = (0.0, 0.0, 0.0),
    **settings: object,
) -> ContactSolver:
    """Return the engine of a scene of fixed bodies and one free tool.

    `poses` are those of the grounds, at the origin if left out; `centre` is the tool's centre of
    mass in its frame [m]. Masses are given, since MuJoCo refuses those of tools below 0.5 mm.
    """
    mass = '<inertial pos="{}" mass="0.1" diaginertia="1e-5 1e-5 1e-5"/>'
    placed = list(poses) or [AT_REST] * len(grounds)
    parts = [
        f'<body name="{body.name}" pos="{_spaced(at[:3])}" quat="{_spaced(at[3:])}">'
        f"{mass.format('0 0 0')}{_geoms(body)}</body>"
        for body, at in zip(grounds, placed, strict=True)
    ]
    middle = mass.format(_spaced(centre))
    parts.append(f'<body name="tool"><freejoint/>{middle}{_geoms(tool)}</body>')
    xml = (
        '<mujoco><compiler inertiafromgeom="false"/>'
        f"<worldbody>{''.join(parts)}</worldbody></mujoco>"
    )
    bodies = [tool, *grounds] if tool_first else [*grounds, tool]
    model = mujoco.MjModel.from_xml_string(xml)
    return ContactSolver(model, bodies, "tool", ForceSettings(**settings))


def _geoms(body: Body) -> str:
    return "".join(
        f'<geom type="{g.kind}" size="{_spaced(g.size)}" pos="{_spaced(g.position)}" '
        f'quat="{_spaced(g.quaternion)}"/>'
        for g in body.geoms
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


def touch(engine: ContactSolver, at: Array, dt: float = TICK) -> Touch:
    wrench = np.array(engine.wrench(at, dt))
    count = int(engine.contacts.count[0])
    rows = [np.array(getattr(engine.contacts, name)[:count]) for name in Touch._fields[1:]]
    return Touch(wrench, *rows)


class UnderBall(NamedTuple):
    """A smooth ball over a plate: depth [m], normal, the ball's deepest place."""

    depth: float
    normal: Array
    place: Array


def under_ball(radius: float, at: Array, plate_pose: Array) -> UnderBall:
    """Return the low-resolution contact of a ball with a plate whose top is at its z = 0."""
    normal = rotation(plate_pose).apply([0.0, 0.0, 1.0])
    depth = radius - normal @ (at[:3] - plate_pose[:3])
    return UnderBall(depth, normal, at[:3] - radius * normal)


def baseline_force(
    law: str, under: UnderBall, texture: HeightField, plate_pose: Array, gain: float = 1.0
) -> Array:
    """Return the force of Minsky, or of Ho et al., on a ball over a textured plate [N]."""
    x, y, _ = rotation(plate_pose).inv().apply(under.place - plate_pose[:3])
    found = texture.derivatives(x, y)
    slope = rotation(plate_pose).apply([float(found.h_u), float(found.h_v), 0.0])
    n, d = under.normal, under.depth
    if law == "minsky":
        return STIFFNESS * d * (n - slope)
    bumped = (n - slope) / np.linalg.norm(n - slope)
    lifted = gain * (float(found.h) - texture.lowest)
    if d >= lifted:
        return STIFFNESS * ((d - lifted) * n + lifted * bumped)
    return STIFFNESS * d * bumped


def patches_of_meshes(engine):
    """Return a `PENETRATION` record for each patch of meshes; several may be one contact."""
    manifold = engine._mesh.space.manifold
    count = manifold.count[0]["patches"]
    return manifold.result[:count][manifold.patches["weight"][:count] > 0.0]
