"""Style and script that viser has no option for."""

from __future__ import annotations

import contextlib
from typing import Any

_NO_MENU = "button:has(> svg.tabler-icon-adjustments), .tabler-icon-adjustments{display:none}"
QUESTION_MARK = """
if (!window.asperityKeys) {
  window.asperityKeys = true;
  document.addEventListener('keydown', (event) => {
    if (event.key !== '?' || /^(INPUT|TEXTAREA)$/.test(event.target.tagName)) return;
    for (const to of [document.documentElement])
      to.dispatchEvent(new KeyboardEvent('keydown',
        {key: 'h', code: 'KeyH', bubbles: true, cancelable: true}));
  });
}
"""
"""viser has no key `?`; it is that of the help, `h`."""


def run_in_browsers(server: Any, source: str) -> None:
    """Run JavaScript in all browsers, now and when they connect, if viser can."""
    with contextlib.suppress(ImportError, AttributeError):
        from viser._messages import RunJavascriptMessage

        server.gui._websock_interface.queue_message(RunJavascriptMessage(source))


def hide_settings_menu(server: Any) -> None:
    """Hide viser's menu, with which one changes cameras and records: not for a participant."""
    server.gui.add_html(f"<style>{_NO_MENU}</style>")
