"""The configuration of a session on the page: everything that a servo process is made from."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.virtual_coupling.settings import coupled_body
from asperity.realtime.devices.catalogue import device, entry_of
from asperity.realtime.devices.mouse import MouseDevice
from asperity.realtime.devices.protocol import Device
from asperity.realtime.servo.process import LoopSettings, ServoSpec
from asperity.scene.scene import Scene

CLEARANCE = 3e-3
"""Height of the tool above its place in the scene at the beginning [m]."""


@dataclass(frozen=True, eq=False)
class SessionConfig(LoopSettings):
    """A scene, a device, and, by name, the parameters of `LoopSettings`.

    Parameters
    ----------
    scene : Scene
    source : str
        Name or folder of the scene for `load_scene`; stored with recordings.
    device : str
        "mouse", or a name from `asperity devices`.
    options : dict
        Options of the device.
    """

    scene: Scene
    source: str = ""
    device: str = "mouse"
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def is_mouse(self) -> bool:
        """Whether the page itself moves the tool."""
        return self.device == "mouse"

    @property
    def first_pose(self) -> NDArray[np.float64]:
        """Initial pose of the mouse's hand (7,): above the tool's place in the scene."""
        pose = self.scene.start.copy()
        pose[2] += CLEARANCE
        return pose

    def spec(self, pointer: Path, start: NDArray[np.float64] | None = None) -> ServoSpec:
        """Return the specification of a servo process whose loop is held.

        Parameters
        ----------
        pointer : Path
            Path of the `PointerFile`.
        start : (7,) array, optional
            Initial pose of a hand on any other device. Default: just above the surface.
        """
        make: Callable[[], Device]
        if self.is_mouse:
            body = coupled_body(self.scene.model, self.scene.tool)
            make = functools.partial(
                MouseDevice, pointer, dt=1.0 / self.rate, centre=tuple(body.centre.tolist())
            )
        else:
            device(self.device, **self.options)  # raises here what would fail in the servo process
            make = functools.partial(device, self.device, **self.options)
        return ServoSpec(
            self.scene,
            make,
            in_scene=entry_of(self.device).steady,
            start=None if start is None else tuple(start.tolist()),
            folders=(pointer.parent,),
            held=True,
            **self.loop_settings(),
        )
