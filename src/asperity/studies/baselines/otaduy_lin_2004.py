r"""The algorithm of Otaduy & Lin (2004) as published, on a processor in place of graphics hardware.

1. Collision detection between the low-resolution bodies gives places of contact c and directions
   n (`low_resolution_contacts`).
2. At each contact both surfaces with their textures are projected along n onto a grid of samples
   (`projection`); the directional penetration depth is the largest overlap of the samples,

       delta = max over the grid of  h_B(u, v) - h_A(u, v).

3. Its gradient by central differences in u, v, theta_u, theta_v and theta_n: two more depths each,
   with the tool moved, eleven in all.
4. Force and torque about c, in the frame {u, v, n} (Eq. 3; n here points to the tool, so that
   d(delta)/dn = -1), summed over the contacts:

       F = k delta (n - delta_u u - delta_v v),
       T = -k delta (delta_theta_u u + delta_theta_v v + delta_theta_n n).

The paper computes depth and gradient from texture images on graphics hardware and refers to a
report for the rest, which could not be read: the grid of 50 x 50 and the form of the projection
are recalled. Asperity's own: contacts by MuJoCo, the size of a cluster, the window, the steps, and
that a rotation moves the rim of the window by as much as a translation moves all of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.kernels import inner_kernel, kernel
from asperity.errors import require_between, require_positive
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene
from asperity.simulation.tool_contact import announce_compiling
from asperity.studies.baselines.low_resolution_contacts import (
    LowCollider,
    LowContact,
    frame_along,
)
from asperity.studies.baselines.placement import centre_at, place_bodies
from asperity.studies.baselines.projection import View, project, shapes_of
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer

Array = NDArray[np.float64]
EVALUATIONS = 11
"""Depths of a contact: one, and two for each of five derivatives."""


class ProjectionBuffers(NamedTuple):
    """Memory of the projections, each (cells, cells)."""

    depth: Array
    body: Array
    tool: Array


@inner_kernel
def _moved(frame, axis, step, frame_out):
    """Fill a frame (3, 4) moved along u or v (axis 0, 1), or turned about u, v, n (2, 3, 4).

    The result is mirrored in n = 0, so that it is seen from below.
    """
    for i in range(3):
        for j in range(4):
            frame_out[i, j] = frame[i, j]
    if axis == 0 or axis == 1:
        frame_out[axis, 3] += step
    elif axis > 1:
        one, two = (axis - 1) % 3, axis % 3
        c, s = np.cos(step), np.sin(step)
        for j in range(4):
            frame_out[one, j] = c * frame[one, j] - s * frame[two, j]
            frame_out[two, j] = s * frame[one, j] + c * frame[two, j]
    for j in range(4):
        frame_out[2, j] = -frame_out[2, j]


@inner_kernel
def _depth(shapes, frame, view, buffers):
    """Return the largest overlap of the tool at a mirrored frame with the bodies; 0 if none."""
    moved = frame.reshape(1, 3, 4)
    project(shapes, moved, view, buffers.depth, buffers.tool)
    best = 0.0
    for i in range(view.cells):
        for j in range(view.cells):
            best = max(best, buffers.body[i, j] + buffers.tool[i, j])
    return best


@kernel
def grid_depths(tool, others, frame, frames, view, steps, buffers, out):
    """Fill the depth [m] of a contact, and its derivatives; return the number of evaluations.

    Parameters
    ----------
    tool, others : Shapes
    frame : (3, 4) array
        Frame of the tool in that of the contact, {u, v, n} at c [m].
    frames : (bodies, 3, 4) array
        Frames of the other bodies.
    view : View
    steps : (2,) array
        Of translations [m] and of rotations [rad].
    buffers : ProjectionBuffers
    out : (6,) array
        Depth; derivatives by u, v [-], theta_u, theta_v, theta_n [m]. Without overlap the depth
        alone.
    """
    moved = np.empty((3, 4))
    project(others, frames, view, buffers.depth, buffers.body)
    _moved(frame, -1, 0.0, moved)
    out[0] = _depth(tool, moved, view, buffers)
    if not out[0] > 0.0:
        return 1
    for axis in range(5):
        step = steps[0] if axis < 2 else steps[1]
        _moved(frame, axis, step, moved)
        ahead = _depth(tool, moved, view, buffers)
        _moved(frame, axis, -step, moved)
        out[1 + axis] = (ahead - _depth(tool, moved, view, buffers)) / (2.0 * step)
    return EVALUATIONS


class PublishedRenderer(Renderer):
    """Renders a scene by projections on a grid.

    Attributes
    ----------
    evaluations : int
        Depths evaluated so far: eleven a contact that overlaps, one of a contact that does not.
    """

    def __init__(self, scene: Scene, method: PublishedMethod) -> None:
        announce_compiling()
        bodies = place_bodies(scene)
        self._method, self._stiffness = method, scene.force.stiffness
        self._collider = LowCollider(scene, method.cluster)
        self._tool = shapes_of([bodies.tool])
        self._others = shapes_of([there.body for there in bodies.standing])
        self._frames = np.array([
            np.column_stack([there.rotation, there.position]) for there in bodies.standing
        ])  # fmt: skip
        self._centre = bodies.centre
        self._reach = sum(
            max((field.relief for body in some for field in body.fields), default=0.0)
            for some in ([bodies.tool], [there.body for there in bodies.standing])
        )
        self._buffers = ProjectionBuffers(
            *(np.empty((method.cells, method.cells)) for _ in range(3))
        )
        self.evaluations = 0

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        own = np.column_stack([rotation_of(pose[3:]), pose[:3]])
        middle = centre_at(pose, self._centre)
        force, torque, deepest, count = np.zeros(3), np.zeros(3), 0.0, 0
        for contact in self._collider.contacts(pose):
            frame = frame_along(contact.normal)
            place, half = _window(contact, frame)
            view = self._view(contact, half + self._method.border)
            depth, by_u, by_v, *by_angle = self._depth(frame, place, view, own)
            if depth <= 0.0:
                continue
            push = self._stiffness * depth * (np.array([-by_u, -by_v, 1.0]) @ frame)  # Eq. 3
            turn = -self._stiffness * depth * (np.array(by_angle) @ frame)
            force += push
            torque += turn + np.cross(place - middle, push)
            deepest, count = max(deepest, depth), count + 1
        return MethodWrench(force, torque, deepest, count) if count else NOTHING

    def _view(self, contact: LowContact, half: float) -> View:
        """Return the grid of a contact."""
        # Surfaces that are higher than any that could touch belong to something else.
        top = half + 2.0 * max(contact.depth, 0.0) + self._reach
        return View(half, self._method.cells, top)

    def _depth(self, frame: Array, place: Array, view: View, own: Array) -> Array:
        """Return depth and derivatives (6,) of a contact, in the axes of the rows of `frame`."""
        out = np.zeros(6)
        steps = np.array([self._method.step, self._method.step / view.half])
        self.evaluations += grid_depths(
            self._tool, self._others, _seen(frame, place, own),
            np.array([_seen(frame, place, other) for other in self._frames]),
            view, steps, self._buffers, out,
        )  # fmt: skip
        return out


def _window(contact: LowContact, frame: Array) -> tuple[Array, float]:
    """Return the middle [m] and half the side [m] of the square that a contact's points fill."""
    across = (contact.points - contact.place) @ frame[:2].T
    low, high = across.min(axis=0), across.max(axis=0)
    return contact.place + 0.5 * (low + high) @ frame[:2], 0.5 * float((high - low).max())


