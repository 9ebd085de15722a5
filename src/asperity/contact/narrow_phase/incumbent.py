"""What a search knows, one row of numbers; and when it has to end.

A search that ends before it is certain says so: what it has found is the least that the depth can
be, and the bounds that are left say how much more it could be.
"""

from __future__ import annotations

import numpy as np

from asperity._core.clock import seconds_now
from asperity._core.kernels import inner_kernel, small_kernel

BEST, UPPER = 0, 1
"""The least and the most that the depth can be [m]."""
NODES, LIMIT = 2, 3
"""How many boxes were looked at, and how many may be."""
TIES = 4
"""How many places are as deep as the deepest, with stale ones."""
JUDGED = 5
"""The bound of the box that was judged last [m]."""
UNTIL = 6
"""When there is to be a result, by `kernel_clock` [s]; 0: whenever."""
LOOK = 7
"""With so many nodes the clock is looked at next."""
CUT = 8
"""Whether a search was ended by the clock, since this was last set to 0."""
STATE_SIZE = 9

_EVERY = 8.0
"""Nodes between two looks at the clock: some 15 us."""
_AT_LEAST = 16.0
"""Nodes that every search has, however late it is; ours."""


@inner_kernel
def begin_state(state, max_nodes, floor):
    """Know nothing but that places deeper than `floor` [m] are looked for."""
    state[BEST], state[UPPER], state[NODES] = floor, -np.inf, 0.0
    state[LIMIT], state[TIES], state[LOOK] = max_nodes, 0.0, _AT_LEAST


@small_kernel
def is_spent(state):
    """Return whether the nodes that a search may look at are spent, or its time."""
    nodes = state[NODES]
    if nodes >= state[LIMIT]:
        return True
    if state[UNTIL] == 0.0 or nodes < state[LOOK]:
        return False
    state[LOOK] = nodes + _EVERY
    if seconds_now() < state[UNTIL]:
        return False
    state[LIMIT], state[CUT] = nodes, 1.0
    return True
