"""The low-resolution query: which geoms of the tool may touch which geoms of the scene.

MuJoCo answers it. Each geom's margin is its texture's reach, so that asperities meet before the
smooth surfaces do; MuJoCo adds the two. Of its answer only the pairs, where they are and how deep
are used; its normals are not (see `normals`).
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.geometry.poses import rotation_of

if TYPE_CHECKING:
    from collections.abc import Iterator


def touchable(model: mujoco.MjModel) -> Iterator[tuple[int, str]]:
    """Yield the number and the body's name of every geom of a model that can be touched."""
    for i in range(model.ngeom):
        if model.geom_contype[i] != 0 or model.geom_conaffinity[i] != 0:
            yield i, model.body(int(model.geom_bodyid[i])).name


def _out_of_pieces(model: mujoco.MjModel, body: Body) -> float:
    """Return how far a body's mesh reaches out of the convex pieces that MuJoCo has of it [m]."""
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
    """Return how far a body reaches out of its geoms [m]."""
    # Convex pieces may miss the mesh by a little.
    reach = 0.0 if body.mesh is None else _out_of_pieces(model, body)
    if body.texture is not None:
        # A spline stays within its coefficients, which reach beyond the samples.
        reach += float(np.max(np.abs(body.texture.coefficients)))
    return reach


class Collider:
    """MuJoCo's query for one tool among fixed bodies.

    Parameters
    ----------
    model : mujoco.MjModel
        With the tool on a freejoint; not changed.
    bodies : sequence of Body
        One for each body of the model that has geoms, their geoms in the model's order.
    tool : str
        Name of the body that moves.
    """

    def __init__(self, model: mujoco.MjModel, bodies: Sequence[Body], tool: str) -> None:
        self._model = copy.copy(model)
        self._data = mujoco.MjData(self._model)
        names = [body.name for body in bodies]
        if tool not in names:
            raise AsperityError(f"no body named {tool!r}; bodies: {', '.join(names)}")
        first = np.cumsum([0, *(len(body.geoms) for body in bodies)])
        self.number = np.full(max(self._model.ngeom, 1), -1, dtype=np.int64)
        """For each geom of the model its number among all geoms of `bodies`, -1 for none."""
        seen = dict.fromkeys(names, 0)
        reach: dict[str, float] = {}
        for i, name in touchable(self._model):
            if name not in seen:
                continue
            which = names.index(name)
            self.number[i] = first[which] + seen[name]
            seen[name] += 1
            if name not in reach:
                reach[name] = _reach(self._model, bodies[which])
            # A margin of the scene's own goes on where there is no texture.
            own = self._model.geom_margin[i] if bodies[which].texture is None else 0.0
            self._model.geom_margin[i] = own + reach[name]
            # The broad phase looks at the body's.
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
        self._room_for(64)
        self._left_out = b""
        self._body_bits = (self._model.body_contype.copy(), self._model.body_conaffinity.copy())
        self._bodies = np.array([self._model.body(name).id for name in names])
        self.centre = np.array(self._model.body_ipos[self._tool])
        """The tool's centre of mass in its own frame [m]."""
        self.poses = np.zeros((len(bodies), 3, 4))
        """Rotation and, in the last column, position of every body where the model has it."""
        for i, name in enumerate(names):
            body = self._data.body(name)
            self.poses[i, :, :3] = body.xmat.reshape(3, 3)
            self.poses[i, :, 3] = body.xpos

    def query(
        self, pose: NDArray[np.float64], without: NDArray[np.bool_] | None = None
    ) -> tuple[
        int, NDArray[np.int32], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]
    ]:
        """Return how many contacts there may be, and for each of them what MuJoCo knows.

        That is the model's geoms (n, 2), place (n, 3), distance (n,) and margin (n,), in arrays
        that are used again. Contacts with the bodies that are marked in `without` (bodies,) are
        not looked for.
        """
        left_out = b"" if without is None else without.tobytes()
        if left_out != self._left_out:
            self._leave_out(left_out)
        self._qpos[:] = pose
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        contact, count = self._data.contact, self._data.ncon
        if count > len(self._geoms):
            self._room_for(2 * count)
        # MuJoCo's arrays are strided but when there is one contact: two types for a kernel.
        self._geoms[:count], self._places[:count] = contact.geom, contact.pos
        self._distances[:count], self._margins[:count] = contact.dist, contact.includemargin
        return count, self._geoms, self._places, self._distances, self._margins

    def _leave_out(self, bodies: bytes) -> None:
        """Have contacts with some bodies not be looked for."""
        self._left_out = bodies
        self._model.body_contype[:], self._model.body_conaffinity[:] = self._body_bits
        out = self._bodies[: len(bodies)][np.frombuffer(bodies, np.bool_)]
        self._model.body_contype[out] = self._model.body_conaffinity[out] = 0

    def _room_for(self, count: int) -> None:
        self._geoms = np.zeros((count, 2), np.int32)
        self._places = np.zeros((count, 3))
        self._distances, self._margins = np.zeros(count), np.zeros(count)
