"""The V-cycle on block kernels: the tested twin of the path on SciPy matrices in `multigrid`."""

from functools import partial
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ..coarsest import CAP, by_pcg, of_coarsest, size
from ..embedding import taps
from ..options import DTYPES
from ..projectors import coarse_nodes, given_nodes, onto_range
from ..smoothers import POLYNOMIAL, largest_eigenvalue, times
from . import coarsest
from .galerkin import coarse_reach, galerkin
from .product import planes_of, product
from .sparse import SERIAL, Blocks, blocks_of, diagonal, inverse_blocks, reach_of
from .sweep import Sweep, correct, residual, split, sweep
from .transfer import Transfer, prolong, restrict, transfer


class Level(NamedTuple):
    """One level of n nodes in d dimensions."""

    A: sp.bsr_array            # (n d, n d)  matrix [kg]
    index: np.ndarray          # (n, d)      world indices, in this level's spacing
    B: np.ndarray              # (n, d, d)   projectors onto the free directions
    D: np.ndarray              # (n, d, d)   diagonal blocks of A [kg]
    D_inv: np.ndarray          # (n, d, d)   their pseudo-inverses [1/kg]
    reach: int                 # nodes over which A couples
    blocks: Blocks             # the arrays of A
    transfer: Transfer | None  # to the next level; None on the coarsest


def build(A, index, levels, kernel):
    """Levels, finest first, as `multigrid.build`."""
    blocks, w = blocks_of(A), taps(kernel)
    D, reach = diagonal(blocks), reach_of(blocks, index)
    B, built = onto_range(D), []
    for _ in range(levels - 1):
        embedding, B_coarse = coarse_nodes(index, B, kernel)
        if not 0 < len(embedding.index) < len(index):
            break
        to = transfer(embedding.W, B)
        built.append(Level(A, index, B, D, inverse_blocks(D, B), reach, blocks, to))
        A = galerkin(blocks, index, to, embedding.index, reach, w)
        index, B, reach, blocks = embedding.index, B_coarse, coarse_reach(reach, w), blocks_of(A)
        D = diagonal(blocks)
    return [*built, Level(A, index, B, D, inverse_blocks(D, B), reach, blocks, None)]


def build_given(matrices):
    """Levels of matrices and node indices, as `multigrid.build_given`."""
    built = []
    for (A, index), coarser in zip_longest(matrices, matrices[1:]):
        blocks = blocks_of(A)
        D = diagonal(blocks)
        B = onto_range(D)
        to = transfer(given_nodes(index, B, coarser[1]), B) if coarser else None
        reach = reach_of(blocks, index)
        built.append(Level(A, index, B, D, inverse_blocks(D, B), reach, blocks, to))
    return built


class GaussSeidel:
    """Sweeps before and after the coarse correction, by kernels that keep their products."""

    def __init__(self, level, dtype=float):
        self.split = split(level.blocks, level.D_inv, level.index, level.reach, dtype)

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


class Polynomial:
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
        return GaussSeidel(level, dtype)
    return Polynomial(level, choices.smoother, dtype)


class Hierarchy:
    """Levels on block arrays and the V-cycle over them; see `multigrid.hierarchy`."""

    def __init__(self, levels, choices):
        self.levels, self.choices = levels, choices
        self.smoothers = [smoother(level, choices) for level in self.levels[:-1]]
        self.direct, self.D_inv = of_coarsest(levels[-1], choices)
        self.coarse = None if self.direct else planes_of(levels[-1].blocks)
        self.iterations = 0           # of the coarsest CG, over all cycles

    def cycle(self, b):
        """u (n, d), roughly A^+ b, of b (n, d): one V-cycle from zero (HOT-alg2)."""
        b = np.ascontiguousarray(b, dtype=float)
        sweeps, rhs = self.choices.sweeps, [b]
        for level, smooth in zip(self.levels, self.smoothers):
            _, r = smooth.before(rhs[-1], sweeps)
            rhs.append(restrict(level.transfer, r))
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
        enough = self.choices.tolerance * size(of, self.D_inv)
        if len(b) < SERIAL:
            u, k = coarsest.conjugate_gradients(self.coarse, self.D_inv, b, enough, CAP)
        else:
            u, k = by_pcg(partial(product, self.coarse), self.D_inv, b, enough)
        self.iterations += k
        return u

    def _restricted(self, load):
        for level in self.levels[:-1]:
            load = restrict(level.transfer, load.copy())
        return load
