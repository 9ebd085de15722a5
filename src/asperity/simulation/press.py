"""The height at which a tool touches, and the depth at which it presses with a given force."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from asperity._core.arrays import Array
from asperity.errors import AsperityError

_FIRST_STEP, _LONGEST_STEP = 1e-4, 1e-3
"""First and longest step of the search [m]: a longer one could pass through a thin plate, or to a
depth at which a soft surface no longer pushes."""
_FARTHEST = 1.0
"""Distance above and below the start within which the surface is searched [m]."""


def touching_pose(engine: Any, start: Array) -> Array:
    """Return the pose `start` (7,) raised or lowered to where the tool just touches.

    Parameters
    ----------
    engine : asperity.contact.solver.ContactSolver
    start : (7,) array
    """
    return _level(engine, start, lambda wrench: engine.contacts.count[0] == 0, "meets nothing")


def pressed_pose(engine: Any, touching: Array, force: float) -> Array:
    """Return the pose `touching` (7,) lowered to where the upward force is `force` [N]."""
    if force == 0.0:
        return touching.copy()
    return _level(
        engine, touching, lambda wrench: wrench[2] < force, f"is not pushed up with {force:g} N"
    )


def _level(engine: Any, start: Array, is_above: Callable[[Array], bool], failure: str) -> Array:
    """Return `start` moved along z to the height below which `is_above` no longer holds."""
    pose = start.copy()

    def above(z: float) -> bool:
        pose[2] = z
        engine.reset()
        return bool(is_above(engine.wrench(pose, 0.0)))

    z, step = float(start[2]), _FIRST_STEP
    free = above(z)
    other = z - step if free else z + step
    while above(other) == free:
        z, step = other, min(2.0 * step, _LONGEST_STEP)
        if abs(z - start[2]) > _FARTHEST:
            place = ", ".join(f"{1e3 * value:.4g}" for value in start[:3])
            raise AsperityError(
                f"the tool {failure} within {_FARTHEST:g} m of its start at ({place}) mm; "
                "set trajectory.start, press less, or set a depth"
            )
        other = z - step if free else z + step
    high, low = (z, other) if free else (other, z)
    while high - low > 1e-15 + 1e-15 * abs(high):
        middle = 0.5 * (high + low)
        if middle in (high, low):
            break
        high, low = (middle, low) if above(middle) else (high, middle)
    pose[2] = low
    return pose
