"""How far what solves a system may be off: by round-off, and by the tolerance of the solve.

An approximate inverse has no sum to bound. Its scale is measured: the matrix and the right-hand
side are moved at random by H times their own scales, and the answer moves by H times its.

An accepted increment is any with ||g^||_2 <= eps sqrt(n) (HOT-eq9). Two correct codes differ by all
that this admits: to first order dv is off by H^-1 g, so that its entry i may be off by

    eps sqrt(n) ||row i of H^-1 K||_2,        K = diag(kappa),

since a gradient may be concentrated where it hurts entry i most. The norms of the rows, and of what
follows linearly from dv, are those of H^-1 K z over random z of unit variance.

As it stands this admits any velocity at the rim, where a node has a millionth of the matter but the
kappa of its stiffness. No code leaves such a gradient there: a gradient is a sum over the node's
particles, and what a solve leaves of the energy g.H^-1 g is spread over all nodes. So the gradient
of a node counts at most by sqrt(D_i / mean D), D the size of its diagonal block: then all nodes may
hold as much energy. It is an assumption, and each file tests it on two methods: see `solving`.
"""

import numpy as np
import scipy.sparse as sp

from ..hot.krylov import CGOptions, pcg
from ..hot.linearization import matrix_product
from ..hot.multigrid.hierarchy import hierarchy
from ..hot.multigrid.projectors import diagonal_blocks
from .error_bounds import size

MOVE = 2.0**-36         # of the scales
MOVES = 8               # random moves of a matrix
SAMPLES = 16            # of the increments that a tolerance admits
SAFETY = 2.0            # of root mean squares of so few samples
TIGHT = 0.03            # of the linear solves, in the energy: samples are worth no more


def spread_of(samples):
    """SAFETY times the root mean square, over the first axis, of sizes of entities."""
    return SAFETY * np.sqrt(np.mean([s * s for s in samples], axis=0))


def moved_matrix(A, B, rng):
    """B (A + MOVE Z) B, with Z symmetric and its blocks of the size of sqrt(D_i D_j): by Cauchy and
    Schwarz no sum over particles has larger terms.
    """
    n, d = len(B), B.shape[1]
    root = np.sqrt(size(diagonal_blocks(A)))
    row = np.repeat(np.arange(n), np.diff(A.indptr))
    Z = (root[row] * root[A.indices])[:, None, None] * rng.normal(size=(len(row), d, d))
    Z = np.einsum("kab,kbc,kcd->kad", B[row], Z, B[A.indices])
    Z = sp.bsr_array((Z, A.indices, A.indptr), shape=A.shape)
    moved = sp.bsr_array(A + MOVE / np.sqrt(2.0) * (Z + Z.T), blocksize=(d, d))
    moved.sort_indices()
    return moved


def scale(solve, system, A, b, S_b):
    """Scale (n,) of solve(A, b), for a right-hand side b (n, d) with the scale S_b (n,)."""
    rng, here = np.random.default_rng(0), solve(A, b)
    changes = []
    for _ in range(MOVES):
        nudge = MOVE * S_b[:, None] * system.project(rng.normal(size=b.shape))
        there = solve(moved_matrix(A, system.unknowns.B, rng), b + nudge)
        changes.append(size(there - here) / MOVE)
    return size(here) + spread_of(changes)


def solver(A, index, levels=3):
    """b -> A^+ b by CG with the V-cycle, for many right-hand sides."""
    cycle = hierarchy(A, index, levels, coarsest="direct").cycle
    rule = CGOptions(lambda size: TIGHT)
    return lambda b: pcg(matrix_product(A), b, cycle, rule).x


def increments(system, A, weight, seed):
    """SAMPLES random increments (n, d) [m/s]: A^+ of gradients with the sizes weight (n,)."""
    rng, solve = np.random.default_rng(seed), solver(A, system.index)
    return [solve(system.project(weight[:, None] * rng.normal(size=system.start.shape)))
            for _ in range(SAMPLES)]


def admitted(options, kappa, A):
    """(weights (n,) [kg m/s], factor): the gradients that the tolerance of the options admits, for
    the Hessian A, are those of ||g / weights||_2 <= factor.
    """
    D = size(diagonal_blocks(A))
    share = np.minimum(1.0, np.sqrt(D / D.mean()))
    if options.norm == "L2":
        return options.eps * share, 1.0
    return options.eps * kappa * share, np.sqrt(len(kappa))
