"""A scene of two meshes and two textures, straight from files: `make_scene`.

What files do not say is chosen here and reported in the scene's notes: how high an image's relief
is, how far it reaches, where the tool starts and how it moves. These numbers are project defaults.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from asperity._core.arrays import Array
from asperity.errors import AsperityError
from asperity.geometry.bodies import Geom
from asperity.geometry.facets.tessellate import geom_triangles
from asperity.geometry.mesh.checks import length
from asperity.geometry.mesh.map_names import maps_in_folder
from asperity.geometry.mesh.materials import MapImage
from asperity.geometry.mesh.mesh import Mesh
from asperity.scene.adapt import adapted
from asperity.scene.asset import (
    own_textures,
    part_of,
    seen_colour,
    texture_of,
)
from asperity.scene.concave import with_convex_pieces
from asperity.scene.document import at, require_table
from asperity.scene.mesh import body_mesh, body_pieces, files_read_once
from asperity.scene.mjcf import compiled, mesh_assets, mesh_geoms, model_around, tool_start
from asperity.scene.placement import fall, slide_over
from asperity.scene.scene import Scene, scene_of
from asperity.scene.shorthand import PRIMITIVES, file_table, pattern, primitive
from asperity.scene.texture_scale import give_scale, has_size

DENSITY = 1000.0
"""Of the tool [kg/m^3]."""
_CLEARANCE = 1e-4
"""How far above contact the tool is drawn, beside both textures' reach [m]."""
_FAR = 10.0
"""Distance from the origin beyond which a mesh is moved there, in its sizes."""
_LEAST = 4
"""Vertices that MuJoCo draws a mesh of."""
_TURNS = {"y": (0.5**0.5, 0.5**0.5, 0.0, 0.0), "x": (0.5**0.5, 0.0, -(0.5**0.5), 0.0)}
"""Quaternions that turn an axis to z, about x and about y."""
_COLOURS = {"tool": "0.42 0.55 0.72 1", "target": "0.8 0.74 0.63 1"}

_SOLID = f"a file of a mesh, or a solid such as sphere:3mm ({', '.join(PRIMITIVES)})"
_PATTERN = "a file of heights, a folder of maps, or a pattern such as knurl:0.8mm"

File = str | Path | Mapping[str, Any]

_NOTE = """Geoms in group 2 are the shapes, only seen; those in group 3 the
       convex pieces that may touch. Textures, force and motion stand in scene.toml. The least
       inertia is for tools of tenths of a millimetre, which MuJoCo would refuse."""
_BODIES = """    <body name="target">
{target}
    </body>
    <body name="tool" pos="{place}">
      <freejoint name="hand"/>
{tool}
    </body>"""


@dataclass(frozen=True, eq=False)
class _Part:
    """One of the two bodies."""

    name: str
    triangles: Array
    """Its surface (m, 3, 3) [m], to find its place."""
    assets: str
    geoms: str
    """Its elements of MJCF."""
    table: dict[str, Any]
    """What stands under `[bodies.NAME]`."""
    notes: tuple[str, ...]


@files_read_once()
def make_scene(
    *,
    tool: File,
    target: File,
    tool_texture: File | None = None,
    target_texture: File | None = None,
    unit: str | None = None,
    stiffness: float = 400.0,
    name: str | None = None,
) -> Scene:
    """Return a scene of a textured tool and a textured target, from files of meshes and images.

    The target stands with its frame at the origin; the tool above it, z upwards, where its lowest
    place meets the target's top. It slides along the longer side of that top. `Scene.save` makes
    a folder of it, where everything can be changed.

    Parameters
    ----------
    tool, target : path or mapping
        A file of a mesh, or what would stand under `[bodies.NAME.mesh]`: `file`, `unit`,
        `hard_angle`, `atlas`, and, if its z is not upwards, `quaternion`. Or a solid: "sphere:3mm",
        "box:20x10x5mm", "capsule:3x20mm", "cylinder:...", "ellipsoid:..." (`scene.shorthand`).
    tool_texture, target_texture : path or mapping, optional
        A file of heights, or what would stand under `[bodies.NAME.texture]`; a folder of maps by
        their names; or a pattern with parameters, "knurl:0.8mm". A file may have options behind
        it, "cast.png:colour=red,pixel_size=10um". Without, the displacement or
        normal map that the mesh's material names, or that lies beside it by its name; if there is
        none the body is smooth. Where not given: *mapping* is "uv" for files (texture coordinates
        are made where the mesh has none) and "triplanar" for patterns; *height_range* of an image
        is 0.2 mm; an image reaches as far as the UV coordinates say, otherwise once over the body's
        largest side. The scene's notes tell what was chosen.
    unit : str
        Of meshes that do not name theirs: "m", "mm", ... By default the one that the file states,
        else m.
    stiffness : float
        Of the contact [N/m].
    name : str, optional
        By default from the files' names.

    Raises
    ------
    AsperityError
        A file that cannot be used, or a value that is not valid; one line.

    Examples
    --------
    >>> scene = asperity.make_scene(
    ...     tool="file.obj", tool_texture={"kind": "cross_cut", "pitch": 1e-3, "height": 2e-4},
    ...     target="part.stl", target_texture="cast.png", unit="mm",
    ... )
    >>> scene.save("file-on-part")
    """
    parts = {
        "tool": _part("tool", tool, tool_texture, unit),
        "target": _part("target", target, target_texture, unit),
    }
    if name is None:
        name = f"{parts['tool'].name}-on-{parts['target'].name}"
    slide, place = slide_over(parts["target"].triangles, parts["tool"].triangles)
    document = {
        "schema": 1,
        "tool": {"body": "tool"},
        "bodies": {key: part.table for key, part in parts.items()},
        "force": {"stiffness": stiffness, "anti_alias": "tick"},
        "trajectory": slide,
    }
    place[2] -= fall(compiled(_xml(name, parts, place)))
    scene = scene_of(_xml(name, parts, place), document, name=name)
    # Asperities meet before the smooth surfaces do.
    reach = [max(b.texture.highest, 0.0) for b in scene.bodies if b.texture is not None]
    place[2] += sum(reach) + _CLEARANCE
    scene = _with_xml(scene, _xml(name, parts, place))
    notes = tuple(f"{key}: {note}" for key, part in parts.items() for note in part.notes)
    return replace(scene, notes=(*notes, *scene.notes))


