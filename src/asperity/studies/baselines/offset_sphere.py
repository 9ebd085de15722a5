r"""A sphere on the offset surface of the body that it touches.

Okamura & Cutkosky, *Feature detection for haptic exploration with robotic fingers* (2001). The
centre of a spherical fingertip of radius r that slides over a surface h traces its offset surface:
in one dimension the points

    ( x - r h' / s ,  h + r / s ),   s = sqrt(1 + h'^2),

without the loops of this curve where h is more sharply curved than the sphere. The rest is the
upper envelope `r + H(u) = max_x [h(x) + sqrt(r^2 - |x - u|^2)]`, which is computed here with
certified accuracy (`geometry.offsets.sphere_search`). The sphere is rendered as a *point*, its
centre c, against that surface: with the depth delta = H(u) + r - c_z below it,

    n = (-H_u, -H_v, 1) / sqrt(1 + |grad H|^2),    d = delta n_z,    F = k d n ,

d being the distance to the tangent plane of the offset surface. The force acts through the centre
and so through the place of contact. It has the direction of asperity's force,
`F = k delta (-grad H, 1)`, the gradient of an energy of the same depth, but is smaller by
1 + |grad H|^2; on slopes it is not the gradient of an energy.

Quoted from memory and from other work. The paper finds features by comparing the curvature of the
trace with that of the fingertip; Otaduy & Lin name it as a rendering method.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.bodies import Body, Geom, origin_of_map
from asperity.geometry.offsets import sphere_search
from asperity.geometry.offsets.sampled import CERTIFIED_TO
from asperity.scene.scene import Scene
from asperity.studies.baselines.placement import (
    Standing,
    centre_at,
    is_level,
    only_one_target,
    place_bodies,
    tool_and_others,
    top_of,
)
from asperity.studies.baselines.protocol import NOTHING, Method, MethodWrench, Renderer
from asperity.texture.bounds import Pyramid, pyramid_of
from asperity.texture.spline import spline_coefficients

Array = NDArray[np.float64]


class OffsetSurface:
    """The offset surface of a texture, for one sphere.

    Parameters
    ----------
    body : Body
        With a planar texture of square pixels, or none.
    radius : float
        Radius of the sphere [m].
    """

    def __init__(self, body: Body, radius: float) -> None:
        self.radius, self._field = radius, body.texture
        if self._field is None:
            return
        self._pixel = self._field.pixel_size[0]
        self._origin = origin_of_map(body)[:2]
        self._margin = int(radius / self._pixel) + 2
        border = "wrap" if self._field.border == "wrap" else "mirror"
        samples = np.asarray(self._field.samples)
        if border == "wrap":
            # The search needs a period at least as wide as the sphere.
            needed = [-(-2 * self._margin // n) for n in samples.shape]
            samples = np.tile(samples, needed)
        self._shape = samples.shape
        self._coefficients = spline_coefficients(samples, border, self._margin) / self._pixel
        self._pyramid: Pyramid = pyramid_of(self._coefficients)
        self._stack = np.empty(sphere_search.STACK_SIZE, sphere_search.NODE)
        self.reset()

    def reset(self) -> None:
        """Forget where the sphere last touched."""
        self._shift = np.zeros(2)

    def at(self, x: float, y: float) -> tuple[float, float, float]:
        """Return H [m] and its two slopes above a place of the body [m]."""
        if self._field is None:
            return 0.0, 0.0, 0.0
        u, v = (np.array([x, y]) - self._origin) / self._pixel
        rows, columns = self._shape
        if self._field.border == "wrap":
            u, v = u % columns, v % rows
        else:
            u, v = min(max(u, 0.0), float(columns)), min(max(v, 0.0), float(rows))
        # Samples are at the centres of pixels, as in `geometry.offsets.sampled`.
        u, v = u + 0.5 + self._margin, v + 0.5 + self._margin
        r = self.radius / self._pixel
        height, px, py = sphere_search.search(
            self._coefficients, self._pyramid, sphere_search.Sphere(u, v, r),
            CERTIFIED_TO / self._pixel, (u + self._shift[0], v + self._shift[1]), self._stack,
        )  # fmt: skip
        self._shift[:] = px - u, py - v
        root = math.sqrt(max(r * r - float(self._shift @ self._shift), 1e-12 * r * r))
        # The envelope theorem: the slope is that of the sphere at the place of contact.
        return height * self._pixel, float(self._shift[0] / root), float(self._shift[1] / root)


class OffsetRenderer(Renderer):
    """A sphere of the tool over the tops of one body."""

    def __init__(self, sphere: Geom, there: Standing, centre: Array, stiffness: float) -> None:
        self.surface = OffsetSurface(there.body, float(sphere.size[0]))
        self._sphere, self._there = np.asarray(sphere.position), there
        self._centre, self._stiffness = centre, stiffness

    def reset(self) -> None:
        """Forget all poses so far."""
        if self._there.body.texture is not None:
            self.surface.reset()

    def wrench(self, pose: Array) -> MethodWrench:
        """Return the wrench at the tool's next pose (7,)."""
        middle = centre_at(pose, self._sphere)
        x, y, z = self._there.rotation.T @ (middle - self._there.position)
        top = _top_under(self._there.body, x, y)
        if top is None:
            return NOTHING
        height, along, across = self.surface.at(x, y)
        depth = top + height + self.surface.radius - z
        # From below, a body's inside has no end here: what is deeper than the sphere is missed.
        if not 0.0 < depth < 2.0 * self.surface.radius + abs(height):
            return NOTHING
        normal = np.array([-along, -across, 1.0]) / math.sqrt(1.0 + along**2 + across**2)
        force = self._there.rotation @ (self._stiffness * depth * normal[2] * normal)
        arm = middle - centre_at(pose, self._centre)
        return MethodWrench(force, np.cross(arm, force), float(depth), 1)


