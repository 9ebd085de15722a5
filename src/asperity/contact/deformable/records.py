"""Arguments of the kernels of deformable surfaces: the surface at rest, its state, the motion."""

from __future__ import annotations

from typing import NamedTuple

from asperity._core.arrays import Array, Indices
from asperity._core.structures import by_reference
from asperity.contact.soft.press import TaxelArrays


@by_reference
class SurfaceArrays(NamedTuple):
    """A surface at rest: `m` triangles, `v` vertices, `g` shared normals, `n` taxels."""

    faces: Indices
    """Vertices of each triangle, (m, 3)."""
    shared: Indices
    """Number of the normal at each corner, (m, 3)."""
    members: Indices
    """Corners, 3 * triangle + 0, 1 or 2, in the order of their normals, (3 m,)."""
    first_member: Indices
    """First member of each normal, (g + 1,)."""
    tilt: Array
    """Coefficients a, b [1/m] and c [-] of each corner's normal, (m, 3, 3)."""
    area: Array
    """Of each triangle [m^2], (m,)."""
    highest: Array
    """Largest distance of a ray's ends from the smooth triangle [m], (m,)."""
    first: Indices
    """First taxel of each triangle, (m + 1,)."""
    weight: Array
    """Barycentric coordinates of the taxels, (n, 3)."""
    height: Array
    """Of the texture at the taxels [m], (n,)."""


@by_reference
class SurfaceState(NamedTuple):
    """State of a surface at one configuration of its vertices."""

    taxels: TaxelArrays
    """Points and rays, world axes; valid for triangles near a body."""
    normal: Array
    """Of each triangle, (m, 3)."""
    hat: Array
    """Gradients of the barycentric coordinates [1/m], (m, 3, 3)."""
    known: Indices
    """Tick at which a triangle was last computed, (m,)."""
    blend: Array
    """The shared normals, (g, 3)."""
    length: Array
    """Of their sums before normalisation, (g,)."""
    blended: Indices
    """Tick at which a shared normal was last computed, (g,)."""
    pull: Array
    """-dU by the shared normals [N m], (g, 3)."""
    used: Indices
    """Numbers of the computed normals; the last entry is their count, (g + 1,)."""
    pressed: Indices
    """Numbers of the triangles with a taxel in contact; the last entry is their count, (m + 1,)."""
    stiffness: Array
    """Minus the derivative of the forces on the vertices of each triangle of `pressed` by their
    positions [N/m], (m, 9, 9); without changes of the normals, of N, and of friction."""
    growing: Array
    """The same of friction, through the pressure [N/m], (m, 9, 9)."""
    damping: Array
    """Friction over the slip velocities (secant) [N s/m], (m, 9, 9)."""
    slipping: Array
    """Secant minus tangent of friction over the slip velocities [N s/m], (m, 9, 9)."""
    force: Array
    """On each vertex: -dU/dx and friction [N], (v, 3)."""
    wrench: Array
    """On each body: force [N], torque about its centre [N m], (bodies, 6)."""
    tick: Indices
    """Number of the tick, and of a collapsed triangle, or -1; (2,)."""


class SurfaceMotion(NamedTuple):
    """Positions and velocities of vertices and bodies, world axes."""

    vertices: Array
    """[m], (v, 3)"""
    velocities: Array
    """[m/s], (v, 3)"""
    centres: Array
    """Points of the bodies [m], (bodies, 3)."""
    twists: Array
    """Velocities of these points [m/s] and angular velocities [rad/s], (bodies, 6)."""
