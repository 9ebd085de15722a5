r"""Voxmap and pointshell: points of the tool's surface against a body's voxels.

McNeely, Puterbaugh & Troy, *Six degree-of-freedom haptic rendering using voxel sampling* (1999).
The stationary body is a *voxmap*: each voxel is free, on the surface, or in a numbered layer below
it. The tool is a *pointshell*: points of its surface with their normals. For a point p with the
tool's outward normal m, in a voxel of layer l (0 on the surface) with centre c, the *tangent plane*
contains c and is perpendicular to m, and

    d = (p - c) . m + l s,    F = - K d m   where d > 0,    T = (p - centre of mass) x F,

where s is the side of a voxel and K the scene's stiffness. Forces are summed over points; for more
than ten points the sum is scaled by 10 / N, so that stiffness grows with N up to ten.

Quoted from memory and from later work; the paper itself was not available. Differences, asperity's
own: the term `l s`, because the paper's tool never gets below the surface layer (its virtual
coupling and braking before contact prevent it), whereas poses compared here are as deep as the
scene's stiffness allows; layers by Euclidean distance; shell points on the surface, one in
each voxel that it meets, instead of at the centres of those voxels.

*Full detail*: shell and voxmap of the displaced surfaces, with voxels as small as the budgets of
memory and points allow. *Low detail*: of the smooth surfaces, coarser.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from asperity._core.kernels import kernel
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body
from asperity.scene.scene import Scene
from asperity.studies.baselines.displaced_surfaces import (
    DisplacedSurface,
    bounding_ball,
    displaced_surface,
    finite_reason,
    is_unbounded,
    spacing_for,
)
from asperity.studies.baselines.placement import Standing, place_bodies
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer

Array = NDArray[np.float64]
SUMMED = 10
"""Number of points above which the summed force is scaled down to that of so many."""
_PER_WAVE, _PER_RELIEF = 8.0, 3.0
"""Sufficient number of voxels per shortest wave of a texture, and per its relief."""
_PLAIN = 1e-4
"""Sufficient side of a voxel for bodies without texture [m]."""
_SOURCE = "McNeely, Puterbaugh & Troy 1999"
_EDGE = 2
"""Free voxels around a body."""


class Voxmap(NamedTuple):
    """A stationary body as voxels in its own frame."""

    codes: NDArray[np.uint8]
    """0 free, 1 on the surface, 1 + l in layer l below it, (x, y, z). Empty for an unbounded
    plane, which is z = 0 of its frame and needs no voxels."""
    corner: NDArray[np.float64]
    """Low corner of the first voxel [m], (3,)."""
    size: float
    """Side of a voxel [m]."""


class Pointshell(NamedTuple):
    """Points of the tool's surface in its own frame."""

    points: NDArray[np.float64]
    """[m], (n, 3)."""
    normals: NDArray[np.float64]
    """Outward, unit, (n, 3)."""


class ShellWrench(NamedTuple):
    """Sums over the points of a shell that touch, per unit of stiffness."""

    force: NDArray[np.float64]
    """In the frame of the voxels [m], (3,)."""
    torque: NDArray[np.float64]
    """About the tool's centre of mass, in the frame of the voxels [m^2], (3,)."""


def build_voxmap(body: Body, size: float, *, smooth: bool = False) -> Voxmap:
    """Return a body as voxels of side `size` [m].

    Raises
    ------
    AsperityError
        If the surface encloses no inside at this size.
    """
    if is_unbounded(body):
        return Voxmap(np.zeros((0, 0, 0), np.uint8), np.zeros(3), size)
    surface = displaced_surface(body, size, smooth=smooth)
    # An odd fraction of a voxel, so that flat faces do not lie between two layers.
    corner = surface.points.min(axis=0) - (_EDGE + 0.37) * size
    shape = ((surface.points.max(axis=0) - corner) / size).astype(np.int64) + 2 + _EDGE
    shell = np.zeros(shape, bool)
    mark_triangles(surface.points, surface.faces, corner, size, shell)
    free, _ = ndimage.label(~shell)
    inside = ~shell & (free != free[0, 0, 0])
    if not inside.any():
        raise AsperityError(
            f"body {body.name!r} encloses no voxel of {1e3 * size:.3g} mm: its surface is open, or "
            "thinner than that"
        )
    codes = shell.astype(np.uint8)
    layers = ndimage.distance_transform_edt(inside)[inside]
    codes[inside] = np.minimum(1.0 + np.floor(layers + 0.5), 255.0)
    return Voxmap(codes, corner, size)


