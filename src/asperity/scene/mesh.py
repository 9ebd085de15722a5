"""A body's mesh, as `scene.toml` describes it: from a file, or made by its kind.

Geoms of type mesh say where a body may touch: they are its convex pieces. Its surface is the
mesh, in the body's frame. MuJoCo moves every mesh so that its middle is at 0 and its axes are
those of its inertia; what is here stays where it was.
"""

from __future__ import annotations

import inspect
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from asperity._core.arrays import Array, Indices, Mask
from asperity.errors import AsperityError, require_finite
from asperity.geometry.bodies import Geom, unit_quaternion
from asperity.geometry.mesh.atlas import with_atlas
from asperity.geometry.mesh.files import companions, read_mesh
from asperity.geometry.mesh.mesh import Mesh, mesh_from_arrays
from asperity.geometry.mesh.normals import HARD_ANGLE
from asperity.geometry.mesh.topology import crosses, gradients
from asperity.geometry.poses import rotation_of
from asperity.geometry.shapes.block import block
from asperity.geometry.shapes.shape import Shape, cad_part, file_tool, hammer
from asperity.scene.document import Table, arguments, at, find_file, make_by_kind, parse_options
from asperity.scene.mjcf import mesh_assets, mesh_geoms, model_mesh
from asperity.texture.files.loading import contents_kept
from asperity.texture.height_field import HeightField

MESHES: dict[str, Callable[..., Shape]] = {
    maker.__name__: maker for maker in (hammer, block, file_tool, cad_part)
}
"""All makers of meshes by name, as scenes name them."""
Material = tuple[float, str]
"""Density [kg/m^3] and colour."""
STEEL: Material = (7850.0, "0.42 0.55 0.72 1")
HANDLE: Material = (700.0, "0.72 0.50 0.30 1")
"""Of tools: their metal, and their handles of wood."""
_KNOWN: ContextVar[dict[tuple[object, ...], Mesh] | None] = ContextVar("_KNOWN", default=None)
"""Meshes of files by path and options, within `files_read_once`."""
_ALIKE = 0.25
"""By how much, in diagonals of the mesh, it and its pieces may be apart."""
_LARGER = 3.0
"""How many times as large as a mesh the boxes round its pieces may be."""
_STRETCHED = 1.5
"""Times its own length over which coordinates may lay a map without a note."""


def geoms_mesh(
    model: mujoco.MjModel, name: str, geoms: Sequence[tuple[int, Geom]], table: Table, key: str,
    folder: Path | None,
) -> Mesh | None:  # fmt: skip
    """Return the mesh of a body of geoms of type mesh, None for one of simple geoms.

    Parameters
    ----------
    model : mujoco.MjModel
    name : str
        Of the body.
    geoms : sequence of (int, Geom)
        Its geoms and their numbers in the model.
    table : mapping
        Its mesh table in `scene.toml`.
    key : str
        The table's dotted key.
    folder : Path or None
        Where the table's file lies.
    """
    simple = [geom.kind for _, geom in geoms if geom.kind != "mesh"]
    if len(simple) == len(geoms) and not table:
        return None
    if simple:
        raise AsperityError(
            f"{key if table else f'body {name!r}'}: the geoms of a body with a mesh are all of "
            f"type mesh, but scene.xml has a {simple[0]}; put it into a separate body"
        )
    mesh = body_mesh(table, key, folder)
    if mesh is None:
        return at(f"body {name!r}", lambda: union_mesh(model, name, [i for i, _ in geoms]))
    check_pieces(mesh, [geom for _, geom in geoms], key)
    return mesh


def copy_with_companions(source: Path, target: Path) -> None:
    """Copy a file, and those that it names beside or below itself, which keep their names."""
    shutil.copyfile(source, target)
    for file in companions(source):
        copy = target.parent / file.relative_to(source.parent)
        if not copy.exists():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)


def body_mesh(table: Table, key: str, folder: Path | None) -> Mesh | None:
    """Return the mesh that `[bodies.NAME.mesh]` describes, None for an empty table.

    Parameters
    ----------
    table : mapping
    key : str
        Its dotted key.
    folder : Path or None
        Where its file lies.
    """
    if not table:
        return None
    if "file" in table:
        mesh = _mesh_of_file(table, key, folder)
    elif "kind" in table:
        shape = _shape(table, key)
        arrays = (shape.vertices, shape.faces)
        mesh = at(key, lambda: mesh_from_arrays(*arrays, normals=shape.normals, name=table["kind"]))
        # Its texture coordinates overlap and leave 0..1 as they were made to: no notes on that.
        mesh = replace(mesh, uv=shape.uv, notes=())
    else:
        raise AsperityError(f"{key} needs either kind (one of: {', '.join(MESHES)}) or file")
    turn, position = _place(table, key)
    return replace(mesh, vertices=mesh.vertices @ turn.T + position, normals=mesh.normals @ turn.T)


