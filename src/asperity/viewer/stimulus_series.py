"""A series of designed stimuli, found beside a scene: what `asperity design` leaves of one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError
from asperity.scene.document import read_toml
from asperity.scene.scene import Scene

BODY = "plate"


def series_of(scene: Scene) -> tuple[list[dict[str, Any]], int]:
    """Return the textures of the series that a scene is of, and which of them it has.

    Returns
    -------
    textures : list of dict
        Tables as in `scene.toml`, with absolute paths, from the smoothest to the roughest; empty
        for a scene that is of none.
    place : int
        0 where the scene has another texture.
    """
    if scene.folder is None:
        return [], 0
    whole = scene.folder.resolve().parent
    try:
        report = json.loads((whole / "design.json").read_text("utf-8"))
        if report.get("kind") != "series":
            return [], 0
        textures = [_texture(whole / str(i + 1)) for i in range(len(report["surfaces"]))]
    except (OSError, ValueError, KeyError, AttributeError, AsperityError):
        return [], 0  # Some other file of that name, or a series of which a part was moved.
    name = scene.document.get("bodies", {}).get(BODY, {}).get("texture", {}).get("file", "")
    own = (scene.folder / name).resolve()
    places = [i for i, one in enumerate(textures) if Path(one["file"]) == own]
    return textures, places[0] if places else 0


def _texture(folder: Path) -> dict[str, Any]:
    table = dict(read_toml(folder / "scene.toml")["bodies"][BODY]["texture"])
    table["file"] = str((folder / table["file"]).resolve())
    return table
