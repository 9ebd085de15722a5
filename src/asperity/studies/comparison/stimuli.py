"""Scenes that differ in one parameter, on which the properties of a method are measured.

A small plate with waves, 0.2 mm from trough to crest and 2 mm long, and a tool above it. All sizes
are asperity's.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from asperity.scene.scene import Scene, scene_of

PLATE = (12e-3, 6e-3, 2e-3)
"""Length, width, thickness [m]."""
WAVELENGTH, AMPLITUDE = 2e-3, 1e-4
STIFFNESS = 4000.0
"""Stiff enough that depths stay within the relief [N/m]."""
FORCE, SPEED = 0.58, 0.083
PATH = 6e-3
"""Length of the path over the centre of the plate, three waves [m]."""
FOOT = (3e-3, 1.5e-3, 1e-3)
"""Half sides of the flat tool [m]."""
DIAMETERS = (0.5e-3, 1.5e-3, 3e-3)
_XML = """<mujoco model="stimulus">
  <worldbody>
    <body name="plate" pos="0 0 {under:.9g}">
{boxes}
    </body>
    <body name="probe" pos="0 0 {height:.9g}">
      <freejoint name="hand"/>
{tool}
    </body>
  </worldbody>
</mujoco>
"""


def ball_on_plate(diameter: float = 3e-3, *, boxes: int = 1) -> Scene:
    """Return a ball above the plate, which consists of `boxes` boxes, a square number."""
    radius = 0.5 * diameter
    tool = f'      <geom type="sphere" size="{radius:.9g}" mass="0.01"/>'
    return _scene(tool, radius + 2e-4, boxes)


def foot_on_plate() -> Scene:
    """Return a flat smooth foot above the plate, with the centre of mass at its centre."""
    size = " ".join(f"{half:.9g}" for half in FOOT)
    tool = f'      <geom type="box" size="{size}" mass="0.01"/>'
    return _scene(tool, FOOT[2] + 2e-4, 1)


def _scene(tool: str, height: float, boxes: int) -> Scene:
    side = math.isqrt(boxes)
    length, width, thick = PLATE
    half = (0.5 * length / side, 0.5 * width / side)
    rows = [
        f'      <geom type="box" size="{half[0]:.9g} {half[1]:.9g} {0.5 * thick:.9g}" '
        f'pos="{(2 * i + 1 - side) * half[0]:.9g} {(2 * j + 1 - side) * half[1]:.9g} 0"/>'
        for i in range(side)
        for j in range(side)
    ]
    xml = _XML.format(under=-0.5 * thick, boxes="\n".join(rows), height=height, tool=tool)
    waves = {"kind": "sinusoid", "wavelength": WAVELENGTH, "amplitude": AMPLITUDE}
    document = {
        "schema": 1,
        "tool": {"body": "probe"},
        "bodies": {"plate": {"texture": waves}},
        "force": {"stiffness": STIFFNESS},
        "trajectory": {"kind": "slide"},
    }
    return scene_of(xml, document, name="stimulus")


def straight_path(scene: Scene, speed: float, dt: float = 1e-3) -> NDArray[np.float64]:
    """Return poses (n, 7) along the path at a speed [m/s], a tick apart."""
    count = round(PATH / (speed * dt)) + 1
    poses = np.tile(scene.start, (count, 1))
    poses[:, 0] = -0.5 * PATH + speed * dt * np.arange(count)
    return poses
