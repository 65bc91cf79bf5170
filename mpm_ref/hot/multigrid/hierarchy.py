"""Node-embedding multigrid: the readable implementation on SciPy matrices, and the choice
between it and the fast one in `blocks`.

A level is a matrix and the prolongation from the next coarser level; coarse matrices are Galerkin
products (HOT-eq6). Held directions are masked out of every prolongation, so that coarse levels
get the conditions through the product alone and no identity rows leak into them (HOT-bc).
"""

from contextlib import nullcontext
from functools import partial
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from .blocks import hierarchy as block_hierarchy
from .coarsest import coarsest_solver, energy_norm, solve_by_cg
from .options import DTYPES, cycle_options
from .projectors import checked, coarse_nodes, diagonal_blocks, inverses, onto_range, weights_onto
from .smoothers import POLYNOMIAL, GaussSeidel, largest_eigenvalue, times


class Level(NamedTuple):
    """One level of n nodes in d dimensions."""

    A: sp.bsr_array               # (n d, n d)  matrix [kg]
    P: sp.bsr_array | None        # (n d, m d)  prolongation from m coarse nodes; None if coarsest
    index: np.ndarray             # (n, d)      world indices, in this level's spacing
    B: np.ndarray                 # (n, d, d)   projectors onto the free directions
    D: np.ndarray                 # (n, d, d)   diagonal blocks of A [kg]
    D_inv: np.ndarray             # (n, d, d)   their pseudo-inverses [1/kg]


def prolongation(W, B):
    """P with blocks W_ic B_i (HOT-eq4), masked by the projectors B (n, d, d) of the finer nodes."""
    row = np.repeat(np.arange(W.shape[0]), np.diff(W.indptr))
    d = B.shape[1]
    shape = (W.shape[0] * d, W.shape[1] * d)
    return sp.bsr_array((W.data[:, None, None] * B[row], W.indices, W.indptr), shape=shape)


def galerkin(A, P):
    """Coarse matrix P^T A P (HOT-eq5, HOT-eq6)."""
    product = sp.bsr_array(P.T @ A @ P)
    product.sort_indices()
    return product


def build(A, index, levels, kernel):
    """Levels, finest first. Fewer than asked where coarsening would leave no node, or as many."""
    D = checked(diagonal_blocks(A))
    B = onto_range(D)
    built = []
    for _ in range(levels - 1):
        embedding, B_coarse = coarse_nodes(index, B, kernel)
        if not 0 < len(embedding.index) < len(index):
            break
        P = prolongation(embedding.W, B)
        built.append(Level(A, P, index, B, D, inverses(D, B)))
        A, index, B = galerkin(A, P), embedding.index, B_coarse
        D = diagonal_blocks(A)
    return [*built, Level(A, None, index, B, D, inverses(D, B))]


def build_from_matrices(matrices):
    """Levels of matrices and node indices that were made one by one, finest first."""
    built = []
    for (A, index), coarser in zip_longest(matrices, matrices[1:]):
        D = checked(diagonal_blocks(A))
        B = onto_range(D)
        P = prolongation(weights_onto(index, B, coarser[1]), B) if coarser else None
        built.append(Level(A, P, index, B, D, inverses(D, B)))
    return built


def smoother(level, word):
    """The map r -> du, both (n d,), of a word in `options.CHOICES`."""
    if word == "gauss-seidel":
        return GaussSeidel(level.A, level.D_inv, level.index)
    largest = largest_eigenvalue(on_nodes(level.A), level.D_inv, level.index)
    polynomial = partial(POLYNOMIAL[word], on_nodes(level.A), level.D_inv, largest=largest)
    return lambda r: polynomial(r.reshape(level.index.shape)).reshape(-1)


def rounded(levels, precision):
    """The levels, all but the coarsest with their matrix rounded to a precision."""
    if precision == "double":
        return levels
    dtype = DTYPES[precision]
    return [*(level._replace(A=level.A.astype(dtype).astype(float)) for level in levels[:-1]),
            levels[-1]]


def on_nodes(A):
    """The product u -> A u on vectors over nodes (n, d)."""
    return lambda u: (A @ u.reshape(-1)).reshape(u.shape)


def v_cycle(levels, smoothers, b, solve, sweeps=1):
    """u of A u = b, approximately (HOT-alg2): smooth from zero, correct on the next level, smooth
    again. A symmetric positive map of b if each smoother and `solve`, of the coarsest, is one.
    """
    (A, P, *_), *coarser_levels = levels
    if not coarser_levels:
        return solve(b)
    smooth, *coarser_smoothers = smoothers
    u = np.zeros_like(b)
    for _ in range(sweeps):
        u += smooth(b - A @ u)
    u += P @ v_cycle(coarser_levels, coarser_smoothers, P.T @ (b - A @ u), solve, sweeps)
    for _ in range(sweeps):
        u += smooth(b - A @ u)
    return u


