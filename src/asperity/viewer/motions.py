"""Canned motions of the mouse's hand: tables of poses that start at the hand's target."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from asperity.errors import require_between, require_choice
from asperity.realtime.devices.pointer_file import MAX_POSES
from asperity.scene.trajectory import ScriptedMotion, scripted

KINDS = ("slide", "circle", "press")
SPEEDS, LENGTHS, FORCES = (1e-3, 0.5), (1e-3, 0.2), (0.0, 3.0)
"""Valid ranges [m/s], [m], [N]."""
_STEP = 1e-3


@dataclass(frozen=True)
class CannedMotion:
    """A motion that repeats without end.

    Parameters
    ----------
    kind : {"slide", "circle", "press"}
        A straight stroke to and fro; a circle; staying in place.
    speed : float
        [m/s].
    length : float
        Of the stroke, or diameter of the circle [m].
    direction : float
        Of the stroke, from x towards y [rad].
    """

    kind: str = "slide"
    speed: float = 0.05
    length: float = 0.03
    direction: float = 0.0

    def __post_init__(self) -> None:
        require_choice("motion", self.kind, KINDS)
        require_between("speed", self.speed, *SPEEDS, "m/s")
        require_between("length", self.length, *LENGTHS, "m")
        require_between("direction", self.direction, -10.0, 10.0, "rad")


class Table(NamedTuple):
    """Poses (n, 7), `step` [s] apart; the last equals row `loop`, after which it continues."""

    poses: NDArray[np.float64]
    loop: int
    step: float


def motion_table(motion: CannedMotion, start: NDArray[np.float64]) -> Table:
    """Return one period of a motion that starts at rest at a pose (7,)."""
    if motion.kind == "press":
        return Table(np.array(start, dtype=np.float64)[None], 0, _STEP)
    plan = ScriptedMotion(
        kind=motion.kind, speed=motion.speed, length=motion.length, radius=0.5 * motion.length,
        direction=motion.direction,
    )  # fmt: skip
    # A circle starts slowly and then continues at constant speed; a stroke starts at rest each
    # time.
    before = plan.ramp if motion.kind == "circle" else 0.0
    count = math.ceil(plan.period / max(_STEP, (plan.period + before) / (MAX_POSES - 2)))
    step = plan.period / count
    loop = math.ceil(before / step)
    seconds = (loop + count) * step
    made = scripted(replace(plan, seconds=seconds), start, dt=step)
    return Table(np.asarray(made.poses, dtype=np.float64), loop, step)


def stroke(motion: object) -> NDArray[np.float64]:
    """Return the way of a scripted slide (3,) [m], zero for other motions."""
    if not isinstance(motion, ScriptedMotion) or motion.kind != "slide":
        return np.zeros(3)
    return motion.length * np.array([math.cos(motion.direction), math.sin(motion.direction), 0.0])
