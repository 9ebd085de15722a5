"""Style and script that viser has no option for."""

from __future__ import annotations

import contextlib
from typing import Any

_NO_MENU = "button:has(> svg.tabler-icon-adjustments), .tabler-icon-adjustments{display:none}"
KEYS = """
if (!window.asperityKeys) {
  window.asperityKeys = true;
  const forward = (key, code) => document.documentElement.dispatchEvent(
    new KeyboardEvent('keydown', {key, code, bubbles: true, cancelable: true}));
  document.addEventListener('keydown', (event) => {
    const target = event.target;
    if (event.key === '?' && !/^(INPUT|TEXTAREA)$/.test(target.tagName)) forward('h', 'KeyH');
    if (event.key === ' ' && target.getAttribute('role') === 'tab') {
      event.preventDefault();
      event.stopPropagation();
      target.blur();
      forward(' ', 'Space');
    }
  }, true);
}
"""
"""viser has no key `?`, which is that of the help, `h`; and a tab that was clicked keeps the space
bar to itself."""


def run_in_browsers(server: Any, source: str) -> None:
    """Run JavaScript in all browsers, now and when they connect, if viser can."""
    with contextlib.suppress(ImportError, AttributeError):
        from viser._messages import RunJavascriptMessage

        server.gui._websock_interface.queue_message(RunJavascriptMessage(source))


def hide_settings_menu(server: Any) -> None:
    """Hide viser's menu, with which one changes cameras and records: not for a participant."""
    server.gui.add_html(f"<style>{_NO_MENU}</style>")