class Hierarchy:
    """Levels on SciPy matrices and the V-cycle over them; see `hierarchy`."""

    def __init__(self, levels, choices):
        self.levels, self.choices = rounded(levels, choices.precision), choices
        self.smoothers = [smoother(level, choices.smoother) for level in self.levels[:-1]]
        self.direct, self.D_inv = coarsest_solver(levels[-1], choices)
        self.iterations = 0           # of the coarsest CG, over all cycles

    def cycle(self, b, on_coarsest=nullcontext):
        """u (n, d), roughly A^+ b, of b (n, d): one V-cycle from zero (HOT-alg2).

        The coarsest level is solved in the context that on_coarsest() returns.
        """
        load = b.reshape(-1)
        for level in self.levels[:-1]:
            load = level.P.T @ load

        def solve(r):
            with on_coarsest():
                return self.coarsest(r, load)

        flat = np.array(b, dtype=float).reshape(-1)
        return v_cycle(self.levels, self.smoothers, flat, solve, self.choices.sweeps).reshape(
            b.shape)

    def coarsest(self, b, load):
        """The last level's u (m d,) of its b (m d,), in a cycle for `load`, restricted (m d,)."""
        last = self.levels[-1]
        b = times(last.B, b.reshape(last.index.shape))
        if self.direct:
            return self.direct(b).reshape(-1)
        of = b if self.choices.stop == "residual" else load.reshape(b.shape)
        enough = self.choices.tolerance * energy_norm(of, self.D_inv)
        u, k = solve_by_cg(on_nodes(last.A), self.D_inv, b, enough)
        self.iterations += k
        return u.reshape(-1)


class Implementation(NamedTuple):
    """An implementation: levels by Galerkin products, levels of given matrices, the V-cycle."""

    build: callable
    build_from_matrices: callable
    cycle: callable


IMPLEMENTATIONS = {
    "scipy": Implementation(build, build_from_matrices, Hierarchy),
    "blocks": Implementation(block_hierarchy.build, block_hierarchy.build_from_matrices,
                   block_hierarchy.BlockHierarchy),
}


def hierarchy(A, index, levels=3, kernel="linear", implementation="blocks", **choices):
    """Multigrid hierarchy of A for nodes with world indices index (n, d), lexicographic.

    A is a bsr_array with d x d blocks [kg], symmetric and positive semi-definite; its null
    directions are held directions of single nodes. kernel is "linear", or "quadratic" for
    HOT-quadratic; implementation is "blocks", or "scipy" for the readable twin; choices are fields
    of `options.CycleOptions`. The result has `levels`, `cycle(b)` and the count `iterations` of
    coarsest CG. One level is the coarsest solver alone (LBFGS-H in HOT-methods).

    Raises ValueError for unknown words, for shapes that do not match, or a diagonal not finite.
    """
    chosen, made = cycle_options(levels, choices), _implementation(implementation)
    index = checked_index(A, index)
    return made.cycle(made.build(A, index, levels, kernel), chosen)


def hierarchy_from_matrices(matrices, implementation="blocks", **choices):
    """Multigrid hierarchy of given pairs (A, index) for every level, finest first.

    Index c of a level is the place of index 2 c of the one before; options as for
    `hierarchy`. Embedding is linear (HOT-methods, LBFGS-GMG).
    """
    chosen = cycle_options(len(matrices), choices)
    made = _implementation(implementation)
    given = [(A, checked_index(A, index)) for A, index in matrices]
    return made.cycle(made.build_from_matrices(given), chosen)


def _implementation(word):
    if word not in IMPLEMENTATIONS:
        raise ValueError(f"implementation = {word!r}: expected one of {', '.join(IMPLEMENTATIONS)}")
    return IMPLEMENTATIONS[word]


def checked_index(A, index):
    """Return the node indices (n, d) of A as integers; raises ValueError if shapes do not match."""
    index = np.ascontiguousarray(index, dtype=np.int64)
    n, d = index.shape
    if A.shape != (n * d, n * d) or A.blocksize != (d, d):
        raise ValueError(
            f"matrix of shape {A.shape} in blocks {A.blocksize} for index of shape {index.shape}: "
            f"expected {(n * d, n * d)} in blocks {(d, d)}")
    return index
