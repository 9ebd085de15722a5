"""The physical scale of a scene of one's own files: what was chosen, what was read, how sure."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from asperity._core.unpacking import suffix_of
from asperity.geometry.bodies import Body
from asperity.geometry.mesh.checks import length
from asperity.geometry.mesh.files import PACKED
from asperity.scene.document import Table
from asperity.scene.scene import Scene

GIVEN, READ, ASSUMED = "given", "read", "ASSUMED"


class ScaleRow(NamedTuple):
    """A row: of which body, what, its value, and whether that was given, read or assumed."""

    body: str
    what: str
    value: str
    source: str


def scale_rows(scene: Scene) -> list[ScaleRow]:
    """Return a row for each length that is given by files or options; none for patterns alone."""
    rows = []
    for body in scene.bodies:
        table = scene.document.get("bodies", {}).get(body.name, {})
        mesh, texture = table.get("mesh", {}), table.get("texture", {})
        if body.mesh is not None and "file" in mesh:
            size = " x ".join(f"{1e3 * side:.4g}" for side in np.ptp(body.mesh.vertices, axis=0))
            rows.append(ScaleRow(body.name, "size", f"{size} mm", _unit(body, mesh)))
        if body.texture is not None and "file" in texture:
            rows += _texture_rows(scene, body, texture)
        for name, of_material in table.get("materials", {}).items():
            if "file" in of_material:
                rows += _material_rows(scene, body, name, of_material)
    return rows


def scale_table(scene: Scene) -> str:
    """Return the rows as a text of aligned columns, "" if there are none."""
    rows = scale_rows(scene)
    widths = [max((len(row[k]) for row in rows), default=0) for k in range(3)]
    return "\n".join(
        "  ".join([*(row[k].ljust(widths[k]) for k in range(3)), row.source]).rstrip()
        for row in rows
    )


def _unit(body: Body, table: Table) -> str:
    assert body.mesh is not None
    if "unit" in table:
        return f"{GIVEN}: unit {table['unit']}"
    if suffix_of(Path(table["file"]), PACKED) in (".glb", ".gltf"):
        return f"{READ}: glTF is in m"
    stated = next((note for note in body.mesh.notes if note.startswith("its unit is ")), "")
    if stated:
        return f"{READ}: unit {stated.split()[3].rstrip(',')}"
    return f"{ASSUMED}: unit m (the file states none)"


def _texture_rows(scene: Scene, body: Body, table: Table) -> list[ScaleRow]:
    """Return the rows of a texture from a file: its extent and pixels, and its relief."""
    field = body.texture
    assert field is not None
    size = " x ".join(f"{1e3 * side:.4g}" for side in field.size)
    pixel = " x ".join(dict.fromkeys(length(side) for side in field.pixel_size))
    sources = _sources(scene, table, body.name)
    return [
        ScaleRow(body.name, "texture", f"{size} mm, pixels of {pixel}", sources[0]),
        ScaleRow(body.name, "relief", length(field.relief), sources[1]),
    ]


def _material_rows(scene: Scene, body: Body, name: str, table: Table) -> list[ScaleRow]:
    """Return the rows of the texture of one material, of what its table states."""
    size, relief = table.get("pixel_size"), table.get("height_range")
    pair = size if isinstance(size, list | tuple) else [size]
    pixel = " x ".join(dict.fromkeys("?" if side is None else length(side) for side in pair))
    height = "as its file has it" if relief is None else length(relief)
    sources = _sources(scene, table, f"{body.name}: {name}")
    return [
        ScaleRow(body.name, f"texture of {name}", f"pixels of {pixel}", sources[0]),
        ScaleRow(body.name, f"relief of {name}", height, sources[1]),
    ]


def _sources(scene: Scene, table: Table, of: str) -> tuple[str, str]:
    """Return where the extent of a texture and its relief come from; `of`: how its notes begin."""
    name = Path(table["file"]).name
    no_unit = next((n for n in scene.notes if n.startswith(f"{of}: no unit is stated: ")), "")

    def source(key: str, keys: tuple[str, ...]) -> str:
        chosen = next((n for n in scene.notes if f"no {key} for {name}: " in n), None)
        if chosen is not None:
            why = chosen.partition(": ")[2].partition("mm")[2].strip(" ,")
            return f"{ASSUMED}: {'the default' if why == '(default)' else why}"
        if any(k in table for k in keys):
            return GIVEN
        if no_unit and (key != "size" or "x, y" in no_unit):
            return f"{ASSUMED}: unit m ({name} states none)"
        return f"{READ}: {name}"

    of_normals = str(table.get("kind", "")).startswith("normal") and "height_range" not in table
    relief = f"{READ}: from the normals and the size" if of_normals else None
    return (
        source("size", ("pixel_size", "size")),
        relief or source("height_range", ("height_range", "unit")),
    )
