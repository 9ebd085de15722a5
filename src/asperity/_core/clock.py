"""The monotonic clock of the system, for kernels with a time limit and for their callers.

A call takes some tens of nanoseconds. Where there is no `clock_gettime`, on Windows, kernels know
no time, and so are never late.
"""

from __future__ import annotations

import math
import time
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import Signature
from numba.extending import intrinsic

IS_KNOWN = hasattr(time, "clock_gettime")
_WHICH = getattr(time, "CLOCK_MONOTONIC", 0)


def ends_in(seconds: float) -> float:
    """Return the value of `seconds_now` after `seconds` have passed; 0 (no limit) for inf."""
    if math.isinf(seconds) or not IS_KNOWN:
        return 0.0
    return time.clock_gettime(_WHICH) + seconds


@intrinsic
def seconds_now(typing_context: Any) -> Any:
    """Return the time of the monotonic clock [s]; 0 where there is none. For kernels only."""

    def generate(context: Any, builder: Any, signature: Signature, _: Any) -> Any:
        if not IS_KNOWN:
            return ir.Constant(ir.DoubleType(), 0.0)
        whole, short = ir.IntType(64), ir.IntType(32)
        # struct timespec, where both of its numbers have 64 bits.
        room = cgutils.alloca_once(builder, ir.ArrayType(whole, 2))
        kind = ir.FunctionType(short, [short, room.type])
        ask = cgutils.get_or_insert_function(builder.module, kind, "clock_gettime")
        builder.call(ask, [ir.Constant(short, _WHICH), room])
        parts = [
            builder.sitofp(
                builder.load(builder.gep(room, [ir.Constant(short, 0), ir.Constant(short, i)])),
                ir.DoubleType(),
            )
            for i in range(2)
        ]
        nanoseconds = builder.fmul(parts[1], ir.Constant(ir.DoubleType(), 1e-9))
        return builder.fadd(parts[0], nanoseconds)

    return types.float64(), generate
