"""Functions that make the devices of sessions; being importable, they can be sent to a process."""

from __future__ import annotations

from typing import Any

from asperity.realtime.devices.catalogue import device
from asperity.realtime.devices.protocol import Device
from asperity.realtime.devices.simulated import SimulatedDevice
from asperity.realtime.servo.safety import SafetySettings
from asperity.scene.scene import Scene
from asperity.scene.trajectory import ScriptedMotion, Trajectory
from asperity.simulation.simulation import Simulation


def named_device(name: str, options: dict[str, Any]) -> Device:
    """Return a device of the catalogue, not opened."""
    return device(name, **options)


def simulated_device(scene: Scene, motion: ScriptedMotion | Trajectory, dt: float) -> Device:
    """Return a device in a simulated hand that follows a motion through a scene.

    The hand lowers its press force in step with the device's soft start: a hand that leans on a
    surface which does not push back yet would fall through it.
    """
    hand = Simulation(scene, dt=dt).hand(motion, press_in=SafetySettings().soft_start)
    return SimulatedDevice(hand)
