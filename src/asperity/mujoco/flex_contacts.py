"""Contacts of textured flexes in one `MjData`: one at each vertex, with the force of the layer.

The layer's energy U gives each vertex the force f = -dU/dx (`contact.deformable`). As a contact of
MuJoCo's at the vertex, with f / |f| as its normal, it acts on the vertex and, opposite, on the
geom's body: the sum is exactly the geom's wrench, since U is invariant to rigid motions of flex and
geom together.

The constraint is a spring k and a damper c, see `flex_rows`. k along f is that for equal motions of
all vertices, an upper bound that keeps the coupling between vertices stable.
"""

from __future__ import annotations

import warnings
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.contact.deformable.surface_contact import SurfaceContact
from asperity.contact.multibody import frame_pose
from asperity.mujoco.bodies import Carried
from asperity.mujoco.flex_rows import Springs, set_rows
from asperity.mujoco.flexes import FlexSurface
from asperity.mujoco.names import geom_name
from asperity.mujoco.put_in import LEAST_FRICTION
from asperity.mujoco.rows import MARK

_DEEP = 1.9
"""Depth over the layer's thickness above which MuJoCo's own contact is kept: at 2 the layer ends.
"""
_SMALL = 1e-9
"""Fraction of the largest force below which forces are dropped."""


class FlexContact(NamedTuple):
    """Contact of a textured flex with all geoms."""

    forces: NDArray[np.float64]
    """-dU/dx of each of its vertices [N], (flex_vertnum, 3)."""
    energy: float
    """U [J]"""
    numbers: NDArray[np.int64]
    """Numbers of its contacts in `data.contact`, (n,)."""


