"""The picture of a bake: full mesh, low-resolution mesh, baked mesh, and error.

The first three are drawn with the same camera and light. The fourth shows, on the baked surface,
the signed distance from the full mesh: red outside of it, blue inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from asperity._core.arrays import Array, Mask
from asperity.baking.nearest import Nearest
from asperity.drawing.figure_style import SMALLEST, style
from asperity.drawing.renderer.render import Buffers, Lamp, camera_at, halved, hollows, look, shade
from asperity.geometry.bodies import Body
from asperity.geometry.displaced.meshes import mesh_sheets
from asperity.geometry.displaced.sheet import Sheet
from asperity.geometry.displaced.view import Camera, ViewBall
from asperity.geometry.mesh.topology import crosses

_COLUMNS, _ROWS = 640, 520
_FOOT = 30.0
"""Space below each picture for scale bars [pixels]."""
_AZIMUTHS = tuple(float(np.radians(a)) for a in (-35.0, 35.0, -60.0, 60.0))
_ELEVATION = float(np.radians(28.0))
_STONE, _PALE = (0.80, 0.74, 0.63), (0.90, 0.90, 0.90)
_LAMP = 900
_UP = np.array([0.0, 0.0, 1.0])
_ALIKE = 0.3
_EDGE_STEPS = 24
_IDENTITY = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def draw_bake(
    full: Array, body: Body, report: dict[str, Any], path: Path,
    *, rough: Mask | None = None,
) -> None:  # fmt: skip
    """Draw a bake to a PNG file.

    Parameters
    ----------
    full : (m, 3, 3) array
        Corners of the full mesh's triangles [m].
    body : Body
        The baked mesh with its texture.
    report : dict
        Contents of `bake.json`.
    path : Path
    rough : (m,) array of bool, optional
        Triangles of the body that represent the full mesh; by default all.
    """
    assert body.mesh is not None
    low = body.mesh.vertices[body.mesh.faces]
    camera = _camera(full)
    baked = list(_baked(body, camera))
    scenes = [_patches(full), _patches(low), baked]
    seen = [look([(0, sheet) for sheet in sheets], camera) for sheets in scenes]
    pictures = [
        _lit(buffers, sheets, camera, colour)
        for buffers, sheets, colour in zip(seen, scenes, (_STONE, _PALE, _STONE), strict=True)
    ]
    error = _errors(body, camera, full, rough)
    with style():
        figure = Figure(figsize=(9.6, 8.5))
        axes = figure.subplots(2, 2).ravel()
        titles = _titles(report)
        for axis, picture, title in zip(axes, [*pictures, None], titles, strict=True):
            if picture is not None:
                axis.imshow(picture, interpolation="lanczos", zorder=1)
            axis.set_title(title, fontsize=9.5)
            axis.set_xlim(-0.5, _COLUMNS - 0.5)
            axis.set_ylim(_ROWS + _FOOT, -0.5)
            axis.set_aspect("equal")
            axis.axis("off")
        _edges(axes[1], low, seen[1], camera)
        _error_panel(figure, axes[3], error, seen[2], scenes[2], camera)
        _scale_bar(axes[0], camera)
        figure.suptitle(report["source"], x=0.02, ha="left", fontsize=11, fontweight="bold")
        figure.subplots_adjust(
            left=0.01, right=0.99, top=0.905, bottom=0.012, wspace=0.02, hspace=0.09
        )
        figure.savefig(path, dpi=150)


def _titles(report: dict[str, Any]) -> list[str]:
    columns, rows = report["texture_size"]
    low, high = report["heights_um"]
    error = [_length(report["error_um"][key]) for key in ("rms", "p99", "max")]
    return [
        f"a  {'Height map' if report['kind'] == 'plate' else 'Full mesh'}: "
        f"{report['full_faces']:,} triangles",
        f"b  Low-resolution mesh: {report['faces']:,} triangles",
        f"c  b with {columns} \N{MULTIPLICATION SIGN} {rows} heights, {_length(low)} to "
        f"{_length(high)}",
        f"d  Distance of c from a: rms {error[0]}, p99 {error[1]}, max {error[2]}",
    ]


def _length(micrometres: float) -> str:
    if abs(micrometres) >= 1000.0:
        return f"{1e-3 * micrometres:.2f} mm".replace("-", "\N{MINUS SIGN}")
    return f"{micrometres:.3g} \N{MICRO SIGN}m".replace("-", "\N{MINUS SIGN}")


def _camera(full: Array) -> Camera:
    """Return a camera that sees the whole mesh, from the side that shows the largest area."""
    corners = full.reshape(-1, 3)[:: max(1, len(full) // 50_000)]
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    best: Camera | None = None
    for azimuth in _AZIMUTHS:
        eye = camera_at(
            middle, _UP, np.array([1.0, 0.0, 0.0]), azimuth=azimuth, elevation=_ELEVATION,
            width=1.0, columns=2 * _COLUMNS, rows=2 * _ROWS,
        )  # fmt: skip
        across, up = (corners @ axis for axis in (eye.right, eye.up))
        width = 1.08 * max(np.ptp(across), np.ptp(up) * _COLUMNS / _ROWS)
        # The middle of the bounding box in the image.
        shift = [0.5 * (a.min() + a.max()) - middle @ b for a, b in
                 ((across, eye.right), (up, eye.up))]  # fmt: skip
        centre = middle + shift[0] * eye.right + shift[1] * eye.up
        eye = Camera(centre, eye.right, eye.up, eye.towards, float(width), eye.columns, eye.rows)
        if best is None or width < 0.97 * best.width:
            best = eye
    assert best is not None
    return best


def _patches(triangles: Array) -> list[Sheet]:
    """Return triangles as a sheet, each with its own normal."""
    normal = crosses(triangles)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    normals = np.ascontiguousarray(np.repeat(normal[:, None], 3, axis=1))
    return [Sheet(np.ascontiguousarray(triangles), normals, np.array([[0, 1, 2]]))]


def _baked(
    body: Body, camera: Camera, faces: Mask | None = None, *, closed: bool = True
) -> Sequence[Sheet]:
    radius = 0.5 * float(np.hypot(camera.width, camera.rows * camera.pixel))
    view = ViewBall(camera.centre, radius, int(radius / camera.pixel), camera)
    return [_as_it_is(sheet) for sheet in mesh_sheets(body, _IDENTITY, view, faces, closed=closed)]


def _as_it_is(sheet: Sheet) -> Sheet:
    """Return a sheet with the normals of its triangles, since relief may be steep here."""
    if sheet.corners is None:
        return sheet
    triangles = sheet.points[:, sheet.corners]
    normal = crosses(triangles.reshape(-1, 3, 3)).reshape(len(triangles), -1, 3)
    normals = np.zeros_like(sheet.points)
    for corner in sheet.corners.T:
        for k, point in enumerate(corner):
            normals[:, point] += normal[:, k]
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-300)
    # Strips along seams are too thin to have normals.
    own = np.einsum("ijk,ijk->ij", normals, sheet.normals) > _ALIKE
    return sheet._replace(normals=np.where(own[..., None], normals, sheet.normals))


def _lit(seen: Buffers, sheets: Sequence[Sheet], camera: Camera, colour: Sequence[float]) -> Array:
    """Return the image at half the size at which it was drawn, on white."""
    numbered = [(0, sheet) for sheet in sheets]
    lamp = Lamp.over(numbered, camera, _UP, _LAMP)
    image = halved(shade(seen, camera, lamp, [colour], hollows(seen, camera)))
    image[..., :3] = np.where(image[..., 3:] > 0.0, image[..., :3], 1.0)
    return image


def _errors(body: Body, camera: Camera, full: Array, rough: Mask | None) -> Array:
    """Return the signed distance from the full mesh of the surface in each pixel [m].

    NaN where there is no surface, or one outside `rough`. Distances are those of the nearest point
    of a sheet, since the position of a pixel is known only to about a pixel.
    """
    coarse = replace(camera, columns=_COLUMNS, rows=_ROWS)
    assert body.mesh is not None
    rough = np.ones(len(body.mesh.faces), dtype=bool) if rough is None else rough
    surface, sheets = Nearest(full), []
    # The skirt of a plate and the strips along seams have no counterpart on the full mesh.
    for sheet in _baked(body, coarse, rough, closed=bool(rough.all())):
        face, away = surface.to(sheet.points.reshape(-1, 3))
        ahead = np.einsum(
            "ij,ij->i", crosses(full[face]), sheet.points.reshape(-1, 3) - full[face, 0]
        )
        distances = np.zeros_like(sheet.points)
        distances[..., 0] = np.where(ahead > 0.0, away, -away).reshape(distances.shape[:2])
        sheets.append((0, sheet._replace(normals=distances)))
    if not rough.all():
        sheets += [(1, sheet) for sheet in _baked(body, coarse, ~rough)]
    seen = look(sheets, coarse)
    return np.where(seen.number == 0, seen.normal[..., 0], np.nan)


def _error_panel(
    figure: Figure, axis: Axes, error: Array, seen: Buffers, sheets: Sequence[Sheet],
    camera: Camera,
) -> None:  # fmt: skip
    """Show the errors in colour, lightly shaded, with a scale and their numbers."""
    import matplotlib as mpl

    known = np.abs(error[np.isfinite(error)]) * 1e6
    limit = max(_round_up(float(np.percentile(known, 99.0)) if known.size else 1.0), 1e-3)
    map_ = mpl.colormaps["RdBu_r"]
    norm = mpl.colors.Normalize(-limit, limit)
    colour = map_(norm(np.nan_to_num(error * 1e6)))
    grey = _lit(seen, sheets, camera, (1.0, 1.0, 1.0))[..., :3].mean(axis=2)
    colour[..., :3] *= (0.72 + 0.28 * np.clip(grey, 0.0, 1.0))[..., None]
    there = np.isfinite(seen.depth[::2, ::2])
    colour[np.isnan(error), :3] = (0.8 * grey)[np.isnan(error), None]
    colour[..., 3] = there
    axis.imshow(colour, interpolation="nearest", zorder=1)
    place = axis.inset_axes((0.03, 0.0, 0.34, 0.025))
    scale = figure.colorbar(mpl.cm.ScalarMappable(norm, map_), cax=place, orientation="horizontal")
    scale.set_ticks([-limit, 0.0, limit])
    scale.set_ticklabels([f"\N{MINUS SIGN}{limit:g}", "0", f"{limit:g} \N{MICRO SIGN}m"])
    place.xaxis.set_ticks_position("top")
    place.tick_params(labelsize=SMALLEST, length=2)
    place.grid(False)
    scale.outline.set_linewidth(0.6)


def _round_up(value: float) -> float:
    power = 10.0 ** np.floor(np.log10(max(value, 1e-3)))
    return float(next(s * power for s in (1.0, 2.0, 5.0, 10.0) if s * power >= value))


def _edges(axis: Axes, triangles: Array, seen: Buffers, camera: Camera) -> None:
    """Draw the sides of visible triangles."""
    sides = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    key = np.sort(np.round(sides / (1e-9 + 1e-6 * np.ptp(triangles, axis=(0, 1)).max())), axis=1)
    _, first = np.unique(key.reshape(len(sides), -1), axis=0, return_index=True)
    sides = sides[first]
    share = np.linspace(0.0, 1.0, _EDGE_STEPS + 1)[:, None]
    points = sides[:, None, 0] * (1.0 - share) + sides[:, None, 1] * share
    away = points - camera.centre
    x = away @ camera.right / camera.pixel + 0.5 * (camera.columns - 1)
    y = 0.5 * (camera.rows - 1) - away @ camera.up / camera.pixel
    depth = -(away @ camera.towards)
    columns = np.clip(np.round(x), 0, camera.columns - 1).astype(int)
    rows = np.clip(np.round(y), 0, camera.rows - 1).astype(int)
    # The nearest surface in a neighbouring pixel may differ by a pixel's slope.
    open_ = depth <= seen.depth[rows, columns] + 4.0 * camera.pixel
    whole = open_[:, :-1] & open_[:, 1:]
    k, i = np.nonzero(whole)
    pixels = np.stack([x, y], axis=-1) / 2.0
    lines = np.stack([pixels[k, i], pixels[k, i + 1]], axis=1)
    axis.add_collection(
        LineCollection(list(lines), colors="#2f4b6e", linewidths=0.45, capstyle="round", zorder=2)
    )


def _scale_bar(axis: Axes, camera: Camera) -> None:
    """Draw a bar of a round length in the lower left corner."""
    longest = 0.25 * camera.width
    power = 10.0 ** np.floor(np.log10(longest))
    length = float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest))
    x, y, wide = 0.04 * _COLUMNS, _ROWS + 0.8 * _FOOT, length / (2.0 * camera.pixel)
    axis.plot([x, x + wide], [y, y], color="black", lw=2.2, solid_capstyle="butt", zorder=3)
    axis.text(x, y - 0.02 * _ROWS, f"{length * 1e3:g} mm", fontsize=SMALLEST, va="bottom", zorder=3)
