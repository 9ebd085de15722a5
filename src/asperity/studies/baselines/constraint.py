r"""Constraint-based simulation of the full-resolution models, by MuJoCo's solver.

Section 3.3 of Otaduy & Lin (2004) calls it the ideal, but prohibitively slow: the bodies do not
interpenetrate at all, and friction and contact are constraints of a simulation. The tool here is a
rigid body that a spring and damper couple to the given pose x_h, as in Colgate, Stanley & Brown
(1995); MuJoCo solves for the contact forces f_i >= 0 along the normals n_i that keep it out,

    M a = sum_i J_i^T f_i + K (x_h - x) + B (v_h - v),     F = K (x - x_h) + B (v - v_h),

and the hand feels the coupling. At rest on a smooth plate that is F = k d, d being how deep the
hand is below the surface; over texture x follows the surface that the tool cannot enter.

Full detail is MuJoCo's height field (`tiles_of`), for level faces; convex pieces, which all
else is to MuJoCo, carry no texture. Asperity's own: a tool of 5 g, whatever the scene's is; its
radius of gyration is that of the ball around it, by which the coupling's stiffness against rotation
follows from k, so that all oscillate alike; critical damping; no friction, as in all of the
comparison; and that a hand which has moved farther in a tick than `jump` is set down anew, free and
then pressed until it rests.

Another meaning of the term is the quasi-static god object of Ortega, Redon & Coquillart (2007): the
pose nearest to the hand's, in the metric of K, among those without penetration. It has no inertia;
this simulation tends to it for slow motion.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from asperity.errors import AsperityError, require_between, require_positive
from asperity.geometry.bodies import Body, origin_of_map
from asperity.scene.scene import Scene
from asperity.studies.baselines.displaced_surfaces import bounding_ball, finite_reason
from asperity.studies.baselines.placement import Placed, centre_at, is_level, place_bodies, top_of
from asperity.studies.baselines.protocol import Method, MethodWrench, Renderer

Array = NDArray[np.float64]
_HARDEST = 0.9999
"""MuJoCo's largest impedance: contacts are as hard as it lets them be."""
_RADIANS = 0.4
"""Largest step of the coupling's oscillation: with 1.3, tool and contact chatter."""
_SETTLED = 10.0
"""Time constants of the coupling after which a tool that was set down counts as at rest."""
_CALMING = 2
"""Ticks, in the steps of the simulation, after those long ones."""
_STILL = np.zeros(3)
_FIRST_LIFT, _FARTHEST_LIFT = 2e-5, 2e-2
"""First and largest height from which a tool is set down [m]."""
_MOST_PAIR = 50
"""MuJoCo's largest number of contacts of two geoms; it drops all others."""


