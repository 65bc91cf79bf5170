"""Stresses of laws in principal stretches: P = U diag(y) V^T of F = U diag(s) V^T, y = y(s).

    tau = P F^T = U diag(y s) U^T

The paper's baselines "spline" and "neural" (NCLAW-methods) give y, d numbers, of s. Pulled back, a
gradient tau' of tau is, with T = U^T tau' U,

    y'_i = T_ii s_i,    F' = U (M + T^T diag(y)) V^T     at fixed y, then U diag(s') V^T with s'(y')

where M has no diagonal and in each pair of axes, with X = T diag(s),

    sym  of the pair  a_ij (X_ij + X_ji)/2,    a_ij = (y_i - y_j)/(s_i - s_j)
    skew of the pair  b_ij (X_ij - X_ji)/2,    b_ij = (y_i + y_j)/(s_i + s_j)

b_ij is 0 where s_i + s_j = 0 to round-off, where R is not determined. Of a_ij there are two kinds:

* y is isotropic: exchanging two stretches exchanges their y. Then y_i = y_j where s_i = s_j, tau
does not depend on the axes that the decomposition picks there, and a_ij has the limit dy_i/ds_i -
dy_i/ds_j. As it is an even function of the gap, a law may evaluate it at a small gap, with an error
of the order of the gap squared (see `nclaw.train.principal_laws`). * y is any function of the
sorted stretches, such as a network of them. Where two stretches are equal its y_i and y_j differ,
tau depends on the axes picked, jumps with them, and has no derivative: a_ij grows as one over the
gap. `bounded_ratios` computes a_ij with gaps of at least LEAST_GAP, and is exact for wider ones.
The authors' release has such a bound, 1e-6 for s_i^2 - s_j^2, and also for b_ij, which needs none.
Even so, gradients over tens of steps explode.
"""


import numpy as np

from ...core.adjoint.deform import back, within
from ...core.jit import CHUNKS, by_type, chunk, kernel, parallel, prange
from ...core.spectral import UNDETERMINED, mixed, svd
from ...core.tensor import (
    diag,
    diagonal,
    fill,
    mat,
    mlin,
    mul,
    put_mat,
    put_vec,
    scale_columns,
    transpose,
    vec,
)

LEAST_GAP = 5e-7        # of s_i - s_j, in the ratios of laws that are not isotropic
PAIRS = {2: ((0, 1),), 3: ((0, 1), (0, 2), (1, 2))}     # of axes, as `spectral.mixed` orders them


def stresses(y, factors):
    """Return tau (n, d, d) of y (n, d) and a `Spectrum`."""
    tau = np.empty_like(factors.U)
    _stresses(y, factors, tau, _like(y))
    return tau


def pull_back(G, y, ratios, factors):
    """Return the gradients of y (n, d), and of F (n, d, d) at fixed y, from that of tau, G (n, d,
    d); ratios (n, pairs) are the a_ij.
    """
    y_bar, F_bar = np.empty_like(y), np.empty_like(G)
    _pull((G, y, ratios), factors, (y_bar, F_bar), _like(y))
    return y_bar, F_bar


def pull_back_stretches(s_bar, factors):
    """Return the gradient of F (n, d, d) from that of s (n, d), counted as sorted: U diag(s')
    V^T.
    """
    F_bar = np.empty_like(factors.U)
    _pull_stretches(s_bar, factors, F_bar, _like(s_bar))
    return F_bar


def bounded_ratios(y, s):
    """Return a_ij (n, pairs) of y (n, d) and s (n, d), which descends; gaps count at least
    LEAST_GAP.
    """
    i, j = np.transpose(PAIRS[s.shape[1]])
    return (y[:, i] - y[:, j]) / np.maximum(s[:, i] - s[:, j], LEAST_GAP)


def _like(a):
    return tuple(range(a.shape[1]))


@kernel
def pairs_of(y, s, a):
    """Return what `mixed` needs of every pair of axes: a_ij, b_ij."""
    if len(s) == 2:
        return ((a[0], skew(y, s, 0, 1)),)
    else:
        return (a[0], skew(y, s, 0, 1)), (a[1], skew(y, s, 0, 2)), (a[2], skew(y, s, 1, 2))


@kernel
def skew(y, s, i, j):
    """Return the ratio b_ij."""
    total = s[i] + s[j]
    return (y[i] + y[j]) / total if total > UNDETERMINED * s[0] else 0.0


@kernel
def stress_of(U, s, y):
    """Return U diag(y s) U^T."""
    return back(U, diag(mul(y, s)), U)


stretch_response = by_type("stretch_response")      # (s, law) -> y [Pa]


@kernel
def kirchhoff(F, law):
    """Return tau [Pa]."""
    U, s, _, _ = svd(F)
    return stress_of(U, s, stretch_response(s, law))


@kernel
def respond(y, factors, tau, like, bounds):
    """Compute tau of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        U, s = mat(factors.U, p, like), vec(factors.s, p, like)
        put_mat(tau, p, stress_of(U, s, vec(y, p, like)))


@kernel
def pull(given, factors, bars, like, bounds):
    """Compute bars = (y_bar, F_bar) of the points bounds[0] .. bounds[1] - 1, of given = (G, y,
    ratios).
    """
    G, ys, ratios = given
    for p in range(bounds[0], bounds[1]):
        U, V = mat(factors.U, p, like), mat(factors.V, p, like)
        s, y = vec(factors.s, p, like), vec(ys, p, like)
        T = within(U, mat(G, p, like), U)
        M = mixed(fill(0.0, s), pairs_of(y, s, ratios[p]), scale_columns(T, s))
        put_vec(bars[0], p, mul(diagonal(T), s))
        put_mat(bars[1], p, back(U, mlin(1.0, M, 1.0, scale_columns(transpose(T), y)), V))


@kernel
def pull_stretches(s_bar, factors, F_bar, like, bounds):
    """Compute U diag(s_bar) V^T of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        U, V = mat(factors.U, p, like), mat(factors.V, p, like)
        put_mat(F_bar, p, back(U, diag(vec(s_bar, p, like)), V))


@parallel
def _stresses(y, factors, tau, like):
    for c in prange(CHUNKS):
        respond(y, factors, tau, like, chunk(c, len(y)))


@parallel
def _pull(given, factors, bars, like):
    for c in prange(CHUNKS):
        pull(given, factors, bars, like, chunk(c, len(given[1])))


@parallel
def _pull_stretches(s_bar, factors, F_bar, like):
    for c in prange(CHUNKS):
        pull_stretches(s_bar, factors, F_bar, like, chunk(c, len(s_bar)))
