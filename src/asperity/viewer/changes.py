"""Changes that a page can make to a session: functions from one `SessionConfig` to another.

All of them validate their arguments, and raise `AsperityError` before anything is changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from asperity._core.data import table_beside
from asperity.contact.response.settings import LAW_LABELS
from asperity.errors import AsperityError, require_between, require_choice
from asperity.geometry.mesh.files import read_contents
from asperity.realtime.devices.catalogue import entry_of, is_installed
from asperity.scene.builtin import load_scene
from asperity.scene.document import PLACING
from asperity.scene.from_files import make_scene
from asperity.scene.property_maps import laid_alone
from asperity.scene.scene import Scene
from asperity.scene.texture import body_texture
from asperity.texture.height_field import HeightField
from asperity.texture.patterns.patterns import EXAMPLES
from asperity.viewer.session_config import SessionConfig

_GRAINS = {"P40": 425e-6, "P60": 269e-6, "P80": 201e-6, "P120": 125e-6, "P180": 82e-6,
           "P240": 58.5e-6}  # fmt: skip
"""Mean diameters of the grains, FEPA 43-1 [m]."""
_TILE = 256
"""Pixels along a side of a tile of sandpaper."""


def _sandpaper(grain: float) -> dict[str, Any]:
    """Return a rough surface whose bumps are as wide as grains; slopes are a project default."""
    pixel = grain / 8.0
    return {
        "kind": "rough", "size": _TILE * pixel, "pixel_size": pixel, "hurst": 0.6,
        "rms_slope": 0.45, "rolloff": 2.5 * grain, "cutoff": 0.5 * grain, "seed": 1,
    }  # fmt: skip


SURFACES: dict[str, dict[str, Any]] = {
    **{f"sandpaper {name}": _sandpaper(grain) for name, grain in _GRAINS.items()},
    **table_beside(__file__, "surfaces.toml"),
}
"""Texture tables by name. They resemble these surfaces; none has been measured."""


SMOOTH, AS_IT_IS = "smooth", "as it is"
MESH_SIZES: dict[str, dict[str, Any]] = {"block": {"length": 0.06, "width": 0.04, "height": 0.015}}
"""Sizes of built-in meshes that need some [m]; project defaults."""
_HEIGHTS = ("amplitude", "height", "depth", "rms", "rms_slope", "height_range")
"""Parameters that scale with the relief."""
_LENGTHS = (
    "wavelength", "pitch", "width", "diameter", "second_pitch", "flank", "fillet", "size",
    "pixel_size", "length", "rolloff", "cutoff", "line", "scale",
)  # fmt: skip
"""Parameters that scale with the pixel size."""
RELIEF, PIXEL = (1e-7, 5e-3), (1e-7, 1e-3)
"""Valid ranges for textures made in a page [m]."""
METHODS: dict[str, dict[str, Any]] = {
    **{label: {"law": law, "gradient": "exact"} for law, label in LAW_LABELS.items()},
    "Otaduy & Lin, central differences": {"law": "otaduy-lin", "gradient": "differences"},
    "Otaduy & Lin, soft maximum": {"law": "otaduy-lin", "gradient": "soft"},
}
"""Force laws by label, with their force settings."""


def bodies_of(scene: Scene) -> list[str]:
    """Return the names of a scene's bodies, textured ones first."""
    return [body.name for body in sorted(scene.bodies, key=lambda body: body.texture is None)]


def texture_of(scene: Scene, body: str) -> HeightField | None:
    """Return a body's texture, or None."""
    require_choice("body", body, [b.name for b in scene.bodies])
    return next(b.texture for b in scene.bodies if b.name == body)


def method_of(scene: Scene) -> str:
    """Return the name in `METHODS` of a scene's force law."""
    force = scene.force
    return next(
        name
        for name, method in METHODS.items()
        if (method["law"], method["gradient"]) == (force.law, force.gradient)
    )


def methods_for(scene: Scene) -> list[str]:
    """Return the force laws that a scene allows: with meshes, only the first."""
    return list(METHODS)[:1] if any(b.mesh is not None for b in scene.bodies) else list(METHODS)


def with_scene(config: SessionConfig, name: str) -> SessionConfig:
    """Return a session with another scene, on a virtual coupling unless the scene specifies one."""
    return replace(config, scene=on_coupling(load_scene(name)), source=name)


def on_coupling(scene: Scene, mode: str | None = None) -> Scene:
    """Return a scene for a hand: with a coupling of the given mode, or `implicit` for `direct`."""
    own = scene.document.get("coupling", {}).get("mode", "direct")
    mode = mode or ("implicit" if own == "direct" else own)
    return replace(scene.changed(coupling={"mode": mode}), notes=scene.notes)


def with_method(
    config: SessionConfig, method: str, *, softness: float | None = None
) -> SessionConfig:
    """Return a session with another force law.

    Parameters
    ----------
    config : SessionConfig
    method : str
        A name in `METHODS`.
    softness : float, optional
        Of the soft maximum [m].
    """
    require_choice("force law", method, methods_for(config.scene))
    force = dict(METHODS[method])
    if softness is not None:
        force["softness"] = softness
    return replace(config, scene=config.scene.changed(force=force))