def _top_under(body: Body, x: float, y: float) -> float | None:
    """Return the height of the highest top face over a place of the body [m], or None."""
    under = [
        geom
        for geom in body.geoms
        # Of a plane, size 0 is unbounded.
        if abs(x - geom.position[0]) <= (geom.size[0] or math.inf)
        and abs(y - geom.position[1]) <= (geom.size[1] or math.inf)
    ]
    return max(map(top_of, under), default=None)


def _sphere_of(body: Body) -> Geom | None:
    """Return the lowest sphere of the tool, or None."""
    spheres = [geom for geom in body.geoms if geom.kind == "sphere"]
    return min(spheres, key=lambda geom: geom.position[2] - geom.size[0], default=None)


@dataclass(frozen=True)
class OffsetMethod(Method):
    """A sphere as a point on the offset surface."""

    name: str = "offset-sphere"
    label: str = "offset surface"
    source: str = "Okamura & Cutkosky 2001"
    what_it_is_not: str = (
        "Their paper finds features with it and does not render. Only the tool's lowest sphere "
        "is felt, on the tops of boxes and planes; no edges, no friction."
    )

    def can(self, scene: Scene) -> str | None:
        """Return why the method cannot render a scene, or None."""
        reason = only_one_target(scene)
        if reason is not None:
            return reason
        tool, (target,) = tool_and_others(scene)
        sphere = _sphere_of(tool)
        if sphere is None or tool.texture is not None:
            return f"made for a smooth sphere, and {tool.name} is none"
        if not is_level(target):
            return f"made for the tops of level boxes, and {target.name} is none"
        field = target.texture
        if field is None:
            return None
        if (
            target.mapping == "cylindrical"
            or abs(field.pixel_size[0] / field.pixel_size[1] - 1) > 1e-9
        ):
            return f"made for a flat map of square pixels, and that of {target.name} is none"
        if field.border != "wrap" and 2.0 * sphere.size[0] > min(field.size):
            return f"the map of {target.name} is smaller than the sphere"
        return None

    def renderer(self, scene: Scene, dt: float) -> OffsetRenderer:
        """Return a renderer of a scene."""
        bodies = place_bodies(scene)
        sphere = _sphere_of(bodies.tool)
        assert sphere is not None
        return OffsetRenderer(sphere, bodies.standing[0], bodies.centre, scene.force.stiffness)


OFFSET_SPHERE = OffsetMethod()
