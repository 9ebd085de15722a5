"""A body's texture from its table in `scene.toml`: a pattern, or read from a file.

The kinds are those of `asperity.texture.patterns.patterns`; the keys of the table are the
parameters of the pattern's function, or of `HeightField.from_file`.
"""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError, require_choice
from asperity.scene.document import PLACING, Table, arguments, at, beside, require_keys
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.patterns import PATTERNS


def body_texture(
    table: Table, key: str, folder: Path | None
) -> tuple[HeightField | None, dict[str, Any]]:
    """Return a body's texture, and the arguments of `Body` that place it."""
    if not table:
        return None, {}
    placing = arguments({k: v for k, v in table.items() if k in PLACING}, key, _placing)
    rest = {k: v for k, v in table.items() if k not in PLACING}
    if "file" in rest:
        name = rest.pop("file")
        if not isinstance(name, str):
            raise AsperityError(f"{key}.file must be a string, got {name!r}")
        reader = HeightField.from_file
        options = _with_placing(rest, key, reader, ("file",))
        path = beside(folder, name)
        if not path.exists():
            raise AsperityError(f"{key}.file: no such file: {path}")
        return at(key, lambda: reader(path, **options)), placing
    if "kind" not in rest:
        raise AsperityError(f"{key} needs either kind (one of: {', '.join(PATTERNS)}) or file")
    kind = rest.pop("kind")
    at(f"{key}.kind", lambda: require_choice("texture", kind, PATTERNS))
    options = _with_placing(rest, key, PATTERNS[kind], ("kind",))
    return at(key, lambda: PATTERNS[kind](**options)), placing


def _with_placing(table: Table, key: str, makes: Any, more: tuple[str, ...]) -> dict[str, Any]:
    """Return the arguments of `makes`; errors also list the keys common to all textures."""
    names = [n for n in inspect.signature(makes).parameters if n != "path"]
    require_keys(table, key, [*more, *names, *PLACING])
    return arguments(table, key, makes)


def _placing(mapping: str = "planar", offset: tuple[float, float] = (0.0, 0.0)) -> None:
    """Define the keys that place a texture, and their types."""


def with_seed(bodies: Table, seed: int) -> dict[str, Any]:
    """Return the changes to `[bodies]` that give every texture with a seed this one."""
    out: dict[str, Any] = {}
    for name, body in bodies.items():
        maker = PATTERNS.get(body.get("texture", {}).get("kind", ""))
        if maker is not None and "seed" in inspect.signature(maker).parameters:
            out[name] = {"texture": {"seed": seed}}
    return out
