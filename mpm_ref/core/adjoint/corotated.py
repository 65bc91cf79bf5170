"""Adjoint of `deform.elastic` in 3D for laws tau = a (F F^T - V) + p(J) I of F = V R, by blocks.

With T the symmetric part of tau_bar and its spin Z, skew, which turns R as F changes,

    Z V + V Z = T V - V T,    F_bar = a (2 T F - (T + Z) R) + p'(J) (tr T) cof F

Of axial vectors the first says ((tr V) I - V) z = axial(T V). No singular values are needed: R and
V follow from their sum, as in the forward pass (`core.corotated`), and as there all is computed for
a block of particles at once (see `blocks`). Particles whose F is close to singular, inverted, huge
or tiny are left to the formulas in singular values.
"""

from typing import NamedTuple

import numpy as np

from ..corotated import BLOCK, sums_of_singular
from ..jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from ..law import corotated, units
from ..spectral import FAR_FROM_SINGULAR, product_of_sums
from .block_steps import fall_back, load, store
from .blocks import (
    axial_vectors,
    cofactors,
    combinations,
    determinants,
    inner_products,
    plus_skew,
    products,
    products_transposed,
    solve,
    symmetrize,
    traces,
    traces_less,
)

TINY, HUGE = 1e-50, 1e50        # |F|^2 of an F whose fourth powers lose no digits


class BlockRoom(NamedTuple):
    """Storage for the particles of a block: matrices, vectors, and rows of numbers."""

    F: np.ndarray
    K: np.ndarray           # cof F
    B: np.ndarray           # F F^T
    R: np.ndarray           # of F = V R, at last F_bar
    V: np.ndarray
    T: np.ndarray           # tau_bar, then its symmetric part
    A: np.ndarray           # what is on the way
    x: np.ndarray           # likewise, a vector
    factors: np.ndarray     # of a sum of three matrices
    invariants: np.ndarray  # (3, BLOCK) |F|^2, |cof F|^2, det F
    roots: np.ndarray       # (2, BLOCK) sum of singular values, and whether it is still computed
    fits: np.ndarray        # (BLOCK,)   1 where R and V keep their digits, else 0
    of_law: np.ndarray      # (2, BLOCK) bars of a and of p(J)


@kernel
def elastic_blocks(step, bars, law, like, c):
    """`deform.elastic_vjp` of chunk c of the particles."""
    A, x, s = np.empty((7, 9 * BLOCK)), np.empty((2, 3 * BLOCK)), np.empty((8, BLOCK))
    block = BlockRoom(A[0], A[1], A[2], A[3], A[4], A[5], A[6], x[0], x[1], s[:3], s[3:5], s[5],
                      s[6:])
    start, stop = chunk(c, len(step.F))
    for first in range(start, stop, BLOCK):
        bounds = first, min(first + BLOCK, stop)
        load(step, bars, like, bounds, block.F, block.T)
        decompose(block, bounds[1] - first)
        pull_stress(block, law, bounds[1] - first)
        fall_back((block.F, block.T), (block.R, block.of_law, block.fits), law, (step.sums, c),
                  bounds[1] - first)
        add_moduli(block, law, step.sums, c, bounds[1] - first)
        store(step, bars, like, bounds, block.R)


@kernel
def decompose(block, n):
    """R and V of F as in `spectral`, of n particles."""
    F, K, B, R, V, _, A, _, factors, invariants, roots, fits, _ = block
    n2, k2, J = invariants[0], invariants[1], invariants[2]
    cofactors(F, K, n)
    inner_products(F, F, n2, n)
    inner_products(K, K, k2, n)
    determinants(F, K, J, n)
    for k in range(n, BLOCK):
        n2[k], k2[k], J[k] = 3.0, 3.0, 1.0      # of the identity
    sums_of_singular(invariants, roots[0], roots[1])
    rotation_factors(invariants, roots[0], factors, fits, n)
    products_transposed(F, F, B, n)
    products(B, F, A, n)
    combinations(factors, (F, K, A), R, n)
    products_transposed(R, F, V, n)


@kernel
def rotation_factors(invariants, t, factors, fits, n):
    """The factors of F, cof F and F F^T F in R (see `spectral`), and whether R keeps its digits."""
    for k in range(n):
        n2, J, root = invariants[0, k], invariants[2, k], t[k]
        z = product_of_sums(root, n2, J)
        factors[k], factors[k + BLOCK] = 0.5 * (n2 + root * root) / z, root / z
        factors[k + 2 * BLOCK] = -1.0 / z
        is_far = FAR_FROM_SINGULAR * z > root * root * root
        fits[k] = 1.0 if is_far and n2 > TINY and n2 < HUGE else 0.0


@kernel
def pull_stress(block, law, n):
    """The bars of F, in R, and of a and p, from that of tau, of n particles; B, V are used up."""
    F, K, B, R, V, T, A, x, factors, invariants, roots, _, of_law = block
    symmetrize(T, n)
    inner_products(T, B, roots[0], n)
    inner_products(T, V, roots[1], n)
    law_bars(T, roots, of_law, n)
    products(T, V, A, n)
    axial_vectors(A, x, n)
    traces_less(V, A, n)
    cofactors(A, B, n)
    solve(A, B, x, n)
    plus_skew(T, x, A, n)
    products(A, R, B, n)
    products(T, F, V, n)
    stress_factors(invariants, of_law, law, factors, n)
    combinations(factors, (V, B, K), R, n)


@kernel
def law_bars(T, inner, of_law, n):
    """The bars T : (F F^T - V) of a and tr T of p, with inner = T : F F^T, T : V."""
    for k in range(n):
        of_law[0, k] = inner[0, k] - inner[1, k]
    traces(T, of_law[1], n)


@kernel
def stress_factors(invariants, of_law, law, factors, n):
    """The factors of T F, (T + Z) R and cof F in F_bar."""
    for k in range(n):
        a, _, dp = corotated(invariants[2, k], law)
        factors[k], factors[k + BLOCK], factors[k + 2 * BLOCK] = 2.0 * a, -a, dp * of_law[1, k]


@kernel
def add_moduli(block, law, sums, c, n):
    """Add the bars of the moduli, from those of a and p(J), to the sums of chunk c."""
    J, of_law, alone = block.invariants[2], block.of_law, units(law)
    for i in range(len(alone)):
        total = sums[c, i]
        for k in range(n):
            a, p, _ = corotated(J[k], alone[i])
            total += a * of_law[0, k] + p * of_law[1, k]
        sums[c, i] = total


def fits(law, d):
    """Return whether `elastic` is for the law in d dimensions."""
    return d == 3 and type(law) in corotated.methods


def elastic(step, bars, law):
    """Adjoint of `deform.elastic`."""
    _elastic(step, bars, law, (0, 1, 2))


@parallel_if_many
def _elastic(step, bars, law, like):
    for c in prange(CHUNKS):
        elastic_blocks(step, bars, law, like, c)
