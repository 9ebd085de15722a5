"""The paper's colour plate 5: a hammer on striped blocks.

The paper prints no sizes; all are asperity's. Three blocks of different lengths, heights and
stripes stand in a row on a smooth table. The hammer strikes face down: its frame is the middle of
its face, z up through the head, the handle towards -x. So its position is where the face is, and
without a turn it stands upright on what it meets. It is rubbed along the first block, across the
stripes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from asperity.geometry.shapes.block import BLOCKS
from asperity.geometry.shapes.hammer import FACE_TIP, TEXTURE
from asperity.scene import Scene, scene_of
from asperity.scene_mesh import body_mesh, body_pieces
from asperity.scene_mjcf import mesh_assets, mesh_geoms

STEEL, WOOD = 7850.0, 700.0
"""Densities of head and handle [kg/m^3]."""
GAP = 0.008
"""Between blocks [m]."""
_UPRIGHT = (float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0)
"""From the maker's frame, the face towards +x, to the face downwards."""

_XML = """<mujoco model="hammer-blocks">
  <!-- Metres and kilograms. The tool's frame is the middle of its striking face. Geoms in group 2
       are the shapes, only seen; those in group 3 the convex pieces that may touch. -->
  <visual>
    <map znear="0.001"/>
  </visual>
  <statistic extent="0.3" center="-0.08 0.03 0.04"/>
  <asset>
{assets}
  </asset>
  <worldbody>
    <light pos="0.1 -0.3 0.5" dir="-0.2 0.5 -0.8"/>
    <body name="table" pos="-0.08 0.045 -0.005">
      <geom name="top" type="box" size="0.26 0.16 0.005" rgba="0.86 0.85 0.83 1"/>
    </body>
{blocks}
    <body name="hammer" pos="{x:.9g} 0 {z:.9g}">
      <freejoint name="hand"/>
{hammer}
    </body>
  </worldbody>
</mujoco>
"""
_BLOCK = """    <body name="{name}" pos="0 {y:.9g} {z:.9g}">
{geoms}
    </body>"""
_COLOURS = ("0.80 0.66 0.47 1", "0.74 0.56 0.38 1", "0.84 0.73 0.56 1")


def hammer_blocks() -> Scene:
    """Return the scene of a textured hammer on three striped blocks."""
    hammer: dict[str, Any] = {
        "kind": "hammer", "position": [0.0, 0.0, FACE_TIP], "quaternion": list(_UPRIGHT),
    }  # fmt: skip
    bodies: dict[str, Any] = {
        "hammer": {"mesh": hammer, "texture": {**TEXTURE, "mapping": "uv"}},
    }
    assets, blocks, y = [], [], -0.5 * BLOCKS[0].size[1]
    for i, made in enumerate(BLOCKS):
        name = f"block-{i + 1}"
        length, width, height = made.size
        mesh = {
            "kind": "block", "length": length, "width": width, "height": height,
            "uv_size": list(made.uv_size),
        }  # fmt: skip
        bodies[name] = {"mesh": mesh, "texture": {**made.texture, "mapping": "uv"}}
        part, geoms = _mjcf(name, mesh, _COLOURS[i % len(_COLOURS)])
        assets.append(part)
        blocks.append(
            _BLOCK.format(name=name, y=y + 0.5 * width, z=0.5 * height, geoms=geoms)
        )
        y += width + GAP
    part, geoms = _mjcf("hammer", hammer, "0.42 0.55 0.72 1")
    length, _, height = BLOCKS[0].size
    xml = _XML.format(
        assets="\n".join([*assets, part]),
        blocks="\n".join(blocks),
        hammer=geoms,
        x=-0.25 * length,
        z=height + 5e-4,
    )
    document = {
        "schema": 1,
        "tool": {"body": "hammer"},
        "bodies": bodies,
        "force": {"stiffness": 400.0, "anti_alias": "tick"},
        "coupling": {"mode": "direct"},
        "trajectory": {
            "kind": "slide", "seconds": 2.0, "speed": 0.05, "length": 0.5 * length,
            "press_force": 2.0,
        },
    }  # fmt: skip
    return scene_of(xml, document, name="hammer-blocks")


def _mjcf(name: str, table: dict[str, Any], rgba: str) -> tuple[str, str]:
    """Return the assets and the geoms of a body with a made mesh."""
    mesh = body_mesh(table, f"bodies.{name}.mesh", None)
    assert mesh is not None
    pieces = body_pieces(table, f"bodies.{name}.mesh", mesh)
    # The head reaches from the face to the ball, above the frame; the handle away to -x.
    density = [WOOD if piece[:, 0].min() < -0.02 else STEEL for piece in pieces]
    return (
        mesh_assets(name, mesh, pieces),
        mesh_geoms(name, mesh, len(pieces), density=density, rgba=rgba),
    )
