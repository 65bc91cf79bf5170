"""The Hessian as a solver uses it: the product with it, and an approximate inverse of it."""

from functools import cache, partial
from typing import NamedTuple

import numpy as np

from .krylov import JACOBI, Rule, half, pcg
from .multigrid.blocks import hierarchy as block_hierarchy
from .multigrid.blocks.product import planes_of, product
from .multigrid.blocks.sparse import KNOWN, blocks_of
from .multigrid.hierarchy import hierarchy, hierarchy_of, on_nodes
from .multigrid.projectors import diagonal_blocks, inverses, onto_range
from .multigrid.smoothers import GaussSeidel


class Linear(NamedTuple):
    """Two functions from nodal fields (n, d) to nodal fields: r -> H r and, about, r -> H^-1 r."""

    product: callable
    inverse: callable


def linearised(system, options, watch):
    """The function from dv to the `Linear` of the Hessian there, of the kind that options name."""
    at = _without_matrix if options.operator == "free" else _with_matrix
    if options.inverse == "geometric":
        at = _with_matrices
    return lambda dv: at(system, dv, options, watch)


def _without_matrix(system, dv, options, watch):
    D = system.diagonal(dv)
    if not np.isfinite(D).all():
        return Linear(nowhere, nowhere)
    with watch.part("hierarchy"):
        inverse = JACOBI[options.jacobi](D)
    return Linear(system.product(dv), watch.timed("jacobi", inverse))


def _with_matrix(system, dv, options, watch):
    A = system.matrix(dv)
    if not np.isfinite(A.data).all():
        return Linear(nowhere, nowhere)
    with watch.part("hierarchy"):
        name, inverse = INVERSES[options.inverse](A, system.index, options, watch)
    return Linear(watch.timed("product", by_matrix(A, options.path)), watch.timed(name, inverse))


def _with_matrices(system, dv, options, watch):
    matrices = system.matrices(dv, options.levels)
    if not all(np.isfinite(A.data).all() for A, _ in matrices):
        return Linear(nowhere, nowhere)
    with watch.part("hierarchy"):
        cycle = _cycle_of(hierarchy_of(matrices, options.path, **options.cycle._asdict()), watch)
    times = watch.timed("product", by_matrix(matrices[0][0], options.path))
    return Linear(times, watch.timed("smoothing", cycle))


def first_inverse(system, options, watch):
    """The function from dv to the `Linear` whose inverse is the first one of L-BFGS: that of
    `linearised`, or CG with it as preconditioner, to half of the energy norm (LBFGS-H;
    HOT-sec5.3-coarse).
    """
    at, rule = linearised(system, options, watch), Rule(half, options.cg_iterations)
    if options.inverse != "cg":
        return at

    def by_cg(dv):
        linear = at(dv)
        return linear._replace(inverse=lambda r: solve(linear, r, rule, watch))
    return by_cg


def solve(linear, b, rule, watch):
    """x of H x = b by CG; what it took is told the watch."""
    with watch.part("krylov"):
        solved = pcg(linear.product, b, linear.inverse, rule)
    watch.inner += solved.iterations
    watch.capped += solved.why is not None
    return solved.x


def by_matrix(A, path="blocks"):
    """r -> A r of a bsr_array; on the path of blocks it is put in order for that at the first r.

    Blocks of a size that kernels do not know are left to SciPy.
    """
    if not _by_kernels(A, path):
        return on_nodes(A)
    planes = cache(partial(planes_of, blocks_of(A)))
    return lambda r: product(planes(), r)


def _by_kernels(A, path):
    return path == "blocks" and A.blocksize in KNOWN


def nowhere(r):
    """NaN: what can be done with a matrix that is not finite; the line search will say so."""
    return np.full_like(r, np.nan)


def symmetric_gauss_seidel(A, index, path="blocks"):
    """r -> (D + U)^+ D (D + L)^+ r of A = L + D + U: one coloured sweep forth and back."""
    if _by_kernels(A, path):
        level, = block_hierarchy.build(A, index, 1, "linear")
        return block_hierarchy.GaussSeidel(level)
    D = diagonal_blocks(A)
    sweep = GaussSeidel(A, inverses(D, onto_range(D)), index)
    return lambda r: sweep(r.reshape(-1)).reshape(r.shape)


def _jacobi(A, index, options, watch):
    return "jacobi", JACOBI[options.jacobi](diagonal_blocks(A))


def _sgs(A, index, options, watch):
    return "sgs", symmetric_gauss_seidel(A, index, options.path)


def _cycle(A, index, options, watch):
    grids = hierarchy(A, index, options.levels, options.kernel, options.path,
                      **options.cycle._asdict())
    return "smoothing", _cycle_of(grids, watch)


def _cycle_of(grids, watch):
    """A cycle of a hierarchy; its iterations and time on the coarsest level are told the watch."""
    grids.coarsest = watch.timed("coarse", grids.coarsest)

    def cycle(r):
        before = grids.iterations
        u = grids.cycle(r)
        watch.coarse += grids.iterations - before
        return u
    return cycle


INVERSES = {"jacobi": _jacobi, "cg": _jacobi, "sgs": _sgs, "cycle": _cycle}
