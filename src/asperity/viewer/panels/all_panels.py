"""The panels of the live page, in the order of their tabs."""

from __future__ import annotations

from asperity.viewer.drawables.shapes import TRIANGLES
from asperity.viewer.panels.controls import Controls
from asperity.viewer.panels.mouse import Mouse
from asperity.viewer.panels.panel import Panel
from asperity.viewer.panels.scene_view import Stage
from asperity.viewer.panels.status import Status
from asperity.viewer.panels.textures import TexturesPanel


def live_panels(triangles: int = TRIANGLES) -> list[Panel]:
    """Return all panels of a page on a running loop, with at most so many triangles shown.

    The stage is last: another scene takes it a while, and the controls are not to wait for it.
    """
    return [Status(), Mouse(), Controls(), TexturesPanel(), Stage(triangles)]
