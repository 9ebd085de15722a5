"""A browser without a window, for pictures of the page and for its tests."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from asperity.errors import AsperityError
from asperity.viewer.motions import CannedMotion
from asperity.viewer.server.server import Page

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
SIZE = (1400, 800)
_CLOSE = ".mantine-Notification-closeButton"
_SLOW = 300.0
"""How long a picture may take where the processor draws it [s]."""
_STARTING, _ATTEMPTS = 60.0, 2
"""How long Chromium may take to start [s], which takes two seconds and on a busy machine ten, and
how often that is tried: on a virtual machine it was seen to hang now and then."""
_QUALITY = 88
"""Of a JPEG [percent]."""
_SETTLED, _WAITED = 4.0, 5.0
"""After which the tool has come down and slides; how long a touch is waited for then [s]."""
_DRAWN, _FOLDED = 25.0, 20.0
"""After which all that the page holds is drawn, and what was closed is folded [s]."""
_ARGUMENTS = (
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    "--hide-scrollbars", "--disable-background-networking", "--disable-component-update",
)  # fmt: skip


def chromium() -> str | None:
    """Return where Chromium is, or None."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


@contextmanager
def browser_tab(size: tuple[int, int] = SIZE) -> Iterator[Any]:
    """Give a tab of a Chromium without a window, as Playwright has it.

    Raises
    ------
    AsperityError
        Playwright or Chromium is not here; how to get it. Or Chromium does not start.
    """
    try:
        from playwright.sync_api import TimeoutError as TooLate
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise AsperityError(
            "a picture of the page needs Playwright: pip install playwright"
        ) from None
    path = chromium()
    if path is None:
        raise AsperityError(f"a picture of the page needs a browser: one of {', '.join(NAMES)}")
    arguments = list(_ARGUMENTS)
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        arguments.append("--no-sandbox")  # root has no sandbox to be in
    with sync_playwright() as playwright:
        for _ in range(_ATTEMPTS):
            with suppress(TooLate):
                browser = playwright.chromium.launch(
                    executable_path=path, args=arguments, timeout=1e3 * _STARTING
                )
                break
        else:
            raise AsperityError(f"{path} did not start within {_STARTING:g} s, {_ATTEMPTS} times")
        try:
            yield browser.new_page(viewport={"width": size[0], "height": size[1]})
        finally:
            browser.close()


def close_notes(tab: Any) -> None:
    """Close what is notified in a tab: that software draws.

    Not by the pointer: a note that goes by itself would be waited for until the time is over.
    """
    tab.evaluate(f"document.querySelectorAll('{_CLOSE}').forEach((button) => button.click())")


def take_picture(
    page: Page, path: Path, *, size: tuple[int, int] = SIZE, press: float = 0.9
) -> None:
    """Write a picture of the page while the tool slides, pressed with a force [N]; PNG or JPEG.

    The page holds still while a browser draws it: software drawing takes all there is of a small
    computer. Shown are the surfaces' controls; the loop's numbers are those of whatever else the
    computer did, and folded away.
    """
    link = page.link
    if link.choice.is_mouse:
        link.move(CannedMotion("slide", 0.02, 0.02), press=press)
    time.sleep(_SETTLED)
    _wait_for_touch(page, press)
    page.pause()
    with browser_tab(size) as tab:
        tab.goto(page.url, timeout=1e3 * _SLOW)
        tab.wait_for_selector("canvas", timeout=1e3 * _SLOW)
        tab.wait_for_timeout(1e3 * _DRAWN)
        close_notes(tab)
        # The legend of the heights is shown, and the loop's numbers of a moment are folded away.
        tab.get_by_role("tab", name="Surfaces").click()
        tab.get_by_text("Loop", exact=True).click()
        tab.wait_for_timeout(1e3 * _FOLDED)
        quality = {} if path.suffix.lower() == ".png" else {"quality": _QUALITY}
        tab.screenshot(path=str(path), timeout=1e3 * _SLOW, **quality)
    page.pause(False)


def _wait_for_touch(page: Page, press: float) -> None:
    """Wait until the hand feels about what it presses with, for some time at most."""
    until = time.monotonic() + _WAITED
    while time.monotonic() < until:
        moment = page.link.latest()
        if moment is not None and moment.contact_count:
            force = float(np.linalg.norm(moment.device_wrench[:3]))
            if 0.5 * press < force < 1.5 * press:
                return
        time.sleep(0.01)
