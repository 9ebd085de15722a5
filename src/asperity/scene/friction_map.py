"""A map of friction from its table in `scene.toml`, in the place of a number.

It lies as the texture of the same surface does. Where there is none, its table says how.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco

from asperity.errors import AsperityError
from asperity.geometry.bodies import Body, Surface
from asperity.scene.document import PLACING, Table, at, find_file, merged, parse_options, placing_of
from asperity.scene.mjcf import geom_names, touchable_geoms
from asperity.texture.friction_map import FrictionMap
from asperity.texture.height_field import HeightField

_EXTENT = ("pixel_size", "size")


def with_friction_map(surface: Surface, table: Table, key: str, folder: Path | None) -> Surface:
    """Return a surface with the map of friction that a table describes.

    Without an extent of its own it covers what the surface's texture does.
    """
    if "file" not in table:
        raise AsperityError(f"{key} must be a number, or a table with the file of a map")
    options = parse_options(table, key, FrictionMap.from_file, "file", PLACING)
    if surface.texture is not None:
        _refuse_placing(table, key, "the texture")
        if not any(name in options for name in _EXTENT):
            options["size"] = surface.texture.size
    path, placing = find_file(table, key, folder), placing_of(table, key)
    found = at(key, lambda: FrictionMap.from_file(path, **options))
    return at(key, lambda: replace(surface, friction=found, **placing))


def on_terrain(
    body: Body, texture: HeightField, middle: Sequence[float], friction: Any, key: str
) -> Body:
    """Return a body with the height field of `scene.xml` as its texture.

    `friction`, with its dotted `key`, is what its table says of it: a map lies as the terrain.
    """
    if body.friction_maps:
        _refuse_placing(friction, key, "the height field of scene.xml")
    return replace(body, texture=texture, offset=tuple(middle))


def _refuse_placing(table: Table, key: str, what: str) -> None:
    wrong = [name for name in PLACING if name in table]
    if wrong:
        raise AsperityError(f"{key} lies as {what} does; leave {' and '.join(wrong)} out")


def without_textures(
    document: Table, bodies: Sequence[Body], model: mujoco.MjModel
) -> dict[str, Any]:
    """Return a scene's document without textures; maps of friction stay where they are."""
    out, owned = merged(document, {}), touchable_geoms(model)
    tables = out.setdefault("bodies", {})
    for body in bodies:
        table = tables.setdefault(body.name, {})
        _lay_alone(table, body.surface)
        table["texture"] = {}  # none, also where the MJCF brings one
        table.pop("materials", None)
        for name, own in table.get("geoms", {}).items():
            row = geom_names(model, owned[body.name]).index(name)
            _lay_alone(own, body.surfaces[row])
            own.pop("texture", None)
    return out


def _lay_alone(table: dict[str, Any], surface: Surface) -> None:
    """Put into the table of a map of friction where it lies, which its texture has said so far."""
    found = surface.friction_map
    if found is not None:
        rest = {k: v for k, v in table["friction"].items() if k not in _EXTENT}
        placing = {"mapping": surface.mapping, "offset": list(surface.offset)}
        table["friction"] = {**rest, **placing, "size": list(found.size)}
