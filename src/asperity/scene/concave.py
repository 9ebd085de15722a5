"""Concave meshes of a user's MJCF, cut into convex pieces.

MuJoCo collides a mesh as its convex hull, so that a tool would be in contact in an empty cavity.
The surface that is felt stays that of the mesh; the pieces only say where it may touch.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.geometry.mesh.checks import count_of
from asperity.geometry.mesh.mesh import mesh_from_arrays
from asperity.scene.document import at
from asperity.scene.mjcf import model_mesh, touchable_geoms

Array = NDArray[np.float64]
_PIECES_GROUP = 3


def with_convex_pieces(
    xml: str, model: mujoco.MjModel, spec: Any = None
) -> tuple[mujoco.MjModel, tuple[str, ...]]:
    """Return a model in which no geom that can be touched is a concave mesh, and notes.

    A concave mesh geom stays, is only seen, and keeps its mass; its pieces, in group 3, have none.

    Parameters
    ----------
    xml : str
        MJCF that refers to no files.
    model : mujoco.MjModel
        Compiled from it; returned if nothing is to be cut.
    spec : mujoco.MjSpec, optional
        Of the model, if it is not that of `xml`.

    Raises
    ------
    AsperityError
        A mesh is concave and CoACD is not installed (`pip install 'asperity[bake]'`), or fails.
    """
    owner = {
        number: body
        for body, geoms in touchable_geoms(model).items()
        for number, geom in geoms
        if geom.kind == "mesh"
    }
    if not owner:
        return model, ()
    from asperity.geometry.convex.pieces import CONVEX_UP_TO, is_convex  # slow to import

    meshes = {int(model.geom_dataid[number]) for number in owner}
    concave = {i for i in meshes if not is_convex(*model_mesh(model, i), CONVEX_UP_TO)}
    if not concave:
        return model, ()
    spec = mujoco.MjSpec.from_string(xml) if spec is None else spec
    spec.compile()  # numbers its geoms, until one is added
    spec.compiler.discardvisual = False  # or the mass of the whole mesh would go
    numbered = [(geom, geom.id) for geom in spec.geoms]
    notes = []
    for geom, number in numbered:
        mesh = int(model.geom_dataid[number])
        if number not in owner or mesh not in concave:
            continue
        body, whole = owner[number], geom.meshname
        name = f"geom {geom.name!r}" if geom.name else f"the geom of mesh {whole!r}"
        pieces = at(f"body {body!r}, {name}", partial(_pieces, model, mesh, whole))
        place = model.geom_pos[number], model.geom_quat[number]
        for i, piece in enumerate(pieces, start=1):
            _add_piece(spec, geom, f"{whole}-{number}-piece-{i}", piece, place)
        geom.contype = geom.conaffinity = 0
        notes.append(
            f"{body}: {name} is concave: cut into {count_of(len(pieces), 'convex piece')}, where "
            "it may touch; its surface is that of the mesh"
        )
    return spec.compile(), tuple(notes)


def _pieces(model: mujoco.MjModel, number: int, name: str) -> tuple[Array, ...]:
    """Return the convex pieces of a mesh of a model, in its frame."""
    from asperity.geometry.convex.pieces import convex_pieces  # slow to import

    return convex_pieces(mesh_from_arrays(*model_mesh(model, number), name=name))


def _add_piece(spec: Any, geom: Any, name: str, piece: Array, place: tuple[Array, Array]) -> None:
    """Add a convex piece (n, 3) of a geom's mesh to its body, as a geom without mass.

    `place` is the position and quaternion of the mesh in the body's frame.
    """
    mesh = spec.add_mesh(name=name, uservert=piece.ravel().tolist())
    # Defaults of the file are for its own meshes and geoms.
    mesh.scale, mesh.refpos, mesh.refquat = [1.0] * 3, [0.0] * 3, [1.0, 0.0, 0.0, 0.0]
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    added = geom.parent.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, mass=0.0, group=_PIECES_GROUP,
        pos=place[0], quat=place[1],
    )  # fmt: skip
    for key in ("contype", "conaffinity", "condim", "margin", "gap", "friction", "rgba"):
        setattr(added, key, getattr(geom, key))
