"""A file on a machined part, after colour plate 6 of Otaduy & Lin (2004).

The paper prints no sizes; all sizes here were chosen for this package. The part, a flange with a
boss, stands on a smooth table, its underside on z = 0. The file lies flat on top of the boss; its
frame is on its middle plane where the blade begins, x along the blade to its point, z up. It is
pushed to and fro along its blade, at an angle to the part's long side.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.scene.mesh import HANDLE, STEEL, body_elements
from asperity.scene.mjcf import MODEL
from asperity.scene.scene import Scene, scene_of

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

_NOTE = """The tool's frame is where its blade begins, on its middle plane. Geoms
       in group 2 are the shapes, for display; group 3 holds the convex pieces that collide."""
_BODIES = """    <body name="table">
      <geom name="top" type="plane" size="0 0 0.01" rgba="0.90 0.89 0.87 1"/>
    </body>
    <body name="part">
{part}
    </body>
    <body name="file" pos="{place}" quat="{turn}">
      <freejoint name="hand"/>
{file}
    </body>"""


def file_cad() -> Scene:
    """Return the scene of a double-cut file on a machined part."""
    meshes: dict[str, dict[str, Any]] = {
        "part": {"kind": "cad_part"},
        "file": {"kind": "file_tool"},
    }
    # The blade lies at x > 0, the handle before it.
    part = body_elements("part", meshes["part"], (STEEL[0], "0.80 0.74 0.63 1"))
    file = body_elements(
        "file", meshes["file"], lambda p: STEEL if p[:, 0].max() >= -0.01 else HANDLE
    )
    along = np.array([np.cos(YAW), np.sin(YAW), 0.0])
    # In the middle of the stroke the middle of the blade is over the boss.
    place = -(0.5 * BLADE_LENGTH + 0.5 * STROKE) * along
    place[2] = BOSS_TOP + 0.5 * BLADE_THICKNESS + 5e-4
    bodies = _BODIES.format(
        part=part[1],
        file=file[1],
        place=" ".join(f"{x:.9g}" for x in place),
        turn=f"{np.cos(0.5 * YAW):.12g} 0 0 {np.sin(0.5 * YAW):.12g}",
    )
    xml = MODEL.format(
        name="file-cad", note=_NOTE, compiler="", extent=0.3, centre="-0.05 -0.02 0.02",
        light="0.1 -0.3 0.5", assets=f"{part[0]}\n{file[0]}", bodies=bodies,
    )  # fmt: skip
    document = {
        "schema": 1,
        "tool": {"body": "file"},
        "bodies": {
            "part": {"mesh": meshes["part"], "texture": {**MACHINED, "mapping": "uv"}},
            "file": {"mesh": meshes["file"], "texture": {**TEETH, "mapping": "uv"}},
        },
        "force": {"stiffness": 400.0, "anti_alias": "tick", "max_nodes": 4000},
        "trajectory": {
            "kind": "slide", "seconds": 2.0, "speed": 0.08, "length": STROKE, "direction": YAW,
        },
    }  # fmt: skip
    return scene_of(xml, document, name="file-cad")
