"""The contact solver: from a pose of the tool to the contacts and the wrench on it.

Between geoms a contact is one direction along which the tool may leave a body, and the wrench is
the gradient of one potential (`response.potential`). Between meshes it is a *patch*, a part of the
overlap region with one normal (`manifold.mesh_manifold`).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity._core.cores import usable_cores
from asperity.contact.body_contact import BodyContact, body_arrays
from asperity.contact.broad_phase.mujoco_pairs import Candidates, Collider
from asperity.contact.refused import refuse_soft_bodies
from asperity.contact.response.settings import ForceSettings
from asperity.errors import AsperityError, require_between
from asperity.geometry.bodies import Body
from asperity.geometry.poses import require_pose

if TYPE_CHECKING:
    import mujoco

_logger = logging.getLogger(__name__)
_BLOCK = 128
"""Poses per block of a thread: enough to hide Python's overhead, few enough to balance the load."""


class ContactSolver(BodyContact):
    """Contact forces between a tool and the bodies of a scene, which do not move.

    Where several bodies move, see `MultibodySolver`.

    Parameters
    ----------
    model : mujoco.MjModel
        The scene; the tool is its body with a freejoint. The model is not changed.
    bodies : sequence of Body
        The bodies of the model with their textures, in any order; the geoms of each in the order
        of the model.
    tool : str
        Name of the tool.
    settings : ForceSettings, optional
        Force law and its parameters; by default those of `ForceSettings()`.

    Attributes
    ----------
    contacts : Contacts
        The contacts of the last pose, in arrays that the next call overwrites; only the first
        `contacts.count[0]` rows are valid.
    centre : (3,) array
        The tool's centre of mass in its own frame [m].
    by_facets : (bodies,) array of int
        Whether contact of the tool with a body is between facets: if either is a mesh.

    Raises
    ------
    AsperityError
        No body has the name `tool`; a body's number of geoms differs from that in the model; or a
        mesh is involved and `settings` has another law than "otaduy-lin" or another gradient
        than "exact".

    Notes
    -----
    Forces are those of Otaduy & Lin (2004, Eqs 2 and 3), with certified penetration depths and
    exact gradients. The baselines are listed in `response.point_laws`.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        bodies: Sequence[Body],
        tool: str,
        settings: ForceSettings | None = None,
    ) -> None:
        refuse_soft_bodies(bodies)
        names = [body.name for body in bodies]
        if tool not in names:
            raise AsperityError(f"no body named {tool!r}; bodies: {', '.join(names)}")
        self._collider, number = Collider(model, bodies), names.index(tool)
        self._arrays = body_arrays(bodies, self._collider, np.arange(len(bodies)) == number)
        self._others = [i for i in range(len(bodies)) if i != number]
        self._workers: list[tuple[BodyContact, Collider]] = []
        super().__init__(self._arrays, number, self._others, settings or ForceSettings())

    def wrench(
        self, pose: NDArray[np.float64], dt: float, seconds: float = math.inf
    ) -> NDArray[np.float64]:
        """Return the wrench on the tool at a pose.

        Parameters
        ----------
        pose : (7,)
            Of the tool's frame: position [m], unit quaternion wxyz.
        dt : float
            Time since the last call [s], by which bristles and noise advance; 0 leaves the memory
            as it is.
        seconds : float
            Time limit of the searches [s]. A search that reaches it returns its incumbent; the
            remaining uncertainty is the `gap` of the contact, and `was_cut` is true. Only the
            searches are limited.

        Returns
        -------
        (6,) array
            Force [N] and torque about the tool's centre of mass [N m], world axes. The same
            array in every call.

        Raises
        ------
        AsperityError
            `pose` is not seven finite numbers, its quaternion is zero, or `dt` is below 0.
        """
        given = np.asarray(pose, dtype=np.float64)
        # Dot products take a third of the time of `isfinite` and `any`.
        is_good = given.shape == (7,) and given.dot(given) < math.inf
        if not (is_good and given[3:].dot(given[3:]) > 0.0):
            require_pose(given, "pose")
        if not dt >= 0.0:
            raise AsperityError(f"dt must be 0 s or above, got {dt!r}")
        near = self.candidates(given, self.in_contact)
        return self.wrench_at(given, dt, near, self._collider.query, seconds)

    def candidates(
        self, pose: NDArray[np.float64], without: NDArray[np.bool_] | None = None
    ) -> Candidates:
        """Return the pairs of geoms that may touch at a pose; see `Collider.query`."""
        self._collider.place(self._scene.tool, pose)
        return self._collider.query(without)

    def keep(self) -> list[NDArray[Any]]:
        """Return a copy of the results of the last pose, for `restore`."""
        return [part.copy() for part in self._results()]

    def restore(self, kept: Sequence[NDArray[Any]]) -> None:
        """Restore the results of an earlier pose, but not the start points of searches."""
        for part, earlier in zip(self._results(), kept, strict=True):
            part[...] = earlier

    def _results(self) -> list[NDArray[Any]]:
        """Return the arrays that hold the result of the last pose."""
        energies = [self._memory.state["way_out"]]
        if self._mesh is not None:
            energies.append(self._mesh.space.energy)
        return [*self.contacts, self._pose, self._out.wrench, self._is_cut_short, *energies]

    def wrenches(
        self,
        poses: ArrayLike,
        *,
        threads: int | None = None,
        certified: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.float64]:
        """Return the wrenches on the tool at many independent poses.

        Equal to `wrench` of each pose after `reset`, with a `dt` of 0: without friction, damping or
        noise. Depths that are not certified are counted in a log message. The memory of this solver
        is not changed.

        Parameters
        ----------
        poses : (n, 7)
            Of the tool's frame: position [m], unit quaternion wxyz.
        threads : int, optional
            Number of threads, 1 or more; by default the number of usable cores.
        certified : (n,) array of bool, optional
            Filled with whether all depths of each pose are certified.

        Returns
        -------
        (n, 6) array
            Force [N] and torque about the tool's centre of mass [N m], world axes.

        Raises
        ------
        AsperityError
            `poses` has another shape, a number is not finite, or a quaternion is zero.
        """
        given = np.ascontiguousarray(poses, dtype=np.float64)
        if given.ndim != 2 or given.shape[1] != 7:
            raise AsperityError(f"poses must be rows of 7 finite numbers, got {given.shape}")
        for row in np.flatnonzero(~np.isfinite(given).all(axis=1) | ~given[:, 3:].any(axis=1))[:1]:
            require_pose(given[row], f"poses[{row}]")
        count = usable_cores()
        if threads is not None:
            count = int(require_between("threads", threads, 1, 1024))
        while len(self._workers) < count:
            contact = BodyContact(self._arrays, self._scene.tool, self._others, self.settings)
            self._workers.append((contact, self._collider.clone()))
        wrench, is_certified = np.empty((len(given), 6)), np.empty(len(given), bool)
        starts = iter(range(0, len(given), _BLOCK))

        def work(worker: tuple[BodyContact, Collider]) -> None:
            contact, collider = worker
            contact.change(self.settings)
            for start in starts:
                part = slice(start, start + _BLOCK)
                contact.solve_batch(given[part], collider, wrench[part], is_certified[part])

        with ThreadPoolExecutor(count) as pool:
            list(pool.map(work, self._workers[:count]))
        if certified is not None:
            certified[:] = is_certified
        missing = int((~is_certified).sum())
        if missing:
            _logger.warning(
                "%d of %d poses have a depth that is not certified; more boxes (max_nodes) help",
                missing, len(given),
            )  # fmt: skip
        return wrench