class FlexContacts:
    """The textured flexes of one `MjData`.

    Parameters
    ----------
    flexes : tuple of FlexSurface
    friction : (ngeom,)
        Coulomb's coefficient given for the surface of each geom, nan for none.
    """

    def __init__(self, flexes: tuple[FlexSurface, ...], friction: NDArray[np.float64]) -> None:
        self._flexes, self._friction = flexes, friction
        self._by_number = {one.flex: one for one in flexes}
        self._solvers: dict[tuple[int, int], list[SurfaceContact]] = {}
        self._warned: set[str] = set()
        self._templates: NDArray[np.void] | None = None
        self._springs = np.zeros((0, 3))
        self.first = 0
        """Number of the first of these contacts in the list."""
        self.latest: dict[int, FlexContact] = {}
        """By the number of the flex."""

    def take(self, model: mujoco.MjModel, records: NDArray[np.void], count: int) -> int:
        """Remove contacts with textured flexes from a list of `count`; return how many remain.

        -1 if the list already has contacts of asperity's.
        """
        flex, geom = records["flex"][:count, 1], records["geom"][:count, 0]
        if (records["vert"][:count, 0] == MARK).any():
            return -1
        self.latest = {}
        taken = np.zeros(count, bool)
        for one in self._flexes:
            mine = (flex == one.flex) & (geom >= 0)
            mine[mine] = one.is_met[geom[mine]]
            deep = mine & (records["dist"][:count] < -_DEEP * one.sides[0].thickness)
            if deep.any():
                self._warn(
                    one.name,
                    f"{geom_name(model, int(geom[deep][0]))} is deeper in {one.name} than its "
                    f"layer of {1e3 * one.sides[0].thickness:.3g} mm allows: such contacts stay "
                    "MuJoCo's own; valid: Layer(thickness=...) that is more, a shorter step, "
                    "slower motion",
                )
            taken |= mine & ~deep
        self._templates = records[:count][taken]
        kept = int(count - taken.sum())
        if kept < count:
            records[:kept] = records[:count][~taken]
        return kept

    @property
    def has_taken(self) -> bool:
        """Whether contacts were removed from the list."""
        return self._templates is not None and len(self._templates) > 0

    def add(
        self, model: mujoco.MjModel, data: mujoco.MjData, records: NDArray[np.void], total: int
    ) -> int:
        """Append the contacts of all flexes to a list of `total`; return its new length."""
        assert self._templates is not None
        self.first, springs = total, []
        bodies = model.geom_bodyid[self._templates["geom"][:, 0]]
        for one in self._flexes:
            start, count = int(model.flex_vertadr[one.flex]), int(model.flex_vertnum[one.flex])
            forces, energy, begin = np.zeros((count, 3)), 0.0, total
            mine = self._templates["flex"][:, 1] == one.flex
            for carrier in np.unique(bodies[mine]).tolist():
                solvers = self._solvers_of(one, carrier)
                places = np.array(data.flexvert_xpos[start : start + count])
                force, stiffness = self._press(data, one, carrier, solvers, places)
                forces += force
                energy += sum(solver.energy for solver in solvers)
                rows = self._rows(model, one, carrier, force)
                templates = self._templates[mine & (bodies == carrier)]
                rows = rows[: len(records) - total]
                found = records[total : total + len(rows)]
                springs.append(_fill(found, templates, rows, places, force, stiffness, one))
                self._set_friction(found, one)
                total += len(rows)
            self.latest[one.flex] = FlexContact(forces, energy, np.arange(begin, total))
        self._springs = np.concatenate(springs) if springs else np.zeros((0, 3))
        return total

    def _solvers_of(self, one: FlexSurface, carrier: int) -> list[SurfaceContact]:
        """Return the contacts of a flex's sides with the bodies on a body of the model."""
        key = (one.flex, carrier)
        if key not in self._solvers:
            bodies = [carried.body for carried in one.bodies[carrier]]
            self._solvers[key] = [SurfaceContact(side, bodies) for side in one.sides]
        return self._solvers[key]

    def _press(
        self, data: mujoco.MjData, one: FlexSurface, carrier: int, solvers: list[SurfaceContact],
        places: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
        """Return each vertex's force (v, 3), and its stiffness for equal motions (v, 3, 3)."""
        force, stiffness = np.zeros_like(places), np.zeros((len(places), 3, 3))
        poses = [_pose(data, carried) for carried in one.bodies[carrier]]
        for side, solver in zip(one.sides, solvers, strict=True):
            solver.press(places[one.vertices], poses)
            force[one.vertices] += solver.state.force
            faces = solver.state.pressed[: solver.state.pressed[-1]]
            blocks = solver.state.stiffness[: len(faces)].reshape(-1, 3, 3, 3, 3)
            corners = one.vertices[side.mesh.faces[faces]]
            np.add.at(stiffness, corners, blocks.sum(axis=3))
        return force, stiffness

    @staticmethod
    def _rows(
        model: mujoco.MjModel, one: FlexSurface, carrier: int, force: NDArray[np.float64]
    ) -> NDArray[np.int64]:
        """Return the vertices with a force, except those fixed to the body itself."""
        size = np.linalg.norm(force, axis=1)
        moves = size > _SMALL * size.max(initial=0.0)
        start = int(model.flex_vertadr[one.flex])
        holders = model.flex_vertbodyid[start : start + len(force)]
        weld = model.body_weldid
        moves &= (holders < 0) | (weld[np.maximum(holders, 0)] != weld[carrier])
        return np.flatnonzero(moves)

    def _set_friction(self, found: NDArray[np.void], one: FlexSurface) -> None:
        """Set the friction of contacts where it was given for the flex or the geom."""
        sliding = np.fmax(self._friction[found["geom"][:, 0]], one.friction)
        known = np.isfinite(sliding)
        found["friction"][known, :2] = np.maximum(sliding[known], LEAST_FRICTION)[:, None]

    def constrain(
        self, model: mujoco.MjModel, data: mujoco.MjData, records: NDArray[np.void],
        dissipation: float,
    ) -> None:  # fmt: skip
        """Set the constraints of the contacts appended by `add`, after MuJoCo has made them.

        Parameters
        ----------
        model : mujoco.MjModel
        data : mujoco.MjData
        records : contact records
        dissipation : float
            a of Hunt & Crossley [s/m].
        """
        count = len(self._springs)
        if not count:
            return
        push, k, lag = self._springs.T
        springs = Springs(k, lag * k + dissipation * push)
        set_rows(model, data, records[self.first : self.first + count], springs)

    def _warn(self, what: str, text: str) -> None:
        """Warn once about each subject."""
        if what not in self._warned:
            self._warned.add(what)
            warnings.warn(text, stacklevel=2)


def _pose(data: mujoco.MjData, carried: Carried) -> NDArray[np.float64]:
    """Return the pose of a body in the world (7,)."""
    turn, local = data.xmat[carried.carrier].reshape(3, 3), carried.local
    return frame_pose(turn @ local[:, :3], data.xpos[carried.carrier] + turn @ local[:, 3])


def _fill(
    found: NDArray[np.void], templates: NDArray[np.void], rows: NDArray[np.int64],
    places: NDArray[np.float64], force: NDArray[np.float64], stiffness: NDArray[np.float64],
    one: FlexSurface,
) -> NDArray[np.float64]:  # fmt: skip
    """Fill contact records at vertices; return their force [N], stiffness [N/m] and lag [s]."""
    at, push = places[rows], np.linalg.norm(force[rows], axis=1)
    normal = force[rows] / push[:, None]
    along = np.einsum("ni,nij,nj->n", normal, stiffness[rows], normal)
    along = np.maximum(along, push / one.sides[0].thickness)
    apart = np.linalg.norm(templates["pos"][None] - at[:, None], axis=2)
    found[:] = templates[apart.argmin(axis=1)]
    # The tangents are arbitrary.
    axes = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = np.cross(normal, axes)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    found["frame"] = np.concatenate([normal, first, np.cross(normal, first)], axis=1)
    found["pos"], found["dist"] = at, -push / along
    found["includemargin"], found["exclude"], found["efc_address"] = 0.0, 0, -1
    found["elem"] = -1
    found["vert"][:, 0], found["vert"][:, 1] = MARK, rows
    return np.stack([push, along, np.full(len(rows), one.damping)], axis=1)
