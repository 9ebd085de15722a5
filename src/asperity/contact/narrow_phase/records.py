"""Records of the narrow phase, each one element of a structured array.

Kernels are passed a record as one pointer (`result = results[i]`) and use its fields by name
(`result.depth`). Every field is documented here, with its unit. Lengths are in metres; `(u, v, z)`
are the axes of the contact frame, whose z points out of the body that a surface belongs to.
"""

from __future__ import annotations

import numpy as np

PENETRATION = np.dtype(
    [
        ("depth", "f8"),  # largest overlap found [m]; -inf where nothing overlaps along n
        ("gap", "f8"),  # upper bound of the depth less the depth [m]
        ("nodes", "i8"),  # boxes evaluated
        ("status", "i8"),  # CERTIFIED or BUDGET_SPENT
        ("ties", "i8"),  # points that are equally deep
        ("point", "f8", 3),  # their mean on A's surface, from the contact's origin [m]
        ("slope_normal", "f8", 3),  # m = n - s_u u - s_v v, mean over the ties; world axes
        ("moment", "f8", 3),  # mean of point x m [m]
    ],
    align=True,
)
"""Penetration depth of two bodies along n, the point where it is attained, and its gradient."""

CERTIFIED, BUDGET_SPENT = 0, 1
"""Status: the gap is within the tolerance; or the search stopped before it was."""
