"""The last check of a wrench before a device: six finite numbers, or nothing is sent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray

ZERO = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
REFUSED = "the wrench was not six finite numbers; zero was sent"


def finite_wrench(wrench: NDArray[Any] | Sequence[float]) -> tuple[float, ...] | None:
    """Return force and torque as six floats, or None if they are not six finite numbers."""
    try:
        values = tuple(map(float, wrench))
    except Exception:  # a device's `write` must not raise, whatever it was given
        return None
    # Each number is checked, as a sum of finite numbers may overflow.
    return values if len(values) == 6 and all(map(math.isfinite, values)) else None
