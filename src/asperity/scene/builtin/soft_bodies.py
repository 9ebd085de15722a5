"""Soft bodies under a rigid probe: a textured sponge, skin over a lump, and an elastic block.

All sizes and moduli are chosen, none is measured: a sponge as soft as foam rubber, tissue about as
soft as the `finger_plate`'s pad, and a block as soft as soft silicone rubber. The lump is a rigid
ball, as in models on which palpation is trained; real ones are stiff, not rigid.
"""

from __future__ import annotations

from typing import Any

from asperity.scene.mjcf import MODEL
from asperity.scene.scene import Scene, scene_of

SPONGE: dict[str, Any] = {
    "thickness": 0.012, "modulus": 3e4, "poisson": 0.1, "taxels": [80, 120], "friction": 0.5,
}  # fmt: skip
"""The table `[bodies.sponge.skin]`."""
TISSUE: dict[str, Any] = {
    "thickness": 0.015, "modulus": 2e4, "poisson": 0.45, "taxels": [96, 128], "friction": 0.2,
    "lumps": [[0.012, 0.006, 0.0015, 0.005]],
}  # fmt: skip
"""The table `[bodies.tissue.skin]`: its lump's top is 3.5 mm below the surface."""
BLOCK: dict[str, Any] = {
    "modulus": 7e4, "poisson": 0.45, "density": 1070.0, "damping": 0.1, "modes": 16,
    "spacing": 4.7e-3, "friction": 0.5, "layer_thickness": 2e-3, "pitch": 1e-3,
}  # fmt: skip
"""The table `[bodies.block.elastic]`, as soft and heavy as the softest silicone rubbers."""
DOTS: dict[str, Any] = {
    "kind": "jittered_dots", "pitch": 4e-3, "height": 4e-4, "diameter": 2.2e-3, "seed": 4,
    "mapping": "triplanar",
}  # fmt: skip
PORES: dict[str, Any] = {
    "kind": "rough", "size": 0.0256, "pixel_size": 1e-4, "hurst": 0.6, "rms_slope": 0.4,
    "rolloff": 2.5e-3, "cutoff": 5e-4, "seed": 3,
}  # fmt: skip
CREASES: dict[str, Any] = {
    "kind": "rough", "size": 0.0256, "pixel_size": 1e-4, "hurst": 0.7, "rms_slope": 0.12,
    "rolloff": 2e-3, "cutoff": 4e-4, "seed": 2,
}  # fmt: skip
_NOTE = """The tool's frame is the centre of its tip. What is soft, textures and the default
       motion are in scene.toml."""
_BODIES = """    <body name="{name}" pos="0 0 {low:.9g}">
      <geom name="block" type="box" size="{length:.9g} {width:.9g} {half:.9g}" rgba="{colour} 1"/>
    </body>
    <body name="probe" pos="{start} {radius:.9g}">
      <freejoint name="hand"/>
      <geom name="tip" type="sphere" size="{radius:.9g}" mass="0.003" rgba="0.42 0.55 0.72 1"/>
      <geom name="grip" type="capsule" fromto="0 0 {radius:.9g} 0 0 0.1" size="0.004"
            mass="0.045" rgba="0.2 0.2 0.22 1" contype="0" conaffinity="0"/>
    </body>"""


def sponge() -> Scene:
    """Return the scene of a ball on a stem that is rubbed over a textured sponge."""
    bodies = _BODIES.format(
        name="sponge", low=-0.01, length=0.03, width=0.02, half=0.01, colour="0.95 0.80 0.35",
        start="-0.015 0", radius=0.006,
    )  # fmt: skip
    return _scene("sponge", "sponge", bodies, {"texture": PORES, "skin": SPONGE}, {"length": 0.03})


def elastic_block() -> Scene:
    """Return the scene of a ball on a stem that is rubbed over a textured elastic block."""
    bodies = _BODIES.format(
        name="block", low=-0.007, length=0.021, width=0.014, half=0.007, colour="0.55 0.72 0.52",
        start="-0.01 0", radius=0.008,
    )  # fmt: skip
    table = {"texture": DOTS, "elastic": BLOCK}
    return _scene("elastic-block", "block", bodies, table, {"length": 0.02})


def palpation() -> Scene:
    """Return the scene of soft skin that hides a stiff lump, and a probe that passes over it."""
    bodies = _BODIES.format(
        name="tissue", low=-0.01, length=0.04, width=0.03, half=0.01, colour="0.87 0.66 0.58",
        start="-0.013 0.006", radius=0.006,
    )  # fmt: skip
    table = {"texture": CREASES, "skin": TISSUE}
    return _scene("palpation", "tissue", bodies, table, {"length": 0.04})


def _scene(
    name: str, body: str, bodies: str, table: dict[str, Any], motion: dict[str, Any]
) -> Scene:  # fmt: skip
    xml = MODEL.format(
        name=name, note=_NOTE, compiler="", extent=0.1, centre="0 0 0.01", light="0.1 -0.2 0.4",
        assets="", bodies=bodies,
    )  # fmt: skip
    document = {
        "schema": 1,
        "tool": {"body": "probe"},
        "bodies": {body: {key: dict(part) for key, part in table.items()}},
        "coupling": {"mode": "implicit"},
        "trajectory": {
            "kind": "slide", "seconds": 1.0, "speed": 0.05, "press_force": 0.8,
        } | motion,
    }  # fmt: skip
    return scene_of(xml, document, name=name)
