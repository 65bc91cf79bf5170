"""Deformation of bodies whose stress needs the stretch V of F = V R, in blocks of particles.

V is a polynomial in F F^T with coefficients of t = sum s_i, the largest root of a polynomial (see
`spectral`). The iteration for t is a chain of divisions, each of which waits for the one before.
Here the iterations of a block of particles run side by side, in vector registers:

    F <- (I + dt L) F of all particles of the block
    t of all particles, by the iteration of `spectral.sum_of_singular`, with the same bits
    tau of all particles, from F and t
"""

from math import sqrt

import numpy as np

from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .law import kirchhoff_of_stretch
from .spectral import (
    FAR_FROM_SINGULAR,
    MOST_ITERATIONS,
    SMALL_STEP,
    halley_step,
    product_of_sums,
    stretch_by_sum,
)
from .state import growth
from .tensor import cofactor, det, mat, mm, mmt, put_mat, trace

BLOCK = 64      # particles


@kernel
def deform_blocks(particles, law, dt, like, bounds):
    """`deform.deform_elastic` in 3D, for laws that have `kirchhoff_of_stretch`."""
    invariants = np.empty((3, BLOCK), particles.F.dtype)
    t, goes_on = np.empty(BLOCK, particles.F.dtype), np.empty(BLOCK, particles.F.dtype)
    for start in range(bounds[0], bounds[1], BLOCK):
        stop = min(start + BLOCK, bounds[1])
        grow(particles, dt, like, (start, stop), invariants)
        sums_of_singular(invariants, t, goes_on)
        for p in range(start, stop):
            F = mat(particles.F, p, like)
            V = stretch_by_sum(F, t[p - start])
            put_mat(particles.tau, p, kirchhoff_of_stretch(F, V, law))


@kernel
def grow(particles, dt, like, bounds, invariants):
    """F <- (I + dt L) F of a block; its |F|^2, |cof F|^2 and det F."""
    for p in range(bounds[0], bounds[1]):
        F = mm(growth(particles.L, p, dt, like), mat(particles.F, p, like))
        B, k = mmt(F, F), p - bounds[0]
        put_mat(particles.F, p, F)
        invariants[0, k], invariants[1, k] = trace(B), trace(cofactor(B))
        invariants[2, k] = det(F)
    for k in range(bounds[1] - bounds[0], BLOCK):
        invariants[0, k], invariants[1, k], invariants[2, k] = 3.0, 3.0, 1.0


@kernel
def sums_of_singular(invariants, t, goes_on):
    """`spectral.sum_of_singular` of a whole block."""
    for k in range(BLOCK):
        t[k], goes_on[k] = sqrt(3.0 * invariants[0, k]), 1.0
    for _ in range(MOST_ITERATIONS):
        if not iterate(invariants, t, goes_on):
            break


@kernel
def iterate(invariants, t, goes_on):
    """One iteration of a whole block, without branches; returns how many go on."""
    left = 0
    for k in range(BLOCK):
        root = t[k]
        n2, k2, J = invariants[0, k], invariants[1, k], invariants[2, k]
        z = product_of_sums(root, n2, J)
        step = halley_step(root, z, n2, k2, J)
        is_on = goes_on[k] > 0.0 and FAR_FROM_SINGULAR * z > root * root * root
        root = root - step if is_on else root
        is_on = is_on and not step <= SMALL_STEP * root
        t[k], goes_on[k] = root, 1.0 if is_on else 0.0
        left += is_on
    return left


def fits(law, d):
    """Return whether `elastic` is for the law in d dimensions."""
    return d == 3 and type(law) in kirchhoff_of_stretch.methods


@parallel_if_many
def elastic(particles, law, dt, like):
    """`deform_blocks` for all particles."""
    for c in prange(CHUNKS):
        deform_blocks(particles, law, dt, like, chunk(c, len(particles.x)))
