"""Structures of many arrays that kernels are handed as one pointer.

Numba hands a `NamedTuple` on part by part, seven numbers or more for each array of it. A tick has
some 200 arrays, and hundreds of kernels that hand them on: most of their compilation went into
that. A class that is marked with `by_reference` reaches them as the address of a table, from which
a kernel loads what it uses. The table is filled once for each call from Python and does not change
until that returns. So structures that are made within kernels stay what Numba makes of them.
"""

from __future__ import annotations

import hashlib
from typing import Any, TypeVar

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.imputils import impl_ret_borrowed
from numba.core.types.containers import BaseTuple
from numba.core.types.misc import NoneType
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import make_array, populate_array
from numba.np.numpy_support import as_dtype

C = TypeVar("C", bound=type)
_BYTE = ir.IntType(8)
_POINTER = _BYTE.as_pointer()
_WORD = 8
"""Alignment of the parts of a table [bytes]."""
_ARRAY_DATA = 4 * _WORD
"""Where in Numba's description of an array its data's address stands; shape and strides follow."""


class Structure(types.Type):
    """Type of a `NamedTuple` that is passed by reference.

    Parameters
    ----------
    made_by : type
        The class.
    parts : tuple of numba.types.Type
        Types of its fields, in order.
    """

    def __init__(self, made_by: type, parts: tuple[Any, ...]) -> None:
        self.made_by, self.parts = made_by, parts
        digest = hashlib.sha256(repr(parts).encode()).hexdigest()[:16]
        super().__init__(f"{made_by.__module__}.{made_by.__qualname__}-{digest}")

    @property
    def key(self) -> Any:
        """What makes it equal to another."""
        return self.made_by, self.parts

    def place(self, name: str) -> int | None:
        """Return the number of a field, None if there is none of this name."""
        fields: tuple[str, ...] = self.made_by._fields  # type: ignore[attr-defined]
        return fields.index(name) if name in fields else None


def by_reference(cls: C) -> C:
    """Mark a `NamedTuple` of many arrays to be handed to kernels as one pointer.

    Kernels read its fields by name; they neither make one nor return one.
    """

    @typeof_impl.register(cls)
    def _type_of(value: Any, context: Any) -> Structure | None:
        parts = tuple(typeof_impl(part, context) for part in value)
        return None if None in parts else Structure(cls, parts)  # None: Numba refuses the call

    return cls


@register_model(Structure)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, structure: Structure) -> None:
        super().__init__(manager, structure, _POINTER)


@infer_getattr
class _Fields(AttributeTemplate):
    key = Structure

    def generic_resolve(self, structure: Structure, name: str) -> Any:
        place = structure.place(name)
        return None if place is None else structure.parts[place]


_known: dict[Structure, tuple[int, ...]] = {}


def _offsets(context: Any, structure: Structure) -> tuple[int, ...]:
    """Return where in a table the parts begin, and its length [bytes]."""
    if structure not in _known:  # to ask for a size takes LLVM a thousandth of a second
        offsets = [0]
        for part in structure.parts:
            size = context.get_abi_sizeof(context.get_value_type(part))
            offsets.append(offsets[-1] + -(-size // _WORD) * _WORD)
        _known[structure] = tuple(offsets)
    return _known[structure]


def _at(builder: Any, table: Any, offset: int, kind: Any) -> Any:
    """Return the address of a value of a table."""
    address = builder.gep(table, [ir.Constant(ir.IntType(64), offset)])
    return builder.bitcast(address, kind.as_pointer())


def _loaded(builder: Any, table: Any, offset: int, kind: Any) -> Any:
    """Return a number or address of a table, which no kernel changes."""
    value = builder.load(_at(builder, table, offset, kind))
    value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value


@lower_getattr_generic(Structure)
def _field(context: Any, builder: Any, structure: Structure, table: Any, name: str) -> Any:
    place = structure.place(name)
    assert place is not None
    part, offset = structure.parts[place], _offsets(context, structure)[place]
    if isinstance(part, types.Array):
        value = _array(context, builder, part, table, offset)
    elif isinstance(part, BaseTuple | NoneType):
        value = builder.load(_at(builder, table, offset, context.get_value_type(part)))
    else:
        value = _loaded(builder, table, offset, context.get_value_type(part))
    return impl_ret_borrowed(context, builder, part, value)


def _array(context: Any, builder: Any, array: Any, table: Any, offset: int) -> Any:
    """Return Numba's description of an array in a table, part by part: few are used."""
    made, word = make_array(array)(context, builder), context.get_value_type(types.intp)
    kind = context.get_data_type(array.dtype).as_pointer()
    first = offset + _ARRAY_DATA + _WORD
    sizes = [_loaded(builder, table, first + _WORD * k, word) for k in range(2 * array.ndim)]
    populate_array(
        made,
        data=_loaded(builder, table, offset + _ARRAY_DATA, kind),
        shape=sizes[: array.ndim],
        strides=sizes[array.ndim :],
        itemsize=context.get_constant(types.intp, as_dtype(array.dtype).itemsize),
        meminfo=None,
    )
    return made._getvalue()


@unbox(Structure)
def _unboxed(structure: Structure, given: Any, c: Any) -> NativeValue:
    """Fill a table on the stack of the call from Python."""
    offsets = _offsets(c.context, structure)
    table = cgutils.alloca_once(c.builder, ir.ArrayType(ir.IntType(64), offsets[-1] // _WORD))
    table = c.builder.bitcast(table, _POINTER)
    failed = cgutils.alloca_once_value(c.builder, cgutils.false_bit)
    cleanups, held = [], []
    for i, (part, offset) in enumerate(zip(structure.parts, offsets[:-1], strict=True)):
        native = c.unbox(part, c.pyapi.tuple_getitem(given, i))
        c.builder.store(native.value, _at(c.builder, table, offset, native.value.type))
        held.append((part, native.value))
        with c.builder.if_then(native.is_error):
            c.builder.store(cgutils.true_bit, failed)
        if native.cleanup is not None:
            cleanups.append(native.cleanup)

    def cleanup() -> None:
        for free in reversed(cleanups):
            free()
        if c.context.enable_nrt:
            for part, value in held:
                c.context.nrt.decref(c.builder, part, value)

    # The compiler may not connect what is loaded from the table with what has been stored there:
    # else it could move loads of what never changes before the stores.
    handed = c.builder.asm(
        ir.FunctionType(_POINTER, [_POINTER]), "", "=r,0,~{memory}", [table], side_effect=True
    )
    return NativeValue(handed, is_error=c.builder.load(failed), cleanup=cleanup)
