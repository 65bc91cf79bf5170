"""Adjoint of `deform.elastic` in 3D for laws tau = a eps + b (tr eps) I of the Hencky strain eps =
log(F F^T)/2, by blocks.

With T the symmetric part of tau_bar and D(T) the change of log(B) as B = F F^T changes by T,

    F_bar = a D(T) F + b (tr T) F^-T        D(T) = int_0^1 (I + t A)^-1 T (I + t A)^-1 dt

where A = B - I. No singular values are needed: the integral is the quadrature of the logarithm (see
`core.logarithm`), whose resolvents are polynomials in A,

    (I + t A)^-1 = ((1 + t i1 + t^2 i2) I - t (1 + t i1) A + t^2 A^2)/(1 + t i1 + t^2 i2 + t^3 i3)

so that D(T) = sum_ij m_ij A^i T A^j with sums m_ij over the nodes. All is computed for a block of
particles at once (see `blocks`). Particles of large strain or inverted are left to the formulas in
singular values.
"""

from typing import NamedTuple

import numpy as np

from ..corotated import BLOCK
from ..jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from ..law import strain_moduli, units
from ..logarithm import LARGEST, MANY
from .block_steps import fall_back, load, store
from .blocks import (
    _1,
    _2,
    _3,
    _4,
    _5,
    _6,
    _7,
    _8,
    _9,
    add_symmetrized,
    cofactors,
    combinations,
    determinants,
    inner_products,
    products,
    symmetrize,
    traces,
)

RADIUS = 0.4        # |eps| below which the derivative of the quadrature errs by round-off alone


class StrainRoom(NamedTuple):
    """Storage for the particles of a block: matrices, and rows of numbers."""

    F: np.ndarray
    K: np.ndarray           # cof F
    T: np.ndarray           # tau_bar, then its symmetric part
    A: np.ndarray           # F F^T - I
    eps: np.ndarray         # first cof A, at last F_bar
    powers: np.ndarray      # (5, 9 BLOCK) products of powers of A and T
    sums: np.ndarray        # of nodes: c0/i3, c1, c2 of eps; m00, m11, m22; m01, m02, m12
    invariants: np.ndarray  # (3, BLOCK) coefficients of det(I + t A)
    J: np.ndarray           # (BLOCK,)   det F
    size: np.ndarray        # (BLOCK,)   |eps|^2
    traces: np.ndarray      # (3, BLOCK) of eps and of T; T : eps
    fits: np.ndarray        # (BLOCK,)   1 where the quadrature is accurate, else 0
    of_law: np.ndarray      # (2, BLOCK) bars of a and of b


@kernel
def elastic_strain_blocks(step, bars, law, like, c):
    """`deform.elastic_vjp` of chunk c of the particles."""
    A, s = np.empty((11, 9 * BLOCK)), np.empty((11, BLOCK))
    block = StrainRoom(A[0], A[1], A[2], A[3], A[4], A[5:10], A[10], s[:3], s[3], s[4], s[5:8],
                       s[8], s[9:])
    start, stop = chunk(c, len(step.F))
    for first in range(start, stop, BLOCK):
        bounds = first, min(first + BLOCK, stop)
        load(step, bars, like, bounds, block.F, block.T)
        measure(block, bounds[1] - first)
        law_bars(block, bounds[1] - first)
        pull_strain(block, law, bounds[1] - first)
        fall_back((block.F, block.T), (block.eps, block.of_law, block.fits), law, (step.sums, c),
                  bounds[1] - first)
        add_moduli(block.of_law, law, step.sums, c, bounds[1] - first)
        store(step, bars, like, bounds, block.eps)


@kernel
def measure(block, n):
    """The strain of F, the sums of nodes, and whether they are accurate, of n particles."""
    F, K, _, A, eps, powers, sums, invariants, J, size, _, fits, _ = block
    cofactors(F, K, n)
    determinants(F, K, J, n)
    stretch_differences(F, A, n)
    cofactors(A, eps, n)
    traces(A, invariants[0], n)
    traces(eps, invariants[1], n)
    determinants(A, eps, invariants[2], n)
    sums[:] = 0.0
    nodes, weights = MANY
    for k in range(len(nodes)):
        add_node(nodes[k], weights[k], invariants, sums, n)
    products(A, A, powers[0], n)
    strains(A, powers[0], (invariants, sums), eps, n)
    inner_products(eps, eps, size, n)
    for k in range(n):
        moderate = J[k] > 0.0 and invariants[0, k] < LARGEST and size[k] < RADIUS * RADIUS
        fits[k] = 1.0 if moderate else 0.0


