"""Textured bodies as sheets of really displaced points: what the brute-force reference samples.

A face of a geom is described by a *chart*: a rectangle of two parameters and a function from them
to base points and unit normals. Rims lie on the borders of charts, so they are met exactly. A
chart, placed in space and seen along n, is a *sheet*: each of its points is moved along its base
normal, `p = base + t w`. Facets that stand steeper than `STEEPEST` to n take no part, and neither
do facets that another geom of the same body covers.

Where the heights are looked up is written here a second time, apart from the engine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Geom, covers, origin_of_map

STEEPEST = 0.2
"""Facets with |w.n| below this belong to another patch."""

_FAR = 100.0
"""Half side of an unbounded plane [m]."""

Array = NDArray[np.float64]
BaseFunction = Callable[[Array, Array], tuple[Array, Array]]


class Chart(NamedTuple):
    """A face in its own parameters: `base(p, q)` gives points [m] and normals, in geom's frame."""

    base: BaseFunction
    low: tuple[float, float]
    high: tuple[float, float]
    side: bool = False


def _stack(*parts: Array) -> Array:
    return np.stack(np.broadcast_arrays(*parts), axis=-1).astype(np.float64)


def _flat(axis: int, sign: float, height: float, half: tuple[float, float]) -> Chart:
    """Return a rectangle perpendicular to `axis` of the geom's frame."""

    def base(p: Array, q: Array) -> tuple[Array, Array]:
        points = np.roll(_stack(p, q, np.full_like(p, sign * height)), axis + 1, axis=-1)
        return points, np.broadcast_to(sign * np.eye(3)[axis], points.shape)

    return Chart(base, (-half[0], -half[1]), half)


def _discs(radius: float, height: float) -> Iterator[Chart]:
    """Yield the quarters of a cylinder's cap in polar parameters, so that its rim is a border."""

    def base(p: Array, q: Array) -> tuple[Array, Array]:
        points = _stack(p * np.cos(q), p * np.sin(q), np.full_like(p, height))
        return points, np.broadcast_to([0.0, 0.0, math.copysign(1.0, height)], points.shape)

    for start in np.arange(-2, 2) * math.pi / 2:
        yield Chart(base, (0.0, start), (radius, start + math.pi / 2))


def _sides(radius: float, half_length: float) -> Iterator[Chart]:
    """Yield the halves of a cylinder's side in (angle, z)."""

    def base(p: Array, q: Array) -> tuple[Array, Array]:
        normals = _stack(np.cos(p), np.sin(p), 0.0 * q)
        return _stack(radius * np.cos(p), radius * np.sin(p), q), normals

    for start in (-math.pi, 0.0):
        yield Chart(base, (start, -half_length), (start + math.pi, half_length), side=True)


def _ends(radius: float, height: float) -> Iterator[Chart]:
    """Yield the quarters of a capsule's end in (latitude, angle)."""
    up = math.copysign(1.0, height)

    def base(p: Array, q: Array) -> tuple[Array, Array]:
        normals = _stack(np.cos(p) * np.cos(q), np.cos(p) * np.sin(q), up * np.sin(p))
        return radius * normals + [0.0, 0.0, height], normals

    for start in np.arange(-2, 2) * math.pi / 2:
        yield Chart(base, (0.0, start), (math.pi / 2, start + math.pi / 2))


def _ellipsoid(axes: Array, toward: Array) -> Chart:
    """Return the visible side of an ellipsoid: the unit sphere seen from above, stretched.

    With q = a e1 + b e2 + c e0 on the unit sphere and e0 along toward / axes, the shadow of
    `axes * q` along `toward` is linear in (a, b).
    """
    middle = toward / axes
    frame = frame_along(middle / np.linalg.norm(middle))

    def base(p: Array, q: Array) -> tuple[Array, Array]:
        inside = 1.0 - p * p - q * q
        third = np.sqrt(np.where(inside >= 0.0, inside, np.nan))
        unit = _stack(p, q, third) @ frame
        normals = unit / axes
        return axes * unit, normals / np.linalg.norm(normals, axis=-1, keepdims=True)

    return Chart(base, (-1.0, -1.0), (1.0, 1.0))


