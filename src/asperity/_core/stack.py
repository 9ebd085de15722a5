"""Small arrays for kernels, on the stack: nothing is allocated, and no reference is counted.

`np.empty(3)` in a kernel asks for memory and counts who holds it, atomically: of a tick that
takes some microseconds, that and handing arrays on took a third.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import Signature
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array


@intrinsic(prefer_literal=True)
def stack_array(typing_context: Any, shape: Any) -> Any:
    """Return an uninitialised array of floats that lives until the function returns.

    `shape` is a tuple of constants, as in `stack_array((3, 3))`. The array must not be returned,
    nor kept. For kernels only.
    """
    if not hasattr(shape, "types"):
        return None
    counts: list[int] = [getattr(part, "literal_value", 0) for part in shape.types]
    if not all(counts):
        return None
    array = types.Array(types.float64, len(counts), "C")

    def generate(context: Any, builder: Any, signature: Signature, _: Any) -> Any:
        number = 1
        strides: list[int] = []
        for count in reversed(counts):
            strides.insert(0, 8 * number)
            number *= count
        room = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), number))
        made = make_array(array)(context, builder)

        def sizes(values: list[int]) -> Any:
            return [context.get_constant(types.intp, value) for value in values]

        populate_array(
            made,
            data=builder.bitcast(room, ir.DoubleType().as_pointer()),
            shape=sizes(counts),
            strides=sizes(strides),
            itemsize=context.get_constant(types.intp, 8),
            meminfo=None,
        )
        return made._getvalue()

    return array(shape), generate
