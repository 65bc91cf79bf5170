"""A return map that contracts the logarithmic strain, and so never adds to an elastic energy; 3D.

Of a trial F = U diag(exp eps) V^T, with e = dev eps and theta = tr eps, it leaves U diag(exp eps')
V^T:

    e' = exp(-a) e,    theta' = exp(-b) theta where theta > 0, else theta
    a, b = softplus(network(x)),    x = log(1 + (|e|, max(theta, 0), max(-theta, 0))/strain)

It is objective and isotropic, and does not change F at rest. Yielding at a radius r is a = max(0,
log(|e|/r)), and that of sand at a multiple of -theta has the same form (NCLAW-eq19, NCLAW-eq16): in
these variables both yield surfaces are straight lines.

It dissipates with any energy that grows with q, r, u and w (`energetic`). Take the strain first
from (e, theta) to (e', theta), then to (e', theta'). On the first path, where e shrinks by a factor
h,

    q = exp(2 theta/3) sum_i exp(2 h e_i) + .., and r with -e_i, are convex in h and flat at h = 0

as sum_i e_i = 0: they decrease with h, and u and w do not change. On the second path theta > 0
decreases; with A = sum_i exp(2 e_i)/3 >= 1, dq/dtheta = 2 A exp(2 theta/3) - 2 > 0, dr/dtheta > 0
similarly, and (J - 1)^2 and J - 1 - log J grow with J > 1. So psi decreases on both, and with the
rate of plastic deformation l_p = -d(eps)/dt in principal axes

    tau : l_p = -dpsi/dt >= 0,    psi(trial) - psi(returned) = integral of tau : l_p >= 0

at every point in every step, for any networks. Compressed matter keeps its volume: from theta < 0
and e != 0, psi may first increase on a path to theta = 0.
"""

from math import exp, log1p
from typing import NamedTuple

import numpy as np

from ...core import law as registry
from ...core.adjoint.deform import back, within
from ...core.jit import CHUNKS, borrowing, chunk, kernel, parallel, prange
from ...core.lanes import stack
from ...core.spectral import UNDETERMINED, mixed
from ...core.tensor import (
    diagonal,
    dot,
    fill,
    lin,
    mat,
    mmt,
    mul,
    norm,
    put_mat,
    put_vec,
    scale_columns,
    total_of,
    vec,
)
from ..log_strain import deviator, log_strain, stretches
from ..log_strain_adjoint import log_gap_ratio
from ..no_flow import never_fails
from ..stretches import inverse
from .guard import NONE, cut_factors, with_half_the_rest
from .layers import outputs
from .network import flatten, softplus
from .principal import pull_back_stretches

READ, ANSWERED = 3, 2
LIKE = (0, 1, 2)        # any tuple of length 3


class Contraction(NamedTuple):
    """Deformation gradient of less logarithmic strain."""

    strain: float = 1e-3        # below which strains are read as they are, above by their logarithm


class ContractionFlow(NamedTuple):
    """F_trial -> F, a return map of the whole deformation gradient."""

    sizes: np.ndarray
    W: np.ndarray
    b: np.ndarray
    strain: float       # see `Contraction`
    low: np.ndarray = NONE      # bounds of strains (see `guard`)
    high: np.ndarray = NONE

    @property
    def dim(self):
        """Number of space dimensions."""
        return 3


def build_flow(weights):
    """Return the `ContractionFlow` of a `LawWeights` of kind `Contraction`."""
    return ContractionFlow(*flatten(weights.layers), weights.kind.strain)


def strains_of(factors, kind):
    """Return x (n, 3) of a `Spectrum`; NaN unless det F > 0."""
    x = np.empty_like(factors.s)
    _strains(factors.s, kind.strain, x)
    return x


def pull_back_strains(x_bar, factors, kind):
    """Return the gradient of F (n, 3, 3) from that of x (n, 3)."""
    s_bar = np.empty_like(factors.s)
    _pull_strains(x_bar, factors.s, kind.strain, s_bar)
    return pull_back_stretches(s_bar, factors)


def contracted(c, factors):
    """Return F (n, 3, 3) after the return, of c = (a, b) (n, 2) and the `Spectrum` of the trial."""
    F = np.empty_like(factors.U)
    _contracted(c, factors, F)
    return F


def pull_back(G, c, factors):
    """Return the gradients of c (n, 2), and of the trial F (n, 3, 3) at fixed c, from that of
    F, G.
    """
    c_bar, F_bar = np.empty_like(c), np.empty_like(factors.U)
    _pull(G, c, factors, c_bar, F_bar)
    return c_bar, F_bar


@kernel
def read(s, strain):
    """Return x of singular values s."""
    eps = log_strain(s)
    theta = total_of(eps)
    return (log1p(norm(deviator(eps)) / strain), log1p(max(theta, 0.0) / strain),
            log1p(max(-theta, 0.0) / strain))


