"""Candidate pairs of geoms that may touch, from MuJoCo's collision query.

The margin of each geom is the height of its texture, so that asperities are found before the
smooth surfaces meet; MuJoCo adds the margins of two geoms. Of its answer only the pairs, points,
distances and margins are used; its normals are not (see `manifold.normals`).
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


def touchable(model: mujoco.MjModel) -> Iterator[tuple[int, str]]:
    """Yield number and body name of every geom of a model that takes part in collisions."""
    for i in range(model.ngeom):
        if model.geom_contype[i] != 0 or model.geom_conaffinity[i] != 0:
            yield i, model.body(int(model.geom_bodyid[i])).name


def _out_of_pieces(model: mujoco.MjModel, body: Body) -> float:
    """Return how far a body's mesh extends beyond its convex pieces in the MuJoCo model [m]."""
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


def _reach(model: mujoco.MjModel, body: Body) -> float:
    """Return how far a textured body extends beyond its geoms in the MuJoCo model [m]."""
    # Convex pieces do not fit the mesh exactly.
    reach = 0.0 if body.mesh is None else _out_of_pieces(model, body)
    if body.texture is not None:
        # A spline is bounded by its coefficients, which exceed the samples.
        reach += float(np.max(np.abs(body.texture.coefficients)))
    return reach


class Collider:
    """MuJoCo's collision query for one tool among fixed bodies.

    Parameters
    ----------
    model : mujoco.MjModel
        With the tool on a freejoint; not changed.
    bodies : sequence of Body
        One for each body of the model that has geoms, their geoms in the model's order.
    tool : str
        Name of the body that moves.

    Attributes
    ----------
    geom_number : (ngeom,) array of int
        For each geom of the model its number among all geoms of `bodies`, -1 for none.
    centre : (3,) array
        The tool's centre of mass in its own frame [m].
    frames : (bodies, 3, 4) array
        Frame of each body: rotation and, in the last column, position [m]; the tool's is that of
        the model.

    Raises
    ------
    AsperityError
        No body has the name `tool`, or a body has not as many geoms as in the model.
    """

    def __init__(self, model: mujoco.MjModel, bodies: Sequence[Body], tool: str) -> None:
        self._model = copy.copy(model)
        self._data = mujoco.MjData(self._model)
        names = [body.name for body in bodies]
        if tool not in names:
            raise AsperityError(f"no body named {tool!r}; bodies: {', '.join(names)}")
        first = np.cumsum([0, *(len(body.geoms) for body in bodies)])
        self.geom_number = np.full(max(self._model.ngeom, 1), -1, dtype=np.int64)
        seen = dict.fromkeys(names, 0)
        reach: dict[str, float] = {}
        for i, name in touchable(self._model):
            if name not in seen:
                continue
            which = names.index(name)
            self.geom_number[i] = first[which] + seen[name]
            seen[name] += 1
            if name not in reach:
                reach[name] = _reach(self._model, bodies[which])
            # Without a texture the margin of the model itself is added.
            own = self._model.geom_margin[i] if bodies[which].texture is None else 0.0
            self._model.geom_margin[i] = own + reach[name]
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
        self._place = int(self._model.jnt_qposadr[self._model.body(tool).jntadr[0]])
        self._tool = self._model.body(tool).id
        self._data.qpos[:] = self._model.qpos0
        mujoco.mj_kinematics(self._model, self._data)
        self._qpos = self._data.qpos[self._place : self._place + 7]
        self._allocate(64)
        self._left_out = b""
        self._body_bits = (self._model.body_contype.copy(), self._model.body_conaffinity.copy())
        self._bodies = np.array([self._model.body(name).id for name in names])
        self.centre = np.array(self._model.body_ipos[self._tool])
        self.frames = np.zeros((len(bodies), 3, 4))
        for i, name in enumerate(names):
            body = self._data.body(name)
            self.frames[i, :, :3] = body.xmat.reshape(3, 3)
            self.frames[i, :, 3] = body.xpos

    def query(
        self, pose: NDArray[np.float64], without: NDArray[np.bool_] | None = None
    ) -> Candidates:
        """Return the candidate contacts at a pose of the tool.

        Parameters
        ----------
        pose : (7,) array
            Of the tool's frame: position [m], unit quaternion wxyz.
        without : (bodies,) array of bool, optional
            Bodies with which no contacts are looked for.

        Returns
        -------
        Candidates
            In arrays that are used again.
        """
        left_out = b"" if without is None else without.tobytes()
        if left_out != self._left_out:
            self._leave_out(left_out)
        self._qpos[:] = pose
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        contact, count = self._data.contact, self._data.ncon
        if count > len(self._geoms):
            self._allocate(2 * count)
        # Copied, since MuJoCo's arrays are strided unless there is one contact: two array types.
        self._geoms[:count], self._points[:count] = contact.geom, contact.pos
        self._distances[:count], self._margins[:count] = contact.dist, contact.includemargin
        return Candidates(count, self._geoms, self._points, self._distances, self._margins)

    def _leave_out(self, bodies: bytes) -> None:
        """Exclude bodies from collisions: all for which the byte in `bodies` is not 0."""
        self._left_out = bodies
        self._model.body_contype[:], self._model.body_conaffinity[:] = self._body_bits
        out = self._bodies[: len(bodies)][np.frombuffer(bodies, np.bool_)]
        self._model.body_contype[out] = self._model.body_conaffinity[out] = 0

    def _allocate(self, count: int) -> None:
        """Allocate the arrays of `count` candidates."""
        self._geoms = np.zeros((count, 2), np.int32)
        self._points = np.zeros((count, 3))
        self._distances, self._margins = np.zeros(count), np.zeros(count)
