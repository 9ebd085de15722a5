"""Pictures of every tab and state of the live page, in docs/images/page/; `make pictures` runs it.

The page is paused while Chromium draws it by software. Needs Playwright and Chromium.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from asperity.realtime.servo.scheduling import RealTime
from asperity.scene.builtin import load_scene
from asperity.viewer.app import live_page
from asperity.viewer.browser import browser_tab, close_notes
from asperity.viewer.changes import on_coupling
from asperity.viewer.motions import CannedMotion
from asperity.viewer.server.server import Page
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.session_config import SessionConfig

OUT = Path(__file__).parent / "page"
SCENE = "probe-plate-dots"
TABS = ("Hand", "Contact", "Surfaces", "Plots", "Record")
_LOADED, _SETTLED, _LIMIT = 10e3, 8e3, 300e3
"""Times to load, to settle, and at most [ms]."""


def main() -> None:
    """Write all pictures."""
    OUT.mkdir(exist_ok=True)
    config = SessionConfig(
        on_coupling(load_scene(SCENE)), SCENE, real_time=RealTime(busy_wait=False)
    )
    with (
        ServoClient(config) as servo,
        live_page(servo, Path("out/view"), 50_000, port=0) as page,
        browser_tab() as tab,
    ):
        tab.set_default_timeout(_LIMIT)
        tab.goto(page.url)
        tab.wait_for_selector("canvas")
        tab.wait_for_timeout(_LOADED)
        tab.keyboard.press("l")  # shadows and reflections, however long they take
        close_notes(tab)
        servo.move(CannedMotion("slide", 0.01, 0.01), press=0.8)
        time.sleep(3.0)
        for name in TABS:
            tab.get_by_role("tab", name=name).click()
            take(page, tab, f"tab-{name.lower()}")
        view = next(p for p in page.panels if hasattr(p, "colour_by_height"))
        for key, height, name in (("z", False, "zoom"), ("", True, "zoom-heights")):
            if key:
                tab.keyboard.press(key)
            view.colour_by_height(height)
            tab.wait_for_timeout(2.0 * _SETTLED)  # the detail is drawn in the background
            take(page, tab, name)
        tab.keyboard.press("z")
        view.colour_by_height(False)
        tab.keyboard.press("Space")
        take(page, tab, "paused")
        tab.keyboard.press("?")
        take(page, tab, "help")


def take(page: Page, tab: Any, name: str) -> None:
    """Write a picture when what is shown has settled."""
    tab.wait_for_timeout(_SETTLED)
    page.pause()
    tab.wait_for_timeout(_SETTLED)
    tab.screenshot(path=str(OUT / f"{name}.jpg"), quality=80, timeout=_LIMIT)
    page.pause(False)
    print(OUT / f"{name}.jpg", flush=True)


if __name__ == "__main__":
    main()
