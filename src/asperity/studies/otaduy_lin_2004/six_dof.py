"""The studies' drags in 6-DoF: the probe's scene, held by a simulated hand.

The studies (`studies`) move a 1-D hand over the exact offset of a surface at constant normal force.
Here a 6-DoF hand holds a sphere that touches the sampled plate of `probe-plate` in the full contact
solver. Three hands are of interest:

- *constant*: light and soft along the normal, so that its normal force is constant, and stiff in
  rotation. This is what the studies assume, and must agree with them.
- *guided*: the same, but on a rail: it cannot move across the path. Over dots this, and not
  *constant*, is the hand of the 1-D model, because dots push a probe aside;
- *full*: the same mass, spring and damper in every direction; it regulates the force slowly and
  yields in rotation. The normal force then varies with the texture.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.dynamics.dragged_hand.hand import Hand
from asperity.dynamics.simulated_hand.hand import HandSettings, SimulatedHand
from asperity.errors import require_choice
from asperity.runs.vibration_metrics import DEFAULT_BAND, band_rms, spectrum
from asperity.scene.builtin.probe_plate import probe_plate
from asperity.scene.scene import Scene
from asperity.scene.trajectory import ScriptedMotion
from asperity.simulation.simulation import Simulation
from asperity.studies.otaduy_lin_2004.drags import Condition

HANDS = ("constant", "guided", "full")
TICK = 1e-4
"""Time step of the hand, finer than that of any device [s]."""
STIFFNESS = 2000.0
"""Stiffness of the contact [N/m]; the slope at the deepest place does not depend on it."""
_START = -0.036
"""Start of the probe's path on the plate, of which it uses 72 mm [m]."""
_SETTLING = 6.0
"""Time constants of the hand before the record begins."""


class SixDofDrag(NamedTuple):
    """Metrics of a drag in 6-DoF."""

    max_acceleration: float
    """Largest u'' of the hand [m/s^2]."""
    max_abs_acceleration: float
    """Largest |u''| [m/s^2]."""
    band_rms: float
    """RMS of u'' in the band [m/s^2]."""
    normal_force: float
    """Mean normal force over the record [N]."""
    normal_force_deviation: float
    """Standard deviation of the normal force over the record [N]."""


def hand_settings(kind: str, condition: Condition, hand: Hand) -> HandSettings:
    """Return one of `HANDS` with the normal force of a condition."""
    require_choice("hand", kind, HANDS)
    if kind == "full":
        return HandSettings(hand, press_force=condition.normal_force)
    return HandSettings(
        hand,
        along_normal=Hand(mass=1e-3, stiffness=1.0, damping=0.5),
        rotational_stiffness=100.0,
        rotational_damping=0.2,
        press_force=condition.normal_force,
        press_time=1e3,
    )


def drag_in_scene(
    condition: Condition,
    *,
    kind: str = "constant",
) -> SixDofDrag:
    """Drag the probe of `probe-plate` over a sinusoid of 0.1 mm; return the motion's metrics.

    Parameters
    ----------
    condition : Condition
        Spacing, diameter, normal force, speed.
    kind : {"constant", "guided", "full"}
        See the module.
    """
    hand = Hand()
    texture = {"kind": "sinusoid", "wavelength": condition.spacing, "amplitude": 1e-4}
    scene = probe_plate(texture, diameter=condition.diameter)
    settling = _SETTLING * hand.time_constant
    period = condition.spacing / condition.speed
    room = 2.0 * abs(_START) / condition.speed - settling
    periods = max(math.ceil(0.15 / period), 4)
    periods = max(min(periods, math.floor(room / period)), 1)
    return drag_over_plate(scene, condition, periods * period, kind=kind, hand=hand)


def drag_over_plate(
    scene: Scene,
    condition: Condition,
    seconds: float,
    *,
    kind: str = "constant",
    hand: Hand | None = None,
    band: tuple[float, float] = DEFAULT_BAND,
    across: float = 0.0,
) -> SixDofDrag:
    """Drag the probe of a scene made as `probe-plate` along u; return the metrics of the motion.

    Parameters
    ----------
    scene : Scene
        Its probe has the diameter of the condition, and its texture repeats.
    condition : Condition
        Diameter, normal force, speed; the spacing is not used.
    seconds : float
        Length of the record, whole periods of the texture [s]; it begins once the hand has
        settled.
    kind
        As for `drag_in_scene`.
    hand : Hand, optional
    band : (float, float)
        Band of the metric `band_rms` [Hz].
    across : float
        The v of the path [m].
    """
    hand = hand or Hand()
    scene = scene.changed(force={"stiffness": STIFFNESS, "anti_alias": "off"})
    simulation = Simulation(scene, dt=TICK)
    press = ScriptedMotion(
        seconds=0.01, press_force=condition.normal_force,
        start=(_START, across, float(scene.start[2])),
    )  # fmt: skip
    start = simulation.trajectory(press).poses[0]
    velocity = np.zeros(7)
    velocity[0] = condition.speed

    def target(seconds: float) -> NDArray[np.float64]:
        return np.asarray(start + seconds * velocity)

    simulated = SimulatedHand(
        target, hand_settings(kind, condition, hand), dt=TICK, centre=simulation.tool.body.centre
    )
    record = round(seconds / TICK)
    first = math.ceil(_SETTLING * hand.time_constant / TICK)
    acceleration, force = np.empty(record), np.empty(record)
    for i in range(first + record):
        pose = simulated.pose
        if kind == "guided":
            pose = pose.copy()
            pose[1] = start[1]
        wrench = simulation.step(pose)
        simulated.advance(wrench)
        if i >= first:
            acceleration[i - first], force[i - first] = simulated.acceleration[0], wrench[2]
    lines = spectrum(acceleration, TICK, periodic=True)
    return SixDofDrag(
        float(acceleration.max()),
        float(np.abs(acceleration).max()),
        band_rms(*lines, band),
        float(force.mean()),
        float(force.std()),
    )