def _with_xml(scene: Scene, xml: str) -> Scene:
    """Return a scene of an XML that places the tool elsewhere: nothing is read again for it."""
    prepared = adapted(xml, scene.tool)
    model, _ = with_convex_pieces(xml, prepared.model, prepared.spec)
    return replace(scene, xml=xml, model=model, start=tool_start(prepared.model, scene.tool))


def _part(which: str, source: File, texture: File | None, unit: str | None) -> _Part:
    """Return the tool or the target: its surface and elements, with what was chosen."""
    solid = primitive(source) if isinstance(source, str) else None
    if solid is not None:
        return _solid(which, *solid, texture)
    table = _table(which, source)
    if "file" in table and unit is not None:
        table.setdefault("unit", unit)
    mesh = body_mesh(table, which, None)
    if mesh is None:
        raise AsperityError(f"{which} must be a file of a mesh, got {source!r}")
    if len(mesh.vertices) < _LEAST:
        raise AsperityError(
            f"{which}: {mesh.name} has {len(mesh.vertices)} vertices; valid: {_LEAST} or more"
        )
    notes: list[str] = []
    mesh = _upright(table, which, mesh, notes)
    mesh = _near_origin(table, which, mesh, notes)
    body: dict[str, Any] = {"mesh": table}
    laid, maps = _texture(which, texture, notes)
    if texture is None and "file" in table:
        own = own_textures(Path(table["file"]), mesh, notes)
        laid, maps = own.pop("", (None, {}))
        for name, (of_material, its_maps) in own.items():
            part = part_of(mesh, name)
            give_scale(of_material, part.vertices[part.faces].reshape(-1, 3), part, its_maps, notes)
            body.setdefault("materials", {})[name] = of_material
    if laid is not None:
        key = f"{which}_texture"
        mesh = _with_mapping(laid, table, mesh, key, notes)
        if "file" in laid:
            on_uv = mesh if laid["mapping"] == "uv" and mesh.uv is not None else None
            give_scale(laid, mesh.vertices, on_uv, maps, notes)
        body["texture"] = laid
    pieces = body_pieces(table, which, mesh)
    colours = [seen_colour(mesh, maps, notes) or _COLOURS[which]] * len(pieces)
    return _Part(
        mesh.name, mesh.vertices[mesh.faces], mesh_assets(which, mesh, pieces),
        mesh_geoms(which, mesh, density=[DENSITY] * len(pieces), rgba=colours), body, tuple(notes),
    )  # fmt: skip


def _solid(which: str, geom: Geom, note: str, texture: File | None) -> _Part:
    """Return a body that is a simple solid."""
    notes = [note]
    vertices, faces, _, _ = geom_triangles(geom)
    laid, maps = _texture(which, texture, notes)
    body: dict[str, Any] = {}
    if laid is not None:
        laid.setdefault("mapping", "triplanar")
        if laid["mapping"] == "uv":
            raise AsperityError(
                f"{which}_texture: a {geom.kind} has no mapping uv; valid: triplanar"
            )
        if "file" in laid:
            give_scale(laid, vertices, None, maps, notes)
        body["texture"] = laid
    size = " ".join(f"{x:.9g}" for x in geom.size[: len(geom.size) - geom.size.count(0.0)])
    element = (
        f'      <geom name="{which}-1" type="{geom.kind}" size="{size}" density="{DENSITY:g}" '
        f'rgba="{_COLOURS[which]}"/>'
    )
    return _Part(geom.kind, vertices[faces], "", element, body, tuple(notes))