@kernel
def read_bars(x_bar, s, strain):
    """Return the bar of s from that of x; 0 of |e| where e = 0, which has a kink."""
    eps = log_strain(s)
    e, theta = deviator(eps), total_of(eps)
    size = norm(e)
    of_size = x_bar[0] / (strain + size) / size if size > 0.0 else 0.0
    of_theta = x_bar[1] / (strain + theta) if theta > 0.0 else -x_bar[2] / (strain - theta)
    return mul(lin(of_size, e, of_theta, fill(1.0, e)), inverse(s))


@kernel
def left(s, a, b):
    """Return the singular values after the return."""
    eps = log_strain(s)
    theta = total_of(eps)
    theta_new = exp(-b) * theta if theta > 0.0 else theta
    return stretches(lin(exp(-a), deviator(eps), theta_new / len(s), fill(1.0, s)))


@kernel
def left_bars(s, s_new, s_new_bar, a, b):
    """Return the bars of s, a, b from that of `left`."""
    eps = log_strain(s)
    theta, bar = total_of(eps), mul(s_new, s_new_bar)
    opened, mean, share = theta > 0.0, total_of(bar) / len(s), exp(-a)
    rest = exp(-b) if opened else 1.0
    a_bar = -share * dot(bar, deviator(eps))
    b_bar = -rest * theta * mean if opened else 0.0
    s_bar = mul(lin(share, deviator(bar), rest * mean, fill(1.0, s)), inverse(s))
    return s_bar, a_bar, b_bar


@kernel
def pairs_of(s, s_new, share):
    """Return the factors that `mixed` needs of every pair of axes."""
    return (pair(s, s_new, 0, 1, share), pair(s, s_new, 0, 2, share), pair(s, s_new, 1, 2, share))


@kernel
def pair(s, s_new, i, j, share):
    """Return (s'_i - s'_j)/(s_i - s_j), where a share of the deviator is left, and the same of
    sums.
    """
    total = s[i] + s[j]
    skew = (s_new[i] + s_new[j]) / total if total > UNDETERMINED * s[0] else 0.0
    return log_gap_ratio(s, s_new, i, j, share, 0.0), skew


@kernel
def read_all(s, strain, x, bounds):
    """Compute x of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        put_vec(x, p, read(vec(s, p, LIKE), strain))


@kernel
def pull_read(x_bar, s, strain, s_bar, bounds):
    """Compute the bars of s of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        put_vec(s_bar, p, read_bars(vec(x_bar, p, LIKE), vec(s, p, LIKE), strain))


@kernel
def contract(c, factors, F, bounds):
    """Compute F after the return of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        s = left(vec(factors.s, p, LIKE), c[p, 0], c[p, 1])
        put_mat(F, p, mmt(scale_columns(mat(factors.U, p, LIKE), s), mat(factors.V, p, LIKE)))


@kernel
def pull(G, c, factors, bars, bounds):
    """Compute bars = (c_bar, F_bar) of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        U, s, V = mat(factors.U, p, LIKE), vec(factors.s, p, LIKE), mat(factors.V, p, LIKE)
        X, s_new = within(U, mat(G, p, LIKE), V), left(s, c[p, 0], c[p, 1])
        s_bar, bars[0][p, 0], bars[0][p, 1] = left_bars(s, s_new, diagonal(X), c[p, 0], c[p, 1])
        put_mat(bars[1], p, back(U, mixed(s_bar, pairs_of(s, s_new, exp(-c[p, 0])), X), V))


@parallel
def _strains(s, strain, x):
    for c in prange(CHUNKS):
        read_all(s, strain, x, chunk(c, len(s)))


@parallel
def _pull_strains(x_bar, s, strain, s_bar):
    for c in prange(CHUNKS):
        pull_read(x_bar, s, strain, s_bar, chunk(c, len(s)))


@parallel
def _contracted(c, factors, F):
    for k in prange(CHUNKS):
        contract(c, factors, F, chunk(k, len(F)))


@parallel
def _pull(G, c, factors, c_bar, F_bar):
    for k in prange(CHUNKS):
        pull(G, c, factors, (c_bar, F_bar), chunk(k, len(G)))


@borrowing
def contracted_point(factors, flow):
    """Return one F after the return, of U, s, V of the trial; NaN unless det F > 0."""
    U, s, V = factors
    x, strains = stack(s[0], READ), read(s, flow.strain)
    for k in range(READ):
        x[k] = strains[k]
    outputs(x, flow.sizes, flow.W, flow.b)
    return mmt(scale_columns(U, left(s, softplus(x[0]), softplus(x[1]))), V)


@borrowing
def returned(F, flow):
    """Return F after the return map; NaN unless det F > 0."""
    F_cut, factors, is_cut = cut_factors(F, flow.low, flow.high)
    F_new = contracted_point(factors, flow)
    return with_half_the_rest(F, F_cut, F_new) if is_cut else F_new


registry.returned.method(ContractionFlow, returned)
registry.intact.method(ContractionFlow, never_fails)
