"""Style and script that viser has no option for."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

_NO_MENU = "button:has(> svg.tabler-icon-adjustments), .tabler-icon-adjustments{display:none}"
KEYS, JUDGE = (
    Path(__file__).with_name(name).read_text("utf-8") for name in ("keys.js", "light.js")
)
"""For keys of the page, and for full light where frames are drawn fast enough."""


def run_in_browsers(server: Any, source: str) -> None:
    """Run JavaScript in all browsers, now and when they connect, if viser can."""
    with contextlib.suppress(ImportError, AttributeError):
        from viser._messages import RunJavascriptMessage

        server.gui._websock_interface.queue_message(RunJavascriptMessage(source))


def hide_settings_menu(server: Any) -> None:
    """Hide viser's menu, with which one changes cameras and records: not for a participant."""
    server.gui.add_html(f"<style>{_NO_MENU}</style>")