def build_pointshell(surface: DisplacedSurface, size: float) -> Pointshell:
    """Return one point of a surface for each voxel of side `size` [m] that it meets."""
    cell = np.floor(surface.points / size)
    away = np.linalg.norm(surface.points - (cell + 0.5) * size, axis=1)
    order = np.lexsort((away, *cell.T))
    first = np.ones(len(order), bool)
    first[1:] = (cell[order][1:] != cell[order][:-1]).any(axis=1)
    chosen = order[first]
    return Pointshell(surface.points[chosen], surface.normals[chosen])


@kernel
def shell_forces(shell, voxmap, rotation, translation, centre, out):
    """Fill the wrench of a shell in a voxmap; return its largest depth [m] and number of contacts.

    Parameters
    ----------
    shell : Pointshell
    voxmap : Voxmap
    rotation, translation : (3, 3), (3,) arrays
        From the tool's frame into that of the voxels.
    centre : (3,) array
        The tool's centre of mass in its frame [m].
    out : ShellWrench
    """
    points, normals, codes, corner, size = (
        shell.points, shell.normals, voxmap.codes, voxmap.corner, voxmap.size
    )  # fmt: skip
    deepest, contacts = 0.0, 0
    out.force[:] = 0.0
    out.torque[:] = 0.0
    middle = np.empty(3)
    for i in range(3):
        middle[i] = translation[i]
        for j in range(3):
            middle[i] += rotation[i, j] * centre[j]
    flat = codes.size == 0
    wide, deep, high = codes.shape
    for n in range(points.shape[0]):
        a, b, c = points[n, 0], points[n, 1], points[n, 2]
        z = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c + translation[2]
        iz = math.floor((z - corner[2]) / size)
        if flat:
            # Surface voxels are those just below z = 0.
            if iz >= 0:
                continue
            layer = -1.0 - iz
        elif iz < 0 or iz >= high:
            continue
        x = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c + translation[0]
        ix = math.floor((x - corner[0]) / size)
        y = rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c + translation[1]
        iy = math.floor((y - corner[1]) / size)
        if not flat:
            if ix < 0 or ix >= wide or iy < 0 or iy >= deep:
                continue
            code = codes[ix, iy, iz]
            if code == 0:
                continue
            layer = code - 1.0
        a, b, c = normals[n, 0], normals[n, 1], normals[n, 2]
        mx = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c
        my = rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c
        mz = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c
        # The tangent plane contains the voxel's centre and is normal to the point's normal.
        d = layer * size
        d += mx * (x - corner[0] - (ix + 0.5) * size)
        d += my * (y - corner[1] - (iy + 0.5) * size)
        d += mz * (z - corner[2] - (iz + 0.5) * size)
        if d <= 0.0:
            continue
        fx, fy, fz = -d * mx, -d * my, -d * mz
        out.force[0] += fx
        out.force[1] += fy
        out.force[2] += fz
        rx, ry, rz = x - middle[0], y - middle[1], z - middle[2]
        out.torque[0] += ry * fz - rz * fy
        out.torque[1] += rz * fx - rx * fz
        out.torque[2] += rx * fy - ry * fx
        deepest = max(deepest, d)
        contacts += 1
    return deepest, contacts


@dataclass(eq=False)
class VoxmapRenderer(Renderer):
    """Renders a pointshell against voxmaps."""

    shell: Pointshell
    maps: list[tuple[Voxmap, Standing]]
    centre: Array
    """The tool's centre of mass in its frame [m], (3,)."""
    stiffness: float
    """K of one point [N/m]."""
    touching: list[int] = field(default_factory=list, init=False)
    """Number of points that touched each body at the last pose."""

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        sums = ShellWrench(np.zeros(3), np.zeros(3))
        force, torque, deepest = np.zeros(3), np.zeros(3), 0.0
        self.touching = []
        for grid, there in self.maps:
            depth, contacts = shell_forces(
                self.shell, grid, *there.relative(pose), self.centre, sums
            )
            force += there.rotation @ sums.force
            torque += there.rotation @ sums.torque
            deepest = max(deepest, float(depth))
            self.touching.append(int(contacts))
        touching = sum(self.touching)
        if touching == 0:
            return NOTHING
        scale = self.stiffness * min(1.0, SUMMED / touching)
        return MethodWrench(scale * force, scale * torque, deepest, touching)