@kernel
def stretch_differences(F, A, n):
    """A = F F^T - I as `logarithm.stretch_difference`."""
    for k in range(n):
        a, b, c = F[k], F[k + _1], F[k + _2]
        d, e, f = F[k + _3], F[k + _4], F[k + _5]
        g, h, i = F[k + _6], F[k + _7], F[k + _8]
        A[k] = (a - 1.0) * (a + 1.0) + (b * b + c * c)
        A[k + _4] = (e - 1.0) * (e + 1.0) + (d * d + f * f)
        A[k + _8] = (i - 1.0) * (i + 1.0) + (g * g + h * h)
        A[k + _1] = A[k + _3] = a * d + b * e + c * f
        A[k + _2] = A[k + _6] = a * g + b * h + c * i
        A[k + _5] = A[k + _7] = d * g + e * h + f * i


@kernel
def add_node(t, weight, invariants, sums, n):
    """Add a node of the quadrature to the sums."""
    for k in range(n):
        i1, i2, i3 = invariants[0, k], invariants[1, k], invariants[2, k]
        growth = 1.0 + t * i1
        r0, r1, r2 = growth + t * t * i2, -t * growth, t * t
        z = 1.0 / (r0 + t * r2 * i3)
        w = 0.5 * weight * z
        sums[k] += r2 * w
        sums[k + _1] += growth * w
        sums[k + _2] -= t * w
        w = weight * z * z
        sums[k + _3] += r0 * r0 * w
        sums[k + _4] += r1 * r1 * w
        sums[k + _5] += r2 * r2 * w
        sums[k + _6] += r0 * r1 * w
        sums[k + _7] += r0 * r2 * w
        sums[k + _8] += r1 * r2 * w


@kernel
def strains(A, squares, quadrature, eps, n):
    """eps = c0 i3 I + c1 A + c2 A^2 of quadrature = (invariants, sums)."""
    invariants, sums = quadrature
    for k in range(n):
        c0, c1, c2 = sums[k] * invariants[2, k], sums[k + _1], sums[k + _2]
        for e in range(0, _9, BLOCK):
            eps[k + e] = c1 * A[k + e] + c2 * squares[k + e]
        eps[k], eps[k + _4], eps[k + _8] = eps[k] + c0, eps[k + _4] + c0, eps[k + _8] + c0


@kernel
def law_bars(block, n):
    """The symmetric part of tau_bar, and the bars T : eps of a and (tr eps)(tr T) of b."""
    T, eps, found, of_law = block.T, block.eps, block.traces, block.of_law
    symmetrize(T, n)
    traces(eps, found[0], n)
    traces(T, found[1], n)
    inner_products(T, eps, found[2], n)
    for k in range(n):
        of_law[0, k], of_law[1, k] = found[2, k], found[0, k] * found[1, k]


@kernel
def pull_strain(block, law, n):
    """The bars of F, in eps, from that of tau, of n particles; A and T are used up."""
    F, K, T, A, F_bar, powers, sums, _, J, _, found, _, _ = block
    AT, ATA, AAT, AATA, AATAA = powers[0], powers[1], powers[2], powers[3], powers[4]
    products(A, T, AT, n)
    products(AT, A, ATA, n)
    products(A, AT, AAT, n)
    products(AAT, A, AATA, n)
    products(AATA, A, AATAA, n)
    combinations(sums[_6:], (AT, AAT, AATA), A, n)
    combinations(sums[_3:_6], (T, ATA, AATAA), AT, n)
    add_symmetrized(A, AT, n)
    products(AT, F, AAT, n)
    stress_factors(found[1], J, law, sums, n)
    stress_sums(sums, AAT, K, F_bar, n)


@kernel
def stress_factors(tr_T, J, law, factors, n):
    """The factors of D F and cof F in F_bar."""
    a, b = strain_moduli(law)
    for k in range(n):
        factors[k], factors[k + _1] = a, b * tr_T[k] / J[k]


@kernel
def stress_sums(factors, DF, K, F_bar, n):
    """F_bar = f_0 D F + f_1 cof F with vectors of factors."""
    for k in range(n):
        of_DF, of_K = factors[k], factors[k + _1]
        for e in range(0, _9, BLOCK):
            F_bar[k + e] = of_DF * DF[k + e] + of_K * K[k + e]


@kernel
def add_moduli(of_law, law, sums, c, n):
    """Add the bars of the moduli, from those of a and b, to the sums of chunk c."""
    alone = units(law)
    for i in range(len(alone)):
        a, b = strain_moduli(alone[i])
        total = sums[c, i]
        for k in range(n):
            total += a * of_law[0, k] + b * of_law[1, k]
        sums[c, i] = total


def fits(law, d):
    """Return whether `elastic` is for the law in d dimensions."""
    return d == 3 and type(law) in strain_moduli.methods


def elastic(step, bars, law):
    """Adjoint of `deform.elastic`."""
    _elastic(step, bars, law, (0, 1, 2))


@parallel_if_many
def _elastic(step, bars, law, like):
    for c in prange(CHUNKS):
        elastic_strain_blocks(step, bars, law, like, c)
