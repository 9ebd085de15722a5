"""Controls of the scene and its contact: what the loop is given between ticks, whole.

Stiffness, friction, coupling and rate go by the mailbox, and hold in the next tick. Another law,
device or scene needs another engine, which is made ready in a process beside (`link`).
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from asperity.dynamics.virtual_coupling.settings import MODES
from asperity.realtime.devices.catalogue import ENTRIES as DEVICES
from asperity.realtime.devices.catalogue import MODELS, device
from asperity.viewer.changes import (
    built_in_scenes,
    method_of,
    methods_for,
    with_device,
    with_method,
    with_scene,
)
from asperity.viewer.notify import attempt, is_asked
from asperity.viewer.panels.panel import Frame
from asperity.viewer.session_config import SessionConfig

if TYPE_CHECKING:
    import viser

    from asperity.viewer.servo_client import ServoClient

RATES = ("500", "1000", "2000", "4000")
STIFFNESS, FRICTION = (20.0, 4000.0), (0.0, 1.5)
OWN = "(this one)"
_NOT_HERE = ("replay", "simulated")
"""Devices that need more than a name."""


class Controls:
    """Scene, contact and device, as a panel."""

    title = "Contact"

    def __init__(self) -> None:
        self._generation = -1
        self._lock, self._under_way = threading.Lock(), 0

    def build(self, server: viser.ViserServer, link: ServoClient) -> None:
        """Make the controls."""
        self._link = link
        gui, scene = server.gui, link.choice.scene
        names = built_in_scenes()
        own = [] if link.choice.source in names else [OWN]
        self._scene = gui.add_dropdown(
            "scene", [*own, *names], initial_value=OWN if own else link.choice.source
        )
        self._scene.on_update(self._choose_scene)
        with gui.add_folder("Force"):
            self._stiffness = gui.add_slider(
                "stiffness [N/m]", *STIFFNESS, 10.0, _within(scene.force.stiffness, STIFFNESS)
            )
            self._friction = gui.add_slider(
                "friction", *FRICTION, 0.01, _within(scene.force.friction, FRICTION)
            )
            self._method = gui.add_dropdown(
                "law", methods_for(scene), initial_value=method_of(scene)
            )
            self._softness = gui.add_number(
                "softness [um]", round(1e6 * scene.force.softness, 3), min=0.1, max=1000.0,
                step=0.1, hint="Of the soft maximum", visible=scene.force.gradient == "soft",
            )  # fmt: skip
        with gui.add_folder("Hand and loop"):
            self._coupling = gui.add_dropdown("coupling", MODES, initial_value=scene.coupling.mode)
            devices = ["mouse", *(n for n in (*DEVICES, *MODELS) if n not in ("mouse", *_NOT_HERE))]
            chosen = link.choice.device
            self._device = gui.add_dropdown(
                "device", devices if chosen in devices else [chosen, *devices],
                initial_value=chosen,
            )  # fmt: skip
            rate = f"{link.choice.rate:.0f}"
            self._rate = gui.add_dropdown(
                "rate [Hz]", RATES if rate in RATES else (rate, *RATES), initial_value=rate
            )
        self._stiffness.on_update(self._of_loop(lambda v: {"stiffness": float(v)}))
        self._friction.on_update(self._of_loop(lambda v: {"friction": float(v)}))
        self._coupling.on_update(
            self._of_loop(
                lambda v: {"coupling": replace(self._link.parameters.coupling, mode=str(v))}
            )
        )
        self._rate.on_update(self._of_loop(lambda v: {"rate": float(v)}))
        self._method.on_update(self._choose_method)
        self._softness.on_update(self._choose_method)
        self._device.on_update(self._choose_device)

    def update(self, frame: Frame) -> None:
        """Show the values of another scene when there is one.

        Not while something that was chosen is being made ready: it would be put back meanwhile.
        """
        if frame.generation == self._generation or self._under_way:
            return
        self._generation = frame.generation
        choice, parameters = self._link.choice, self._link.parameters
        scene = choice.scene
        self._stiffness.value = _within(parameters.stiffness, STIFFNESS)
        self._friction.value = _within(parameters.friction, FRICTION)
        self._method.options = methods_for(scene)
        self._method.value = method_of(scene)
        self._softness.visible = scene.force.gradient == "soft"
        self._coupling.value = parameters.coupling.mode
        for control, value in (
            (self._scene, choice.source or OWN), (self._device, choice.device),
            (self._rate, f"{parameters.rate:.0f}"),
        ):  # fmt: skip
            if value not in control.options:
                control.options = (value, *control.options)
            control.value = value

    def close(self) -> None:
        """Nothing is held."""

    def _of_loop(self, changes: Callable[[Any], dict[str, Any]]) -> Callable[[Any], None]:
        """Return what a control does whose value the mailbox carries."""

        def changed(event: Any) -> None:
            if is_asked(event):
                label = str(event.target.label)
                value = event.target.value
                attempt(event, label, lambda: self._link.change(**changes(value)))

        return changed

    def _choose_scene(self, event: Any) -> None:
        if is_asked(event) and self._scene.value != OWN:
            name = self._scene.value
            self._restart(event, f"Scene {name}", lambda choice: with_scene(choice, name))

    def _choose_method(self, event: Any) -> None:
        if is_asked(event):
            method, softness = self._method.value, 1e-6 * self._softness.value
            self._restart(
                event, method, lambda choice: with_method(choice, method, softness=softness)
            )

    def _choose_device(self, event: Any) -> None:
        if is_asked(event):
            name = self._device.value

            def chosen(choice: SessionConfig) -> SessionConfig:
                if name != "mouse":
                    device(name)  # says what lacks
                return with_device(choice, name)

            self._restart(event, f"Device {name}", chosen)

    def _restart(
        self, event: Any, what: str, make: Callable[[SessionConfig], SessionConfig]
    ) -> None:
        """Have another loop made ready; if that fails, show what goes on."""
        link = self._link

        def change() -> None:
            link.restart(make(link.choice)).result()

        with self._lock:
            self._under_way += 1
        done = attempt(event, what, change)
        with self._lock:
            self._under_way -= 1
        if not done:
            self._generation = -1


def _within(value: float, bounds: tuple[float, float]) -> float:
    return float(min(max(value, bounds[0]), bounds[1]))