@dataclass(frozen=True)
class VoxmapMethod(Method):
    """Voxmap and pointshell, of displaced or of smooth surfaces.

    Parameters
    ----------
    smooth : bool
        Leave textures out.
    voxels : int
        Approximate largest number of voxels of all bodies together.
    points : int
        Approximate largest number of points of the shell.
    size : float, optional
        Side of a voxel [m], regardless of the budgets.
    """

    smooth: bool
    voxels: int
    points: int
    size: float | None = None

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        return None if self.smooth else finite_reason(*scene.bodies)

    def renderer(self, scene: Scene, dt: float) -> VoxmapRenderer:
        """Return a renderer of a scene; takes some seconds at full detail."""
        bodies = place_bodies(scene)
        size = self.voxel_size(scene)
        maps = [
            (build_voxmap(there.body, size, smooth=self.smooth), there) for there in bodies.standing
        ]
        pitch = max(size, spacing_for(bodies.tool, self.points))
        surface = displaced_surface(bodies.tool, 0.5 * pitch, smooth=self.smooth)
        shell = build_pointshell(surface, pitch)
        return VoxmapRenderer(shell, maps, bodies.centre, scene.force.stiffness)

    def voxel_size(self, scene: Scene) -> float:
        """Return the side of a voxel [m]: as fine as the textures need, or as the budget allows."""
        if self.size is not None:
            return self.size
        bodies = place_bodies(scene)
        bounded = [there.body for there in bodies.standing if not is_unbounded(there.body)]
        room = sum(map(_box_volume, bounded))
        fits = (room / self.voxels) ** (1.0 / 3.0)
        if self.smooth:
            return fits
        fine = _PLAIN
        for body in scene.bodies:
            if body.texture is not None and body.texture.relief > 0.0:
                waves = body.texture.shortest_wavelength / _PER_WAVE
                fine = min(fine, waves, body.texture.relief / _PER_RELIEF)
        return max(fits, fine)


def _box_volume(body: Body) -> float:
    """Return the volume of a box around a body [m^3]."""
    _, radius = bounding_ball(body)
    points = displaced_surface(body, 0.05 * radius, smooth=True).points
    return float(np.prod(np.ptp(points, axis=0)))


FULL = VoxmapMethod(
    "voxmap-full",
    "voxmap, full detail",
    _SOURCE,
    "Without the paper's virtual coupling and braking before contact, and pressed deeper than its "
    "authors let a tool get; the formula is recalled, not read in the source. Surface voxels "
    "are those that contain samples half a voxel apart: another meshing changes a few of them.",
    smooth=False,
    voxels=8_000_000,
    points=300_000,
)
LOW = VoxmapMethod(
    "voxmap-low",
    "voxmap, low detail",
    _SOURCE,
    "As at full detail, of surfaces without their textures: what was affordable in 1999.",
    smooth=True,
    voxels=200_000,
    points=5_000,
)


@kernel
def mark_triangles(points, faces, corner, size, marked_out):
    """Mark the voxels in which a triangle has a sample; samples are at most half a voxel apart.

    Parameters
    ----------
    points, faces : (n, 3), (m, 3) arrays
        Corners [m], and the three of each triangle.
    corner : (3,) array
        Low corner of the first voxel [m].
    size : float
        Side of a voxel [m].
    marked_out : (x, y, z) array of bool
        Marked voxels are set; the others are left as they are.
    """
    for n in range(faces.shape[0]):
        a, b, c = faces[n, 0], faces[n, 1], faces[n, 2]
        longest = 0.0
        for p, q in ((a, b), (b, c), (c, a)):
            side = 0.0
            for i in range(3):
                side += (points[q, i] - points[p, i]) ** 2
            longest = max(longest, side)
        parts = max(math.ceil(2.0 * math.sqrt(longest) / size), 1)
        for i in range(parts + 1):
            for j in range(parts + 1 - i):
                u, v = i / parts, j / parts
                w = 1.0 - u - v
                x = w * points[a, 0] + u * points[b, 0] + v * points[c, 0] - corner[0]
                y = w * points[a, 1] + u * points[b, 1] + v * points[c, 1] - corner[1]
                z = w * points[a, 2] + u * points[b, 2] + v * points[c, 2] - corner[2]
                marked_out[int(x / size), int(y / size), int(z / size)] = True
