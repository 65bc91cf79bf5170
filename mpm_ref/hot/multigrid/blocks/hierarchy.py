"""The V-cycle on block kernels: the tested twin of the one on SciPy matrices in `multigrid`."""

from contextlib import nullcontext
from functools import partial
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ..coarsest import CAP, coarsest_solver, energy_norm, solve_by_cg
from ..embedding import taps
from ..options import DTYPES
from ..projectors import checked, coarse_nodes, weights_onto
from ..smoothers import POLYNOMIAL, largest_eigenvalue, times
from . import coarsest
from .galerkin import coarse_radius, galerkin
from .product import planes_of, product
from .sparse import (
    SERIAL,
    BlockMatrix,
    blocks_of,
    coupling_radius,
    diagonal,
    free_directions,
    inverse_blocks,
)
from .sweep import Sweep, correct, residual, split, sweep
from .transfer import Transfer, prolong, restrict, transfer


class BlockLevel(NamedTuple):
    """One level of n nodes in d dimensions."""

    A: sp.bsr_array            # (n d, n d)  matrix [kg]
    index: np.ndarray          # (n, d)      world indices, in this level's spacing
    B: np.ndarray              # (n, d, d)   projectors onto the free directions
    D: np.ndarray              # (n, d, d)   diagonal blocks of A [kg]
    D_inv: np.ndarray          # (n, d, d)   their pseudo-inverses [1/kg]
    radius: int                # nodes over which A couples, along an axis
    blocks: BlockMatrix        # the arrays of A
    transfer: Transfer | None  # to the next level; None on the coarsest


def build(A, index, levels, kernel):
    """Levels, finest first, as `multigrid.hierarchy.build`."""
    blocks, w = blocks_of(A), taps(kernel)
    D, radius = checked(diagonal(blocks)), coupling_radius(blocks, index)
    B, built = free_directions(D), []
    for _ in range(levels - 1):
        embedding, B_coarse = coarse_nodes(index, B, kernel)
        if not 0 < len(embedding.index) < len(index):
            break
        to = transfer(embedding.W, B)
        built.append(BlockLevel(A, index, B, D, inverse_blocks(D, B), radius, blocks, to))
        A = galerkin(blocks, index, to, embedding.index, radius, w)
        index, B, radius, blocks = embedding.index, B_coarse, coarse_radius(radius, w), blocks_of(A)
        D = diagonal(blocks)
    return [*built, BlockLevel(A, index, B, D, inverse_blocks(D, B), radius, blocks, None)]


def build_from_matrices(matrices):
    """Levels of matrices and node indices, as `multigrid.build_from_matrices`."""
    built = []
    for (A, index), coarser in zip_longest(matrices, matrices[1:]):
        blocks = blocks_of(A)
        D = checked(diagonal(blocks))
        B = free_directions(D)
        to = transfer(weights_onto(index, B, coarser[1]), B) if coarser else None
        radius = coupling_radius(blocks, index)
        built.append(BlockLevel(A, index, B, D, inverse_blocks(D, B), radius, blocks, to))
    return built


class BlockGaussSeidel:
    """Sweeps before and after the coarse correction, by kernels that keep their products."""

    def __init__(self, level, dtype=float):
        self.split = split(level.blocks, level.D_inv, level.index, level.radius, dtype)

    def __call__(self, b):
        """The iterate of b (n, d) after one sweep from zero."""
        self._start(b)
        self._sweep(b, 1)
        return self.state.u

    def before(self, b, sweeps):
        """(iterate, residual) of b (n, d) after sweeps from zero."""
        self._start(b)
        self._sweep(b, sweeps)
        return self.state.u, residual(self.split, self.state)

    def after(self, b, correction, sweeps):
        """The iterate of `before` plus a correction (n, d), smoothed again."""
        correct(self.split, self.state, correction)
        self._sweep(b, sweeps)
        return self.state.u

    def _start(self, b):
        self.state = Sweep(np.empty_like(b), np.zeros_like(b), np.empty_like(b))

    def _sweep(self, b, sweeps):
        for _ in range(sweeps):
            sweep(self.split, b, self.state)


class BlockPolynomial:
    """Jacobi or Chebyshev smoothing with products by kernel."""

    def __init__(self, level, word, dtype=float):
        self.level, self.smooth = level, POLYNOMIAL[word]
        self.planes = planes_of(level.blocks, dtype)
        self.largest = largest_eigenvalue(self._product, level.D_inv, level.index)

    def _product(self, u):
        return product(self.planes, u)

    def before(self, b, sweeps):
        """(iterate, residual) of b (n, d) after sweeps from zero."""
        self.u = self.after(b, np.zeros_like(b), sweeps, np.zeros_like(b))
        return self.u, b - self._product(self.u)

    def after(self, b, correction, sweeps, u=None):
        """The iterate of `before` plus a correction (n, d), smoothed again."""
        u = (self.u if u is None else u) + correction
        for _ in range(sweeps):
            r = b - self._product(u)
            u = u + self.smooth(self._product, self.level.D_inv, r, self.largest)
        return u


def smoother(level, choices):
    """Smoother of a level by the words of `Choices`."""
    dtype = DTYPES[choices.precision]
    if choices.smoother == "gauss-seidel":
        return BlockGaussSeidel(level, dtype)
    return BlockPolynomial(level, choices.smoother, dtype)


class BlockHierarchy:
    """Levels on block arrays and the V-cycle over them; see `multigrid.hierarchy.hierarchy`."""

    def __init__(self, levels, choices):
        self.levels, self.choices = levels, choices
        self.smoothers = [smoother(level, choices) for level in self.levels[:-1]]
        self.direct, self.D_inv = coarsest_solver(levels[-1], choices)
        self.coarse = None if self.direct else planes_of(levels[-1].blocks)
        self.iterations = 0           # of the coarsest CG, over all cycles

    def cycle(self, b, on_coarsest=nullcontext):
        """u (n, d), roughly A^+ b, of b (n, d): one V-cycle from zero (HOT-alg2).

        The coarsest level is solved in the context that on_coarsest() returns.
        """
        b = np.ascontiguousarray(b, dtype=float)
        sweeps, rhs = self.choices.sweeps, [b]
        for level, smooth in zip(self.levels, self.smoothers):
            _, r = smooth.before(rhs[-1], sweeps)
            rhs.append(restrict(level.transfer, r))
        with on_coarsest():
            u = self.coarsest(rhs.pop(), b)
        for level, smooth in zip(self.levels[-2::-1], self.smoothers[::-1]):
            u = smooth.after(rhs.pop(), prolong(level.transfer, u), sweeps)
        return u

    def coarsest(self, b, load):
        """The last level's u (m, d) of its b (m, d), in a cycle for `load` (n, d)."""
        last = self.levels[-1]
        b = times(last.B, b)
        if self.direct:
            return self.direct(b)
        of = b if self.choices.stop == "residual" else self._restricted(load)
        enough = self.choices.tolerance * energy_norm(of, self.D_inv)
        if len(b) < SERIAL:
            u, k = coarsest.conjugate_gradients(self.coarse, self.D_inv, b, enough, CAP)
        else:
            u, k = solve_by_cg(partial(product, self.coarse), self.D_inv, b, enough)
        self.iterations += k
        return u

    def _restricted(self, load):
        for level in self.levels[:-1]:
            load = restrict(level.transfer, load.copy())
        return load
