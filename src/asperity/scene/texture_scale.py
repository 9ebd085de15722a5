"""The size and the relief of a texture's file where a scene is made straight from files.

What the file states is taken; else it reaches as the texture coordinates say, or once over the
body, and its relief is a default. These numbers are project defaults.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.geometry.mesh.materials import FELT, MapImage
from asperity.geometry.mesh.mesh import Mesh
from asperity.scene.asset import range_from_normals
from asperity.scene.mesh import uv_size
from asperity.texture.files.images import IMAGE_SUFFIXES
from asperity.texture.files.own_scale import OwnScale, own_scale

HEIGHT_RANGE = 2e-4
"""Of an image whose relief is not given [m]."""
_COVERS = 0.9
"""Share of the body's largest side that a map has to cover for no note."""


def has_size(texture: Mapping[str, Any]) -> bool:
    """Return whether the pixel size of a file of heights is given, or stated by the file."""
    if "pixel_size" in texture or "size" in texture:
        return True
    own = own_scale(Path(texture["file"]), texture.get("array"))
    return own is not None and own.pixel_size is not None


def give_scale(
    texture: dict[str, Any], vertices: Array, on_uv: Mesh | None, maps: Mapping[str, MapImage],
    notes: list[str],
) -> None:  # fmt: skip
    """Give a file of heights the size and relief that it does not have itself.

    `on_uv` is the mesh whose texture coordinates lay it, if any do; `maps` those that came with it.
    """
    path = Path(texture["file"])
    _check_lengths(texture)
    own = own_scale(path, texture.get("array"))
    if path.suffix.lower() not in IMAGE_SUFFIXES:
        if own is not None and on_uv is None and texture.get("border", "clamp") == "clamp":
            notes += _patch(texture, own, float(np.ptp(vertices, axis=0).max()))
        return
    if "border" not in texture:
        beyond = on_uv is None or on_uv.uv.min() < -1e-6 or on_uv.uv.max() > 1.0 + 1e-6  # type: ignore[union-attr]
        stated = next((maps[kind].border for kind in FELT if kind in maps), "wrap")
        texture["border"] = "wrap" if beyond and stated != "clamp" else "clamp"
        if beyond and stated == "other":
            notes.append(f"{path.name} is mirrored beyond its edges, or clamped along one axis, as "
                         "its file states: here it repeats")  # fmt: skip
    normals = str(texture.get("kind", "height")).startswith("normal")
    if own is None:
        return
    rows, columns = own.shape
    sized = own.pixel_size is not None and on_uv is None
    if "pixel_size" not in texture and "size" not in texture and not sized:
        if on_uv is not None:
            size = uv_size(on_uv)
            why = "as its texture coordinates reach on average"
        else:
            pixel = float(np.ptp(vertices, axis=0).max()) / max(rows, columns)
            size = (pixel * columns, pixel * rows)
            why = "once over the body's largest side"
        texture["pixel_size"] = [size[0] / columns, size[1] / rows]
        notes.append(
            f"no size for {path.name}: {1e3 * size[0]:.4g} x {1e3 * size[1]:.4g} mm, "
            f"{why} (default)"
        )
    if normals or {"height_range", "unit"} & {*texture} or own.metres is not None:
        return
    pixels = texture.get("pixel_size", [texture["size"][0] / columns, texture["size"][1] / rows]
                         if "size" in texture else own.pixel_size)  # fmt: skip
    pair = tuple(pixels) if isinstance(pixels, list | tuple) else (pixels, pixels)
    found = range_from_normals(maps, texture, pair, notes)
    texture["height_range"] = HEIGHT_RANGE if found is None else float(f"{found:.4g}")
    how = "(default)" if found is None else f"so that its slopes are those of {maps['normal'].name}"
    notes.append(f"no height_range for {path.name}: {1e3 * texture['height_range']:.4g} mm {how}")


def _check_lengths(texture: Mapping[str, Any]) -> None:
    """Raise `AsperityError` for a size or a pixel size that is no length, or no pair of them."""
    for key, counts, valid in (
        ("size", (2,), "two lengths, as size=20x10mm"),
        ("pixel_size", (1, 2), "a length or two, as pixel_size=10um"),
    ):
        given = texture.get(key, [1.0] * counts[0])
        values = given if isinstance(given, list | tuple) else [given]
        good = all(isinstance(v, int | float | np.number) and 0.0 < v < np.inf for v in values)
        if not good or len(values) not in counts:
            name = Path(texture["file"]).name
            raise AsperityError(f"{name}: {key} is {given!r}; valid: {valid}")


def _patch(texture: Mapping[str, Any], own: OwnScale, reach: float) -> list[str]:
    """Return a note if a map that does not repeat is smaller than the body, of size `reach` [m]."""
    pixels = np.asarray(texture.get("pixel_size", own.pixel_size or np.nan), dtype=np.float64)
    size = texture.get("size", pixels * own.shape[::-1])
    if not np.max(size) < _COVERS * reach:  # NaN: it has no size
        return []
    length_mm = " x ".join(f"{1e3 * side:.4g}" for side in np.broadcast_to(size, 2))
    name = Path(texture["file"]).name
    return [
        f"{name} covers {length_mm} mm of {1e3 * reach:.4g} mm, beyond it is level: border=wrap "
        "repeats it"
    ]
