"""Contact between all bodies of a model that can move relative to each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from asperity.contact.body_contact import BodyContact, body_arrays
from asperity.contact.broad_phase.mujoco_pairs import Candidates, Collider
from asperity.contact.contacts import Contacts
from asperity.contact.refused import refuse_soft_bodies
from asperity.contact.response.settings import ForceSettings
from asperity.contact.search_room import search_room
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.geometry.poses import rotation_of

_RIGID = 1e-6
"""Tolerance of the relative poses of rigidly connected bodies [m, rad]."""


class PairContact(NamedTuple):
    """Contact of one body with others that do not move relative to each other."""

    body: int
    """Number of the body on which the wrench of `contact` acts."""
    others: tuple[int, ...]
    """Numbers of the bodies that it touches."""
    contact: BodyContact
    """Its `contacts`, `stiffness()` and `damping()` are those at the last poses, world axes."""


class MultibodySolver:
    """Contact wrenches between all bodies of a model, any of which may move.

    Parameters
    ----------
    model : mujoco.MjModel
        Its joints define which bodies can move relative to each other, its collision filters which
        may touch. The model is not changed.
    bodies : sequence of Body
        The bodies of the model with their textures, in any order; the geoms of each in the order
        of the model. Other bodies of the model touch nothing.
    settings : ForceSettings, optional
        Force law and its parameters; by default those of `ForceSettings()`.

    Attributes
    ----------
    pairs : tuple of PairContact
        Contacts, stiffness and damping of each body with each group of rigidly connected bodies.

    Raises
    ------
    AsperityError
        A body's number of geoms differs from that in the model, no body moves, or `settings` has a
        law that contact with meshes does not support.

    Notes
    -----
    The wrench between two groups is minus the gradient of one potential of their relative pose
    (`response.potential`), so that forces, and torques about one point, are equal and opposite.
    `ContactSolver` is the case of one free body among fixed ones.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        bodies: Sequence[Body],
        settings: ForceSettings | None = None,
    ) -> None:
        refuse_soft_bodies(bodies)
        self._collider = Collider(model, bodies)
        groups = self._collider.groups
        arrays = body_arrays(bodies, self._collider, groups)
        self._names = [body.name for body in bodies]
        self._home, self._centres = arrays.frames, arrays.centres
        number = arrays.geom_number
        self._numbers = np.where(number >= 0, arrays.geometry.body[number], -1)
        pairs: list[PairContact] = []
        # Pairs are searched in turn, so that they share the large memory of a search.
        room = search_room(arrays.geometry, arrays.facets)
        for one, two in _pairs_of_groups(groups):
            for body in np.flatnonzero(groups == one).tolist():
                others = tuple(np.flatnonzero(groups == two).tolist())
                contact = BodyContact(arrays, body, others, settings or ForceSettings(), room)
                pairs.append(PairContact(body, others, contact))
        if not pairs:
            raise AsperityError("no body of the model can move against another one: give it joints")
        self.pairs = tuple(pairs)
        self._groups = [np.flatnonzero(groups == group).tolist() for group in np.unique(groups)]

    def change(self, settings: ForceSettings) -> None:
        """Change stiffness, friction and dissipation from the next poses on."""
        for pair in self.pairs:
            pair.contact.change(settings)

    def reset(self) -> None:
        """Forget all contacts and their bristles."""
        for pair in self.pairs:
            pair.contact.reset()

    def solve(self, poses: ArrayLike, dt: float) -> NDArray[np.float64]:
        """Return the wrench on each body at poses of all bodies.

        Parameters
        ----------
        poses : (bodies, 7)
            Of the bodies' frames: position [m], unit quaternion wxyz; in the order of `bodies`.
        dt : float
            Time since the last call [s], by which bristles advance; 0 leaves the memory as it is.

        Returns
        -------
        (bodies, 6) array
            Force [N] and torque about each body's centre of mass [N m], world axes.

        Raises
        ------
        AsperityError
            `poses` has another shape, a number is not finite, a quaternion is zero, or rigidly
            connected bodies are moved relative to each other.
        """
        given = np.asarray(poses, dtype=np.float64)
        is_whole = given.shape == (len(self._names), 7) and bool(np.isfinite(given).all())
        if not is_whole or not given[:, 3:].any(axis=1).all():
            raise AsperityError(
                f"poses must be {len(self._names)} rows of 7 finite numbers, one a body "
                f"({', '.join(self._names)}), the last four not all 0, got {given.tolist()}"
            )
        frames = np.empty((len(given), 3, 4))
        frames[:, :, :3] = [rotation_of(q / np.linalg.norm(q)) for q in given[:, 3:]]
        frames[:, :, 3] = given[:, :3]
        self._require_rigid(frames)
        self._collider.place_all(frames)
        return self.solve_at(frames, self._collider.query(), dt)

    def solve_at(
        self, frames: NDArray[np.float64], candidates: Candidates, dt: float
    ) -> NDArray[np.float64]:
        """Return the wrenches (bodies, 6) at frames (bodies, 3, 4) with these candidates."""
        out = np.zeros((len(frames), 6))
        near = self._have_candidates(candidates)
        centres = frames[:, :, 3] + np.einsum("bij,bj->bi", frames[:, :, :3], self._centres)
        for body, others, contact in self.pairs:
            if not near[body, list(others)].any():
                contact.leave(dt)
                continue
            turn, move = _motion(self._home[others[0]], frames[others[0]])
            pose = frame_pose(turn.T @ frames[body, :, :3], turn.T @ (frames[body, :, 3] - move))
            found = contact.wrench_at(pose, dt, candidates, lambda: candidates)
            wrench = np.concatenate([turn @ found[:3], turn @ found[3:]])
            contact.turn_to_world(turn, move)
            out[body] += wrench
            _subtract_reactions(contact.contacts, wrench, centres[body], centres, out)
        return out

    def _have_candidates(self, candidates: Candidates) -> NDArray[np.bool_]:
        """Return whether each two bodies have candidates, (bodies, bodies)."""
        near = np.zeros((len(self._names), len(self._names)), bool)
        one, two = self._numbers[candidates.geoms[: candidates.count]].T
        is_known = (one >= 0) & (two >= 0)
        near[one[is_known], two[is_known]] = near[two[is_known], one[is_known]] = True
        return near

    def _require_rigid(self, frames: NDArray[np.float64]) -> None:
        """Refuse frames that change the relative poses of bodies of one group."""
        for first, *rest in self._groups:
            turn, move = _motion(self._home[first], frames[first])
            for body in rest:
                wanted = turn @ self._home[body]
                wanted[:, 3] += move
                if np.abs(frames[body] - wanted).max() > _RIGID:
                    one, two = self._names[first], self._names[body]
                    raise AsperityError(
                        f"poses move body {two!r} against body {one!r}, to which it is fixed; "
                        "give it a joint in the model"
                    )


