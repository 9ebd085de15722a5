"""Textures that a model carries itself: in its `<custom>` texts, or in a TOML file beside it.

    <custom><text name="texture:table" data="knurl:0.8mm"/></custom>

In the file every table of `[textures]` has the keys of a body's table in `scene.toml`:

    [textures.table]
    friction = 0.4
    texture = {kind = "knurl", pitch = 8e-4, height = 1.6e-4}
"""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any

import mujoco

from asperity._core.files import text_of
from asperity.errors import AsperityError
from asperity.scene.document import SURFACE, require_keys
from asperity.scene.texture import body_surface

_PREFIX = "texture:"


def textures_of_model(model: mujoco.MjModel) -> dict[str, Any]:
    """Return the textures in the `<custom>` texts of a model, by name.

    Raises
    ------
    AsperityError
        There are none.
    """
    found = {}
    for i in range(model.ntext):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, i) or ""
        if name.startswith(_PREFIX):
            start, size = int(model.text_adr[i]), int(model.text_size[i])
            text = bytes(model.text_data[start : start + size]).split(b"\0")[0]
            found[name.removeprefix(_PREFIX)] = text.decode()
    if not found:
        raise AsperityError(
            'the model has no custom text such as <text name="texture:GEOM" data="knurl:0.8mm"/>; '
            "give textures, or a TOML file of them (for asperity view: textures.toml beside it)"
        )
    return found


def textures_of_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the textures in a TOML file, by name; files that it names lie beside it.

    Raises
    ------
    AsperityError
        The file cannot be read, or has a key that is not valid.
    """
    path = Path(path)
    try:
        document = tomllib.loads(text_of(path.read_bytes()))
    except (OSError, ValueError) as error:
        raise AsperityError(f"{path}: {' '.join(str(error).split())}") from None
    tables = document.get("textures")
    if not isinstance(tables, dict) or not tables:
        raise AsperityError(f"{path} has no table [textures.NAME]")
    out = {}
    for name, table in tables.items():
        key = f"textures.{name}"
        if not isinstance(table, dict):
            raise AsperityError(f"{path}: {key} must be a table with texture = {{...}}")
        try:
            require_keys(table, key, SURFACE)
            out[name] = body_surface(table, key, path.parent)
        except AsperityError as error:
            raise AsperityError(f"{path}: {error}") from None
    return out
