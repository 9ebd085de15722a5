"""What a page shows of a scene: its surfaces, and the handle's."""

from __future__ import annotations

from typing import NamedTuple

from asperity.scene.scene import Scene
from asperity.viewer.drawables.shapes import TRIANGLES, Drawable, shapes_of

_GHOST_TRIANGLES = 3000


class SceneLook(NamedTuple):
    """The surfaces of a scene, and the smooth ones of the handle."""

    scene: Scene
    shapes: list[Drawable]
    ghost: list[Drawable]

    @classmethod
    def of(cls, scene: Scene, triangles: int = TRIANGLES) -> SceneLook:
        """Return the surfaces of a scene with at most `triangles` triangles."""
        ghost = [s for s in shapes_of(scene.smooth(), _GHOST_TRIANGLES) if s.is_tool]
        return cls(scene, shapes_of(scene, triangles), ghost)