def body_pieces(table: Table, key: str, mesh: Mesh) -> tuple[Array, ...]:
    """Return the vertices (n, 3) of the convex pieces of a mesh that `body_mesh` returned."""
    if "kind" not in table:
        from asperity.geometry.convex.pieces import convex_pieces  # slow to import

        return at(key, lambda: convex_pieces(mesh))
    turn, position = _place(table, key)
    return tuple(np.asarray(piece) @ turn.T + position for piece in _shape(table, key).pieces)


def mesh_and_pieces(table: Table, key: str) -> tuple[Mesh, tuple[Array, ...]]:
    """Return the mesh that a table describes, and the vertices of its convex pieces."""
    mesh = body_mesh(table, key, None)
    if mesh is None:
        raise AsperityError(f"{key} is empty; it needs file or kind ({', '.join(MESHES)})")
    return mesh, body_pieces(table, key, mesh)


def body_elements(
    name: str, table: Table, material: Material | Callable[[Array], Material]
) -> tuple[str, str]:
    """Return the MJCF of a body's mesh: its assets and its geoms.

    Parameters
    ----------
    name : str
        Of the body.
    table : mapping
        What `[bodies.NAME.mesh]` holds.
    material : (float, str) or callable
        Density [kg/m^3] and colour; or a function that returns those of a convex piece, given its
        vertices (n, 3) [m].
    """
    mesh, pieces = mesh_and_pieces(table, f"bodies.{name}.mesh")
    of_pieces = [material(piece) if callable(material) else material for piece in pieces]
    density, rgba = zip(*of_pieces, strict=True)
    return mesh_assets(name, mesh, pieces), mesh_geoms(name, mesh, density=density, rgba=rgba)


def _shape(table: Table, key: str) -> Shape:
    """Return what the maker named by `kind` makes."""
    shape: Shape = make_by_kind("mesh", MESHES, table, key, _PLACING)
    return shape


def _mesh_of_file(table: Table, key: str, folder: Path | None) -> Mesh:
    given = parse_options(table, key, _file_keys, "file", _PLACING)
    path = find_file(table, key, folder)
    atlas = given.pop("atlas", False)
    known, what = _KNOWN.get(), (path, *sorted(given.items()))
    mesh = known.get(what) if known is not None else None
    if mesh is None:
        mesh = at(key, lambda: read_mesh(path, **given))
    if known is not None:
        known[what] = mesh
    return at(f"{key}.atlas", lambda: with_atlas(mesh)) if atlas else mesh


@contextmanager
def files_read_once() -> Iterator[None]:
    """Read each file of a mesh once within the context, in which files stay as they are.

    One of heights too, if it is read as a texture once.
    """
    token = _KNOWN.set({})
    try:
        with contents_kept():
            yield
    finally:
        _KNOWN.reset(token)


def _file_keys(
    unit: str | None = None, hard_angle: float | None = None, atlas: bool = False
) -> None:
    """Say which keys go with a mesh's file, and their types."""


def _place_keys(
    position: tuple[float, ...] = (0.0, 0.0, 0.0),
    quaternion: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0),
) -> None:
    """Say which keys place a mesh in its body's frame, and their types."""


_PLACING = tuple(inspect.signature(_place_keys).parameters)


def _place(table: Table, key: str) -> tuple[Array, Array]:
    """Return how a mesh is turned (3, 3) and then moved (3,) into its body's frame."""
    place = arguments({k: v for k, v in table.items() if k in _PLACING}, key, _place_keys)
    quaternion = at(key, lambda: unit_quaternion(place.get("quaternion", (1.0, 0.0, 0.0, 0.0))))
    position = at(key, lambda: require_finite("position", place.get("position", (0, 0, 0)), 3))
    return rotation_of(quaternion), np.asarray(position)