def _pairs_of_groups(groups: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Return pairs of groups, the one of fewer bodies first, the static one last."""
    numbers, sizes = np.unique(groups, return_counts=True)
    order = [int(number) for number in numbers[np.argsort(sizes, kind="stable")]]
    # A body among static ones is `ContactSolver`'s case.
    order = [number for number in order if number != 0] + [0] * (0 in order)
    return [(one, two) for i, one in enumerate(order) for two in order[i + 1 :]]


def _motion(
    home: NDArray[np.float64], frame: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rotation (3, 3) and translation (3,) from a body's first frame to another one."""
    turn = frame[:, :3] @ home[:, :3].T
    return turn, frame[:, 3] - turn @ home[:, 3]


def frame_pose(turn: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pose (7,) of a frame."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, turn.ravel())
    return np.concatenate([place, quaternion])


def _subtract_reactions(
    contacts: Contacts, wrench: NDArray[np.float64], centre: NDArray[np.float64],
    centres: NDArray[np.float64], out: NDArray[np.float64],
) -> None:  # fmt: skip
    """Subtract the reactions on the touched bodies from the wrenches `out` (bodies, 6).

    The force of a contact acts on its own body. The rest of `wrench`, about `centre`, acts on the
    body of the first contact.
    """
    count = int(contacts.count[0])
    rest = wrench.copy()
    for c in range(count):
        force, body = contacts.force[c], int(contacts.body[c])
        rest[:3] -= force
        rest[3:] -= np.cross(contacts.point[c] - centre, force)
        out[body, :3] -= force
        out[body, 3:] -= np.cross(contacts.point[c] - centres[body], force)
    if count:
        body = int(contacts.body[0])
        out[body, :3] -= rest[:3]
        out[body, 3:] -= rest[3:] + np.cross(centre - centres[body], rest[:3])
