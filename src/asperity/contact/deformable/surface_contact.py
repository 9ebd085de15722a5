"""Contact of a deformable textured surface: forces on its vertices and on the other bodies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array, Indices
from asperity._core.kernels import Repeated
from asperity.contact.deformable.press import press_surface
from asperity.contact.deformable.records import SurfaceMotion, SurfaceState
from asperity.contact.deformable.surface import DeformableSurface
from asperity.contact.soft.solids import fill_frames, require_bodies, solids_of
from asperity.contact.soft.taxel_sums import empty_output
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.geometry.poses import require_pose

_IDENTITY = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


class SurfaceContact:
    """Contact of a deformable surface with rigid bodies.

    The energy is `U = sum a w(delta)` over the taxels, as that of `SkinContact`, a function of all
    vertices and of the poses of all bodies. `forces` are minus its gradient with respect to the
    vertices, `wrenches` with respect to the bodies; both with friction, if there is any.

    Parameters
    ----------
    surface : DeformableSurface
    bodies : sequence of Body
        The other bodies, textured or smooth; meshes have to be closed.
    centres : (bodies, 3), optional
        Reference points of torques on the bodies, in their frames [m]; by default their origins.
    leap : float, optional
        Largest displacement of a vertex between two ticks [m]; a larger one is refused. By default
        there is no limit.

    Raises
    ------
    AsperityError
        A mesh is open, or there is no body.

    Examples
    --------
    >>> surface = DeformableSurface(mesh, thickness=1e-3, modulus=5e4, pitch=4e-4, texture=pores)
    >>> contact = SurfaceContact(surface, [tool])
    >>> contact.press(vertices, [tool_pose])
    >>> contact.forces  # on the vertices
    >>> contact.wrenches  # on the tool
    """

    def __init__(
        self,
        surface: DeformableSurface,
        bodies: Sequence[Body],
        *,
        centres: ArrayLike | None = None,
        leap: float | None = None,
    ) -> None:
        require_bodies("a surface", bodies)
        self.surface, self._leap = surface, leap
        count, shape = len(bodies), (len(bodies), 3)
        self._centres = np.zeros(shape) if centres is None else np.array(centres, dtype=np.float64)
        if self._centres.shape != shape or not np.isfinite(self._centres).all():
            raise AsperityError(f"centres must be finite, of shape {shape}, got {centres!r}")
        self._solids = solids_of(bodies, [np.array(_IDENTITY)] * count)
        arrays = surface.arrays
        m, v, g = len(arrays.faces), len(surface.mesh.vertices), len(arrays.first_member) - 1
        self.state = SurfaceState(
            surface.taxels(), np.zeros((m, 3)), np.zeros((m, 3, 3)), np.zeros(m, np.int64),
            np.zeros((g, 3)), np.zeros(g), np.zeros(g, np.int64), np.zeros((g, 3)),
            np.zeros(g + 1, np.int64), np.zeros(m + 1, np.int64),
            np.zeros((m, 9, 9)), np.zeros((m, 9, 9)), np.zeros((m, 9, 9)), np.zeros((m, 9, 9)),
            np.zeros((v, 3)),
            np.zeros((count, 6)), np.zeros(2, np.int64),
        )  # fmt: skip
        self.out = empty_output(surface.taxel_count)
        self._motion = SurfaceMotion(
            np.array(surface.mesh.vertices), np.zeros((v, 3)), np.zeros(shape),
            np.zeros((count, 6)),
        )  # fmt: skip
        self._is_first = True
        self._press = Repeated(press_surface)

    def press(
        self,
        vertices: ArrayLike,
        poses: Sequence[ArrayLike],
        *,
        velocities: ArrayLike | None = None,
        twists: ArrayLike | None = None,
    ) -> None:
        """Compute the contact at positions of the vertices and poses of the bodies.

        Parameters
        ----------
        vertices : (v, 3)
            In the order of the mesh's, world axes [m].
        poses : (bodies, 7)
            Of the bodies' frames: position [m], unit quaternion wxyz.
        velocities : (v, 3), optional
            Of the vertices [m/s], for friction; by default 0.
        twists : (bodies, 6), optional
            Velocity of the bodies' centres [m/s] and angular velocity [rad/s], world axes.

        Raises
        ------
        AsperityError
            An array has another shape or is not finite; a vertex moves by more than `leap`; a
            triangle has less than 1e-4 of its area at rest. Then there is no force until the next
            call.
        """
        motion = self._motion
        try:
            places = _checked("vertices", vertices, motion.vertices.shape)
            speeds = np.zeros_like(places)
            if velocities is not None:
                speeds = _checked("velocities", velocities, places.shape)
            if len(poses) != len(motion.centres):
                raise AsperityError(
                    f"there are {len(motion.centres)} bodies, but {len(poses)} poses"
                )
            moved = np.zeros_like(motion.twists)
            if twists is not None:
                moved = _checked("twists", twists, moved.shape)
            self._refuse_leap(places)
            self.place([require_pose(pose, "pose") for pose in poses])
            motion.twists[:] = moved
            self.press_at(places, speeds)
        except AsperityError:
            self.clear()
            raise
        self._is_first = False

    def _refuse_leap(self, places: Array) -> None:
        if self._leap is None or self._is_first:
            return
        way = np.linalg.norm(places - self._motion.vertices, axis=1)
        if way.max() > self._leap:
            raise AsperityError(
                f"vertex {int(way.argmax())} leaps by {way.max():.3g} m in one tick; valid: at "
                f"most leap = {self._leap:g} m"
            )

    def place(self, poses: Sequence[Array]) -> None:
        """Move the bodies to poses (bodies, 7), which are not checked, with zero twists."""
        motion = self._motion
        motion.twists[:] = 0.0
        turns = fill_frames(self._solids, poses)
        for centre, turn, own, pose in zip(
            motion.centres, turns, self._centres, poses, strict=True
        ):
            centre[:] = pose[:3] + turn @ own

    def press_at(self, vertices: Array, velocities: Array) -> None:
        """Compute the contact at positions of the vertices, which are not checked; see `press`.

        Raises
        ------
        AsperityError
            A triangle has collapsed.
        """
        self._motion.vertices[:] = vertices
        self._motion.velocities[:] = velocities
        self._press(
            self._solids, self.surface.arrays, self.surface.friction, self._motion, self.state,
            self.out,
        )  # fmt: skip
        self._refuse_collapsed()

    def _refuse_collapsed(self) -> None:
        triangle = int(self.state.tick[1])
        if triangle >= 0:
            raise AsperityError(
                f"triangle {triangle} of {self.surface.mesh.name!r} has collapsed: it has less "
                "than 1e-4 of its area at rest"
            )

    def clear(self) -> None:
        """Clear contact and forces until the next call."""
        self.state.wrench[:] = 0.0
        state = self.state
        for blocks in (state.stiffness, state.growing, state.damping, state.slipping):
            blocks[:] = 0.0
        self.state.force[:] = 0.0
        for array in (self.out.compression, self.out.traction, self.out.force, self.out.wrench):
            array[:] = 0.0
        self.out.stiffness[:] = self.out.damping[:] = self.out.damped[:] = 0.0
        self.out.energy[:] = self.out.push[:] = 0.0
        self.out.pressed[-1] = self.state.pressed[-1] = 0
        self._is_first = True

    @property
    def centres(self) -> Array:
        """Positions of the bodies' centres [m], (bodies, 3)."""
        return self._motion.centres

    @property
    def twists(self) -> Array:
        """Velocities of the centres [m/s] and angular velocities [rad/s], (bodies, 6)."""
        return self._motion.twists

    @property
    def energy(self) -> float:
        """U of the last configuration [J]."""
        return float(self.out.energy[0])

    @property
    def forces(self) -> Array:
        """On each vertex [N], world axes, (v, 3)."""
        return self.state.force.copy()

    @property
    def _pressed_vertices(self) -> Indices:
        return self.out.pressed[: self.out.pressed[-1]]

    @property
    def wrenches(self) -> Array:
        """On each body: force [N], torque about its centre [N m], world axes, (bodies, 6)."""
        return self.state.wrench.copy()

    @property
    def compression(self) -> Array:
        """Compression of each taxel [m], (n,)."""
        return self.out.compression.copy()

    @property
    def pressure(self) -> Array:
        """Pressure along each taxel's ray, over its area at rest [Pa], (n,)."""
        return self.out.traction[:, 0].copy()

    @property
    def shear(self) -> Array:
        """Traction normal to each taxel's ray [Pa], (n, 2).

        Along the first edge of its triangle, and perpendicular to that.
        """
        return self.out.traction[:, 1:].copy()

    @property
    def contact_area(self) -> float:
        """Area at rest of the taxels in contact [m^2]."""
        return float(self.surface.taxel_area[self._pressed_vertices].sum())

    def stiffness(self) -> Array:
        """Return the stiffness (6, 6) on the first body with all vertices held.

        About its centre, world axes [N/m, N/rad; N, N m/rad], in the Gauss-Newton approximation.
        """
        return self.out.stiffness.copy()


def _checked(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return an array of floats, or refuse it."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise AsperityError(f"{name} must be numbers of shape {shape}, got {values!r}") from None
    if array.shape != shape:
        raise AsperityError(f"{name} must have the shape {shape}, got {array.shape}")
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise AsperityError(f"{name} must be finite; row {row} is {array[row].tolist()}")
    return array
