"""A spherical probe on a textured plate, after colour plate 4 of Otaduy & Lin (2004).

The paper prints no sizes. Chosen for this package: a tip of 3 mm diameter; waves of 0.1 mm
amplitude and 2 mm length; raised dots and ridges of 0.4 mm height; a stiffness of 400 N/m, which a
3D Systems Touch can render; a drag at 83 mm/s that begins with a normal force of 0.58 N.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from asperity.errors import require_between, require_choice
from asperity.scene.mjcf import MODEL
from asperity.scene.scene import Scene, scene_of

TEXTURES: dict[str, dict[str, Any]] = {
    "sinusoid": {"kind": "sinusoid", "wavelength": 2e-3, "amplitude": 1e-4},
    "jittered_dots": {
        "kind": "jittered_dots", "pitch": 2e-3, "height": 4e-4, "diameter": 8e-4,
        "jitter": 0.5, "seed": 0,
    },
    "grating": {"kind": "grating", "pitch": 2.5e-3, "height": 4e-4, "width": 1e-3},
}  # fmt: skip
"""The textures of the three plates, as in `scene.toml`."""

_NOTE = """The tool's frame is the centre of its tip; textures, force and the
       default motion are in scene.toml."""
_BODIES = """    <body name="plate" pos="0 0 -0.004">
      <geom name="slab" type="box" size="0.05 0.02 0.004" rgba="0.80 0.74 0.63 1"/>
    </body>
    <body name="probe" pos="-0.03 0 {height:.9g}">
      <freejoint name="hand"/>
      <geom name="tip" type="sphere" size="{radius:.9g}" mass="0.001" rgba="0.42 0.55 0.72 1"/>
      <geom name="shaft" type="capsule" fromto="0 0 {shaft:.9g} 0 0 0.04" size="{thin:.9g}"
            mass="0.004" rgba="0.42 0.55 0.72 1"/>
      <geom name="grip" type="capsule" fromto="0 0 0.04 0 0 0.11" size="0.004"
            mass="0.045" rgba="0.2 0.2 0.22 1"/>
    </body>"""


def probe_plate(texture: str | Mapping[str, Any] = "sinusoid", *, diameter: float = 3e-3) -> Scene:
    """Return the scene of a spherical probe on a textured plate.

    Parameters
    ----------
    texture : str or mapping
        "sinusoid", "jittered_dots" or "grating" (see `TEXTURES`), or the contents of the table
        `[bodies.plate.texture]`.
    diameter : float
        Diameter of the tip [m], 0.2 mm to 8 mm.
    """
    require_between("diameter", diameter, 2e-4, 8e-3, "m")
    table: Mapping[str, Any]
    if isinstance(texture, str):
        table = TEXTURES[require_choice("texture of probe-plate", texture, TEXTURES)]
    else:
        table = texture
    radius = 0.5 * diameter
    bodies = _BODIES.format(
        height=radius + 1e-4, radius=radius, thin=0.6 * radius, shaft=0.5 * radius
    )
    xml = MODEL.format(
        name="probe-plate", note=_NOTE, compiler="", extent=0.12, centre="0 0 0.03",
        light="0.1 -0.2 0.4", assets="", bodies=bodies,
    )  # fmt: skip
    document = {
        "schema": 1,
        "tool": {"body": "probe"},
        "bodies": {"plate": {"texture": dict(table)}},
        "force": {"stiffness": 400.0, "anti_alias": "tick"},
        "trajectory": {"kind": "slide", "seconds": 2.0, "speed": 0.083, "length": 0.06},
    }
    ending = {"sinusoid": "", "jittered_dots": "-dots"}.get(str(table.get("kind")))
    kind = table.get("kind", "map")
    return scene_of(xml, document, name="probe-plate" + (f"-{kind}" if ending is None else ending))
