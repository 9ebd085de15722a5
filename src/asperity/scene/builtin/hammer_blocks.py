"""A hammer on striped blocks, after colour plate 5 of Otaduy & Lin (2004).

The paper prints no sizes; all sizes here were chosen for this package. Three blocks of different
lengths, heights and stripes stand in a row on a smooth table. The hammer strikes face down: its
frame is the middle of its face, z up through the head, the handle towards -x. So its position is
that of the face, and the identity rotation stands it upright on a surface. It is rubbed along the
first block, across the stripes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from asperity.scene.mesh import HANDLE, STEEL, body_elements
from asperity.scene.mjcf import MODEL
from asperity.scene.scene import Scene, scene_of

WOOD = 700.0
"""Density of the blocks [kg/m^3]."""
GAP = 0.008
"""Between blocks [m]."""
FACE_TIP = 0.0479
"""Distance from the shipped hammer's origin to the middle of its face [m]."""
_PIXEL = 3.6e-4
"""Pixel of the hammer's texture [m]: two triangles each make the 433,000 of the paper's model."""
FORGED: dict[str, Any] = {
    "kind": "rough", "size": 0.036, "pixel_size": _PIXEL, "hurst": 0.8,
    "rms_slope": 0.06, "rolloff": 0.008, "cutoff": 5 * _PIXEL, "seed": 5,
}  # fmt: skip
"""Forged and worn steel."""


class StripedBlock(NamedTuple):
    """Size and texture of one of the blocks."""

    size: tuple[float, float, float]
    """Length, width, height [m]."""
    texture: dict[str, Any]
    """As in `scene.toml`."""
    uv_size: tuple[float, float]
    """Size of the texture's tile [m]."""


BLOCKS = (
    StripedBlock(
        (0.060, 0.040, 0.030),
        {"kind": "grating", "pitch": 3e-3, "height": 3e-4, "width": 1.5e-3, "fillet": 3e-4},
        (0.024, 0.024),
    ),
    StripedBlock(
        (0.040, 0.040, 0.020),
        {"kind": "grating", "pitch": 2e-3, "height": 3e-4, "width": 1e-3, "fillet": 2.5e-4},
        (0.016, 0.016),
    ),
    StripedBlock(
        (0.080, 0.030, 0.015),
        {"kind": "stripes", "pitch": 4e-3, "depth": 3e-4, "width": 2.4e-3, "fillet": 4e-4},
        (0.032, 0.032),
    ),
)
"""Three blocks of different size and pitch; the stripes run across their length."""
_UPRIGHT = (float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0)
"""Rotation from the mesh's frame, its face towards +x, to face down."""

_NOTE = """The tool's frame is the middle of its striking face. Geoms in group 2
       are the shapes, for display; group 3 holds the convex pieces that collide."""
_BODIES = """    <body name="table">
      <geom name="top" type="plane" size="0 0 0.01" rgba="0.90 0.89 0.87 1"/>
    </body>
{blocks}
    <body name="hammer" pos="{x:.9g} 0 {z:.9g}">
      <freejoint name="hand"/>
{hammer}
    </body>"""
_BLOCK = """    <body name="{name}" pos="0 {y:.9g} {z:.9g}">
{geoms}
    </body>"""
_COLOURS = ("0.84 0.72 0.53 1", "0.76 0.60 0.42 1", "0.88 0.79 0.63 1")


def hammer_blocks() -> Scene:
    """Return the scene of a textured hammer on three striped blocks."""
    hammer: dict[str, Any] = {
        "kind": "hammer", "position": [0.0, 0.0, FACE_TIP], "quaternion": list(_UPRIGHT),
    }  # fmt: skip
    bodies: dict[str, Any] = {"hammer": {"mesh": hammer, "texture": {**FORGED, "mapping": "uv"}}}
    # The head lies above the face, the handle away towards -x.
    part, geoms = body_elements(
        "hammer", hammer, lambda p: HANDLE if p[:, 0].min() < -0.02 else STEEL
    )
    assets, blocks = [part], list[str]()
    y = -0.5 * BLOCKS[0].size[1]
    for block, colour in zip(BLOCKS, _COLOURS, strict=True):
        name = f"block-{len(blocks) + 1}"
        length, width, height = block.size
        mesh = {
            "kind": "block", "length": length, "width": width, "height": height,
            "uv_size": list(block.uv_size),
        }  # fmt: skip
        bodies[name] = {"mesh": mesh, "texture": {**block.texture, "mapping": "uv"}}
        part, solids = body_elements(name, mesh, (WOOD, colour))
        assets.append(part)
        blocks.append(_BLOCK.format(name=name, y=y + 0.5 * width, z=0.5 * height, geoms=solids))
        y += width + GAP
    length, _, height = BLOCKS[0].size
    xml = MODEL.format(
        name="hammer-blocks", note=_NOTE, compiler="", extent=0.3, centre="-0.08 0.03 0.04",
        light="0.1 -0.3 0.5", assets="\n".join(assets),
        bodies=_BODIES.format(
            blocks="\n".join(blocks), hammer=geoms, x=-0.25 * length, z=height + 5e-4
        ),
    )  # fmt: skip
    document = {
        "schema": 1,
        "tool": {"body": "hammer"},
        "bodies": bodies,
        "force": {"stiffness": 400.0, "anti_alias": "tick", "max_nodes": 4000},
        "trajectory": {"kind": "slide", "seconds": 2.0, "speed": 0.05, "length": 0.5 * length},
    }
    return scene_of(xml, document, name="hammer-blocks")
