"""Displaced surfaces of a scene as meshes for the page, coloured by height.

All bodies together stay within a budget of triangles. Surfaces are sampled evenly, as finely as the
budget allows; meshes only near the first contact. Rows and columns of a grid that lie on straight
lines between others are omitted first, so ridges are drawn much finer than dots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from asperity.drawing.renderer.parts import Part, scene_parts
from asperity.geometry.displaced.sheet import Sheet, facing_outwards, grid_triangles
from asperity.geometry.displaced.view import ViewBall
from asperity.geometry.poses import rotation_of
from asperity.scene.scene import Scene
from asperity.viewer.drawables.atlas import Atlas
from asperity.viewer.drawables.ground import is_ground, is_plane
from asperity.viewer.drawables.materials import Paint, SurfaceLook, by_height, material_of

Array = NDArray[np.float64]
TRIANGLES = 50_000
"""Default budget of all bodies together."""
FEWEST, MOST = 1_000, 2_000_000
"""Smallest and largest budget."""
_STRAIGHT = 0.03
"""Points closer to a straight line than this times the relief are omitted."""
_FINEST = 2e-5
"""Smallest spacing of samples [m]."""
_WIDE = 2.5
"""Radius of the shown part of an unbounded plane, in radii of the rest of the scene."""
_ROUNDS, _MOST_ROUNDS = 6, 14
"""Rounds in which the budget should be met closely, and in which it must be met."""
_COARSER = 1.2
"""Factor by which the spacing grows in each round after the first `_ROUNDS`."""
_SPREAD, _NEAR = 6000, 3e-3
"""Random points on each mesh for `first_contact`; those this close to the nearest count [m]."""
_FINE = 0.028
"""Radius around the first contact in which meshes show their relief [m]."""
_ACROSS = 220
"""Samples across the detail near a contact."""
_LIFTED = 0.02
"""Height of that detail above the surface that it lies on, over the relief."""
_RIM = 0.2
"""Part of its radius over which the rim of that detail sinks into the coarse surface."""
_TOOL_COARSER = 1.6
"""Factor on the spacing of the tool, whose relief is mostly hidden."""


@dataclass(frozen=True, eq=False)
class Drawable:
    """A mesh to be shown.

    Attributes
    ----------
    name : str
    is_tool : bool
    vertices : (n, 3) array
        [m], in the frame of the tool or of the world.
    normals : (n, 3) array
        Unit length.
    colours : (n, 3) array
        sRGB, 0 to 1.
    faces : (m, 3) array
    lowest, highest : float
        Of the relief [m].
    places : (n, 2) array or None
        Texture coordinates in the image of the atlas.
    atlas : Atlas or None
        Replaces the colours where present.
    material : SurfaceLook or None
        What it is made of.
    """

    name: str
    is_tool: bool
    vertices: Array
    normals: Array
    colours: Array
    faces: NDArray[np.int64]
    lowest: float
    highest: float
    places: Array | None = None
    atlas: Atlas | None = None
    material: SurfaceLook | None = None


def shapes_of(scene: Scene, triangles: int = TRIANGLES) -> list[Drawable]:
    """Return the surfaces of a scene with at most `triangles` triangles.

    A budget that is too small for the undisplaced shapes is exceeded. A plane that is the ground
    (`ground.ground_height`) is left empty.
    """
    parts = scene_parts(scene, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
    centre, radius = _extent(scene, parts)
    contact = first_contact(scene)
    views = [_view(part, centre, radius, contact, scene.start) for part in parts]
    return shapes_of_parts(parts, views, radius, triangles, materials=True)


def shapes_of_parts(
    parts: Sequence[Part],
    views: Sequence[ViewBall],
    radius: float,
    triangles: int = TRIANGLES,
    *,
    materials: bool = False,
) -> list[Drawable]:
    """Return the surfaces of parts, as `shapes_of`.

    Parameters
    ----------
    parts : sequence of Part
    views : sequence of ViewBall
        Where each is drawn finely.
    radius : float
        Of all bounded parts together [m].
    triangles : int
    materials : bool
        Whether they look like what they are made of, and not by height.
    """
    spacing = radius / 100.0
    best: list[Drawable] = []
    fewest: list[Drawable] = []
    low, high, least = 0.0, np.inf, np.inf
    for tried in range(_MOST_ROUNDS):
        shapes = [
            _shape(part, view, spacing, i, materials)
            for i, (part, view) in enumerate(zip(parts, views, strict=True))
        ]
        count = sum(len(shape.faces) for shape in shapes)
        if count <= triangles:
            best, high = shapes, spacing
            if count > 0.85 * triangles or spacing <= _FINEST:
                break
        else:
            low = spacing
            if count == least and not best:
                break  # coarser they do not become
            if count < least:
                fewest, least = shapes, count
        if tried + 1 >= _ROUNDS and best:
            break
        wanted = spacing * np.sqrt(max(count, 1) / (0.95 * triangles))
        if low < high < np.inf:
            wanted = np.clip(wanted, low + 0.1 * (high - low), high - 0.1 * (high - low))
        elif tried + 1 >= _ROUNDS:
            wanted = max(wanted, _COARSER * spacing)
        spacing = float(max(wanted, _FINEST))
    return best or fewest


def _extent(scene: Scene, parts: list[Part]) -> tuple[Array, float]:
    """Return the middle (3,) and the radius of all bounded bodies, the tool at its start [m]."""
    boxes = []
    for part in parts:
        place = scene.start if part.is_tool else part.pose
        if part.body.mesh is not None:
            points = part.body.mesh.vertices
        else:
            solids = [geom for geom in part.body.geoms if geom.kind != "plane"]
            if not solids:
                continue
            points = np.concatenate(
                [np.asarray(g.position) + s * max(g.size) for g in solids for s in (-1.0, 1.0)]
            ).reshape(-1, 3)
        boxes.append(np.array([points.min(axis=0), points.max(axis=0)]) + place[:3])
    if not boxes:
        return np.zeros(3), 0.1
    corners = np.concatenate(boxes)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))


def first_contact(scene: Scene) -> Array:
    """Return approximately where the tool at its start is nearest to another mesh (3,) [m]."""
    meshes = {body.name: body.mesh for body in scene.bodies if body.mesh is not None}
    tool = meshes.pop(scene.tool, None)
    if tool is None or not meshes:
        return scene.start[:3]
    from scipy.spatial import cKDTree  # slow to import

    parts = {part.body.name: part.pose for part in scene_parts(scene, scene.start)}
    others = np.concatenate(
        [_spread(mesh.vertices[mesh.faces], parts[name]) for name, mesh in meshes.items()]
    )
    away, _ = cKDTree(_spread(tool.vertices[tool.faces], scene.start)).query(others)
    near = np.asarray(away) < np.min(away) + _NEAR
    return np.asarray(others[near].mean(axis=0))


def _spread(triangles: Array, pose: Array) -> Array:
    """Return random points (n, 3) on triangles (m, 3, 3), in the world [m]."""
    area = np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )
    draw = np.random.default_rng(0)
    chosen = draw.choice(len(triangles), _SPREAD, p=area / area.sum())
    weights = draw.dirichlet((1.0, 1.0, 1.0), _SPREAD)
    points = np.einsum("ij,ijk->ik", weights, triangles[chosen])
    return np.asarray(points @ rotation_of(pose[3:]).T + pose[:3])


def _view(part: Part, centre: Array, radius: float, contact: Array, start: Array) -> ViewBall:
    """Return the ball in which a part is drawn finely, in its frame if it is the tool."""
    if part.body.mesh is not None:
        if part.is_tool:
            contact = rotation_of(start[3:]).T @ (contact - start[:3])
        return ViewBall(contact, _FINE, 100)
    if part.is_tool:
        return ViewBall(np.zeros(3), 4.0 * radius, 100)
    return ViewBall(centre, (_WIDE if is_plane(part) else 2.0) * radius, 100)


def _shape(part: Part, view: ViewBall, spacing: float, number: int, materials: bool) -> Drawable:
    """Return the surface of a part, sampled every `spacing` [m]."""
    if part.is_tool:
        spacing *= _TOOL_COARSER
    if part.body.texture is None and part.body.mesh is None:
        spacing = max(spacing, _rounding(part))
    view = view._replace(samples=max(int(2.0 * view.radius / spacing), 4))
    surfaces, faces, count = [], [], 0
    hidden = materials and is_ground(part)
    made_of = material_of(part.colour) if materials else None
    paint = _paint(part, made_of)
    atlas, places = _atlas(part, paint), []
    for sheet in () if hidden else part.sheets(view):
        if atlas is not None and sheet.face is not None and sheet.weights is not None:
            places.append(atlas.places(sheet.face, sheet.weights).reshape(-1, 2))
        *surface, triangles = _thinned(sheet)
        surfaces.append(surface)
        faces.append(triangles + count)
        count += len(surface[0])
    if not count:
        empty = np.zeros((0, 3))
        return Drawable(
            f"{part.body.name}-{number}", part.is_tool, empty, empty, empty,
            np.zeros((0, 3), np.int64), 0.0, 0.0,
        )  # fmt: skip
    points, normals, height = (np.concatenate(parts) for parts in zip(*surfaces, strict=True))
    field = part.body.texture
    low, high = (field.lowest, field.highest) if field is not None else (0.0, 0.0)
    return Drawable(
        f"{part.body.name}-{number}", part.is_tool, points, normals,
        paint(points, height),
        facing_outwards(points, normals, _with_area(points, np.concatenate(faces))),
        low, high, np.concatenate(places) if places else None, atlas, made_of,
    )  # fmt: skip


def detail_of(
    scene: Scene, tool_pose: Array, contact: Array, radius: float, *, heights: bool
) -> list[Drawable]:
    """Return the textured surfaces near a contact, drawn finely; not that of an elastic body.

    Parameters
    ----------
    scene : Scene
    tool_pose : (7,) array
    contact : (3,) array
        In the world [m].
    radius : float
        Of the ball that is drawn [m].
    heights : bool
        Coloured by height; else by material.
    """
    out = []
    for i, part in enumerate(scene_parts(scene, np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))):
        is_bent = scene.elastic is not None and scene.elastic.body.name == part.body.name
        if not part.body.fields or is_bent:
            continue
        at = contact
        if part.is_tool:
            at = rotation_of(tool_pose[3:]).T @ (contact - tool_pose[:3])
        shape = _shape(part, ViewBall(at, radius, 2), 2.0 * radius / _ACROSS, i, not heights)
        near = np.linalg.norm(shape.vertices[shape.faces].mean(axis=1) - at, axis=1) < radius
        if near.any():
            used, faces = np.unique(shape.faces[near], return_inverse=True)
            out.append(
                replace(
                    shape, name=f"detail-{shape.name}",
                    vertices=_lifted(shape, used, at, radius),
                    normals=shape.normals[used], colours=shape.colours[used],
                    faces=faces.reshape(-1, 3), places=None, atlas=None,
                )
            )  # fmt: skip
    return out


def _lifted(shape: Drawable, used: NDArray[np.int64], at: Array, radius: float) -> Array:
    """Return the vertices of a detail round `at`: a little above the surface, so as to cover it.

    The page lowers a coarse surface under its detail by the relief. So towards its rim the detail
    sinks by as much, and ends in the coarse surface without a step.
    """
    relief = shape.highest - shape.lowest
    points, normals = shape.vertices[used], shape.normals[used]
    raised = _LIFTED * relief * normals
    if shape.is_tool:
        return points + raised
    rim = np.clip((np.linalg.norm(points - at, axis=1) / radius - 1.0 + _RIM) / _RIM, 0.0, 1.0)
    rim = (rim * rim * (3.0 - 2.0 * rim))[:, None]
    up = normals.mean(axis=0)
    return points + (1.0 - rim) * raised - 1.05 * rim * relief * up / np.linalg.norm(up)


def _paint(part: Part, material: SurfaceLook | None) -> Paint:
    """Return what colours a part: by height unless it has a material."""
    field = part.body.texture
    low, high = (field.lowest, field.highest) if field is not None else (0.0, 0.0)
    return by_height(low, high, part.colour) if material is None else material.paint(low, high)


def _atlas(part: Part, paint: Paint) -> Atlas | None:
    body = part.body
    if body.mesh is None or body.texture is None or body.texture.lowest == body.texture.highest:
        return None
    every = np.ones(len(body.mesh.faces), bool)
    return Atlas(body, every if part.faces is None else part.faces, paint)


def _rounding(part: Part) -> float:
    """Return the largest spacing for a smooth solid: a fifth of its smallest dimension [m]."""
    return min(geom.smallest if geom.kind != "plane" else 1.0 for geom in part.body.geoms) / 5.0


def _thinned(sheet: Sheet) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    """Return points, normals, heights and triangles of a sheet; grids without redundant rows."""
    points, normals, height = sheet.points, sheet.normals, sheet.height
    if height is None:
        height = np.full(points.shape[:2], np.nan)
    if sheet.corners is None:
        rows, columns = (_kept(sheet, axis) for axis in (0, 1))
        grid = np.ix_(rows, columns)
        points, normals, height = points[grid], normals[grid], height[grid]
        faces = grid_triangles(len(rows), len(columns))
    else:
        faces = sheet.triangles()
    return points.reshape(-1, 3), normals.reshape(-1, 3), height.reshape(-1), faces


def _kept(sheet: Sheet, axis: int) -> NDArray[np.int64]:
    """Return the rows (axis 0) or columns (axis 1) of a grid that represent it without loss."""
    points = np.moveaxis(sheet.points, axis, 0)
    # A few lines across suffice if they contain the coarsest relief.
    points = points[:, :: max(points.shape[1] // 64, 1)]
    relief = 0.0 if sheet.height is None else float(np.ptp(sheet.height))
    size = float(np.ptp(points.reshape(-1, 3), axis=0).max())
    slack = _STRAIGHT * relief if relief > 0.0 else 1e-3 * size
    count = len(points)
    bent = np.abs(points[1:-1] - 0.5 * (points[:-2] + points[2:])).max(axis=(1, 2)) > slack
    kept, at = [0], 0
    while at < count - 1:
        span = 1
        if at < len(bent) and bent[at]:  # as most are of a relief
            at += 1
            kept.append(at)
            continue
        while at + 2 * span < count and _is_straight(points[at : at + 2 * span + 1], slack):
            span *= 2
        step = span
        while step > 1:
            step //= 2
            if at + span + step < count and _is_straight(points[at : at + span + step + 1], slack):
                span += step
        at = min(at + span, count - 1)
        kept.append(at)
    return np.array(kept)


def _is_straight(points: Array, slack: float) -> bool:
    """Return whether the inner rows lie on straight lines between the first and the last."""
    share = np.linspace(0.0, 1.0, len(points))[:, None, None]
    off = points - ((1.0 - share) * points[0] + share * points[-1])
    return bool(np.abs(off).max() <= slack)


def _with_area(points: Array, faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles that have an area."""
    a, b, c = np.moveaxis(points[faces], 1, 0)
    return faces[np.cross(b - a, c - a).any(axis=1)]
