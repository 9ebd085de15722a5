"""Orders that are balanced over participants.

A Williams design (Williams 1949, Aust. J. Sci. Res. A 2, 149-168) is a Latin square in which every
item also follows every other one equally often, so that effects of order and of carry-over from one
trial to the next cancel out over participants. An even number of items needs as many rows, an odd
one twice as many.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from asperity.errors import AsperityError, require_between

_BLOCKS = 4
"""How often each position comes in each shuffled run of positions."""


def williams(count: int) -> NDArray[np.int64]:
    """Return the rows of a Williams design, each an order of 0 ... `count` - 1.

    Returns
    -------
    (count, count) array of int if `count` is even, else (2 count, count)
    """
    require_between("count", count, 1, 10000)
    ends = [(i // 2 + 1 if i % 2 else count - i // 2) % count for i in range(count)]
    # 0, 1, n-1, 2, n-2, ...: the differences of neighbours are all different.
    rows = (np.array(ends, dtype=np.int64) + np.arange(count)[:, None]) % count
    return rows if count % 2 == 0 else np.concatenate([rows, rows[:, ::-1]])


def participant_number(code: str) -> int:
    """Return the number at the end of a participant's code, from 0: of P07 it is 6.

    Raises
    ------
    AsperityError
        There is none, or it is 0.
    """
    found = re.search(r"(\d+)$", code)
    if found is None or int(found[1]) == 0:
        raise AsperityError(
            'session.order = "balanced" needs codes that end in the number of the participant, '
            f"from 1, such as P07; got {code!r}"
        )
    return int(found[1]) - 1


def balanced_orders(count: int, blocks: int, row: int, seed: list[int]) -> list[list[int]]:
    """Return an order of `count` items for each block: consecutive rows of a Williams design.

    As many consecutive participants as it has rows have each row in each block.

    Parameters
    ----------
    count, blocks : int
    row : int
        The first one, counted around: the number of the participant.
    seed : list of int
        Of the names of the items; the same for all participants.
    """
    names = np.random.default_rng(seed).permutation(count)
    rows = williams(count)
    return [names[rows[(row + block) % len(rows)]].tolist() for block in range(blocks)]


def balanced_positions(intervals: int, trials: int, number: int, seed: list[int]) -> list[int]:
    """Return the interval, from 0, of the comparison in each trial.

    As many consecutive participants as there are intervals have it in another one each, in every
    trial; and each participant equally often in each, in every run of some trials.

    Parameters
    ----------
    intervals, trials : int
    number : int
        Of the participant, from 0.
    seed : list of int
    """
    rng = np.random.default_rng([*seed, number // intervals])
    run = np.repeat(np.arange(intervals), _BLOCKS)
    drawn = [rng.permutation(run) for _ in range(-(-trials // len(run)))]
    places = np.concatenate(drawn)[:trials] if drawn else np.zeros(0, dtype=np.int64)
    return [int(place) for place in (places + number) % intervals]
