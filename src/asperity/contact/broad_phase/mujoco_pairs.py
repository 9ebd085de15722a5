"""Candidate pairs of geoms that may touch, from MuJoCo's collision query.

The margin of each geom is the height of its texture, so that asperities are found before the
smooth surfaces meet; MuJoCo adds the margins of two geoms. Its contact normals are not used (see
`manifold.separations`).
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.geometry.poses import rotation_of

if TYPE_CHECKING:
    from collections.abc import Iterator


class Candidates(NamedTuple):
    """Points where geoms are closer than their margins; the first `count` rows are valid."""

    count: int  # type: ignore[assignment]  # hides tuple.count
    geoms: NDArray[np.int32]
    """Geoms of the MuJoCo model, (n, 2)."""
    points: NDArray[np.float64]
    """World axes [m], (n, 3)."""
    distances: NDArray[np.float64]
    """Between the smooth surfaces [m], negative where they overlap; (n,)."""
    margins: NDArray[np.float64]
    """Distances at which the textured surfaces may touch [m], (n,)."""


def no_candidates(room: int) -> Candidates:
    """Return an empty list of candidates with room for `room`."""
    return Candidates(
        0, np.zeros((room, 2), np.int32), np.zeros((room, 3)), np.zeros(room), np.zeros(room)
    )


def touchable(model: mujoco.MjModel) -> Iterator[tuple[int, str]]:
    """Yield number and body name of every geom of a model that takes part in collisions."""
    for i in range(model.ngeom):
        if model.geom_contype[i] != 0 or model.geom_conaffinity[i] != 0:
            yield i, model.body(int(model.geom_bodyid[i])).name


def _convex_piece_error(model: mujoco.MjModel, body: Body) -> float:
    """Return the largest distance of a mesh from its convex pieces in the MuJoCo model [m]."""
    from asperity.geometry.convex.pieces import piece_error  # slow to import

    assert body.mesh is not None
    pieces = []
    for i, name in touchable(model):
        if name != body.name:
            continue
        mesh = int(model.geom_dataid[i])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        points = np.asarray(model.mesh_vert[first : first + count], dtype=np.float64)
        pieces.append(points @ rotation_of(model.geom_quat[i]).T + model.geom_pos[i])
    return piece_error(body.mesh, tuple(pieces))


def _bound_errors(model: mujoco.MjModel, body: Body) -> list[tuple[float, bool]]:
    """Return by how much a body exceeds each of its geoms [m], and whether the geom is smooth."""
    # Convex pieces do not fit the mesh exactly.
    reach = 0.0 if body.mesh is None else _convex_piece_error(model, body)
    # A spline is bounded by its coefficients, which exceed the samples.
    tops = {id(field): float(np.max(np.abs(field.coefficients))) for field in body.fields}
    textures = [surface.texture for surface in body.surfaces]
    return [(reach + tops.get(id(texture), 0.0), texture is None) for texture in textures]


def _matrices(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation matrices (n, 3, 3) of unit quaternions wxyz (n, 4)."""
    return np.array([rotation_of(quaternion) for quaternion in quaternions]).reshape(-1, 3, 3)


