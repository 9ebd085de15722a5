"""A soft fingertip on a tactile map: raised streets, symbols and a word in Braille.

The finger is that of `finger_plate`. The drawing is the pattern `tactile_map`; lines 0.5 mm high
are usual on maps for the blind.
"""

from __future__ import annotations

from asperity.scene.builtin.finger_plate import finger_on
from asperity.scene.scene import Scene


def tactile_map() -> Scene:
    """Return the scene of a soft fingertip that follows a street of a tactile map."""
    plate = {"length": 0.03, "half": 0.002, "colour": "0.93 0.92 0.88", "height": 0.0077}
    texture = {
        "kind": "tactile_map", "height": 5e-4, "scale": 1.0, "line": 1.2e-3, "pixel_size": 1e-4,
        "offset": [-0.03, -0.02],
    }  # fmt: skip
    return finger_on("tactile-map", plate, texture, length=0.04)
