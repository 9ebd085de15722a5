"""A flat foot on a smooth plate, and where on its sole a method says that the force acts."""

from __future__ import annotations

import numpy as np

from asperity.scene.scene import scene_of
from asperity.studies.comparison import stimuli

PLACES = ((0.0, 0.0), (7e-4, 4e-4), (-1.1e-3, 0.2e-3))
"""Places of the foot on the plate [m]; the seams of a plate of four boxes cross at (0, 0)."""


def foot_on_smooth_plate(boxes=1):
    """Return the foot of the comparison above its plate of so many boxes, without texture."""
    ball = stimuli.ball_on_plate(2.0 * stimuli.FOOT[2], boxes=boxes)
    size = " ".join(f"{half:.9g}" for half in stimuli.FOOT)
    sphere = f'type="sphere" size="{stimuli.FOOT[2]:.9g}"'
    assert sphere in ball.xml
    xml = ball.xml.replace(sphere, f'type="box" size="{size}"')
    return scene_of(xml, ball.document, name="foot").smooth()


def at_place(scene, x, y, depth):
    """Return the pose of the foot at a place, pressed in by a depth [m]."""
    pose = scene.start.copy()
    pose[:3] += [x, y, -2e-4 - depth]
    return pose


def centre_of_pressure(felt, foot=stimuli.FOOT):
    """Return where on the sole of an upright foot the force acts, from its middle (2,) [m]."""
    (fx, fy, fz), (tx, ty, _) = felt.force, felt.torque
    return np.array([-(ty + foot[2] * fx) / fz, (tx - foot[2] * fy) / fz])
