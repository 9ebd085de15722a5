"""A map of friction from its table in `scene.toml`, in the place of a number.

It lies as the texture of the same surface does. Where there is none, its own table places it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Surface
from asperity.scene.document import PLACING, Table, at, find_file, merged, parse_options, placing_of
from asperity.scene.mjcf import geom_names, touchable_geoms
from asperity.texture.friction_map import FrictionMap
from asperity.texture.height_field import HeightField


def with_friction_map(surface: Surface, table: Table, key: str, folder: Path | None) -> Surface:
    """Return a surface with the map of friction that a table describes.

    Without an extent in the table it covers what the surface's texture does.
    """
    if "file" not in table:
        raise AsperityError(f"{key} must be a number, or a table with the file of a map")
    options = parse_options(table, key, FrictionMap.from_file, "file", PLACING)
    path, placing = find_file(table, key, folder), placing_of(table, key)
    if surface.texture is not None:
        _refuse_apart(surface, placing, key, "the texture")
        if not options.keys() & {"pixel_size", "size"}:
            options["size"] = surface.texture.size
    found = at(key, lambda: FrictionMap.from_file(path, **options))
    return at(key, lambda: replace(surface, friction=found, **placing))


def on_terrain(body: Body, texture: HeightField, middle: Array, friction: Any, key: str) -> Body:
    """Return a body with the height field of `scene.xml` as its texture.

    `friction` is the body's in the document, with its dotted `key`: a map lies as the terrain.
    """
    laid = replace(body, texture=texture, mapping="planar", offset=tuple(middle.tolist()))
    if body.friction_map is not None:
        _refuse_apart(laid.surface, placing_of(friction, key), key, "the height field of scene.xml")
    return laid


def _refuse_apart(surface: Surface, placing: dict[str, Any], key: str, what: str) -> None:
    """Raise `AsperityError` for a map that is to lie otherwise than the surface's texture."""
    for name, value in placing.items():
        if value != getattr(surface, name):
            raise AsperityError(
                f"{key}.{name} is {value!r}, but the map lies as {what} does: "
                f"{getattr(surface, name)!r}; leave it out"
            )


def without_textures(
    document: Table, bodies: Sequence[Body], model: mujoco.MjModel
) -> dict[str, Any]:
    """Return a scene's document without textures; maps of friction stay where they are."""
    out, owned = merged(document, {}), touchable_geoms(model)
    tables = out.setdefault("bodies", {})
    for body in bodies:
        # No texture, also where the MJCF brings one.
        gone = {"texture": None, "materials": None, **laid_alone(body.surface)}
        table = tables[body.name] = {**merged(tables.get(body.name, {}), gone), "texture": {}}
        for name, own in table.get("geoms", {}).items():
            row = geom_names(model, owned[body.name]).index(name)
            gone = {"texture": None, **laid_alone(body.surfaces[row])}
            table["geoms"][name] = merged(own, gone)
    return out


def laid_alone(surface: Surface) -> dict[str, Any]:
    """Return what a surface's table changes by for its map of friction to stay where it is.

    The texture may then be replaced, or be taken away. Without such a map nothing changes.
    """
    found = surface.friction_map
    if found is None:
        return {}
    placing = {"mapping": surface.mapping, "offset": list(surface.offset)}
    return {"friction": {**placing, "size": list(found.size), "pixel_size": None}}
