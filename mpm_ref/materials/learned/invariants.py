"""Invariants of a deformation gradient, the inputs of a neural law, and their adjoint.

With F = U diag(s) V^T, where U and V are proper rotations, a law reads (NCLAW-alg4,
NCLAW-input-norm)

    a = (s - 1, F^T F - I, det F - 1),    d + d^2 + 1 numbers, 13 in 3D

which do not change with rotations R* F (NCLAW-eq22 to NCLAW-eq30) and which vanish at F = I. Its
output is rotated by R = U V^T. Pulled back, a gradient a' of a, and R' of R, is

    F' = U (diag(s') + X) V^T + F (C' + C'^T) + J' cof F,    X_ij = (M_ij - M_ji)/(s_i + s_j)

with M = U^T R' V (`spectral.d_rotation` is its own transpose): U and V do not occur alone, so
that repeated singular values need no special treatment. s' is in the order of the sorted values.
"""

from typing import NamedTuple

import numpy as np

from ...core.jit import CHUNKS, chunk, kernel, parallel, prange
from ...core.spectral import d_rotation, svd
from ...core.tensor import cofactor, det, diag, mat, mlin, mm, mmt, put_mat, put_vec, transpose, vec


class Spectrum(NamedTuple):
    """F = U diag(s) V^T of many points; see `spectral.svd`."""

    U: np.ndarray       # (n, d, d)
    s: np.ndarray       # (n, d)
    V: np.ndarray       # (n, d, d)


def count(d):
    """Return the number of invariants in d dimensions."""
    return d + d * d + 1


def spectrum(F):
    """Return the `Spectrum` of F (n, d, d); NaN where F is not finite."""
    n, d, _ = F.shape
    result = Spectrum(np.empty((n, d, d)), np.empty((n, d)), np.empty((n, d, d)))
    _spectra(F, result, tuple(range(d)))
    return result


def rotations(factors):
    """Return R = U V^T (n, d, d) of a `Spectrum`."""
    R = np.empty_like(factors.U)
    _turn(factors, R, tuple(range(R.shape[1])))
    return R


def invariants(F, factors):
    """Return a (n, count(d)) of F (n, d, d) with its `Spectrum`."""
    n, d, _ = F.shape
    a = np.empty((n, count(d)))
    _read(F, factors.s, a, tuple(range(d)))
    return a


def pull_back(F, factors, a_bar, R_bar):
    """Return the gradient (n, d, d) with respect to F, of gradients a_bar (n, count(d)) and R_bar
    (n, d, d); zero where F leaves R undetermined.
    """
    F_bar = np.empty_like(F)
    _pull(F, factors, (a_bar, R_bar), F_bar, tuple(range(F.shape[1])))
    return F_bar


@kernel
def decompose(F, factors, like, bounds):
    """Compute the singular value decompositions of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        U, s, V, _ = svd(mat(F, p, like))
        put_mat(factors.U, p, U)
        put_vec(factors.s, p, s)
        put_mat(factors.V, p, V)


@kernel
def turn(factors, R, like, bounds):
    """Compute R = U V^T of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        put_mat(R, p, mmt(mat(factors.U, p, like), mat(factors.V, p, like)))


@kernel
def read(F, s, a, like, bounds):
    """Apply `describe` to the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        describe(mat(F, p, like), vec(s, p, like), a[p])


@kernel
def describe(F, s, a):
    """Set a = (s - 1, F^T F - I, det F - 1), F^T F row by row; further entries of a stay."""
    d = len(s)
    C = mm(transpose(F), F)
    for i in range(d):
        a[i] = s[i] - 1.0
        for j in range(d):
            a[d + d * i + j] = C[i][j] - (1.0 if i == j else 0.0)
    a[d + d * d] = det(F) - 1.0


@kernel
def pull(F, factors, bars, F_bar, like, bounds):
    """Compute F_bar of the points bounds[0] .. bounds[1] - 1, from bars = (a_bar, R_bar)."""
    a_bar, R_bar = bars
    for p in range(bounds[0], bounds[1]):
        factors_p = mat(factors.U, p, like), vec(factors.s, p, like), mat(factors.V, p, like)
        put_mat(F_bar, p, pulled(mat(F, p, like), factors_p, a_bar[p], mat(R_bar, p, like)))


@kernel
def pulled(F, factors, a_bar, R_bar):
    """Return the bar of one F with factors (U, s, V), from those of its invariants and of R."""
    (U, s, V), d = factors, len(F)
    a = a_bar.reshape(1, -1)
    from_s = mmt(mm(U, diag(vec(a, 0, s))), V)
    spin = d_rotation(U, s, V, R_bar)
    C_bar = mat(a[0, d:d + d * d].reshape(1, d, d), 0, F)
    stretch = mm(F, mlin(1.0, C_bar, 1.0, transpose(C_bar)))
    size = mlin(a_bar[d + d * d], cofactor(F), 1.0, stretch)
    return mlin(1.0, mlin(1.0, from_s, 1.0, spin), 1.0, size)


@parallel
def _spectra(F, factors, like):
    for c in prange(CHUNKS):
        decompose(F, factors, like, chunk(c, len(F)))


@parallel
def _turn(factors, R, like):
    for c in prange(CHUNKS):
        turn(factors, R, like, chunk(c, len(R)))


@parallel
def _read(F, s, a, like):
    for c in prange(CHUNKS):
        read(F, s, a, like, chunk(c, len(F)))


@parallel
def _pull(F, factors, bars, F_bar, like):
    for c in prange(CHUNKS):
        pull(F, factors, bars, F_bar, like, chunk(c, len(F)))