def union_mesh(model: mujoco.MjModel, name: str, numbers: Sequence[int]) -> Mesh:
    """Return the mesh that a body's geoms of type mesh make together.

    Parameters
    ----------
    model : mujoco.MjModel
    name : str
        Of the body.
    numbers : sequence of int
        Its geoms in the model.
    """
    vertices: list[Array] = []
    faces: list[Indices] = []
    for i in numbers:
        points, triangles = model_mesh(model, int(model.geom_dataid[i]))
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[i])
        faces.append(triangles + sum(map(len, vertices)))
        vertices.append(points @ turn.reshape(3, 3).T + model.geom_pos[i])
    mesh = mesh_from_arrays(
        np.concatenate(vertices), np.concatenate(faces), hard_angle=HARD_ANGLE, name=name
    )
    note = (
        f"no [bodies.{name}.mesh]: its surface is that of its {len(numbers)} MuJoCo meshes, "
        f"edges hard beyond {HARD_ANGLE:g} degrees"
    )
    if len(numbers) > 1:
        note += ", with the walls between them"
    return replace(mesh, notes=(note, *mesh.notes))


def check_pieces(mesh: Mesh, geoms: Sequence[Geom], key: str) -> None:
    """Refuse a mesh that does not lie where the convex pieces of its body do."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = np.concatenate(
        [signs * g.size @ rotation_of(g.quaternion).T + np.asarray(g.position) for g in geoms]
    )
    of_mesh, of_pieces = (
        np.array([points.min(axis=0), points.max(axis=0)]) for points in (mesh.vertices, corners)
    )
    diagonal = float(np.linalg.norm(of_mesh[1] - of_mesh[0]))
    # Boxes round turned geoms are larger than what they hold: they have to cover the mesh, and not
    # be of another order.
    slack = _ALIKE * diagonal
    covered = (of_mesh[0] > of_pieces[0] - slack).all() and (
        of_mesh[1] < of_pieces[1] + slack
    ).all()
    if not covered or np.linalg.norm(of_pieces[1] - of_pieces[0]) > _LARGER * diagonal:
        boxes = [
            f"({', '.join(f'{1e3 * x:.4g}' for x in low)}) to "
            f"({', '.join(f'{1e3 * x:.4g}' for x in high)}) mm"
            for low, high in (of_mesh, of_pieces)
        ]
        raise AsperityError(
            f"{key}: the mesh reaches from {boxes[0]}, but the geoms of scene.xml from {boxes[1]}; "
            "they must be one body in one frame (is the unit right?)"
        )


def uv_size(mesh: Mesh) -> tuple[float, float]:
    """Return how far one unit of u and one of v reach on a mesh [m], averaged over its area."""
    assert mesh.uv is not None
    triangles, laid = mesh.vertices[mesh.faces], _laid(mesh.uv)
    per_metre = np.linalg.norm(gradients(triangles, mesh.uv), axis=2)  # of u and v, on each
    area = np.linalg.norm(crosses(triangles), axis=1) * laid
    mean = np.average(per_metre, axis=0, weights=area) if laid.any() else np.zeros(2)
    if not (mean > 0.0).all():
        raise AsperityError(f"mesh {mesh.name!r} has texture coordinates that cover no area")
    return 1.0 / float(mean[0]), 1.0 / float(mean[1])


def stretch_note(mesh: Mesh | None, texture: HeightField | None, mapping: str) -> tuple[str, ...]:
    """Return a note if texture coordinates lay a map over another length than it has."""
    if mesh is None or texture is None or mapping != "uv" or len(mesh.materials) > 1:
        return ()  # maps of several materials are laid by their own
    if not has_area(mesh):
        return ()
    laid, own = uv_size(mesh), texture.size
    times = [a / b for a, b in zip(laid, own, strict=True)]
    if all(1.0 / _STRETCHED < ratio < _STRETCHED for ratio in times):
        return ()
    sizes = [" x ".join(f"{1e3 * side:.4g}" for side in pair) for pair in (own, laid)]
    return (
        f"its map is {sizes[0]} mm, but its texture coordinates lay it over {sizes[1]} mm, "
        f"stretched {times[0]:.3g} and {times[1]:.3g} times; mapping 'triplanar' keeps its size",
    )


def has_area(mesh: Mesh) -> bool:
    """Return whether texture coordinates cover some area."""
    return mesh.uv is not None and bool(_laid(mesh.uv).any())


def _laid(uv: Array) -> Mask:
    """Return which triangles cover an area of the texture, (m, 3, 2) -> (m,)."""
    sides = uv[:, 1:] - uv[:, :1]
    cross = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    return np.asarray(np.abs(cross) > 1e-12)
