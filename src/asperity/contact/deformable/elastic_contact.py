"""Contact of an elastic body's textured surface with rigid bodies: dynamic, and static.

In the displacements u = Phi q + G f of the surface the modes are dynamic, `q'' + 2 zeta omega q' +
omega^2 q = Phi^T f`, the rest is quasi-static in the forces f. A step of h is implicit (backward
Euler): with H = h^2 / (1 + 2 zeta omega h + h^2 omega^2) of each mode, and f linearised about the
last displacements u_k,

    u = u_0 + (Phi H Phi^T + G) f,    f = f_k - (K + D / h) (u - u_k),

with u_0 the displacements without contact, K and D stiffness and damping of the contact: one system
of equations for the vertices in contact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from asperity._core.arrays import Array
from asperity._core.kernels import Repeated
from asperity.contact.deformable.elastic_body import ElasticBody
from asperity.contact.deformable.linear_contact import (
    add_product,
    agreeing_forces,
    disagreement,
    displaced,
    farthest,
    first_turned,
    pull_on_modes,
    stored,
    yielding_stiffness,
)
from asperity.contact.deformable.surface import DeformableSurface
from asperity.contact.deformable.surface_contact import SurfaceContact
from asperity.errors import AsperityError, require_between, require_not_negative
from asperity.geometry.bodies import Body
from asperity.geometry.poses import mean_twist, require_pose
from asperity.geometry.rigid_body import cross

LONGEST_STEP = 0.02
"""[s]"""
_STEP_ERROR = 3e-4
"""Largest error of a displacement after a step, over the thickness of the layer [-]."""
_NEWTON_STEPS, _HALVINGS = 16, 4
_CLOSE = 1e-9
"""Largest error of a displacement at rest, over the thickness of the layer [-]."""
# These take contiguous arrays.
_add_product, _agreeing = Repeated(add_product), Repeated(agreeing_forces)
_disagreement, _displaced = Repeated(disagreement), Repeated(displaced)
_farthest, _first_turned = Repeated(farthest), Repeated(first_turned)
_pull_on_modes, _stored_energy = Repeated(pull_on_modes), Repeated(stored)
_yielding = Repeated(yielding_stiffness)


class ElasticContact:
    """Contact of an elastic body with a textured surface and rigid bodies.

    All quantities are in the frame of the elastic body: its held nodes do not move.

    Parameters
    ----------
    body : ElasticBody
    surface : DeformableSurface
        On the mesh of the body.
    bodies : sequence of Body
        The other bodies; meshes have to be closed.
    damping : float
        Damping ratio zeta of each mode, 0 to 10.
    centres : (bodies, 3), optional
        Reference points of torques on the bodies, in their frames [m].
    leap : float, optional
        Largest displacement of a vertex in one step [m]; by default the thickness of the layer.

    Raises
    ------
    AsperityError
        The surface has another mesh than the body, or a value is outside its range.
    """

    def __init__(
        self,
        body: ElasticBody,
        surface: DeformableSurface,
        bodies: Sequence[Body],
        *,
        damping: float = 0.05,
        centres: ArrayLike | None = None,
        leap: float | None = None,
    ) -> None:
        require_between("damping", damping, 0.0, 10.0)
        if surface.mesh is not body.mesh:
            raise AsperityError(
                f"the surface is on the mesh {surface.mesh.name!r}, not on that of the elastic body"
            )
        self.body, self._damping = body, float(damping)
        self.surface = SurfaceContact(surface, bodies, centres=centres)
        self._leap = surface.thickness if leap is None else float(leap)
        self._residual = np.ascontiguousarray(body.residual)
        self._compliance = np.ascontiguousarray(body.compliance)
        self._modes, self._shapes = map(np.ascontiguousarray, (body.modes, body.modes.T))
        self._acting = self._compliance, math.inf
        self._step, self._yield = 0.0, np.zeros((0, 0))
        self._slow = self._stiff = np.zeros(0)
        self._found = np.zeros(len(body.modes))
        self.reset()

    def reset(self) -> None:
        """Reset the body to rest, without contact."""
        count = self.body.modes.shape[1]
        self._q, self._rate = np.zeros(count), np.zeros(count)
        self._u, self._force = np.zeros(len(self.body.modes)), np.zeros(len(self.body.modes))
        self._speed = np.zeros(len(self.body.modes))
        self._poses: list[Array] | None = None
        self.surface.clear()
        self.error = 0.0
        """Residual of the last step: displacements minus those caused by the contact [m]."""

    @property
    def vertices(self) -> Array:
        """Of the surface, displaced [m], (v, 3)."""
        return self.body.mesh.vertices + self._u.reshape(-1, 3)

    @property
    def displacements(self) -> Array:
        """Of the vertices [m], (v, 3)."""
        return self._u.reshape(-1, 3).copy()

    @property
    def energy(self) -> float:
        """Elastic energy of the body and of the layer [J]."""
        modal = float(((self.body.frequencies * self._q) ** 2).sum())
        return self.surface.energy + 0.5 * (modal + _stored_energy(self._residual, self._force))

    @property
    def is_accurate(self) -> bool:
        """Whether the last step was solved: `error` is at most 3e-4 of the layer's thickness."""
        return self.error <= _STEP_ERROR * self.surface.surface.thickness

    @property
    def kinetic_energy(self) -> float:
        """Of the modes [J]."""
        return 0.5 * float(self._rate @ self._rate)

    def step(self, poses: Sequence[ArrayLike], dt: float) -> Array:
        """Advance the body by one step, and return the wrenches on the others.

        Parameters
        ----------
        poses : (bodies, 7)
            Of the bodies at the end of the step.
        dt : float
            [s], up to 0.02.

        Returns
        -------
        (bodies, 6) array
            Force [N] and torque about each body's centre [N m]: minus the gradient of the layer's
            energy, at the displacements at the end of the step; and friction.

        Raises
        ------
        AsperityError
            A pose or the step is wrong, a vertex would move by more than `leap`, or the surface
            collapses or is inverted. The body is then at rest again, without force.
        """
        require_between("dt", dt, 1e-6, LONGEST_STEP, "s")
        placed = [require_pose(pose, "pose") for pose in poses]
        last = self._poses or placed
        try:
            self.surface.place(placed)
            for out, centre, old, new in zip(
                self.surface.twists, self.surface.centres, last, placed, strict=True
            ):
                out[:] = mean_twist(old, new, dt)
                out[:3] += cross(out[3:], centre - new[:3])
            self._advance(dt)
        except AsperityError:
            self.reset()
            raise
        self._poses = placed
        return self.surface.wrenches

    def _advance(self, dt: float) -> None:
        if dt != self._step:
            omega, self._step = self.body.frequencies, dt
            self._stiff = dt * omega**2
            self._slow = 1.0 / (1.0 + 2.0 * self._damping * omega * dt + dt * self._stiff)
            compliant = (self._modes * (dt * dt * self._slow)) @ self._modes.T
            self._yield = np.ascontiguousarray(compliant + self._residual)
        rate = (self._rate - self._stiff * self._q) * self._slow
        free, pull = np.empty_like(self._u), np.empty_like(rate)
        _displaced(self._shapes, self._q + dt * rate, free)
        self._acting = self._yield, dt
        force, u = self._implicit(free, dt)
        if not _farthest(u, self._u) <= self._leap:
            way = np.abs(u - self._u).reshape(-1, 3).max(axis=1)
            raise AsperityError(
                f"vertex {int(np.nanargmax(way))} would leap by {np.nanmax(way):.3g} m along an "
                f"axis in a step of {dt:g} s; valid: at most {self._leap:g} m, with "
                "slower bodies or a shorter step"
            )
        _pull_on_modes(self._modes, force, pull)
        self._rate = rate + dt * self._slow * pull
        self._q = self._q + dt * self._rate
        self._speed = (u - self._u) / dt
        self._u, self._force = u, force
        self._refuse_inverted()

    def _implicit(self, free: Array, dt: float) -> tuple[Array, Array]:
        """Return forces on the vertices and displacements at the end of a step, (3 v,) both.

        `free` are the displacements without contact. By Newton's method, whose steps are halved if
        they increase the error. The contact is then that at these displacements.
        """
        goal = _STEP_ERROR * self.surface.surface.thickness
        # Start from the extrapolated motion: with the last forces instead, these would jump.
        u = self._u + dt * self._speed
        error = self._contact_residual(u, free, dt)
        first = force = self.surface.state.force.ravel().copy()
        slipping = 1.0
        for _ in range(_NEWTON_STEPS):
            if error <= goal:
                break
            better, share = self._solved(free, self._yield, dt, slipping), 1.0
            target, start = _add_to(free, self._yield, better), (u, force)
            for _ in range(_HALVINGS):
                u = start[0] + share * (target - start[0])
                force = start[1] + share * (better - start[1])
                found = self._contact_residual(u, free, dt)
                if found < error:
                    break
                share *= 0.5
            if found >= error and slipping:
                # Near the speed at which friction saturates, its slope misleads Newton's method.
                (u, force), slipping = start, 0.0
                found = self._contact_residual(u, free, dt)
            error = found
        self.error = error
        return force, (self._found.copy() if force is first else u)

    def _contact_residual(self, u: Array, free: Array, dt: float) -> float:
        """Return the residual: displacements minus those caused by their contact [m].

        Fills `_found` with the latter.
        """
        self._press(u, (u - self._u) / dt)
        force = self.surface.state.force.ravel()
        return float(_disagreement(free, self._yield, force, u, self._found))

    def derivatives(self) -> tuple[Array, Array]:
        """Return stiffness and damping (6, 6) on the first body, of contact and elastic body.

        About its centre, in the frame of the elastic body, in the Gauss-Newton approximation: over
        the last step, or static and without damping after `settle`. Both are symmetric and positive
        semidefinite [N/m, N/rad; N, N m/rad].
        """
        state, (compliance, dt) = self.surface.state, self._acting
        count = int(state.pressed[-1])
        stiffness, damping = np.zeros((6, 6)), np.zeros((6, 6))
        if count:
            faces = self.surface.surface.arrays.faces[state.pressed[:count]]
            arms = self.vertices - self.surface.centres[0]
            springs = state.stiffness[:count]
            _yielding(faces, springs, compliance, arms, stiffness)
            if self.surface.surface.friction > 0.0 and dt < math.inf:
                drag = (state.damping[:count] - state.slipping[:count]) / dt
                _yielding(faces, springs + drag, compliance, arms, damping)
                damping = dt * (damping - stiffness)
        return stiffness, damping

    def settle(
        self, poses: Sequence[ArrayLike], *, most: int = 200, close: float = _CLOSE
    ) -> Array:
        """Find static equilibrium with bodies at rest; return the wrenches on these.

        The energy of body and layer is then minimal, so the wrenches are minus its gradient with
        respect to the poses alone.

        Parameters
        ----------
        poses : (bodies, 7)
        most : int
            Maximum number of Newton steps.
        close : float
            Tolerance of displacements, over the thickness of the layer.

        Raises
        ------
        AsperityError
            The steps do not converge to the accuracy of a time step, or the surface collapses or is
            inverted. The body is then undeformed, without force.
        """
        require_not_negative("most", most)
        placed = [require_pose(pose, "pose") for pose in poses]
        try:
            self.surface.place(placed)
            self._relax(most, close)
        except AsperityError:
            self.reset()
            raise
        self._q = self.body.modes.T @ self._force / self.body.frequencies**2
        self._rate[:] = self._speed[:] = 0.0
        self._poses = placed
        return self.surface.wrenches

    def _relax(self, most: int, close: float) -> None:
        compliance, none = self._compliance, np.zeros_like(self._u)
        self._acting = compliance, math.inf
        thickness = self.surface.surface.thickness
        force = self._force
        u = _add_to(none, compliance, force)
        self._press(u, none)
        energy = self._total_energy(u, force)
        for turn in range(most + 1):
            better = self._solved(none, compliance, np.inf)
            target = _add_to(none, compliance, better)
            self.error = float(np.abs(target - u).max())
            # Convergence is linear, since K ignores the rotation of normals.
            goal = close if turn < most else max(close, _STEP_ERROR)
            if self.error < goal * thickness:
                self._u, self._force = target, better
                self._press(target, none)
                self._refuse_inverted()
                return
            share = 1.0
            while True:
                trial = u + share * (target - u), force + share * (better - force)
                self._press(trial[0], none)
                found = self._total_energy(*trial)
                if found <= energy * (1.0 + 1e-12) or share < 1e-6:
                    break
                share *= 0.5
            (u, force), energy = trial, found
        raise AsperityError(f"the elastic body did not come to rest within {most} steps of Newton")

    def _total_energy(self, u: Array, force: Array) -> float:
        """Return the energy of body and layer [J]."""
        return self.surface.energy + 0.5 * float(u @ force)

    def _press(self, u: Array, speed: Array) -> None:
        shape = self.body.mesh.vertices.shape
        self.surface.press_at(self.body.mesh.vertices + u.reshape(shape), speed.reshape(shape))
        self._at = u

    def _solved(self, free: Array, compliance: Array, dt: float, slipping: float = 1.0) -> Array:
        """Return the forces on the vertices (3 v,) that are consistent with their displacements.

        `free` are the displacements without them. `slipping` is 1 for the tangent of the friction,
        0 for its secant.
        """
        state, out = self.surface.state, np.empty_like(free)
        count = int(state.pressed[-1])
        faces = self.surface.surface.arrays.faces[state.pressed[:count]]
        drag = state.damping[:count] - slipping * state.slipping[:count]
        springs = state.stiffness[:count] + state.growing[:count] + drag / dt
        _agreeing(faces, springs, compliance, free, self._at, state.force.ravel(), out)
        return out

    def _refuse_inverted(self) -> None:
        """Refuse a surface that is inverted where it is in contact."""
        state, surface = self.surface.state, self.surface.surface
        turned = _first_turned(state.pressed, state.normal, surface.normals)
        if turned >= 0:
            raise AsperityError(
                f"triangle {turned} of {surface.mesh.name!r} has turned inside out: "
                "the body is pressed harder than a linear one can bear"
            )


def _add_to(start: Array, matrix: Array, vector: Array) -> Array:
    """Return `start` plus a symmetric matrix times a sparse vector."""
    out = start.copy()
    _add_product(matrix, vector, out)
    return out
