"""Numbers side by side in vector registers, room on the stack, and the precision of an array.

The compiler finds such vectors itself in most loops. It does not where sums should stay in
registers although each needs many passes of an inner loop. Products and sums are rounded one by
one, as those of scalars are, so that they have the same bits on every processor.
"""

from llvmlite import ir
from numba.core import types
from numba.core.errors import NumbaTypeError, RequireLiteralValue
from numba.extending import intrinsic, models, register_model
from numba.np.arrayobj import populate_array


class Lanes(types.Type):
    """A vector of `count` numbers of a type `dtype`, in kernels alone."""

    def __init__(self, dtype, count):
        self.dtype, self.count = dtype, count
        super().__init__(f"Lanes({dtype}, {count})")


@register_model(Lanes)
class LanesModel(models.PrimitiveModel):
    """Representation of `Lanes` as a vector of LLVM."""

    def __init__(self, manager, kind):
        one = manager.lookup(kind.dtype).get_value_type()
        super().__init__(manager, kind, ir.VectorType(one, kind.count))


@intrinsic(prefer_literal=True)
def lanes(context, a, start, count):
    """Return the `Lanes` of `count` entries, a constant, of a contiguous array from `start` on.
    Nothing checks that the array has them.
    """
    _require_contiguous(a, a.dtype)
    return Lanes(a.dtype, _constant(count))(a, types.intp, count), _load


@intrinsic
def lanes_as(context, like, a, start):
    """Return the `Lanes` of a contiguous array from `start` on, as many as those of `like`."""
    _require_contiguous(a, like.dtype)
    return like(like, a, types.intp), lambda context, builder, signature, arguments: _load(
        context, builder, signature.return_type(*signature.args[1:]), arguments[1:])


@intrinsic
def put_lanes(context, a, start, values):
    """Set the entries of a contiguous array from `start` on to `Lanes`."""
    _require_contiguous(a, values.dtype)

    def code(context, builder, signature, arguments):
        place, alignment = _place(context, builder, (a, values), arguments)
        builder.store(arguments[2], place, align=alignment)
        return context.get_dummy_value()

    return types.void(a, types.intp, values), code


@intrinsic
def plus_product(context, z, a, w):
    """Return z + a w of `Lanes` z and w, alike, and a number a."""
    if w != z:
        raise NumbaTypeError(f"lanes {w}: expected {z}")

    def code(context, builder, signature, arguments):
        z, a, w = arguments
        lane, every = ir.IntType(32), ir.VectorType(ir.IntType(32), w.type.count)
        one = builder.insert_element(ir.Constant(w.type, ir.Undefined), a, lane(0))
        a = builder.shuffle_vector(one, one, ir.Constant(every, None))
        return builder.fadd(z, builder.fmul(a, w))

    return z(z, z.dtype, w), code


@intrinsic(prefer_literal=True)
def stack(context, like, n):
    """Return an array of n numbers, a constant, of the type of `like`: room on the stack of the
    kernel that calls, with any content, and gone when it returns: it must not be returned.
    """
    count, kind = _constant(n), types.Array(like, 1, "C")

    def code(context, builder, signature, arguments):
        one, length = context.get_data_type(like), ir.Constant(ir.IntType(64), count)
        with builder.goto_entry_block():        # in a loop it would grow the stack
            room = builder.alloca(ir.ArrayType(one, count))
        size = ir.Constant(ir.IntType(64), context.get_abi_sizeof(one))
        array = context.make_array(kind)(context, builder)
        populate_array(array, builder.bitcast(room, one.as_pointer()), [length], [size], size, None)
        return array._getvalue()

    return kind(like, n), code


@intrinsic
def is_single(context, a):
    """Return whether an array is of single precision, a constant of the compiler."""
    answer = a.dtype == types.float32

    def code(context, builder, signature, arguments):
        return ir.Constant(ir.IntType(1), int(answer))

    return types.boolean(a), code


def _require_contiguous(a, dtype):
    """Raise TypingError unless an array is contiguous, and of a type of numbers."""
    if a.layout != "C" or a.dtype != dtype:
        raise NumbaTypeError(f"lanes of {a}: expected a contiguous array of {dtype}")


def _constant(kind):
    if not isinstance(kind, types.IntegerLiteral):
        raise RequireLiteralValue("a number of entries: expected a constant")
    return kind.literal_value


def _load(context, builder, signature, arguments):
    """Load the `Lanes` that a signature (array, start, ..) returns."""
    kinds = signature.args[0], signature.return_type
    place, alignment = _place(context, builder, kinds, arguments)
    return builder.load(place, align=alignment)


def _place(context, builder, kinds, arguments):
    """Return address and alignment of lanes of an array; kinds: of both, arguments: array and start
    of the lanes.
    """
    array = context.make_array(kinds[0])(context, builder, arguments[0])
    first = builder.gep(array.data, [arguments[1]])
    return (builder.bitcast(first, context.get_value_type(kinds[1]).as_pointer()),
            context.get_abi_sizeof(context.get_data_type(kinds[0].dtype)))
