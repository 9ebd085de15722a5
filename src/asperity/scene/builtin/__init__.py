"""Built-in scenes, and `load_scene`, which also reads scenes from folders."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from asperity.errors import AsperityError, did_you_mean
from asperity.scene.builtin.file_cad import file_cad
from asperity.scene.builtin.finger_plate import finger_plate
from asperity.scene.builtin.hammer_blocks import hammer_blocks
from asperity.scene.builtin.probe_plate import probe_plate
from asperity.scene.builtin.soft_bodies import elastic_block, palpation, sponge
from asperity.scene.builtin.tactile_map import tactile_map
from asperity.scene.scene import Scene, read_scene
from asperity.scene.texture import with_seed

SCENES: dict[str, Callable[[], Scene]] = {
    "probe-plate": lambda: probe_plate("sinusoid"),
    "probe-plate-dots": lambda: probe_plate("jittered_dots"),
    "probe-plate-grating": lambda: probe_plate("grating"),
    "hammer-blocks": hammer_blocks,
    "file-cad": file_cad,
    "finger-plate": finger_plate,
    "tactile-map": tactile_map,
    "sponge": sponge,
    "palpation": palpation,
    "elastic-block": elastic_block,
}
"""Constructors of the built-in scenes, by name."""
PROBE_PLATES = tuple(name for name in SCENES if name.startswith("probe-plate"))
"""Scenes whose probe has a `diameter`."""


def load_scene(name_or_path: str | Path, *, seed: int | None = None) -> Scene:
    """Return a built-in scene, or the one in a folder.

    Parameters
    ----------
    name_or_path : str or Path
        One of `SCENES`, or a folder with `scene.xml` and `scene.toml`.
    seed : int, optional
        Seed of all random textures; by default those of the scene.

    Raises
    ------
    AsperityError
        No such scene, or an invalid one: one line that names the key and its valid values.
    """
    name = str(name_or_path)
    if name in SCENES:
        scene = SCENES[name]()
    elif Path(name_or_path).exists():
        scene = read_scene(name_or_path)
    else:
        raise AsperityError(
            f"no scene {name!r}{did_you_mean(name, SCENES)}; give a folder with scene.xml and "
            f"scene.toml, or one of: {', '.join(SCENES)}"
        )
    if seed is None:
        return scene
    return scene.changed(bodies=with_seed(scene.document.get("bodies", {}), seed))


__all__ = [
    "PROBE_PLATES", "SCENES", "elastic_block", "file_cad", "finger_plate", "hammer_blocks",
    "load_scene", "palpation", "probe_plate", "sponge", "tactile_map",
]  # fmt: skip