def _charts(geom: Geom, toward: Array) -> Iterator[Chart]:
    """Yield the charts of `geom` that may face `toward`, a unit vector in its frame."""
    size = np.asarray(geom.size, dtype=np.float64)
    if geom.kind == "plane":
        yield _flat(2, 1.0, 0.0, (size[0] or _FAR, size[1] or _FAR))
    elif geom.kind == "box":
        for axis in range(3):
            half = (size[(axis + 1) % 3], size[(axis + 2) % 3])
            yield _flat(axis, math.copysign(1.0, toward[axis]), size[axis], half)
    elif geom.kind in ("sphere", "ellipsoid"):
        yield _ellipsoid(size if geom.kind == "ellipsoid" else np.full(3, size[0]), toward)
    elif geom.kind in ("cylinder", "capsule"):
        yield from _sides(size[0], size[1])
        end = math.copysign(size[1], toward[2])
        yield from (_discs if geom.kind == "cylinder" else _ends)(size[0], end)
    else:
        raise AsperityError(f"no reference for geoms of kind {geom.kind!r}")


def _texture(body: Body, geom: Geom, chart: Chart, local: Array, base: Array, w: Array) -> Array:
    """Return the heights t [m] at base points, given in the geom's and in the body's frame."""
    field, mapping = body.texture, body.mapping
    if field is None or (mapping == "cylindrical" and not chart.side):
        return np.zeros(base.shape[:-1])
    if mapping == "cylindrical":
        du, dv = -origin_of_map(body)
        angle = np.arctan2(local[..., 1], local[..., 0])
        # A map that wraps is stretched to go round a whole number of times.
        round_it = 2.0 * np.pi * geom.size[0] / field.size[0]
        stretch = max(round(round_it), 1) / round_it if field.border == "wrap" else 1.0
        return field.heights(geom.size[0] * angle * stretch + du, local[..., 2] + dv)
    return flat_heights(body, base, w)


def flat_heights(body: Body, base: Array, w: Array) -> Array:
    """Return the heights t [m] of planar and triplanar maps at base points of normal w."""
    assert body.texture is not None
    heights = body.texture.heights
    du, dv = -origin_of_map(body)
    x, y, z = np.moveaxis(base, -1, 0)
    if body.mapping == "planar":
        return heights(x + du, y + dv)
    share = w**4 / np.sum(w**4, axis=-1, keepdims=True)
    maps = [heights(a + du, b + dv) for a, b in ((y, z), (z, x), (x, y))]
    return np.sum(share * np.stack(maps, axis=-1), axis=-1)


def matrix(quaternion: ArrayLike) -> Array:
    """Return the rotation matrix of a quaternion wxyz."""
    return Rotation.from_quat(np.roll(np.asarray(quaternion, dtype=np.float64), -1)).as_matrix()


def frame_along(n: Array) -> Array:
    """Return the rows u, v, n of a right-handed frame."""
    u = np.cross(np.eye(3)[np.argmin(np.abs(n))], n)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(n, u), n])


@dataclass(frozen=True, eq=False)
class Sheet:
    """A chart placed in {u, v, n}; its third coordinate is the *rise*, n for B and -n for A."""

    body: Body
    geom: Geom
    chart: Chart
    rotation: Array
    shift: Array
    sense: float

    @property
    def ends(self) -> Array:
        """(2, 2) array: lowest and highest values of the two parameters."""
        return np.array([self.chart.low, self.chart.high])

    @property
    def unbounded(self) -> bool:
        """Whether this is a plane without borders."""
        return self.geom.kind == "plane" and 0.0 in self.geom.size[:2]

    def at(self, p: Array, q: Array, displaced: bool = True) -> Array:
        """Return (..., 3) places [m]: u, v, rise; NaN where the facet takes no part."""
        local, normals = self.chart.base(*np.broadcast_arrays(p, q))
        turn = matrix(self.geom.quaternion)
        base, w = local @ turn.T + np.asarray(self.geom.position), normals @ turn.T
        shown = self.sense * (w @ self.rotation[2]) >= STEEPEST
        for other in self.body.geoms:
            if other is not self.geom:
                # Where geoms of one body meet or overlap, what lies within is no surface of it.
                shown &= ~covers(other, base + 1e-9 * w)
        local, base, w = (np.where(shown[..., None], part, 0.0) for part in (local, base, w))
        if displaced:
            safe = np.where(shown[..., None], w, 1.0)
            t = _texture(self.body, self.geom, self.chart, local, base, safe)
            base = base + t[..., None] * w
        places = base @ self.rotation.T + self.shift
        places[..., 2] *= self.sense
        places[~shown] = np.nan
        return places


def sheets(body: Body, pose: Array, frame: Array, origin: Array, sense: float) -> list[Sheet]:
    """Return the sheets of `body` that face n (`sense` 1) or -n (`sense` -1)."""
    rotation, shift = frame @ matrix(pose[3:]), frame @ (pose[:3] - origin)
    found = []
    for geom in body.geoms:
        toward = sense * (rotation @ matrix(geom.quaternion))[2]
        found += [Sheet(body, geom, c, rotation, shift, sense) for c in _charts(geom, toward)]
    return found
