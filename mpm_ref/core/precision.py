"""Single precision: kernels whose arguments are single compute in single.

In Numba a literal is a double, and one double makes doubles of all that it meets. `Compiler` has a
further pass: in a function whose arguments are single, with no double among them, the literals and
constants become single. All other functions compile as they do without it, so that mixed work, such
as conditions at nodes with their times in double, is done in double.
"""

import numpy as np
from numba.core import ir, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.untyped_passes import IRProcessing

OUTER = -1      # index of a variable of no closure: Numba compares the values of its constants
PRECISIONS = {"double": np.float64, "single": np.float32}


def scalars(kind):
    """Yield the scalar types in a type of Numba: of arrays, tuples and NamedTuples their items."""
    if isinstance(kind, types.Array | types.UniTuple | types.NamedUniTuple):
        yield from scalars(kind.dtype)
    elif isinstance(kind, types.BaseTuple):
        for part in kind:
            yield from scalars(part)
    else:
        yield kind


def is_single(kinds):
    """Return whether types have floats and all of them are single."""
    floats = {one for kind in kinds for one in scalars(kind) if isinstance(one, types.Float)}
    return floats == {types.float32}


def rounded(value):
    """Return a constant with floats in single precision; other constants as they are."""
    if type(value) is tuple:
        return tuple(map(rounded, value))
    return np.float32(value) if type(value) is float else value


@register_pass(mutates_CFG=False, analysis_only=False)
class SingleConstants(FunctionPass):
    """Makes the constants of a function single where its arguments are."""

    _name = "single_constants"

    def __init__(self):
        super().__init__()

    def run_pass(self, state):
        """Change the constants; return whether the function was one to change."""
        if not is_single(state.args):
            return False
        for block in state.func_ir.blocks.values():
            for assignment in block.find_insts(ir.Assign):
                constant = assignment.value
                if isinstance(constant, ir.Const | ir.Global | ir.FreeVar):
                    value = rounded(constant.value)
                    if value is not constant.value:
                        assignment.value = ir.FreeVar(OUTER, repr(value), value, constant.loc)
        return True


class Compiler(CompilerBase):
    """Numba's compiler with the pass `SingleConstants`."""

    def define_pipelines(self):
        """Return the one pipeline."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.add_pass_after(SingleConstants, IRProcessing)
        pipeline.finalize()
        return [pipeline]


def with_rounded_spacing(grid):
    """Return a `state.Grid` with dx in the precision of its arrays, for kernels that compute in it;
    nodes lie at multiples of dx in double, where conditions look for them.
    """
    return grid._replace(dx=converted(grid.dx, grid.v.dtype.type))


def converted(value, real):
    """Return a number, an array or a tuple of such with its floats of the type `real`; nested and
    named tuples likewise. What has that type already, or no floats, stays as it is.
    """
    if isinstance(value, tuple):
        parts = [converted(one, real) for one in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if isinstance(value, np.ndarray):
        return value.astype(real, copy=False) if value.dtype.kind == "f" else value
    if real is np.float64 or not isinstance(value, float | np.floating):
        return value
    return real(value)