def rigid_groups(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the body that each body of the model is welded to, 0 for the world."""
    group = np.arange(model.nbody)
    for i in range(1, model.nbody):
        if model.body_jntnum[i] == 0 and model.body_mocapid[i] < 0:
            group[i] = group[model.body_parentid[i]]
    return group


class Collider:
    """MuJoCo's collision query for textured bodies.

    Parameters
    ----------
    model : mujoco.MjModel
        Not changed.
    bodies : sequence of Body
        One for each body of the model that has geoms, their geoms in the model's order.

    Attributes
    ----------
    geom_number : (ngeom,) array of int
        For each geom of the model its number among all geoms of `bodies`, -1 for none.
    centres : (bodies, 3) array
        Centre of mass of each body in its own frame [m].
    frames : (bodies, 3, 4) array
        Frame of each body in the model's first pose: rotation and, in the last column, position
        [m].
    groups : (bodies,) array of int
        Bodies with the same number are welded together; those of 0 are static.

    Raises
    ------
    AsperityError
        A body has not as many geoms as in the model.
    """

    def __init__(self, model: mujoco.MjModel, bodies: Sequence[Body]) -> None:
        self._model = copy.copy(model)
        self._data = mujoco.MjData(self._model)
        names = [body.name for body in bodies]
        first = np.cumsum([0, *(len(body.geoms) for body in bodies)])
        self.geom_number = np.full(max(self._model.ngeom, 1), -1, dtype=np.int64)
        seen = dict.fromkeys(names, 0)
        reach: dict[str, list[tuple[float, bool]]] = {}
        for i, name in touchable(self._model):
            if name not in seen:
                continue
            number = names.index(name)
            if name not in reach:
                reach[name] = _bound_errors(self._model, bodies[number])
            if seen[name] < len(reach[name]):
                height, is_smooth = reach[name][seen[name]]
                # Without a texture the margin of the model itself is added.
                own = self._model.geom_margin[i] if is_smooth else 0.0
                self._model.geom_margin[i] = own + height
            self.geom_number[i] = first[number] + seen[name]
            seen[name] += 1
            # MuJoCo's broad phase uses the body's margin.
            owner = int(self._model.geom_bodyid[i])
            self._model.body_margin[owner] = max(
                self._model.body_margin[owner], self._model.geom_margin[i]
            )
        for body in bodies:
            if seen[body.name] != len(body.geoms):
                raise AsperityError(
                    f"body {body.name!r} has {len(body.geoms)} geoms, but the model "
                    f"{seen[body.name]} that can be touched"
                )
        self._data.qpos[:] = self._model.qpos0
        mujoco.mj_kinematics(self._model, self._data)
        self._allocate(64)
        self._excluded = b""
        self._body_bits = (self._model.body_contype.copy(), self._model.body_conaffinity.copy())
        self._bodies = np.array([self._model.body(name).id for name in names])
        self.centres = np.array(self._model.body_ipos[self._bodies])
        self.frames = np.zeros((len(bodies), 3, 4))
        self.frames[:, :, :3] = self._data.xmat[self._bodies].reshape(-1, 3, 3)
        self.frames[:, :, 3] = self._data.xpos[self._bodies]
        self.groups = rigid_groups(self._model)[self._bodies]
        self._geoms_in = np.flatnonzero(self.geom_number >= 0)
        owner = self._model.geom_bodyid[self._geoms_in]
        self._owner = np.array([self._bodies.tolist().index(i) for i in owner.tolist()], np.int64)
        self._geom_axes = _matrices(self._model.geom_quat[self._geoms_in])
        self._inertial_axes = _matrices(self._model.body_iquat[self._bodies])
        self._free: tuple[int, NDArray[np.float64]] = (-1, np.zeros(7))

    def clone(self) -> Collider:
        """Return a collider for another thread."""
        other = copy.copy(self)
        other._model, other._data = copy.copy(self._model), copy.copy(self._data)
        other._free = (-1, np.zeros(7))
        other._allocate(64)
        return other

    def place(self, body: int, pose: NDArray[np.float64]) -> None:
        """Put one body, which has a freejoint, at a pose (7,)."""
        if self._free[0] != body:
            first = int(self._model.body_jntadr[self._bodies[body]])
            start = int(self._model.jnt_qposadr[first])
            self._free = (body, self._data.qpos[start : start + 7])
        self._free[1][:] = pose
        mujoco.mj_kinematics(self._model, self._data)

    def place_all(self, frames: NDArray[np.float64]) -> None:
        """Put all bodies at frames (bodies, 3, 4), whatever joints they have."""
        data, model = self._data, self._model
        turn, at, own = frames[:, :, :3], frames[:, :, 3], self._bodies
        data.xpos[own], data.xmat[own] = at, turn.reshape(-1, 9)
        data.xipos[own] = at + np.einsum("bij,bj->bi", turn, model.body_ipos[own])
        data.ximat[own] = (turn @ self._inertial_axes).reshape(-1, 9)
        geoms, owner = self._geoms_in, self._owner
        moved = np.einsum("gij,gj->gi", turn[owner], model.geom_pos[geoms])
        data.geom_xpos[geoms] = at[owner] + moved
        data.geom_xmat[geoms] = (turn[owner] @ self._geom_axes).reshape(-1, 9)

    def query(self, without: NDArray[np.bool_] | None = None) -> Candidates:
        """Return the candidate contacts where the bodies are.

        Parameters
        ----------
        without : (bodies,) array of bool, optional
            Bodies to exclude.

        Returns
        -------
        Candidates
            Valid until the next query.
        """
        excluded = b"" if without is None else without.tobytes()
        if excluded != self._excluded:
            self._exclude(excluded)
        mujoco.mj_collision(self._model, self._data)
        return self.candidates(self._data)

    def candidates(self, data: mujoco.MjData) -> Candidates:
        """Return the candidate contacts of a collision query, from `data`."""
        contact, count = data.contact, data.ncon
        if count > len(self._geoms):
            self._allocate(2 * count)
        # Copied, since MuJoCo's arrays are strided, but for a single contact: two array types.
        self._geoms[:count], self._points[:count] = contact.geom, contact.pos
        self._distances[:count], self._margins[:count] = contact.dist, contact.includemargin
        return Candidates(count, self._geoms, self._points, self._distances, self._margins)

    def _exclude(self, bodies: bytes) -> None:
        """Exclude from collisions each body whose byte in `bodies` is not 0."""
        self._excluded = bodies
        self._model.body_contype[:], self._model.body_conaffinity[:] = self._body_bits
        out = self._bodies[: len(bodies)][np.frombuffer(bodies, np.bool_)]
        self._model.body_contype[out] = self._model.body_conaffinity[out] = 0

    def allowed_pairs(self, body: int) -> NDArray[np.int32]:
        """Return the pairs (n, 2) of a geom of a body and one of another that may collide."""
        model, numbers = self._model, self._geoms_in
        mine, others = numbers[self._owner == body], numbers[self._owner != body]
        kinds, partners = model.geom_contype, model.geom_conaffinity
        allowed = (kinds[mine, None] & partners[others]) | (kinds[others] & partners[mine, None])
        one, two = np.nonzero(allowed)
        return np.column_stack([mine[one], others[two]]).astype(np.int32)

    def _allocate(self, count: int) -> None:
        """Allocate the arrays of `count` candidates."""
        _, self._geoms, self._points, self._distances, self._margins = no_candidates(count)
