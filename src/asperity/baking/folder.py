"""The folder that baking writes: a scene, readable by other programs too.

`object.obj` with texture coordinates, `heights.tiff` in metres (32-bit floats), and the scene:
`scene.xml` for MuJoCo and `scene.toml`. The object is at rest in its own frame, z upwards; a probe
slides over it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity._core.arrays import Array
from asperity.baking.place import PRESSED, Stroke
from asperity.geometry.mesh.files import read_mesh
from asperity.geometry.mesh.mesh import Mesh
from asperity.scene.document import write_toml
from asperity.scene.mjcf import mesh_assets, mesh_geoms, model_around

OBJECT, MESH, HEIGHTS = "object", "object.obj", "heights.tiff"
STIFFNESS = 400.0
"""Contact stiffness [N/m], which a 3D Systems Touch can render."""
FORCE = 0.58
"""Largest normal force with which the motion begins [N]."""
MAX_NODES = 50_000
"""Limit of the contact search. Heights that include the shape lost by simplification are large, and
large heights make bounds loose: with the usual budget a contact may be missed."""
_COLOUR = "0.8 0.74 0.63 1"

_NOTE = (
    "Geoms in group 2 are the shape, for display; group 3 holds the convex pieces that collide. "
    "The probe's frame is the centre of its tip; texture, force and motion are in scene.toml."
)
_BODIES = """    <body name="object">
{geoms}
    </body>
    <body name="probe" pos="{start}">
      <freejoint name="hand"/>
      <geom name="tip" type="sphere" size="{radius:.9g}" mass="0.001" rgba="0.42 0.55 0.72 1"/>
      <geom name="shaft" type="capsule" fromto="0 0 {shaft:.9g} 0 0 {neck:.9g}" size="{thin:.9g}"
            mass="0.004" rgba="0.42 0.55 0.72 1"/>
      <geom name="grip" type="capsule" fromto="0 0 {neck:.9g} 0 0 {end:.9g}" size="{thick:.9g}"
            mass="0.045" rgba="0.2 0.2 0.22 1"/>
    </body>"""


class Texture(NamedTuple):
    """Heights [m] (n, m), [iv, iu], row 0 at v = 0, and the size that they cover (u, v) [m]."""

    heights: NDArray[np.float32]
    size: tuple[float, float]


def write_mesh(mesh: Mesh, folder: Path, hard_angle: float) -> Mesh:
    """Write the mesh and return it as read back; heights are baked over the result.

    Nine digits are kept; the normals along which the texture displaces follow from them.
    """
    assert mesh.uv is not None
    lines = ["# metres; texture coordinates over heights.tiff, v upwards"]
    lines += ["v {:.9g} {:.9g} {:.9g}".format(*row) for row in mesh.vertices.tolist()]
    places, number = np.unique(mesh.uv.reshape(-1, 2), axis=0, return_inverse=True)
    lines += ["vt {:.9g} {:.9g}".format(*row) for row in places.tolist()]
    corners = np.stack([mesh.faces, number.reshape(-1, 3)], axis=2) + 1
    lines += [
        "f " + " ".join(f"{vertex}/{place}" for vertex, place in face) for face in corners.tolist()
    ]
    (folder / MESH).write_text("\n".join(lines) + "\n", "utf-8")
    return read_mesh(folder / MESH, hard_angle=hard_angle)


def write_heights(texture: Texture, folder: Path) -> None:
    """Write the heights, with v = 1 at the top of the image."""
    import tifffile

    pixels = np.ascontiguousarray(texture.heights[::-1], dtype=np.float32)
    description = "heights in metres along the interpolated unit vertex normals; bottom row: v = 0"
    tifffile.imwrite(folder / HEIGHTS, pixels, description=description, compression="zlib")


def write_scene(
    name: str, mesh: Mesh, pieces: Sequence[Array], texture: Texture, stroke: Stroke, folder: Path,
    hard_angle: float,
) -> None:  # fmt: skip
    """Write `scene.xml` and `scene.toml` for the mesh and heights in the folder."""
    (folder / "scene.xml").write_text(_xml(name, mesh, pieces, stroke), "utf-8")
    table: dict[str, Any] = {"file": MESH, "unit": "m", "hard_angle": hard_angle}
    heights = {
        "file": HEIGHTS, "unit": "m", "size": [float(s) for s in texture.size],
        "border": "clamp", "mapping": "uv",
    }  # fmt: skip
    trajectory: dict[str, Any] = {
        "kind": "slide", "seconds": 2.0, "speed": min(0.083, max(4.0 * stroke.length, 1e-3)),
        "length": stroke.length, "direction": stroke.direction,
        "press_force": min(FORCE, STIFFNESS * PRESSED * stroke.radius),
    }  # fmt: skip
    document = {
        "schema": 1,
        "tool": {"body": "probe"},
        "bodies": {OBJECT: {"mesh": table, "texture": heights}},
        "force": {"stiffness": STIFFNESS, "anti_alias": "tick", "max_nodes": MAX_NODES},
        "trajectory": trajectory,
    }
    (folder / "scene.toml").write_text(write_toml(document), "utf-8")


def _xml(name: str, mesh: Mesh, pieces: Sequence[Array], stroke: Stroke) -> str:
    radius = stroke.radius
    bodies = _BODIES.format(
        geoms=mesh_geoms(
            OBJECT, mesh, density=[1000.0] * len(pieces), rgba=[_COLOUR] * len(pieces)
        ),
        start=" ".join(f"{value:.9g}" for value in stroke.start),
        radius=radius,
        shaft=0.5 * radius,
        neck=radius * 80.0 / 3.0,
        end=radius * 220.0 / 3.0,
        thin=0.6 * radius,
        thick=radius * 8.0 / 3.0,
    )
    return model_around(
        name,
        (mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)),
        note=_NOTE,
        assets=mesh_assets(OBJECT, mesh, pieces),
        bodies=bodies,
    )
