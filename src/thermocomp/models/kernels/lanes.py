"""Vectors of eight numbers for numba, which does not vectorise loops over eight numbers by itself.

`load` and `store` move a row of an array of shape (n, 8), C order; the other functions work elementwise on loaded
vectors in double precision, so that each lane has the same result as a scalar. For use in compiled functions only.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

LANES = 8
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


class _Lanes(types.Type):
    """numba type of a vector of eight numbers."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)  # type: ignore[no-untyped-call]


register_model(_Lanes)(_LanesModel)
_LANES = _Lanes()


def _address(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, args[0])
    row = context.cast(builder, args[1], signature.args[1], types.uintp)
    first = builder.mul(row, ir.Constant(row.type, LANES))
    return builder.bitcast(builder.gep(array.data, [first]), _VECTOR.as_pointer())


def _load(_: Any, table: Any, row: Any) -> Any:
    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(_address(context, builder, signature, args), align=8)

    return _LANES(table, row), emit


def _store(_: Any, table: Any, row: Any, value: Any) -> Any:
    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[2], _address(context, builder, signature, args), align=8)
        return context.get_dummy_value()

    return types.void(table, row, value), emit


def _splat(_: Any, number: Any) -> Any:
    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        value = context.cast(builder, args[0], signature.args[0], types.float64)
        vector = ir.Constant(_VECTOR, ir.Undefined)
        for k in range(LANES):
            vector = builder.insert_element(vector, value, cgutils.intp_t(k))
        return vector

    return _LANES(number), emit


def _binary(instruction: str) -> Callable[..., Any]:
    def operation(_: Any, a: Any, b: Any) -> Any:
        def emit(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
            return getattr(builder, instruction)(*args)

        return _LANES(a, b), emit

    operation.__name__ = instruction
    return operation


load: Any = intrinsic(_load)
store: Any = intrinsic(_store)
splat: Any = intrinsic(_splat)
add: Any = intrinsic(_binary("fadd"))
subtract: Any = intrinsic(_binary("fsub"))
multiply: Any = intrinsic(_binary("fmul"))
