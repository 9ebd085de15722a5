"""Panel of a page on a running MuJoCo model: state, pause, reset, and actuators."""

from __future__ import annotations

import time
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from asperity.mujoco.surfaces import Surfaces
from asperity.viewer.server.script import KEYS, run_in_browsers

Array = NDArray[np.float64]
_STEPS = 200
"""Positions of the slider of an actuator."""
_WINDOW = 1.0
"""Time over which the speed is measured [s]."""
_REAL_TIME = 0.95
"""Fraction of real time above which the speed is shown as real time."""


class ModelPanel:
    """Buttons and sliders of a model that `run_on_page` steps.

    Browsers are served by other threads, so requests are stored until `act` is called between
    steps.
    """

    def __init__(self, server: Any, surfaces: Surfaces) -> None:
        self._surfaces, self._model = surfaces, surfaces.model
        self._controls: list[Any] = []
        self.is_paused = False
        self._wants_reset = False
        self._changed: dict[int, float] = {}
        self._since, self._speed = (time.perf_counter(), 0.0), 1.0
        model = self._model
        gui = server.gui
        self._state = gui.add_markdown("")
        self._buttons = gui.add_button_group(
            "model", ("Pause", "Reset"), hint="Pause or go on (space); the first state (r)"
        )
        self._buttons.on_click(
            lambda event: (self._pause if event.target.value == "Pause" else self._reset)(event)
        )
        gui.add_command("Pause or go on", hotkey="space").on_trigger(self._pause)
        gui.add_command("Reset", hotkey="R").on_trigger(self._reset)
        run_in_browsers(server, KEYS)
        if model.nu:
            with gui.add_folder("Actuators"):
                self._controls = [self._add_control(gui, i) for i in range(model.nu)]

    def _add_control(self, gui: Any, i: int) -> Any:
        """Add the control of an actuator: a slider over its range, or a number without one."""
        actuator = self._model.actuator(i)
        name = actuator.name or f"actuator {i}"
        if actuator.ctrllimited[0]:
            low, high = actuator.ctrlrange.tolist()
            control = gui.add_slider(name, low, high, (high - low) / _STEPS, np.clip(0, low, high))
        else:
            control = gui.add_number(name, 0.0, step=0.01)
        control.on_update(lambda event: self._set(i, event))
        return control

    def _set(self, i: int, event: Any) -> None:
        if event.client is not None:  # moved by a person, not by `start`
            self._changed[i] = float(event.target.value)

    def _pause(self, _: Any) -> None:
        self.is_paused = not self.is_paused

    def _reset(self, _: Any) -> None:
        self._wants_reset = True

    def act(self, data: mujoco.MjData) -> bool:
        """Apply the requests: reset the data, set its controls; return whether it was reset."""
        for i in list(self._changed):
            data.ctrl[i] = self._changed.pop(i)
        if not self._wants_reset:
            return False
        self._wants_reset = False
        self.start(data)
        return True

    def start(self, data: mujoco.MjData) -> None:
        """Set a state to the first keyframe of the model, if it has one, and show its controls."""
        if self._model.nkey:
            mujoco.mj_resetDataKeyframe(self._model, data, 0)
        else:
            mujoco.mj_resetData(self._model, data)
        self._surfaces.forward(data)
        self._since = time.perf_counter(), data.time
        for control, value in zip(self._controls, data.ctrl.tolist(), strict=True):
            low, high = getattr(control, "min", None), getattr(control, "max", None)
            control.value = value if None in (low, high) else min(max(value, low), high)

    def show(self, data: mujoco.MjData, forces: Array) -> None:
        """Show time, speed, and the forces (n, 3) [N] of the contacts."""
        begun, then = self._since
        if (passed := time.perf_counter() - begun) > _WINDOW:
            self._speed = (data.time - then) / passed
            self._since = time.perf_counter(), data.time
        speed = "real time" if self._speed > _REAL_TIME else f"{self._speed:.2f} of real time"
        largest = np.linalg.norm(forces, axis=1).max(initial=0.0)
        self._state.content = (
            f"**{data.time:.2f} s** · {'paused' if self.is_paused else speed}  \n"
            f"contacts: {len(forces)} · largest force: {largest:.2f} N"
        )
