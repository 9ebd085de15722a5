"""Maps of friction and of stiffness from their tables in `scene.toml`, in the place of a number.

They lie as the texture of the same surface does. Where there is none, their own tables place them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
from asperity.texture.property_map import PropertyMap
from asperity.texture.stiffness_map import StiffnessMap

MAPS: dict[str, type[PropertyMap]] = {"stiffness": StiffnessMap, "friction": FrictionMap}
"""The properties that may be maps, in the order in which they are laid."""


def with_maps(surface: Surface, table: Table, key: str, folder: Path | None) -> Surface:
    """Return a surface with the maps of properties that its table describes.

    Without an extent a map covers what the surface's texture does.
    """
    for name in MAPS:
        if isinstance(table.get(name), Mapping):
            surface = _with_map(surface, name, table[name], f"{key}.{name}", folder)
    return surface


def _with_map(surface: Surface, name: str, table: Table, key: str, folder: Path | None) -> Surface:
    if "file" not in table:
        raise AsperityError(f"{key} must be a number, or a table with the file of a map")
    options = parse_options(table, key, MAPS[name].from_file, "file", PLACING)
    path, placing, laid = find_file(table, key, folder), placing_of(table, key), surface.laid_map
    if laid is not None:
        what = "the map of stiffness" if surface.texture is None else "the texture"
        _refuse_apart(surface, placing, key, what)
        if not options.keys() & {"pixel_size", "size"}:
            options["size"] = laid.size
        if name == "stiffness":
            options.setdefault("border", laid.border)
    found = at(key, lambda: MAPS[name].from_file(path, **options))
    return at(key, lambda: replace(surface, **{name: found}, **placing))


def on_terrain(body: Body, texture: HeightField, middle: Array, table: Table, key: str) -> Body:
    """Return a body with the height field of `scene.xml` as its texture.

    `table` is the body's in the document, with its dotted `key`: its maps lie as the terrain.
    """
    middle_of_map = tuple(middle.tolist())
    laid = at(key, lambda: replace(body, texture=texture, mapping="planar", offset=middle_of_map))
    for name in _maps_of(body.surface):
        own = f"{key}.{name}"
        placing = placing_of(table[name], own)
        _refuse_apart(laid.surface, placing, own, "the height field of scene.xml")
    return laid


def _maps_of(surface: Surface) -> dict[str, PropertyMap]:
    """Return the maps of properties of a surface, by their names."""
    found = {name: getattr(surface, name) for name in MAPS}
    return {name: one for name, one in found.items() if isinstance(one, PropertyMap)}


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
    """Return a scene's document without textures; maps of properties stay where they are."""
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
    """Return what a surface's table changes by for its maps of properties to stay where they are.

    The texture may then be replaced, or be taken away. Without such maps nothing changes.
    """
    placing = {"mapping": surface.mapping, "offset": list(surface.offset)}
    return {
        name: {**placing, "size": list(found.size), "pixel_size": None}
        for name, found in _maps_of(surface).items()
    }
