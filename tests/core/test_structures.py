"""Structures that kernels are handed as one pointer."""

import pickle
import sys
from typing import NamedTuple

import numba
import numpy as np
import pytest
from llvmlite import ir
from numba.core.errors import TypingError

from asperity._core.kernels import inner_kernel, kernel
from asperity._core.structures import Structure, by_reference

ROW = np.dtype([("number", "i8"), ("vector", "f8", 3)], align=True)


@by_reference
class Inside(NamedTuple):
    values: np.ndarray
    rows: np.ndarray
    count: int


@by_reference
class Outside(NamedTuple):
    flag: bool
    inside: Inside
    table: np.ndarray
    nothing: None
    pair: tuple
    factor: float
    small: np.float32


@inner_kernel
def _fill(given, k):
    inside = given.inside
    for j in range(inside.values.size):
        given.table[j, k] += inside.values[j] * given.factor
    inside.rows[0].number += inside.count
    inside.rows[1].vector[2] = given.table[-1, k]
    return inside.count if given.flag else -1


@kernel
def fill(given):
    """Add to the table, and return sums of the numbers."""
    total = 0
    for k in range(given.table.shape[1]):
        total += _fill(given, k)
    if given.nothing is None:
        total += given.pair[0]
    return total, given.small


@kernel
def missing(given):
    """Read a field that there is none of."""
    return given.absent


@pytest.fixture
def given():
    """Return a structure; the table is no contiguous array."""
    inside = Inside(np.arange(4.0), np.zeros(2, ROW), 7)
    return Outside(True, inside, np.zeros((8, 6))[::2, ::3], None, (100, 2.5), 0.5, np.float32(1.5))


def test_fields_are_read_by_name_and_arrays_are_written_to(given):
    assert fill(given) == (114, 1.5)
    assert np.array_equal(given.table, np.outer(np.arange(4.0), [0.5, 0.5]))
    assert given.inside.rows["number"].tolist() == [14, 0]
    assert given.inside.rows["vector"][1, 2] == 1.5
    assert fill(given._replace(flag=False)) == (98, 1.5)
    assert given.table[3, 0] == 3.0


def test_no_array_is_held_after_a_call(given):
    fill(given)
    arrays = (given.table, given.inside.values, given.inside.rows, given, given.inside)
    before = [sys.getrefcount(array) for array in arrays]
    for _ in range(100):
        fill(given)
    assert [sys.getrefcount(array) for array in arrays] == before


def test_a_kernel_is_handed_one_address_whatever_the_structure_holds(given):
    structure = numba.typeof(given)
    assert isinstance(structure, Structure)
    assert fill.targetctx.get_value_type(structure) == ir.IntType(8).as_pointer()


def test_other_layouts_are_other_types(given):
    turned = given._replace(table=np.zeros((4, 2)))
    one, two = numba.typeof(given), numba.typeof(turned)
    assert one != two
    assert str(one) != str(two)
    assert pickle.loads(pickle.dumps(one)) == one == numba.typeof(given._replace(factor=2.0))
    assert fill(turned) == (114, 1.5)
    assert turned.table[3, 1] == 1.5


def test_what_cannot_be_handed_on_is_refused(given):
    with pytest.raises(TypingError, match="absent"):
        missing(given)
    with pytest.raises(TypingError, match="Cannot determine Numba type"):
        fill(given._replace(factor=object()))
