"""A headless browser, for pictures of the page and for its tests."""

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
"""Time limit for a picture that is rendered in software [s]."""
_STARTING, _ATTEMPTS = 60.0, 2
"""Time limit for Chromium to start [s], and number of attempts. It takes two seconds, ten on a busy
machine, and on a virtual machine it was seen to hang now and then.
"""
_QUALITY = 88
"""Quality of a JPEG [percent]."""
_SETTLED, _WAITED = 4.0, 5.0
"""Time for the tool to come down and slide, and time limit for contact after that [s]."""
_PRESS = 0.9
"""Normal force that the hand presses with [N]."""
_DRAWN, _FOLDED = 25.0, 20.0
"""Time for the page to be drawn completely, and for closed folders to fold [s]."""
_DRAW = """() => new Promise((done) => {
  let left = 3;
  const next = () => (left-- ? requestAnimationFrame(next) : done());
  next();
})"""
"""Waits for frames: on a busy computer, folders were not folded after the time for that."""
_ARGUMENTS = (
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
    "--hide-scrollbars", "--disable-background-networking", "--disable-component-update",
)  # fmt: skip


def chromium() -> str | None:
    """Return the path of Chromium, or None."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


def require_browser() -> str:
    """Return the path of Chromium: the system's, else the one that Playwright has installed.

    Raises
    ------
    AsperityError
        Playwright or Chromium is not installed.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise AsperityError(
            "a picture of the page needs Playwright: pip install playwright"
        ) from None
    path = chromium()
    if path is None:
        with sync_playwright() as playwright:
            path = playwright.chromium.executable_path
        if not Path(path).is_file():
            raise AsperityError(
                f"a picture of the page needs a browser: one of {', '.join(NAMES)}, or that of "
                "'playwright install chromium'"
            )
    return path


@contextmanager
def browser_tab(size: tuple[int, int] = SIZE) -> Iterator[Any]:
    """Open a tab of a headless Chromium, as a Playwright page.

    Raises
    ------
    AsperityError
        Playwright or Chromium is not installed, or Chromium does not start.
    """
    path = require_browser()
    from playwright.sync_api import TimeoutError as TooLate
    from playwright.sync_api import sync_playwright

    arguments = list(_ARGUMENTS)
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        arguments.append("--no-sandbox")  # Chromium's sandbox does not work for root
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
            page = browser.new_page(viewport={"width": size[0], "height": size[1]})
            page.add_init_script("window.asperityLight = 'chosen'")  # the key `l` changes it
            yield page
        finally:
            browser.close()


def close_notes(tab: Any) -> None:
    """Close the notifications in a tab, which cost time where software renders.

    Not by the pointer: Playwright would wait for a notification that disappears by itself.
    """
    tab.evaluate(f"document.querySelectorAll('{_CLOSE}').forEach((button) => button.click())")


def take_picture(page: Page, path: Path) -> None:
    """Write a picture of the page while the tool slides, as PNG or JPEG.

    The page is paused while a browser draws it, because software rendering occupies a small
    computer completely. The picture shows the controls of the surfaces; the loop's statistics,
    which would be those of a busy computer, are folded away.
    """
    servo = page.servo
    if servo.config.is_mouse:
        servo.move(CannedMotion("slide", 0.02, 0.02), press=_PRESS)
    time.sleep(_SETTLED)
    _wait_for_touch(page)
    page.pause()
    with browser_tab() as tab:
        tab.goto(page.url, timeout=1e3 * _SLOW)
        tab.wait_for_selector("canvas", timeout=1e3 * _SLOW)
        tab.wait_for_timeout(1e3 * _DRAWN)
        tab.keyboard.press("l")  # shadows and reflections, however long they take
        close_notes(tab)
        # Show the legend of heights, and fold the loop's statistics away.
        tab.get_by_role("tab", name="Surfaces").click()
        tab.get_by_text("Loop", exact=True).click()
        tab.wait_for_timeout(1e3 * _FOLDED)
        tab.evaluate(_DRAW)
        quality = {} if path.suffix.lower() == ".png" else {"quality": _QUALITY}
        tab.screenshot(path=str(path), timeout=1e3 * _SLOW, **quality)
    page.pause(False)


def _wait_for_touch(page: Page) -> None:
    """Wait until the hand feels about the force it presses with, at most `_WAITED`."""
    until = time.monotonic() + _WAITED
    while time.monotonic() < until:
        snapshot = page.servo.latest()
        if snapshot is not None and snapshot.contact_count:
            force = float(np.linalg.norm(snapshot.device_wrench[:3]))
            if 0.5 * _PRESS < force < 1.5 * _PRESS:
                return
        time.sleep(0.01)
