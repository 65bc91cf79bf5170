"""The Hessian as solvers use it: the product with it, and an approximate inverse of it."""

from functools import cache, partial
from typing import NamedTuple

import numpy as np

from .krylov import JACOBI, CGOptions, one_half, pcg
from .multigrid.blocks import hierarchy as block_hierarchy
from .multigrid.blocks.product import planes_of, product
from .multigrid.blocks.sparse import BLOCK_SIZES, blocks_of
from .multigrid.hierarchy import hierarchy, hierarchy_from_matrices, on_nodes
from .multigrid.projectors import diagonal_blocks, inverses, onto_range
from .multigrid.smoothers import GaussSeidel


class Linearization(NamedTuple):
    """Two functions from nodal fields (n, d) to nodal fields: r -> H r and, about, r -> H^-1 r."""

    product: callable
    inverse: callable


def linearizer(system, options, profiler):
    """Return the function from dv to the `Linearization` there, of the kind that options name."""
    linearize = _without_matrix if options.operator == "matrix-free" else _with_matrix
    if options.inverse == "geometric":
        linearize = _with_matrices
    return lambda dv: linearize(system, dv, options, profiler)


def _without_matrix(system, dv, options, profiler):
    D = system.diagonal(dv)
    if not np.isfinite(D).all():
        return Linearization(not_finite, not_finite)
    with profiler.part("hierarchy"):
        inverse = JACOBI[options.jacobi](D)
    return Linearization(system.product(dv), profiler.timed("jacobi", inverse))


def _with_matrix(system, dv, options, profiler):
    A = system.matrix(dv)
    if not np.isfinite(A.data).all():
        return Linearization(not_finite, not_finite)
    with profiler.part("hierarchy"):
        name, inverse = INVERSES[options.inverse](A, system.index, options, profiler)
    product_ = matrix_product(A, options.implementation)
    return Linearization(profiler.timed("product", product_), profiler.timed(name, inverse))


def _with_matrices(system, dv, options, profiler):
    matrices = system.matrices(dv, options.levels)
    if not all(np.isfinite(A.data).all() for A, _ in matrices):
        return Linearization(not_finite, not_finite)
    with profiler.part("hierarchy"):
        grids = hierarchy_from_matrices(matrices, options.implementation, **options.cycle._asdict())
        cycle = _cycle_of(grids, profiler)
    times = profiler.timed("product", matrix_product(matrices[0][0], options.implementation))
    return Linearization(times, profiler.timed("smoothing", cycle))


def initial_inverse(system, options, profiler):
    """Return the function from dv to the `Linearization` whose inverse starts L-BFGS: that of
    `linearizer`, or CG with it as preconditioner, to half of the energy norm (LBFGS-H;
    HOT-sec5.3-coarse).
    """
    linearize = linearizer(system, options, profiler)
    rule = CGOptions(one_half, options.max_cg_iterations)
    if options.inverse != "cg":
        return linearize

    def by_cg(dv):
        linear = linearize(dv)
        return linear._replace(inverse=lambda r: solve(linear, r, rule, profiler))
    return by_cg


def solve(linear, b, rule, profiler):
    """Return x of H x = b by CG; the profiler counts its iterations."""
    with profiler.part("krylov"):
        solved = pcg(linear.product, b, linear.inverse, rule)
    profiler.cg_iterations += solved.iterations
    profiler.capped_solves += solved.message is not None
    return solved.x


def matrix_product(A, implementation="blocks"):
    """Return the function r -> A r of a bsr_array, by block kernels or by SciPy.

    Block kernels rearrange A at the first r; SciPy takes blocks of sizes that they do not have.
    """
    if not _by_kernels(A, implementation):
        return on_nodes(A)
    planes = cache(partial(planes_of, blocks_of(A)))
    return lambda r: product(planes(), r)


def _by_kernels(A, implementation):
    return implementation == "blocks" and A.blocksize in BLOCK_SIZES


def not_finite(r):
    """Return NaN, the product with a matrix that is not finite; the line search reports it."""
    return np.full_like(r, np.nan)


def symmetric_gauss_seidel(A, index, implementation="blocks"):
    """Return r -> (D + U)^+ D (D + L)^+ r of A = L + D + U: one coloured sweep forth and back."""
    if _by_kernels(A, implementation):
        level, = block_hierarchy.build(A, index, 1, "linear")
        return block_hierarchy.BlockGaussSeidel(level)
    D = diagonal_blocks(A)
    sweep = GaussSeidel(A, inverses(D, onto_range(D)), index)
    return lambda r: sweep(r.reshape(-1)).reshape(r.shape)


def _jacobi(A, index, options, profiler):
    return "jacobi", JACOBI[options.jacobi](diagonal_blocks(A))


def _sgs(A, index, options, profiler):
    return "sgs", symmetric_gauss_seidel(A, index, options.implementation)


def _cycle(A, index, options, profiler):
    grids = hierarchy(A, index, options.levels, options.kernel, options.implementation,
                      **options.cycle._asdict())
    return "smoothing", _cycle_of(grids, profiler)


def _cycle_of(grids, profiler):
    """A cycle of a hierarchy; the profiler gets its iterations and time on the coarsest level."""
    def cycle(r):
        before = grids.iterations
        u = grids.cycle(r, partial(profiler.part, "coarse"))
        profiler.coarse_iterations += grids.iterations - before
        return u
    return cycle


INVERSES = {"jacobi": _jacobi, "cg": _jacobi, "sgs": _sgs, "cycle": _cycle}
