"""A soft, finely ridged fingertip on a plate with raised dots.

Sizes and properties, each with how sure it is:

- Semi-axes of the pad, 10, 8 and 7 mm: of the order of an adult's index finger; chosen.
- Ridges every 0.45 mm: the usual figure for an adult's epidermal ridges, 0.4 to 0.5 mm. Height
  from valley to crest 0.06 mm, straight and evenly spaced: chosen; real ones form loops and whorls.
- Thickness of the layer, 3 mm, and Poisson's ratio, 0.45: chosen, for soft tissue between bone
  and surface that hardly changes its volume.
- Young's modulus, 12 kPa: fitted, not measured. With the three values above a smooth plate has
  a contact of some 75 mm^2, 1 mm deep, at 0.6 N, which is our estimate for a finger pad. Measured
  are force, depth and area of fingers by Serina et al. (J. Biomech. 31, 639, 1998) and Dzidek et
  al. (J. R. Soc. Interface 14, 20160935, 2017): only their abstracts were read, and no number here
  is from them. Expect people to differ by a factor of two or more.
- Friction 0.4: chosen.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from asperity.scene.mjcf import MODEL
from asperity.scene.scene import Scene, scene_of

SKIN: dict[str, Any] = {
    "thickness": 3e-3, "modulus": 1.2e4, "poisson": 0.45, "taxels": [64, 64], "friction": 0.4,
    "size": [0.014, 0.012], "middle": [0.0, 0.0, 0.0],
}  # fmt: skip
"""The table `[tool.skin]`."""
PAD = (0.010, 0.008, 0.007)
"""Semi-axes of the pad [m]."""
RIDGES: dict[str, Any] = {"kind": "sinusoid", "wavelength": 4.5e-4, "amplitude": 3e-5}
"""Epidermal ridges."""
DOTS: dict[str, Any] = {
    "kind": "jittered_dots", "pitch": 2.4e-3, "height": 3e-4, "diameter": 1e-3, "jitter": 0.3,
    "seed": 0,
}  # fmt: skip
"""Raised dots of the plate."""
_NOTE = """The tool's frame is the middle of the pad. Its soft skin, textures, force and the
       default motion are in scene.toml."""
_BODIES = """    <body name="plate" pos="0 0 -{half:.9g}">
      <geom name="slab" type="box" size="{length:.9g} 0.02 {half:.9g}" rgba="{colour} 1"/>
    </body>
    <body name="finger" pos="-0.02 0 {height:.9g}">
      <freejoint name="hand"/>
      <geom name="pad" type="ellipsoid" size="{pad}" mass="0.006"
            rgba="0.86 0.68 0.58 1"/>
      <geom name="phalanx" type="capsule" fromto="-0.004 0 0.002 -0.034 0 0.014" size="0.0065"
            mass="0.014" rgba="0.86 0.68 0.58 1"/>
    </body>"""


def finger_plate() -> Scene:
    """Return the scene of a soft fingertip on a plate with raised dots."""
    plate = {"length": 0.05, "half": 0.004, "colour": "0.80 0.74 0.63", "height": 0.0075}
    return finger_on("finger-plate", plate, DOTS, length=0.02)


def finger_on(
    name: str, plate: Mapping[str, Any], texture: Mapping[str, Any], *, length: float
) -> Scene:
    """Return a scene of the finger that slides to and fro on a textured plate.

    Parameters
    ----------
    name : str
    plate : mapping
        `length` and `half` of the plate: half its length, half its thickness [m]; its `colour`; and
        `height`, that of the middle of the pad, which is 7 mm above its lowest point [m].
    texture : mapping
        Contents of `[bodies.plate.texture]`.
    length : float
        Of the slide [m].
    """
    xml = MODEL.format(
        name=name, note=_NOTE, compiler="", extent=0.08, centre="0 0 0.01", light="0.1 -0.2 0.4",
        assets="", bodies=_BODIES.format(pad=" ".join(f"{half:.3f}" for half in PAD), **plate),
    )  # fmt: skip
    document = {
        "schema": 1,
        "tool": {"body": "finger", "skin": dict(SKIN)},
        "bodies": {"plate": {"texture": dict(texture)}, "finger": {"texture": dict(RIDGES)}},
        "coupling": {"mode": "implicit"},
        "trajectory": {
            "kind": "slide", "seconds": 1.0, "speed": 0.04, "length": length, "press_force": 0.6,
        },
    }  # fmt: skip
    return scene_of(xml, document, name=name)
