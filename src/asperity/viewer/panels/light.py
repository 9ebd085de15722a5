"""Light: with shadows and reflections, but for browsers that draw slowly.

Each browser has its own. At first it has neither, so that there is a picture soon; a script in it
adds them where enough frames are drawn. Where the processor draws they take most of its time, which
is the loop's where there are few cores.
"""

from __future__ import annotations

import time
from typing import Any

from asperity.viewer.drawables.stage import set_light
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.server.script import JUDGE, run_in_browsers
from asperity.viewer.servo_client import ServoClient

NOTE_AFTER = 10.0
"""Time after which a browser without shadows and reflections gets a note [s]."""


class LightPanel(Panel):
    """The key for full light, which a script presses where ten frames a second are drawn."""

    title = ""

    def __init__(self) -> None:
        self.full: set[int] = set()
        """Numbers of the browsers with shadows and reflections."""
        self._noted: set[int] = set()
        self._since: dict[int, float] = {}

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the key and the script; begin with simple light."""
        self._server = server
        server.gui.add_command("Shadows and reflections", hotkey="L").on_trigger(self._switch)
        server.on_client_disconnect(lambda client: self.full.discard(client.client_id))
        run_in_browsers(server, JUDGE)
        set_light(server.scene, simple=True)

    def update(self, frame: Frame) -> None:
        """Show a note in browsers that draw slowly."""
        now = time.monotonic()
        for number, client in self._server.get_clients().items():
            due = now - self._since.setdefault(number, now) > NOTE_AFTER
            if due and number not in self._noted | self.full:
                self._noted.add(number)
                client.add_notification(
                    "Drawn simply", "Without shadows and reflections, which take most of the time "
                    "where the processor draws. The key L adds them.", color="blue",
                    auto_close_seconds=12.0,
                )  # fmt: skip

    def _switch(self, event: Any) -> None:
        client = event.client
        if client is not None:
            self._noted.add(client.client_id)
            self.full ^= {client.client_id}
            set_light(client.scene, simple=client.client_id not in self.full)
