"""What is felt and with what: all that a servo process is made of, as the page changes it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.virtual_coupling.settings import coupled_body
from asperity.realtime.devices.catalogue import device
from asperity.realtime.devices.mouse import MouseDevice
from asperity.realtime.devices.protocol import Device
from asperity.realtime.servo.device_makers import named_device
from asperity.realtime.servo.process import ServoSpec
from asperity.realtime.servo.safety import SafetySettings
from asperity.realtime.servo.scheduling import RealTime
from asperity.scene.scene import Scene

CLEARANCE = 3e-3
"""How far above its place in the scene a tool is held at first [m]."""


@dataclass(frozen=True, eq=False)
class SessionConfig:
    """A scene, a device and a rate.

    Parameters
    ----------
    scene : Scene
    source : str
        What `load_scene` makes the scene of, for recordings.
    device : str
        "mouse", or as in `asperity devices`.
    options : dict
        Of the device.
    rate : float
        Ticks a second.
    seconds : float, optional
        After which the loop ends. Default: when the page is closed.
    passivity : bool
        Whether the passivity controller may change the wrench.
    mapping : dict
        Options of `Mapping`.
    safety : SafetySettings
    real_time : RealTime
    """

    scene: Scene
    source: str = ""
    device: str = "mouse"
    options: dict[str, Any] = field(default_factory=dict)
    rate: float = 1000.0
    seconds: float | None = None
    passivity: bool = True
    mapping: dict[str, Any] = field(default_factory=dict)
    safety: SafetySettings = field(default_factory=SafetySettings)
    real_time: RealTime = field(default_factory=RealTime)

    @property
    def is_mouse(self) -> bool:
        """Whether the page itself moves the tool."""
        return self.device == "mouse"

    @property
    def first_pose(self) -> NDArray[np.float64]:
        """Where the mouse's hand is at first (7,): above where the scene draws the tool."""
        pose = self.scene.start.copy()
        pose[2] += CLEARANCE
        return pose

    def spec(self, pointed: Path, start: NDArray[np.float64] | None = None) -> ServoSpec:
        """Return what a servo process needs to know, with its loop held.

        Parameters
        ----------
        pointed : Path
            The file of `Pointed`.
        start : (7,) array, optional
            Where a hand on any other device begins. Default: just above the surface.
        """
        make: Callable[[], Device]
        if self.is_mouse:
            body = coupled_body(self.scene.model, self.scene.tool)
            make = functools.partial(
                MouseDevice, pointed, dt=1.0 / self.rate, centre=tuple(body.centre.tolist())
            )
        else:
            device(self.device, **self.options)  # refuses here what would be refused there
            make = functools.partial(named_device, self.device, self.options)
        return ServoSpec(
            self.scene,
            make,
            in_scene=self.is_mouse or self.device.startswith("replay"),
            start=None if start is None else tuple(start.tolist()),
            folders=(pointed.parent,),
            held=True,
            rate=self.rate,
            seconds=self.seconds,
            passivity=self.passivity,
            mapping=dict(self.mapping),
            safety=self.safety,
            real_time=self.real_time,
        )
