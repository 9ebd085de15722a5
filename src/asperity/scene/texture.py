"""A body's texture from its table in `scene.toml`: a pattern, or read from a file.

The kinds are those of `asperity.texture.patterns.patterns`; the keys of the table are the
parameters of the pattern's function, or of `HeightField.from_file`.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from asperity.errors import AsperityError
from asperity.geometry.bodies import Surface
from asperity.geometry.mesh.materials import Material
from asperity.scene.document import (
    PLACING,
    SURFACE,
    Table,
    arguments,
    at,
    find_file,
    make_by_kind,
    parse_options,
    placing_of,
)
from asperity.scene.property_maps import with_maps
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.patterns import PATTERNS

T = TypeVar("T", Surface, Material)
TOUCH = SURFACE[1:]
"""Keys of a surface beside its texture."""


def body_texture(
    table: Table, key: str, folder: Path | None
) -> tuple[HeightField | None, dict[str, Any]]:
    """Return a body's texture, and the arguments of `Body` that place it."""
    if not table:
        return None, {}
    placing = placing_of(table, key)
    if "file" in table:
        given = parse_options(table, key, HeightField.from_file, "file", PLACING)
        path = find_file(table, key, folder)
        return at(key, lambda: HeightField.from_file(path, **given)), placing
    if "kind" not in table:
        raise AsperityError(f"{key} needs either kind (one of: {', '.join(PATTERNS)}) or file")
    return make_by_kind("texture", PATTERNS, table, key, PLACING), placing


def body_surface(table: Table, key: str, folder: Path | None) -> Surface:
    """Return the surface that the table of a body or of a geom describes."""
    texture, placing = body_texture(table.get("texture", {}), f"{key}.texture", folder)
    placed = at(f"{key}.texture", lambda: Surface(texture, **placing))
    placed = with_maps(placed, table, key, folder)
    numbers = {k: v for k, v in table.items() if not isinstance(v, Mapping)}
    return with_touch(placed, numbers, key)


def with_touch(surface: T, table: Table, key: str) -> T:
    """Return a surface, or a material, with the friction and the stiffness of its table."""
    given = arguments({k: v for k, v in table.items() if k in TOUCH}, key, _touch)
    return at(key, lambda: replace(surface, **given))


def _touch(friction: float = 0.0, stiffness: float = 1.0) -> None:
    """Define the keys of a surface beside its texture, and their types."""


def with_seed(bodies: Table, seed: int) -> dict[str, Any]:
    """Return the changes to `[bodies]` that give every texture with a seed this one."""
    out: dict[str, Any] = {}
    for name, body in bodies.items():
        maker = PATTERNS.get(body.get("texture", {}).get("kind", ""))
        if maker is not None and "seed" in inspect.signature(maker).parameters:
            out[name] = {"texture": {"seed": seed}}
    return out
