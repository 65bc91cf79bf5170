"""A hint to the processor to read memory that a kernel needs soon.

Rows of a large array in an order that the processor does not foresee come one by one, each after a
wait for memory. A kernel that names a row some rows ahead has it in the cache when it is due. A
hint changes no number, and one of an address that does not exist is ignored.
"""

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, overload

LINE = 64           # bytes of a line of the cache, which a hint reads
READ, KEEP, DATA = 0, 3, 1      # arguments of LLVM's hint: for reading, into all caches, of data


def prefetch(a, start):
    """Hint that the line of entry `start` of a contiguous array, counted over all axes, is needed
    soon; nothing where Python is not compiled.
    """


@intrinsic
def _hint(context, a, start):
    def code(context, builder, signature, arguments):
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        byte, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        place = builder.bitcast(builder.gep(array.data, [arguments[1]]), byte)
        kind = ir.FunctionType(ir.VoidType(), [byte, *3 * [number]])
        hint = builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        builder.call(hint, [place, number(READ), number(KEEP), number(DATA)])
        return context.get_dummy_value()

    return types.void(a, types.intp), code


@overload(prefetch)
def _compiled(a, start):
    return lambda a, start: _hint(a, start)
