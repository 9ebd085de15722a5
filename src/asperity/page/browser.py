"""A browser without a window, for pictures of the page and for its tests."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from asperity.errors import AsperityError
from asperity.page.motions import Motion
from asperity.page.server import Page

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
SIZE = (1400, 800)
_CLOSE = ".mantine-Notification-closeButton"
_SLOW = 300.0
"""How long a picture may take where the processor draws it [s]."""
_QUALITY = 88
"""Of a JPEG [percent]."""
_SETTLED, _SHOWN, _DRAWN = 4.0, 0.6, 2.0
"""After which the tool has come down and slides, all panels show it, and that is drawn [s]."""
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
        Playwright or Chromium is not here; how to get it.
    """
    try:
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
        browser = playwright.chromium.launch(executable_path=path, args=arguments)
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

    The loop goes on; the page holds still while a browser draws it.
    """
    link = page.link
    with browser_tab(size) as tab:
        tab.goto(page.url, timeout=1e3 * _SLOW)
        tab.wait_for_selector("canvas", timeout=1e3 * _SLOW)
        # Software drawing takes all there is of a small computer: the loop first, then the picture.
        page.pause()
        close_notes(tab)
        if link.choice.is_mouse:
            link.move(Motion("slide", 0.02, 0.02), press=press)
        time.sleep(_SETTLED)
        page.pause(False)
        time.sleep(_SHOWN)
        page.pause()
        tab.wait_for_timeout(1e3 * _DRAWN)
        quality = {} if path.suffix.lower() == ".png" else {"quality": _QUALITY}
        tab.screenshot(path=str(path), timeout=1e3 * _SLOW, **quality)
    page.pause(False)