class ConstraintRenderer(Renderer):
    """Simulates the tool on its coupling, a tick for every pose.

    Attributes
    ----------
    model : mujoco.MjModel
        The tool, and the other bodies at full detail.
    data : mujoco.MjData
        Its state.
    truncated : int
        Ticks in which two geoms had as many contacts as MuJoCo keeps.
    """

    def __init__(self, scene: Scene, method: ConstraintMethod, dt: float) -> None:
        bodies = place_bodies(scene)
        self._centre, self._dt, self._jump = bodies.centre, dt, method.jump
        stiffness, lever = scene.force.stiffness, bounding_ball(bodies.tool)[1]
        frequency = math.sqrt(stiffness / method.mass)
        self._steps = max(method.substeps, math.ceil(frequency * dt / _RADIANS))
        self._settling_step = _RADIANS / frequency
        self._k = np.repeat([stiffness, stiffness * lever**2], 3)
        self._b = 2.0 * self._k / frequency
        self.model = _model(bodies, method, dt / self._steps, method.mass * lever**2)
        self.data = mujoco.MjData(self.model)
        self._couple()
        up = next((t.rotation[:, 2] for t in bodies.standing if t.body.texture is not None), None)
        self._up = np.array([0.0, 0.0, 1.0]) if up is None else up
        self.reset()

    def reset(self) -> None:
        """Forget the tool's state."""
        mujoco.mj_resetData(self.model, self.data)
        self._hand: Array | None = None
        self.truncated = 0

    def _couple(self) -> None:
        """Set the joints' springs and dampers, which MuJoCo integrates implicitly."""
        self.model.jnt_stiffness[:] = [*self._k[:3], self._k[3]]
        self.model.dof_damping[:] = self._b

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        hand, last = self._joints(pose), self._hand
        self._hand = hand
        if last is None or np.linalg.norm(hand[:3] - last[:3]) > self._jump:
            self._set_down(hand)
            return self._felt(hand, _STILL, _STILL)
        velocity, spin = (hand[:3] - last[:3]) / self._dt, np.empty(3)
        mujoco.mju_subQuat(spin, hand[3:], last[3:])
        spin /= self._dt
        turning = _turned(spin, last[3:])
        between = np.array(last)
        step = self.model.opt.timestep
        for _ in range(self._steps):
            between[:3] += step * velocity
            mujoco.mju_quatIntegrate(between[3:], spin, step)
            self._step(between, velocity, turning)
        return self._felt(hand, velocity, turning)

    def _step(self, hand: Array, velocity: Array, turning: Array) -> None:
        """Advance by a step while the hand's joints are at `hand` (7,) and move, in world axes."""
        self.model.qpos_spring[:] = hand
        # Dampers act against the hand's motion, not against the world.
        self.data.qfrc_applied[:3] = self._b[:3] * velocity
        self.data.qfrc_applied[3:] = self._b[3:] * _turned(turning, self.data.qpos[3:], -1.0)
        mujoco.mj_step(self.model, self.data)

    def _joints(self, pose: Array) -> Array:
        """Return the joints' positions (7,) at a pose: three slides of the centre, and a ball."""
        return np.concatenate([centre_at(pose, self._centre) - self._centre, pose[3:]])

    def _set_down(self, here: Array) -> None:
        """Put the tool at the hand, lift it until it is free, and press it until it rests."""
        mujoco.mj_resetData(self.model, self.data)

        def is_free(height: float) -> bool:
            self.data.qpos[:] = here
            self.data.qpos[:3] += height * self._up
            mujoco.mj_fwdPosition(self.model, self.data)
            return bool(self.data.ncon == 0)

        low, high = 0.0, 0.0
        while not is_free(high):
            low, high = high, max(2.0 * high, _FIRST_LIFT)
            if high > _FARTHEST_LIFT:
                raise AsperityError(
                    f"the tool is not free within {1e3 * _FARTHEST_LIFT:g} mm above its pose: "
                    "give a pose nearer to the surface"
                )
        while high - low > _FIRST_LIFT:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if is_free(middle) else (middle, high)
        is_free(high)
        if high == 0.0:
            return
        step, self.model.opt.timestep = self.model.opt.timestep, self._settling_step
        for _ in range(math.ceil(_SETTLED / _RADIANS)):
            self._step(here, _STILL, _STILL)
        self.model.opt.timestep = step
        for _ in range(_CALMING * self._steps):
            self._step(here, _STILL, _STILL)

    def _felt(self, hand: Array, velocity: Array, turning: Array) -> MethodWrench:
        """Return the wrench of the coupling on the hand."""
        data, leans = self.data, np.empty(3)
        away = data.qpos[:3] - hand[:3]
        mujoco.mju_subQuat(leans, data.qpos[3:], hand[3:])
        force = self._k[:3] * away + self._b[:3] * (data.qvel[:3] - velocity)
        torque = self._k[3:] * _turned(leans, hand[3:])
        torque += self._b[3:] * (_turned(data.qvel[3:], data.qpos[3:]) - turning)
        count = int(data.ncon)
        if count >= _MOST_PAIR:
            _, each = np.unique(data.contact.geom[:count], axis=0, return_counts=True)
            self.truncated += bool(each.max() >= _MOST_PAIR)
        return MethodWrench(force, torque, float(np.linalg.norm(away)) if count else 0.0, count)


