"""Controls of the scene, the contact and the device.

Stiffness, friction, coupling and rate are sent through the mailbox and take effect in the next
tick. Another force law, device or scene needs another servo process; see `servo_client`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from asperity.dynamics.virtual_coupling.settings import COUPLING_MODES
from asperity.realtime.devices.catalogue import ENTRIES as DEVICES
from asperity.realtime.devices.catalogue import MODELS, device
from asperity.scene.builtin import SCENES
from asperity.viewer.changes import (
    METHODS,
    method_of,
    methods_for,
    with_device,
    with_method,
    with_scene,
)
from asperity.viewer.notify import attempt, from_browser, notify
from asperity.viewer.panels.panel import Frame, Panel, ViserServer
from asperity.viewer.servo_client import ServoClient
from asperity.viewer.session_config import SessionConfig

RATES = ("500", "1000", "2000", "4000")
STIFFNESS, FRICTION = {"device": (20.0, 4000.0), "object": (1e3, 2e5)}, (0.0, 1.5)
"""Ranges of the stiffness: what a device renders, and, on a coupling, that of the objects."""
OWN = "(this one)"
REFUSED = " (not for meshes)"
"""Ends the name of a law that a scene cannot have."""
_GREY = (
    f'<style>[role=option][value$="{REFUSED}"]{{color:#a0a6ad;pointer-events:none;'
    "font-style:italic}</style>"
)


class ControlsPanel(Panel):
    """Controls of scene, contact and device."""

    title = "Contact"

    def __init__(self) -> None:
        self._generation = -1
        self._lock, self._under_way = threading.Lock(), 0

    def build(self, server: ViserServer, servo: ServoClient) -> None:
        """Add the controls."""
        self._servo = servo
        gui, force = server.gui, servo.config.scene.force
        hardware = [name for name, entry in DEVICES.items() if not entry.steady]
        self._scene = gui.add_dropdown("scene", list(SCENES))
        with gui.add_folder("Force"):
            lowest, highest = STIFFNESS["device"]
            self._stiffness = gui.add_slider("stiffness [N/m]", lowest, highest, 10.0, lowest)
            self._friction = gui.add_slider("friction", *FRICTION, 0.01, FRICTION[0])
            self._method = gui.add_dropdown(
                "law", list(METHODS), hint="How force follows from the contact. Those in grey "
                "work on the height at a point, which a mesh does not have",
            )  # fmt: skip
            gui.add_html(_GREY)
            self._softness = gui.add_number(
                "softness [um]", round(1e6 * force.softness, 3), min=0.1, max=1000.0, step=0.1,
                hint="Of the soft maximum",
            )  # fmt: skip
        with gui.add_folder("Hand and loop"):
            self._coupling = gui.add_dropdown(
                "coupling", COUPLING_MODES,
                hint="Spring and damper between hand and tool; direct: there is none",
            )  # fmt: skip
            self._device = gui.add_dropdown("device", ["mouse", *hardware, *MODELS])
            self._rate = gui.add_dropdown(
                "rate [Hz]", RATES, hint="Ticks a second; less where the loop starves"
            )
        self._show_values()
        self._scene.on_update(self._choose_scene)
        self._stiffness.on_update(self._of_loop(lambda v: {"stiffness": float(v)}))
        self._friction.on_update(self._of_loop(lambda v: {"friction": float(v)}))
        self._coupling.on_update(
            self._of_loop(
                lambda v: {"coupling": replace(self._servo.parameters.coupling, mode=str(v))}
            )
        )
        self._rate.on_update(self._of_loop(lambda v: {"rate": float(v)}))
        self._method.on_update(self._choose_method)
        self._softness.on_update(self._choose_method)
        self._device.on_update(self._choose_device)

    def update(self, frame: Frame) -> None:
        """Show the values of a new servo process.

        Not while a change is under way: the control that was moved would jump back meanwhile.
        """
        if frame.generation == self._generation or self._under_way:
            return
        self._generation = frame.generation
        self._show_values()

    def _show_values(self) -> None:
        config, parameters = self._servo.config, self._servo.parameters
        scene = config.scene
        self._show_stiffness()
        self._friction.value = float(np.clip(parameters.friction, *FRICTION))
        allowed = methods_for(scene)
        refused = [f"{name}{REFUSED}" for name in METHODS if name not in allowed]
        self._method.options = [*allowed, *refused]
        self._method.value = method_of(scene)
        self._softness.visible = scene.force.gradient == "soft"
        self._coupling.value = parameters.coupling.mode
        for control, value in (
            (self._scene, config.source or OWN), (self._device, config.device),
            (self._rate, f"{parameters.rate:.0f}"),
        ):  # fmt: skip
            if value not in control.options:
                control.options = (value, *control.options)
            control.value = value

    def _show_stiffness(self) -> None:
        """Show the stiffness that acts, in the range of what it is the stiffness of."""
        parameters, slider = self._servo.parameters, self._stiffness
        least, most = STIFFNESS["device" if parameters.is_direct else "object"]
        # Not outside of its range for a moment, or the browser would correct it.
        slider.min, slider.max = min(least, slider.min), max(most, slider.max)
        slider.value = float(np.clip(parameters.stiffness, least, most))
        slider.min, slider.max = least, most

    def _of_loop(self, changes: Callable[[Any], dict[str, Any]]) -> Callable[[Any], None]:
        """Return the callback of a control whose value is sent through the mailbox."""

        def changed(event: Any) -> None:
            if from_browser(event):
                label = str(event.target.label)
                value = event.target.value
                attempt(event, label, lambda: self._servo.change(**changes(value)))
                if event.target is self._coupling:
                    self._show_stiffness()

        return changed

    def _choose_scene(self, event: Any) -> None:
        if from_browser(event) and self._scene.value != OWN:
            name = self._scene.value
            self._restart(event, f"Scene {name}", lambda config: with_scene(config, name))

    def _choose_method(self, event: Any) -> None:
        if from_browser(event):
            method, softness = self._method.value, 1e-6 * self._softness.value
            if method.endswith(REFUSED):
                notify(event, method, "These laws need the height at a point.", "orange")
                self._method.value = method_of(self._servo.config.scene)
                return
            self._restart(
                event, method, lambda config: with_method(config, method, softness=softness)
            )

    def _choose_device(self, event: Any) -> None:
        if from_browser(event):
            name = self._device.value

            def chosen(config: SessionConfig) -> SessionConfig:
                if name != "mouse":
                    device(name)  # raises if something is missing
                return with_device(config, name)

            self._restart(event, f"Device {name}", chosen)

    def _restart(
        self, event: Any, what: str, make: Callable[[SessionConfig], SessionConfig]
    ) -> None:
        """Start another servo process; if that fails, show the values of the one that continues."""
        servo = self._servo

        def change() -> None:
            servo.restart(make(servo.config)).result()

        with self._lock:
            self._under_way += 1
        done = attempt(event, what, change)
        with self._lock:
            self._under_way -= 1
        if not done:
            self._generation = -1
