"""Light: with shadows and reflections, or without them where a browser draws slowly.

Each browser has its own. What draws by software takes two thirds of its time for them, and those
seconds are the loop's where there are few cores.
"""

from __future__ import annotations

from typing import Any

from asperity.viewer.drawables.stage import set_light
from asperity.viewer.notify import notify
from asperity.viewer.panels.panel import Panel, ViserServer
from asperity.viewer.server.script import JUDGE, run_in_browsers
from asperity.viewer.servo_client import ServoClient


class LightPanel(Panel):
    """The key for simple light; a script presses it where fewer than ten frames a second come."""

    title = ""

    def __init__(self) -> None:
        self.simple: set[int] = set()
        """Numbers of the browsers with simple light."""

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the key and the script."""
        server.gui.add_command("Shadows and reflections", hotkey="L").on_trigger(self._switch)
        server.on_client_disconnect(lambda client: self.simple.discard(client.client_id))
        run_in_browsers(server, JUDGE)

    def _switch(self, event: Any) -> None:
        client = event.client
        if client is None:
            return
        self.simple ^= {client.client_id}
        simple = client.client_id in self.simple
        set_light(client.scene, simple=simple)
        if simple:
            notify(
                event, "Drawn simply", "Without shadows and reflections, which take most of the "
                "time where the processor draws. The key l brings them back.", "blue",
            )  # fmt: skip