def with_device(config: SessionConfig, name: str) -> SessionConfig:
    """Return a session with another device; AsperityError if its package is missing."""
    entry = entry_of(name)
    if not is_installed(entry):
        raise AsperityError(f"{name} needs pip install 'asperity[{entry.extra}]'")
    return replace(config, device=name, options={})


def scaled_texture(
    table: Mapping[str, Any],
    *,
    relief: float | None = None,
    pixel_size: float | None = None,
    folder: Path | None = None,
) -> dict[str, Any]:
    """Return the description of a texture, scaled to a given relief and pixel size.

    Parameters
    ----------
    table : mapping
        As in `[bodies.NAME.texture]`.
    relief : float, optional
        Height from the lowest to the highest point [m], 1e-7 to 5e-3.
    pixel_size : float, optional
        Distance between samples [m], 1e-7 to 1e-3; all lengths along the surface scale with it.
    folder : Path, optional
        Folder of the texture's file.
    """
    out = {key: value for key, value in table.items() if value is not None}
    if relief is not None:
        require_between("relief", relief, *RELIEF, "m")
    if pixel_size is not None:
        require_between("pixel size", pixel_size, *PIXEL, "m")
    field, _ = body_texture(out, "texture", folder)
    if field is None:
        return out
    if pixel_size is not None:
        factor = pixel_size / field.pixel_size[0]
        if "file" in out and "size" not in out:
            out["pixel_size"] = field.pixel_size[0]
        _multiply(out, _LENGTHS, factor)
    if relief is not None and field.relief > 0.0:
        if "file" in out and "height_range" not in out:
            out["height_range"] = field.relief
        if out.get("kind") == "rough" and pixel_size is not None:
            # Its slopes are given, so a wider surface is already higher.
            field, _ = body_texture(out, "texture", folder)
            assert field is not None
        _multiply(out, _HEIGHTS, relief / field.relief)
    return out


def _multiply(table: dict[str, Any], names: tuple[str, ...], factor: float) -> None:
    for name in names:
        value = table.get(name)
        if isinstance(value, list | tuple):
            table[name] = [factor * float(v) for v in value]
        elif value is not None:
            table[name] = factor * float(value)


def with_texture(
    config: SessionConfig,
    body: str,
    kind: str | Mapping[str, Any],
    *,
    relief: float | None = None,
    pixel_size: float | None = None,
) -> SessionConfig:
    """Return a session in which a body has another texture.

    Parameters
    ----------
    config : SessionConfig
    body : str
    kind : str or mapping
        The name of a pattern, "smooth", "as it is", or a texture table.
    relief, pixel_size : float, optional
        As for `scaled_texture`.
    """
    scene = config.scene
    texture_of(scene, body)
    known = scene.document.get("bodies", {}).get(body, {})
    old = dict(known.get("texture", {}))
    made = next(b for b in scene.bodies if b.name == body)
    maps = laid_alone(made.surface)
    laid_by = old or next(iter(maps.values()), {})
    placing = {key: laid_by[key] for key in PLACING if key in laid_by}
    placing.setdefault("mapping", "triplanar" if made.mesh is not None else "planar")
    if kind == SMOOTH:
        change: dict[str, Any] = {"texture": None, "materials": None, **maps}
        return replace(config, scene=scene.changed(bodies={body: change}))
    table: dict[str, Any] = {**old}
    if kind == AS_IT_IS:
        if known.get("materials") and relief is None and pixel_size is None:
            return config
        if not old:
            smooth = "has a map for each material" if known.get("materials") else "is smooth"
            raise AsperityError(f"{body} {smooth}; choose a texture for it")
    elif isinstance(kind, str):
        require_choice("texture", kind, [AS_IT_IS, SMOOTH, *EXAMPLES])
        table = {"kind": kind, **EXAMPLES[kind], **placing}
    else:
        table = {**kind, **placing}
    table = scaled_texture(table, relief=relief, pixel_size=pixel_size, folder=scene.folder)
    gone = dict.fromkeys(key for key in old if key not in table)
    change = {"texture": {**gone, **table}, "materials": None, **maps}
    return replace(config, scene=scene.changed(bodies={body: change}))


def with_meshes(
    config: SessionConfig,
    tool: Mapping[str, Any],
    target: Mapping[str, Any],
    unit: str | None = None,
) -> SessionConfig:
    """Return a session with a scene of two meshes, from files or built in; see `make_scene`.

    A built-in mesh without sizes gets those of `MESH_SIZES`. Without `unit` a file is in the unit
    that it states, else in mm.
    """
    tables = []
    for table in (tool, target):
        made = MESH_SIZES.get(table.get("kind", ""), {}) | dict(table)
        if "file" in made:
            made["unit"] = unit or read_contents(Path(made["file"])).unit or "mm"
        tables.append(made)
    scene = make_scene(tool=tables[0], target=tables[1])
    return replace(config, scene=on_coupling(scene), source="")