def _turned(vector: Array, quaternion: Array, sign: float = 1.0) -> Array:
    """Return a vector turned by a quaternion, or with `sign` -1 back."""
    out, by = np.empty(3), np.array(quaternion)
    by[1:] *= sign
    mujoco.mju_rotVecQuat(out, vector, by)
    return out


def _model(bodies: Placed, method: ConstraintMethod, step: float, inertia: float) -> mujoco.MjModel:
    """Return the tool, with an inertia [kg m^2], among the other bodies, with a time step [s]."""
    spec = mujoco.MjSpec()
    spec.option.timestep = step
    spec.option.gravity = [0.0, 0.0, 0.0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    hard = {"condim": 1, "solref": [2.0 * step, 1.0], "solimp": [_HARDEST] * 2 + [1e-4, 0.5, 2.0]}
    for there in bodies.standing:
        body = spec.worldbody.add_body(pos=there.position, quat=quaternion_of(there.rotation))
        if there.body.texture is None:
            add_geoms(body, there.body, hard)
            continue
        for i, tile in enumerate(tiles_of(there.body, method.samples, method.tiles)):
            name = f"{there.body.name} {i}"
            spec.add_hfield(
                name=name, nrow=tile.heights.shape[0], ncol=tile.heights.shape[1],
                size=tile.size, userdata=tile.heights.ravel(),
            )  # fmt: skip
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=name, pos=tile.position, **hard
            )
    tool = spec.worldbody.add_body(
        mass=method.mass, ipos=bodies.centre, inertia=[inertia] * 3,
        explicitinertial=True,
    )  # fmt: skip
    for axis in np.eye(3):
        tool.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    tool.add_joint(type=mujoco.mjtJoint.mjJNT_BALL, pos=bodies.centre)
    add_geoms(tool, bodies.tool, hard)
    return spec.compile()


def quaternion_of(rotation: Array) -> Array:
    """Return the unit quaternion wxyz (4,) of a rotation (3, 3)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))


def add_geoms(body: mujoco.MjsBody, solid: Body, options: dict) -> None:
    """Add the geoms of a body without texture."""
    for geom in solid.geoms:
        kind = getattr(mujoco.mjtGeom, f"mjGEOM_{geom.kind.upper()}")
        size = np.array(geom.size)
        if geom.kind == "plane":
            size[2] = 1.0  # spacing of the grid that is drawn
        body.add_geom(type=kind, size=size, pos=geom.position, quat=geom.quaternion, **options)


@dataclass(frozen=True)
class ConstraintMethod(Method):
    """A tool on a coupling, kept out of the full-resolution surfaces by MuJoCo.

    Parameters
    ----------
    mass : float
        Of the simulated tool [kg].
    substeps : int
        Least number of steps of the simulation in a tick, 1 to 100.
    samples : int
        Approximate largest number of samples of a body's relief.
    tiles : int
        Largest number of height fields of a box.
    jump : float
        A hand that has moved farther in a tick is set down anew [m].
    """

    name: str = "constraint"
    label: str = "constraint-based simulation"
    source: str = "Otaduy & Lin 2004, section 3.3; MuJoCo: Todorov, Erez & Tassa 2012"
    what_it_is_not: str = (
        "Texture on level faces alone, as height fields, under a tool without any: a mesh is its "
        "convex hull to MuJoCo, so meshes are refused. Its mass is 5 g, and MuJoCo's contacts give "
        "way by nanometres at rest."
    )
    mass: float = 5e-3
    substeps: int = 6
    samples: int = 250_000
    tiles: int = 400
    jump: float = 3e-4

    def __post_init__(self) -> None:
        for name, unit in (("mass", "kg"), ("jump", "m")):
            require_positive(name, getattr(self, name), unit)
        require_between("substeps", self.substeps, 1, 100)
        require_between("samples", self.samples, 100, 10**7)
        require_between("tiles", self.tiles, 1, 10**5)

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        for body in scene.bodies:
            if body.mesh is not None:
                return (
                    f"{body.name} is a mesh, which MuJoCo replaces by its convex hull; it has "
                    "texture on level faces alone, as height fields"
                )
            if any(geom.surface is not None for geom in body.geoms):
                return f"made for one texture on a body, and geoms of {body.name} have their own"
            if body.texture is None:
                continue
            if body.name == scene.tool:
                return f"the tool {body.name} is textured, and a height field cannot move"
            if not is_level(body) or body.mapping != "planar":
                return f"{body.name} is not of level boxes and planes with a planar map"
        return finite_reason(*scene.bodies)

    def renderer(self, scene: Scene, dt: float) -> ConstraintRenderer:
        """Return a renderer of a scene."""
        return ConstraintRenderer(scene, self, dt)


CONSTRAINT = ConstraintMethod()


_PER_WAVE = 20.0
"""Sufficient number of samples per shortest wave of a texture."""
_SMALLEST = 5
"""Cells along the side of a tile that two triangles a cell cannot make too many contacts of."""
_FLAT = 1e-6
"""Height that MuJoCo is given for a tile that is level, since it wants one above 0 [m]."""


class Tile(NamedTuple):
    """A height field as MuJoCo takes it."""

    heights: Array
    """From 0 to 1, rows along y, (rows, columns)."""
    size: tuple[float, float, float, float]
    """Half sides, height of the relief, and thickness of what is below it [m]."""
    position: Array
    """Of its middle, at the lowest point of its relief, in the body's frame [m], (3,)."""


