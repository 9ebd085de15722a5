r"""A designed surface as a printable plate: a watertight STL with base, number and calibration.

The plate is one map of heights on a base. Its front edge is a strip with the number of the
stimulus, engraved, and a calibration patch: stairs of five equal steps, then bars one, two and
four features wide. Stairs show the layers and the scale of heights, bars the blur. Strip and
texture pass over into each other without a step.

An STL has no unit; lengths are millimetres, as slicers take them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity.designing.process import ManufactureProcess
from asperity.errors import AsperityError, require_between, require_positive
from asperity.texture.height_field import HeightField

_PASSAGE = 2e-3
"""Width over which texture becomes strip [m]."""
_TRIANGLE = np.dtype(
    [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")], align=False
)
_ENGRAVED = 0.3e-3
"""Depth of the number, if the relief of the process allows it [m]."""
MOST_SAMPLES = 12_000_000
"""Of a plate; its file has 100 bytes for each."""


@dataclass(frozen=True)
class PrintedPlate:
    """Size of the plate that carries a designed surface.

    Parameters
    ----------
    size : (float, float)
        Of the textured part [m], 2 mm to 0.5 m each.
    base : float
        Thickness below the lowest place [m].
    strip : float
        Width of the strip with number and calibration patch [m]; 0 for none.
    """

    size: tuple[float, float] = (50e-3, 50e-3)
    base: float = 3e-3
    strip: float = 8e-3

    def __post_init__(self) -> None:
        if len(self.size) != 2:
            raise AsperityError(f"size of a plate must be two lengths [m], got {self.size!r}")
        for side in self.size:
            require_between("size of a plate", side, 2e-3, 0.5, "m")
        require_positive("base", self.base, "[m]")
        if self.strip != 0.0:
            require_between("strip", self.strip, 4e-3, 0.1, "m")


def plate_map(
    field: HeightField, process: ManufactureProcess, plate: PrintedPlate, number: str
) -> tuple[Array, int]:
    """Return the heights of a plate [m], lowest 0, and how many rows the strip takes.

    Parameters
    ----------
    field : HeightField
        The map to make, which is repeated.
    process : ManufactureProcess
        Gives the pixel; strip and number keep to its slope and relief.
    plate : PrintedPlate
    number : str
        To be engraved.
    """
    pixel = process.pixel
    columns, rows = (round(side / pixel) for side in plate.size)
    edge = round(plate.strip / pixel)
    if columns * (rows + edge) > MOST_SAMPLES:
        raise AsperityError(
            f"a plate of {columns} x {rows + edge} samples; valid: {MOST_SAMPLES:,} at most, "
            "so give a smaller plate or a larger pixel"
        )
    u, v = ((np.arange(n) + 0.5) * pixel for n in (columns, rows))
    heights = np.concatenate([
        field.heights(u[None, :], v[None, i : i + 1].T) for i in range(rows)
    ]) if rows * columns > 4e6 else field.heights(u[None, :], v[:, None])  # fmt: skip
    heights = heights - field.lowest
    if edge == 0:
        return heights, 0
    level = 0.5 * field.relief
    strip = level + _strip((edge, columns), process, number)
    whole = np.concatenate([strip, heights])
    # Texture fades into the strip's level within the strip's side of the border.
    passage = min(round(_PASSAGE / pixel), edge // 2)
    share = 0.5 - 0.5 * np.cos(np.pi * (np.arange(passage) + 0.5) / passage)[:, None]
    before = field.heights(u[None, :], (np.arange(-passage, 0)[:, None] + 0.5) * pixel)
    rows_at = slice(edge - passage, edge)
    whole[rows_at] = share * (before - field.lowest) + (1.0 - share) * level
    return whole - whole.min(), edge


def _strip(shape: tuple[int, int], process: ManufactureProcess, number: str) -> Array:
    """Return the strip's heights about its level [m]: number, stairs, bars."""
    from scipy import ndimage

    rows, columns = shape
    pixel, sharp = process.pixel, np.zeros(shape)
    free = slice(round(0.15 * rows), round(0.65 * rows))
    depth = min(_ENGRAVED, 0.4 * process.relief)
    glyphs = _glyphs(number, free.stop - free.start)
    width = min(glyphs.shape[1], columns // 3)
    left = columns // 20
    sharp[free, left : left + width] = -depth * glyphs[:, :width]
    stairs = np.repeat(np.arange(1, 6) / 5.0, max(columns // 20, 1)) * depth
    start = round(0.4 * columns)
    sharp[free, start : start + stairs.size] = stairs
    at = start + stairs.size + columns // 20
    for features in (1, 2, 4):
        wide = max(round(features * process.feature / pixel), 1)
        for _ in range(3):
            if at + wide < columns - columns // 20:
                sharp[free, at : at + wide] = -depth
            at += 2 * wide
        at += 2 * wide
    # A step of `depth` blurred by s has the slope depth / (s sqrt(2 pi)), and where two cross
    # corners, somewhat more.
    widest = 1.5 * depth / (process.slope * np.sqrt(2.0 * np.pi))
    return ndimage.gaussian_filter(sharp, max(widest, 0.5 * process.feature) / pixel)


def _glyphs(text: str, height: int) -> Array:
    """Return letters as 0 and 1 (height, n)."""
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(size=float(max(height, 8)))
    left, top, right, bottom = font.getbbox(text)
    size = (max(round(right - left), 1), max(round(bottom - top), 1))
    image = Image.new("L", size)
    ImageDraw.Draw(image).text((-left, -top), text, fill=255, font=font)
    wide = max(round(size[0] * height / size[1]), 1)
    # Row 0 of a height map is nearest to the person who reads it.
    return np.asarray(image.resize((wide, height)), dtype=np.float64)[::-1] / 255.0


def plate_triangles(heights: Array, pixel: float, base: float) -> Array:
    """Return the closed surface of a plate (n, 3, 3) [m], its base below z = 0.

    Samples are corners of triangles. The bottom is a fan, so that the file is hardly larger than
    its top.
    """
    rows, columns = heights.shape
    x, y = ((np.arange(n) - 0.5 * (n - 1)) * pixel for n in (columns, rows))
    top = np.stack([*np.broadcast_arrays(x[None, :], y[:, None]), heights], axis=-1)
    a, b, c, d = top[:-1, :-1], top[:-1, 1:], top[1:, 1:], top[1:, :-1]
    faces = [np.stack(three, axis=2).reshape(-1, 3, 3) for three in ((a, b, c), (a, c, d))]
    # The rim, counter-clockwise seen from above.
    rim = np.concatenate([top[0, :-1], top[:-1, -1], top[-1, :0:-1], top[:0:-1, 0]])
    after = np.roll(rim, -1, axis=0)
    low, low_after = rim.copy(), after.copy()
    low[:, 2] = low_after[:, 2] = -base
    centre = np.broadcast_to([0.0, 0.0, -base], low.shape)
    faces += [
        np.stack(three, axis=1)
        for three in ((low, low_after, after), (low, after, rim), (low_after, low, centre))
    ]
    return np.concatenate(faces)


def write_stl(triangles: Array, path: Path) -> None:
    """Write triangles (n, 3, 3) [m] as a binary STL in millimetres."""
    out = np.zeros(len(triangles), _TRIANGLE)
    corners = triangles * 1e3
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    out["normal"] = normals / np.where(lengths > 0.0, lengths, 1.0)
    out["corners"] = corners
    with path.open("wb") as file:
        file.write(b"asperity: a designed plate, millimetres".ljust(80, b" "))
        file.write(np.uint32(len(out)).tobytes())
        out.tofile(file)


def write_base(shape: tuple[int, int], pixel: float, base: float, path: Path) -> None:
    """Write the plate without its texture as OBJ [mm], onto which `asperity bake` puts it back.

    Its top has vertices just inside its rim, so that all inner normals are upright.
    """
    y, x = (0.5 * (n - 1) * pixel * 1e3 for n in shape)
    inset = 2.0 * pixel * 1e3
    low = -base * 1e3
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    vertices = [(sx * (x - inset), sy * (y - inset), 0.0) for sx, sy in corners]
    vertices += [(sx * x, sy * y, z) for z in (0.0, low) for sx, sy in corners]
    quads = [(0, 1, 2, 3), (11, 10, 9, 8)]
    for k in range(4):
        m = (k + 1) % 4
        quads += [(4 + k, 4 + m, m, k), (8 + k, 8 + m, 4 + m, 4 + k)]
    lines = ["# millimetres; the plate without its texture"]
    lines += ["v {:.9g} {:.9g} {:.9g}".format(*vertex) for vertex in vertices]
    lines += [f"f {quad[0] + 1} {quad[i] + 1} {quad[i + 1] + 1}" for quad in quads for i in (1, 2)]
    path.write_text("\n".join(lines) + "\n", "utf-8")


NAME = "object.stl"
_MOST_TRIANGLES = 4_000_000


def write_on_mesh(
    mesh: Path, field: HeightField, process: ManufactureProcess, folder: Path
) -> dict[str, Any]:
    """Write the surface on a closed mesh as a watertight `object.stl` [mm]; return what was done.

    The mesh is divided, all triangles alike, until no edge is longer than a pixel or the number of
    triangles allows no more, and its vertices are moved along their normals by the map, projected
    along three axes (triplanar), so that no seam opens.

    Parameters
    ----------
    mesh : Path
        A closed mesh in millimetres, in any format of trimesh.
    field : HeightField
        The map to make.
    process : ManufactureProcess
        Gives the pixel.
    folder : Path
    """
    import trimesh

    if not mesh.is_file():
        raise AsperityError(f"no such file: {mesh}")
    loaded = trimesh.load(mesh, force="mesh")
    if not loaded.is_watertight:
        raise AsperityError(f"{mesh}: the mesh is open; valid: a closed one, to be printed")
    vertices, faces = np.asarray(loaded.vertices) * 1e-3, np.asarray(loaded.faces)
    while True:
        edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
        if edges.max() <= process.pixel or 4 * len(faces) > _MOST_TRIANGLES:
            break
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    fine = trimesh.Trimesh(vertices, faces, process=False)
    normals = np.asarray(fine.vertex_normals)
    weights = normals**4
    weights /= weights.sum(axis=1, keepdims=True)
    heights = sum(
        weights[:, axis] * field.heights(vertices[:, i], vertices[:, j])
        for axis, (i, j) in enumerate(((1, 2), (2, 0), (0, 1)))
    )
    moved = vertices + np.asarray(heights - field.lowest)[:, None] * normals
    write_stl(moved[faces], folder / NAME)
    return {"triangles": len(faces), "longest_edge": float(edges.max())}
