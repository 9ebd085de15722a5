"""A file on a machined part, after colour plate 6 of Otaduy & Lin (2004).

The paper prints no sizes; all sizes here were chosen for this package. The part, a flange with a
boss, stands on a smooth table, its underside on z = 0. The file lies flat on top of the boss; its
frame is on its middle plane where the blade begins, x along the blade to its point, z up. It is
pushed to and fro along its blade, at an angle to the part's long side.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.scene.mesh import mesh_and_pieces
from asperity.scene.mjcf import mesh_assets, mesh_geoms
from asperity.scene.scene import Scene, scene_of

STEEL, WOOD = 7850.0, 700.0
"""Densities of the blade and the part, and of the file's handle [kg/m^3]."""
METAL, HANDLE = "0.42 0.55 0.72 1", "0.72 0.50 0.30 1"
YAW = float(np.radians(20.0))
"""Angle from the part's long side to the file [rad]."""
STROKE = 0.04
"""Length of a stroke [m]."""
BLADE_LENGTH, BLADE_THICKNESS = 0.120, 0.0040
"""Of the shipped file [m]."""
BOSS_TOP = 0.022
"""Height of the shipped part [m]."""
_TILE, _PIXEL = 0.033, 1.65e-4
"""Of the part's texture [m]; two triangles a texel make the 658,000 of the paper's full detail."""
MACHINED: dict[str, Any] = {
    "kind": "brushed", "size": _TILE, "pixel_size": _PIXEL, "rms": 6e-6,
    "length": 0.012, "width": 6 * _PIXEL, "seed": 6,
}  # fmt: skip
"""Marks of machining along the part's long side."""
_PITCH = 1.55e-3
"""Distance between teeth [m], a coarse cut. With 8 samples a tooth, the fewest that a spline
follows, the pixels on the cut faces make the 286,000 triangles of the paper's full detail."""
TEETH: dict[str, Any] = {
    "kind": "cross_cut", "pitch": _PITCH, "second_pitch": _PITCH, "height": 2.5e-4,
    "samples": 8, "periods": 12, "variation": 0.2, "seed": 3,
}  # fmt: skip
"""Teeth of a double cut, steep towards the point."""

_XML = """<mujoco model="file-cad">
  <!-- Metres and kilograms. The tool's frame is where its blade begins, on its middle plane. Geoms
       in group 2 are the shapes, for display; group 3 holds the convex pieces that collide. -->
  <visual>
    <map znear="0.001"/>
  </visual>
  <statistic extent="0.3" center="-0.05 -0.02 0.02"/>
  <asset>
{assets}
  </asset>
  <worldbody>
    <light pos="0.1 -0.3 0.5" dir="-0.2 0.5 -0.8"/>
    <body name="table">
      <geom name="top" type="plane" size="0 0 0.01" rgba="0.90 0.89 0.87 1"/>
    </body>
    <body name="part">
{part}
    </body>
    <body name="file" pos="{place}" quat="{turn}">
      <freejoint name="hand"/>
{file}
    </body>
  </worldbody>
</mujoco>
"""


def file_cad() -> Scene:
    """Return the scene of a double-cut file on a machined part."""
    meshes: dict[str, dict[str, Any]] = {
        "part": {"kind": "cad_part"},
        "file": {"kind": "file_tool"},
    }
    assets, geoms = [], {}
    for name, colour in (("part", "0.80 0.74 0.63 1"), ("file", METAL)):
        mesh, pieces = mesh_and_pieces(meshes[name], f"bodies.{name}.mesh")
        # The blade lies at x > 0, the handle before it.
        wooden = [name == "file" and piece[:, 0].max() < -0.01 for piece in pieces]
        assets.append(mesh_assets(name, mesh, pieces))
        geoms[name] = mesh_geoms(
            name, mesh,
            density=[WOOD if wood else STEEL for wood in wooden],
            rgba=[HANDLE if wood else colour for wood in wooden],
        )  # fmt: skip
    along = np.array([np.cos(YAW), np.sin(YAW), 0.0])
    # In the middle of the stroke the middle of the blade is over the boss.
    place = -(0.5 * BLADE_LENGTH + 0.5 * STROKE) * along
    place[2] = BOSS_TOP + 0.5 * BLADE_THICKNESS + 5e-4
    xml = _XML.format(
        assets="\n".join(assets),
        place=" ".join(f"{x:.9g}" for x in place),
        turn=f"{np.cos(0.5 * YAW):.12g} 0 0 {np.sin(0.5 * YAW):.12g}",
        **geoms,
    )
    document = {
        "schema": 1,
        "tool": {"body": "file"},
        "bodies": {
            "part": {"mesh": meshes["part"], "texture": {**MACHINED, "mapping": "uv"}},
            "file": {"mesh": meshes["file"], "texture": {**TEETH, "mapping": "uv"}},
        },
        "force": {"stiffness": 400.0, "anti_alias": "tick", "max_nodes": 1000},
        "coupling": {"mode": "direct"},
        "trajectory": {
            "kind": "slide", "seconds": 2.0, "speed": 0.08, "length": STROKE, "direction": YAW,
        },
    }  # fmt: skip
    return scene_of(xml, document, name="file-cad")
