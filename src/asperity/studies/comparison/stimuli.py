"""Scenes that differ in one parameter, on which the properties of a method are measured.

A small plate with waves, 0.2 mm from trough to crest and 2 mm long, and a tool above it. All sizes
are asperity's.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.geometry.offsets.analytic import Sinusoid
from asperity.geometry.poses import rotated
from asperity.scene.scene import Scene, scene_of

Array = NDArray[np.float64]

PLATE = (14e-3, 6e-3, 2e-3)
"""Length, width, thickness [m]."""
WAVELENGTH, AMPLITUDE = 2e-3, 1e-4
STIFFNESS = 4000.0
"""Stiff enough that depths stay within the relief [N/m]."""
FORCE, SPEED = 0.58, 0.083
PATH, BEGIN = 6e-3, -2.97e-3
"""Length of the path over the centre of the plate, three waves, and where it begins [m]. Not in a
trough, where a ball touches both sides at once."""
FOOT = (3e-3, 1.5e-3, 1e-3)
"""Half sides of the flat tool [m]."""
FOOT_WAVELENGTH = 1.3e-3
"""Of the waves of a textured foot [m], which are half as high as those of the plate."""
CLOSED = 400
"""Steps of the closed path."""
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
    return _scene(tool, radius + 2e-4, boxes, {})


def foot_on_plate(*, boxes: int = 1, textured: bool = False) -> Scene:
    """Return a flat foot above the plate, with the centre of mass at its centre.

    Parameters
    ----------
    boxes : int
        Number of boxes of which the plate consists, a square number.
    textured : bool
        Whether the foot has waves too.
    """
    size = " ".join(f"{half:.9g}" for half in FOOT)
    tool = f'      <geom type="box" size="{size}" mass="0.01"/>'
    waves = {"kind": "sinusoid", "wavelength": FOOT_WAVELENGTH, "amplitude": 0.5 * AMPLITUDE}
    own = {"probe": {"texture": waves}} if textured else {}
    return _scene(tool, FOOT[2] + 2e-4, boxes, own)


def _scene(tool: str, height: float, boxes: int, bodies: dict[str, Any]) -> Scene:
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
        "bodies": {"plate": {"texture": waves}, **bodies},
        "force": {"stiffness": STIFFNESS},
        "trajectory": {"kind": "slide"},
    }
    return scene_of(xml, document, name="stimulus")


def straight_path(scene: Scene, speed: float, dt: float = 1e-3) -> Array:
    """Return poses (n, 7) along the path at a speed [m/s], a tick apart."""
    count = round(PATH / (speed * dt)) + 1
    poses = np.tile(scene.start, (count, 1))
    poses[:, 0] = BEGIN + speed * dt * np.arange(count)
    return poses


def to_and_fro(scene: Scene, speed: float, seconds: float) -> Array:
    """Return poses (n, 7) along the path and back at a speed [m/s], for at least so long [s]."""
    there = straight_path(scene, speed)
    both = np.concatenate([there, there[-2:0:-1]])
    return np.concatenate([both] * math.ceil(seconds / (1e-3 * len(both))))


def turned(poses: Array, vectors: Array) -> Array:
    """Return poses (n, 7) rotated in place by rotation vectors, (3,) or (n, 3) [rad]."""
    each = np.broadcast_to(vectors, (len(poses), 3))
    return np.array([rotated(pose, vector) for pose, vector in zip(poses, each, strict=True)])


def turning_path(scene: Scene) -> Array:
    """Return poses (n, 7) that turn the tool about the vertical by 20 degrees either way."""
    poses = np.tile(scene.start, (81, 1))
    poses[:, 0] += 3e-4
    angles = np.radians(np.linspace(-20.0, 20.0, len(poses)))
    return turned(poses, angles[:, None] * np.array([0.0, 0.0, 1.0]))


def closed_path(scene: Scene, *, turn: float = 0.0) -> Array:
    """Return poses (n, 7) of a smooth closed path, about the middle of the plate.

    An ellipse of 0.8 mm along and 0.5 mm across the waves, with a height that changes by 40 um
    twice a turn; so that neither force nor torque cancels by symmetry.

    Parameters
    ----------
    scene : Scene
    turn : float
        Angle by which the tool also turns to and fro, about the vertical, and a twentieth of it
        about the waves [rad].
    """
    phase = np.linspace(0.0, 2.0 * math.pi, CLOSED + 1)
    poses = np.tile(scene.start, (len(phase), 1))
    poses[:, 0] += 0.8e-3 * np.cos(phase) + 0.17e-3
    poses[:, 1] += 0.5e-3 * np.sin(phase)
    poses[:, 2] += 2e-5 * np.sin(2.0 * phase + 0.5)
    if turn:
        about = np.stack([0.0 * phase, 0.05 * np.cos(phase + 1.0), np.cos(phase)], axis=1)
        poses = turned(poses, turn * about)
    return poses


def offset_slope(diameter: float, x: Array) -> Array:
    """Return the slope of the surface that a ball's lowest point traces on the plate.

    The closed form of the offset of a sinusoid, at places `x` (n,) [m] along the plate.
    """
    waves = Sinusoid(AMPLITUDE, WAVELENGTH)
    return np.asarray(waves.tracer(diameter)(x).slope)