def _seen(frame: Array, place: Array, own: Array) -> Array:
    """Return a frame (3, 4) of the world in that of a contact at a place."""
    return np.column_stack([frame @ own[:, :3], frame @ (own[:, 3] - place)])


@dataclass(frozen=True)
class PublishedMethod(Method):
    """Directional penetration depth on a grid, and its central differences.

    Parameters
    ----------
    cells : int
        Samples along a side of the grid, 4 to 1000.
    border : float
        How far the grid reaches beyond the outermost points of a low-resolution contact [m].
    step : float
        Step of the central differences [m]. Rotations move the rim of the grid as far.
    cluster : float
        Radius within which low-resolution contacts count as one [m].
    """

    name: str = "otaduy-lin-2004"
    label: str = "Otaduy & Lin, as published"
    source: str = "Otaduy & Lin 2004; Otaduy, Jain, Sud & Lin 2004"
    what_it_is_not: str = (
        "On a processor, with MuJoCo's contacts of convex pieces; grid, window and steps are "
        "asperity's, since the report that has the authors' could not be read."
    )
    cells: int = 50
    border: float = 2e-3
    step: float = 2e-5
    cluster: float = 1e-2

    def __post_init__(self) -> None:
        require_between("cells", self.cells, 4, 1000)
        for name in ("border", "step", "cluster"):
            require_positive(name, getattr(self, name), "m")

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        for body in scene.bodies:
            if any(geom.surface is not None for geom in body.geoms):
                return f"made for one texture on a body, and geoms of {body.name} have their own"
        return None

    def renderer(self, scene: Scene, dt: float) -> PublishedRenderer:
        """Return a renderer of a scene."""
        return PublishedRenderer(scene, self)


PUBLISHED = PublishedMethod()
