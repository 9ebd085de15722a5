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
from asperity.scene.mesh import mesh_and_pieces
from asperity.scene.mjcf import mesh_assets, mesh_geoms
from asperity.scene.scene import Scene, scene_of

STEEL, WOOD = 7850.0, 700.0
"""Densities of the head, and of handle and blocks [kg/m^3]."""
METAL, HANDLE = "0.42 0.55 0.72 1", "0.72 0.50 0.30 1"
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
    <body name="table">
      <geom name="top" type="plane" size="0 0 0.01" rgba="0.90 0.89 0.87 1"/>
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
_COLOURS = ("0.84 0.72 0.53 1", "0.76 0.60 0.42 1", "0.88 0.79 0.63 1")


def hammer_blocks() -> Scene:
    """Return the scene of a textured hammer on three striped blocks."""
    hammer: dict[str, Any] = {
        "kind": "hammer", "position": [0.0, 0.0, FACE_TIP], "quaternion": list(_UPRIGHT),
    }  # fmt: skip
    bodies: dict[str, Any] = {"hammer": {"mesh": hammer, "texture": {**TEXTURE, "mapping": "uv"}}}
    part, geoms = _hammer(hammer)
    assets, blocks = [part], list[str]()
    y = -0.5 * BLOCKS[0].size[1]
    for made, colour in zip(BLOCKS, _COLOURS, strict=True):
        name = f"block-{len(blocks) + 1}"
        length, width, height = made.size
        mesh = {
            "kind": "block", "length": length, "width": width, "height": height,
            "uv_size": list(made.uv_size),
        }  # fmt: skip
        bodies[name] = {"mesh": mesh, "texture": {**made.texture, "mapping": "uv"}}
        part, solids = _block(name, mesh, colour)
        assets.append(part)
        blocks.append(_BLOCK.format(name=name, y=y + 0.5 * width, z=0.5 * height, geoms=solids))
        y += width + GAP
    length, _, height = BLOCKS[0].size
    xml = _XML.format(
        assets="\n".join(assets), blocks="\n".join(blocks), hammer=geoms, x=-0.25 * length,
        z=height + 5e-4,
    )  # fmt: skip
    document = {
        "schema": 1,
        "tool": {"body": "hammer"},
        "bodies": bodies,
        "force": {"stiffness": 400.0, "anti_alias": "tick", "max_nodes": 2000},
        "coupling": {"mode": "direct"},
        "trajectory": {"kind": "slide", "seconds": 2.0, "speed": 0.05, "length": 0.5 * length},
    }
    return scene_of(xml, document, name="hammer-blocks")


def _hammer(table: dict[str, Any]) -> tuple[str, str]:
    """Return the assets and the geoms of the hammer."""
    mesh, pieces = mesh_and_pieces(table, "bodies.hammer.mesh")
    # The head lies above the face, the handle away towards -x.
    wooden = [piece[:, 0].min() < -0.02 for piece in pieces]
    density = [WOOD if wood else STEEL for wood in wooden]
    colours = [HANDLE if wood else METAL for wood in wooden]
    return (
        mesh_assets("hammer", mesh, pieces),
        mesh_geoms("hammer", mesh, density=density, rgba=colours),
    )


def _block(name: str, table: dict[str, Any], colour: str) -> tuple[str, str]:
    """Return the assets and the geoms of a block."""
    mesh, pieces = mesh_and_pieces(table, f"bodies.{name}.mesh")
    return (
        mesh_assets(name, mesh, pieces),
        mesh_geoms(name, mesh, density=[WOOD] * len(pieces), rgba=[colour] * len(pieces)),
    )