def tiles_of(body: Body, samples: int, tiles: int) -> Iterator[Tile]:
    """Yield the textured tops of a body's boxes and planes as height fields, in tiles.

    MuJoCo keeps 50 contacts of two geoms, each with one triangle of a height field, and drops the
    others in the order of rows. A flat tool touches more triangles than that, but of no tile of
    5 x 5 cells. Where so small tiles would be too many, they are larger; that is enough for a tip.

    Parameters
    ----------
    body : Body
        Of level boxes and bounded planes, with a planar texture.
    samples : int
        Approximate largest number of samples of all of them.
    tiles : int
        Largest number of tiles of all of them, but one at least of each.
    """
    assert body.texture is not None
    area = sum(4.0 * geom.size[0] * geom.size[1] for geom in body.geoms)
    pitch = max(body.texture.shortest_wavelength / _PER_WAVE, math.sqrt(area / samples))
    side = max(_SMALLEST * pitch, math.sqrt(area / max(tiles, 1)))
    origin = origin_of_map(body)
    for geom in body.geoms:
        thick = 2.0 * geom.size[2] if geom.kind == "box" else abs(body.texture.lowest) + 1e-2
        grids = []
        for k in (0, 1):
            pieces = max(math.floor(2.0 * geom.size[k] / side), 1)
            cells = max(math.ceil(2.0 * geom.size[k] / pieces / pitch), 1)
            edges = np.linspace(-geom.size[k], geom.size[k], pieces + 1) + geom.position[k]
            grids.append([np.linspace(a, b, cells + 1) for a, b in itertools.pairwise(edges)])
        for x, y in itertools.product(*grids):
            heights = body.texture.heights(*np.meshgrid(x - origin[0], y - origin[1]))
            low, relief = float(heights.min()), float(np.ptp(heights))
            yield Tile(
                (heights - low) / relief if relief > _FLAT else np.zeros(heights.shape),
                (0.5 * (x[-1] - x[0]), 0.5 * (y[-1] - y[0]), max(relief, _FLAT), thick + low),
                np.array([0.5 * (x[0] + x[-1]), 0.5 * (y[0] + y[-1]), top_of(geom) + low]),
            )
