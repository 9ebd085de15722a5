"""A mouse's hand dragged over a plate in simulated time: what it feels, and how it shakes."""

from __future__ import annotations

import numpy as np

from asperity.dynamics.virtual_coupling.settings import coupled_body
from asperity.realtime.devices.mouse import MouseDevice
from asperity.realtime.devices.pointer_file import PointerFile
from asperity.realtime.devices.protocol import Reading
from asperity.scene.builtin import load_scene
from asperity.simulation.simulation import Simulation
from asperity.viewer.motions import CannedMotion, motion_table

DT = 1e-3
SPEED = 0.05
BAND = (20.0, 200.0)


def smooth_plate():
    plain = load_scene("probe-plate").changed(bodies={"plate": {"texture": None}})
    return plain.changed(coupling={"mode": "implicit"})


def dragged(
    folder, name, *, scene=None, rate=60.0, jitter=0.0, seconds=1.4, deep=5e-3, table=False
):
    """Return force on the hand (n, 3) [N] and its acceleration (n, 3) [m/s^2], after it settled.

    The pointer goes evenly at `SPEED`, reported `rate` times a second, each time late by up to
    `jitter` [s]; or it is a canned motion.
    """
    scene = scene or smooth_plate()
    simulation = Simulation(scene, dt=DT)
    start = scene.start.copy()
    start[2] += 1e-3
    pointer = PointerFile(folder / name, start)
    now = [0.0]
    centre = coupled_body(scene.model, scene.tool).centre
    device = MouseDevice(folder / name, dt=DT, centre=tuple(centre), clock=lambda: now[0])
    device.open()
    reading, draw = Reading.empty(), np.random.default_rng(3)
    force, acceleration, due, message = [], [], 0.0, -1
    for tick in range(round(seconds / DT)):
        now[0] = (tick + 1) * DT
        if now[0] >= due and not table:
            message += 1
            goal = start.copy()
            goal[2] -= deep
            goal[0] += SPEED * message / rate
            pointer.point(goal)
            due = (message + 1) / rate + jitter * draw.random()
        if table and tick == 0:
            down = start.copy()
            down[2] -= deep
            made = motion_table(CannedMotion("slide", SPEED, 0.075), down)
            pointer.move(made.poses, loop=made.loop, step=made.step, begun=0.0)
        device.read(reading)
        wrench = simulation.step(reading.pose)
        at_handle = wrench.copy()
        at_handle[3:] += np.cross(centre, wrench[:3])
        device.write(at_handle)
        force.append(wrench[:3].copy())
        acceleration.append(device.hand.acceleration.copy())
    settled = round(0.6 / DT)
    return np.array(force)[settled:], np.array(acceleration)[settled:]


def in_band(values):
    """Return the RMS of a signal (n, 3) in the band in which texture is felt."""
    window = np.hanning(len(values))[:, None]
    spectrum = np.fft.rfft((values - values.mean(axis=0)) * window, axis=0)
    frequency = np.fft.rfftfreq(len(values), DT)
    inside = (frequency >= BAND[0]) & (frequency <= BAND[1])
    power = 2.0 * (np.abs(spectrum[inside]) ** 2).sum() / (window**2).sum() / len(values)
    return float(np.sqrt(power))
