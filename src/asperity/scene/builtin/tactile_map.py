"""A soft fingertip on a tactile map: raised streets, symbols and a word in Braille.

The finger is that of `finger_plate`. The drawing is the pattern `tactile_map`; lines 0.5 mm high
are usual on maps for the blind.
"""

from __future__ import annotations

from asperity.scene.builtin.finger_plate import FINGER, NOTE, with_finger
from asperity.scene.mjcf import MODEL
from asperity.scene.scene import Scene, scene_of

_PLATE = """    <body name="plate" pos="0 0 -0.002">
      <geom name="sheet" type="box" size="0.03 0.02 0.002" rgba="0.93 0.92 0.88 1"/>
    </body>
"""


def tactile_map() -> Scene:
    """Return the scene of a soft fingertip that follows a street of a tactile map."""
    xml = MODEL.format(
        name="tactile-map", note=NOTE, compiler="", extent=0.08, centre="0 0 0.01",
        light="0.1 -0.2 0.4", assets="", bodies=_PLATE + FINGER.format(height=0.0077),
    )  # fmt: skip
    plate = {
        "texture": {
            "kind": "tactile_map", "height": 5e-4, "scale": 1.0, "line": 1.2e-3,
            "pixel_size": 1e-4, "offset": [-0.03, -0.02],
        },
    }  # fmt: skip
    return scene_of(xml, with_finger(plate, length=0.04), name="tactile-map")