def _texture(
    which: str, texture: File | None, notes: list[str]
) -> tuple[dict[str, Any] | None, Mapping[str, MapImage]]:
    """Return the table of a texture that is given, and maps by kind if it is a folder of them."""
    if texture is None:
        return None, {}
    if isinstance(texture, str | Path) and str(texture) and Path(texture).expanduser().is_dir():
        key, folder = f"{which}_texture", Path(texture).expanduser()
        maps = at(key, lambda: maps_in_folder(folder, notes))
        laid = at(key, lambda: texture_of(maps, notes))
        if laid is not None:  # as on what it is laid asks
            del laid["mapping"]
        return laid, maps
    named = pattern(texture) if isinstance(texture, str) else None
    if named is not None:
        table, note = named
        notes += [note] if note else []
        return table, {}
    return _table(f"{which}_texture", texture), {}


def _upright(table: dict[str, Any], which: str, mesh: Mesh, notes: list[str]) -> Mesh:
    """Return a mesh turned such that the axis that its file states as upwards is along z."""
    if mesh.up not in _TURNS or "quaternion" in table:
        return mesh
    table["quaternion"] = list(_TURNS[mesh.up])
    notes.append(
        f"its {mesh.up} axis points upwards, as the file states: turned to z; "
        "quaternion=1,0,0,0 keeps it"
    )
    return body_mesh(table, which, None) or mesh


def _near_origin(table: dict[str, Any], which: str, mesh: Mesh, notes: list[str]) -> Mesh:
    """Return a mesh moved to the origin if it lies far from it, where MJCF has few digits."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    middle = 0.5 * (low + high)
    far = float(np.abs(middle).max())
    if far <= _FAR * float((high - low).max()) or "position" in table:
        return mesh
    table["position"] = [-float(x) for x in middle]
    notes.append(f"it lies {length(far)} from the origin: moved there")
    return body_mesh(table, which, None) or mesh


def _table(key: str, source: File) -> dict[str, Any]:
    """Return a path or a mapping as a table; the path absolute."""
    table: Any = {"file": str(source)} if isinstance(source, Path) else source
    if isinstance(source, str):
        table = file_table(source)
    require_table(table, key)
    out = dict(table)
    if isinstance(out.get("file"), str | Path):
        path = Path(out["file"]).expanduser().absolute()
        if not path.is_file():
            valid = _PATTERN if key.endswith("_texture") else _SOLID
            is_folder = bool(str(out["file"])) and path.is_dir()
            what = "this is a folder" if is_folder else "no such file"
            raise AsperityError(f"{key}: {what}: {str(out['file'])[-120:]}; valid: {valid}")
        out["file"] = str(path)
    return out


def _with_mapping(
    texture: dict[str, Any], table: dict[str, Any], mesh: Mesh, key: str, notes: list[str]
) -> Mesh:
    """Set how a texture is laid where that is not said; return the mesh, maybe with an atlas."""
    wanted = texture.get("mapping", "uv" if "file" in texture else "triplanar")
    if wanted == "uv" and mesh.uv is None and "mapping" not in texture and has_size(texture):
        wanted = "triplanar"
        notes.append(
            "the mesh has no texture coordinates: mapping triplanar, which keeps the size of "
            f"{Path(texture['file']).name}"
        )
    elif wanted == "uv" and mesh.uv is None:
        if importlib.util.find_spec("xatlas") is not None:
            table["atlas"] = True
            mesh = body_mesh(table, key.removesuffix("_texture"), None) or mesh
            notes.append("the mesh has no texture coordinates: an atlas was made")
        elif "mapping" not in texture:
            wanted = "triplanar"
            notes.append(
                "the mesh has no texture coordinates, and xatlas, which makes some, is not "
                "installed (pip install 'asperity[bake]'): mapping triplanar"
            )
    texture["mapping"] = wanted
    return mesh


def _xml(name: str, parts: Mapping[str, _Part], place: Array) -> str:
    """Return the MJCF with the tool at a place."""
    corners = np.concatenate(
        [parts["target"].triangles.reshape(-1, 3), parts["tool"].triangles.reshape(-1, 3) + place]
    )
    geoms = {key: part.geoms for key, part in parts.items()}
    return model_around(
        name,
        (corners.min(axis=0), corners.max(axis=0)),
        note=_NOTE,
        compiler=' boundmass="1e-12" boundinertia="2e-15"',
        assets="\n".join(part.assets for part in parts.values()),
        bodies=_BODIES.format(place=" ".join(f"{value:.9g}" for value in place), **geoms),
    )
