"""Arrays on the stack hold what is written to them, each its own, wherever they are made."""

import numpy as np

from asperity._core.kernels import inner_kernel, kernel
from asperity._core.stack import stack_array


@inner_kernel
def _sum_of_products(values):
    products, row = stack_array((3, 3)), stack_array((3,))
    for i in range(3):
        row[i] = values[i]
    for i in range(3):
        for j in range(3):
            products[i, j] = row[i] * row[j]
    total = 0.0
    for i in range(products.shape[0]):
        for j in range(products.shape[1]):
            total += products[i, j] * row[j]
    return total


@inner_kernel
def _nested(values, depth):
    mine = stack_array((3,))
    for i in range(3):
        mine[i] = values[i] + depth
    below = _nested(mine, depth - 1) if depth > 0 else 0.0
    # What was made further down has not touched it.
    return below + mine[0] + mine[1] + mine[2]


@kernel
def _many(values, times):
    total = 0.0
    for _ in range(times):
        total += _sum_of_products(values)
    return total


@kernel
def _deep(values, depth):
    return _nested(values, depth)


def test_an_array_on_the_stack_is_an_array():
    values = np.array([1.0, 2.0, 3.0])
    assert _many(values, 1) == 84.0
    # A loop makes it again in the same place: a million of them need no more room than one.
    assert _many(values, 1_000_000) == 84.0e6


def test_each_call_has_its_own():
    assert _deep(np.array([1.0, 2.0, 3.0]), 3) == 12 * 1 + (
        # (1 + 2 + 3) + 3 d at depth 3, then deeper ones on top of it: d = 3, 5, 6, 6
        3 * 3 + 3 * 5 + 3 * 6 + 3 * 6 + 12
    )
