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
    if (event.key === 'Escape') {
      const buttons = document.querySelectorAll('.mantine-Modal-content button');
      if (buttons.length) buttons[buttons.length - 1].click();
    }
    if (event.key === ' ' && target.getAttribute('role') === 'tab') {
      event.preventDefault();
      event.stopPropagation();
      target.blur();
      forward(' ', 'Space');
    }
  }, true);
}
"""
"""viser has no key `?`, which is that of the help, `h`, and none that closes a window; a tab that
was clicked keeps the space bar to itself."""

JUDGE = """
if (!window.asperityJudge) {
  // `asperityLight`: 'chosen' by a person, by this, or for pictures and tests.
  window.asperityJudge = (perSecond) => {
    if (window.asperityLight === 'chosen' || perSecond < LEAST) return;
    window.asperityLight = 'chosen';
    document.documentElement.dispatchEvent(new KeyboardEvent('keydown',
      {key: 'l', code: 'KeyL', bubbles: true, cancelable: true}));
  };
  document.addEventListener('keydown', (event) => {
    if (event.key === 'l' && event.isTrusted) window.asperityLight = 'chosen';
  }, true);
  const watch = () => {
    let frames = 0;
    const count = () => { frames += 1; requestAnimationFrame(count); };
    requestAnimationFrame(count);
    setTimeout(() => {
      if (document.visibilityState === 'visible') window.asperityJudge(1e3 * frames / WINDOW);
    }, WINDOW);
  };
  const wait = () => document.querySelector('[role=tab]') ? setTimeout(watch, WAIT)
    : setTimeout(wait, 200);
  wait();
}
"""
"""Requests full light where enough frames are drawn a second, which viser does not measure."""
for _name, _value in {"LEAST": 10, "WINDOW": 2000, "WAIT": 1000}.items():
    JUDGE = JUDGE.replace(_name, str(_value))


def run_in_browsers(server: Any, source: str) -> None:
    """Run JavaScript in all browsers, now and when they connect, if viser can."""
    with contextlib.suppress(ImportError, AttributeError):
        from viser._messages import RunJavascriptMessage

        server.gui._websock_interface.queue_message(RunJavascriptMessage(source))


def hide_settings_menu(server: Any) -> None:
    """Hide viser's menu, with which one changes cameras and records: not for a participant."""
    server.gui.add_html(f"<style>{_NO_MENU}</style>")
