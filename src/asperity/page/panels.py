"""The panels of the live page, in the order of their tabs."""

from __future__ import annotations

from asperity.page.controls import Controls
from asperity.page.mouse import Mouse
from asperity.page.panel import Panel
from asperity.page.shapes import TRIANGLES
from asperity.page.stage import Stage
from asperity.page.status import Status
from asperity.page.textures import Textures


def live_panels(triangles: int = TRIANGLES) -> list[Panel]:
    """Return all panels of a page on a running loop, with at most so many triangles shown.

    The stage is last: another scene takes it a while, and the controls are not to wait for it.
    """
    return [Status(), Mouse(), Controls(), Textures(), Stage(triangles)]
