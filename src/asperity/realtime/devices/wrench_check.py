"""Wrenches on their last step to a device: six finite numbers, or nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray

ZERO = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
REFUSED = "the wrench was not six finite numbers; zero was sent"


def taken(wrench: NDArray[Any] | Sequence[float]) -> tuple[float, ...] | None:
    """Return force and torque as six floats, or None if they are not six finite numbers."""
    try:
        values = tuple(map(float, wrench))
    except Exception:  # whatever was handed over, a device's write does not raise
        return None
    # A sum of finite numbers may overflow, so each is asked.
    return values if len(values) == 6 and all(map(math.isfinite, values)) else None
