"""Copy and clear records (elements of structured NumPy arrays) in kernels.

A kernel is passed a record as one pointer, and its fields are read and written by name. Nested
arrays and records are views: nothing is allocated and no reference is counted.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import Signature
from numba.extending import intrinsic


@intrinsic
def copy_record(typing_context: Any, target: Any, source: Any) -> Any:
    """Copy all fields of `source` to `target`, a record of the same type. For kernels only."""
    if not isinstance(target, types.Record) or target != source:
        return None

    def generate(context: Any, builder: Any, signature: Signature, arguments: Any) -> Any:
        size = context.get_constant(types.intp, signature.args[0].size)
        cgutils.raw_memcpy(builder, arguments[0], arguments[1], size, 1, align=8)
        return context.get_dummy_value()

    return types.none(target, source), generate


@intrinsic
def clear_record(typing_context: Any, target: Any) -> Any:
    """Set all fields of a record to zero. For kernels only."""
    if not isinstance(target, types.Record):
        return None

    def generate(context: Any, builder: Any, signature: Signature, arguments: Any) -> Any:
        size = ir.Constant(ir.IntType(64), signature.args[0].size)
        cgutils.memset(builder, arguments[0], size, 0)
        return context.get_dummy_value()

    return types.none(target), generate
