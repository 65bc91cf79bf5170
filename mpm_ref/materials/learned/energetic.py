"""Stresses of an energy of four measures of F, each of which vanishes and is flat at rest; 3D.

    q = |F|^2 - 3 - 2 log J,    r = |cof F|^2 - 3 - 4 log J,    u = (J - 1)^2,    w = J - 1 - log J

    psi = unit (N(q, r, u, w) - N(0)),    tau = (dpsi/dF) F^T = unit sum_k N_k T_k

    T_q = 2 (b - I),  T_r = 2 (tr(b) b - b^2) - 4 I,  T_u = 2 J (J - 1) I,  T_w = (J - 1) I

with J = det F, b = F F^T and N_k the slopes of N. For any N, tau is symmetric, objective and
isotropic, and vanishes at rest together with psi: no value or slope at rest must be subtracted.

N is a network whose weights are all positive, with softplus between its layers: it is convex and
grows with each measure. The measures are convex functions of (F, cof F, J), so that psi is
polyconvex; none of them is negative, hence neither is psi; and psi has no bound as J goes to 0,
nor as strains grow. At rest mu = 2 unit (N_q + N_r) and lam = unit (4 N_r + 2 N_u + N_w) are
positive, so that waves are real. `kirchhoff` and `psi` evaluate N and its slopes, backwards through
its layers, in doubles:

    a_{l+1} = softplus(a_l W_l + b_l),   N = a_{L-1} W_{L-1},   g_l = (g_{l+1} softplus'(z_l)) W_l^T

That is more than thermodynamics requires. Laws that are softer in strong compression than any
polyconvex one, such as fixed corotated (NCLAW-eq12), cannot be represented there.
"""

from math import exp, inf, log
from typing import NamedTuple

import numpy as np

from ...core import law as registry
from ...core.jit import CHUNKS, chunk, kernel, parallel, prange
from ...core.tensor import (
    cofactor,
    det,
    identity,
    inner,
    mat,
    mlin,
    mm,
    mmt,
    put_mat,
    trace,
    transpose,
)
from ..waves import moduli_at_rest, stiffness
from .guard import NONE, cut
from .network import flatten, softplus

MEASURES = 4
LIKE = (0, 1, 2)        # any tuple of length 3


class Energetic(NamedTuple):
    """Kirchhoff stress that belongs to an energy."""

    unit: float = 1e4       # of N [Pa]


class EnergyLaw(NamedTuple):
    """F -> psi [J/m^3], tau [Pa]."""

    sizes: np.ndarray   # widths of the layers, inputs first, outputs last; integer
    W: np.ndarray       # weights >= 0, as of `network.NeuralLaw`
    b: np.ndarray
    unit: float         # of N [Pa]
    rest: float         # N at rest
    mu: float           # moduli at rest [Pa]
    lam: float
    low: np.ndarray = NONE      # bounds of strains (see `guard`)
    high: np.ndarray = NONE

    @property
    def dim(self):
        """Number of space dimensions."""
        return 3


def build_law(weights):
    """Return the `EnergyLaw` of a `LawWeights` of kind `Energetic`."""
    law = EnergyLaw(*flatten(weights.layers), weights.kind.unit, 0.0, 0.0, 0.0)
    value, (q, r, u, w) = value_and_slopes((0.0, 0.0, 0.0, 0.0), law)
    return law._replace(rest=value, mu=2.0 * law.unit * (q + r),
                        lam=law.unit * (4.0 * r + 2.0 * u + w))


def measures_of(F):
    """Return q, r, u, w (n, 4) of F (n, 3, 3); NaN unless det F > 0."""
    out = np.empty((len(F), MEASURES))
    _measures(F, out)
    return out


def stresses(g, F):
    """Return sum_k g_k T_k (n, 3, 3) of slopes g (n, 4) and F (n, 3, 3)."""
    tau = np.empty_like(F)
    _stresses(g, F, tau)
    return tau


def pull_back(G, g, F):
    """Return the gradients of g (n, 4), and of F (n, 3, 3) at fixed g, from that of the
    stress, G.
    """
    g_bar, F_bar = np.empty_like(g), np.empty_like(F)
    _pull(G, g, F, g_bar, F_bar)
    return g_bar, F_bar


def pull_back_measures(m_bar, F):
    """Return the gradient of F (n, 3, 3) from that of its measures (n, 4)."""
    F_bar = np.empty_like(F)
    _pull_measures(m_bar, F, F_bar)
    return F_bar


@kernel
def measures(F):
    """Return q, r, u, w of one F with det F > 0."""
    J, K = det(F), cofactor(F)
    log_J = log(J)
    return (inner(F, F) - 3.0 - 2.0 * log_J, inner(K, K) - 3.0 - 4.0 * log_J,
            (J - 1.0) * (J - 1.0), J - 1.0 - log_J)


@kernel
def stress(g, F):
    """Return sum_k g_k T_k."""
    b, J = mmt(F, F), det(F)
    shared = 2.0 * J * (J - 1.0) * g[2] + (J - 1.0) * g[3] - 2.0 * g[0] - 4.0 * g[1]
    tau = mlin(2.0 * g[0] + 2.0 * g[1] * trace(b), b, -2.0 * g[1], mmt(b, b))
    return mlin(1.0, tau, shared, identity(F))


@kernel
def stress_bars(G, g, F):
    """Return the bars of g, T_k : G, and of F at fixed g."""
    b, J = mmt(F, F), det(F)
    S, of_J, t = mlin(0.5, G, 0.5, transpose(G)), trace(G), trace(b)
    S_b, Sb = inner(S, b), mm(S, b)
    g_bar = (2.0 * (S_b - of_J), 2.0 * (t * S_b - inner(Sb, b)) - 4.0 * of_J,
             2.0 * J * (J - 1.0) * of_J, (J - 1.0) * of_J)
    across = mlin(4.0 * (g[0] + g[1] * t), S, -4.0 * g[1], mlin(1.0, Sb, 1.0, transpose(Sb)))
    F_bar = mlin(1.0, mm(across, F), 4.0 * g[1] * S_b, F)
    return g_bar, mlin(1.0, F_bar, of_J * ((4.0 * J - 2.0) * g[2] + g[3]), cofactor(F))


@kernel
def measure_bars(m_bar, F):
    """Return the bar of F, sum_k m_bar_k T_k F^-T."""
    return mlin(1.0 / det(F), mm(stress(m_bar, F), cofactor(F)), 0.0, F)


@kernel
def row(a, p):
    """Return row p of an (n, 4) array."""
    return a[p, 0], a[p, 1], a[p, 2], a[p, 3]


@kernel
def put_row(a, p, x):
    """Set a[p] = x for an (n, 4) array."""
    for k in range(MEASURES):
        a[p, k] = x[k]


@kernel
def measure(F, out, bounds):
    """Compute measures of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        put_row(out, p, measures(mat(F, p, LIKE)))


@kernel
def respond(g, F, tau, bounds):
    """Compute stresses of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        put_mat(tau, p, stress(row(g, p), mat(F, p, LIKE)))


@kernel
def pull(G, given, bars, bounds):
    """Compute bars = (g_bar, F_bar) of the points bounds[0] .. bounds[1] - 1, of given = (g, F)."""
    for p in range(bounds[0], bounds[1]):
        g_bar, F_bar = stress_bars(mat(G, p, LIKE), row(given[0], p), mat(given[1], p, LIKE))
        put_row(bars[0], p, g_bar)
        put_mat(bars[1], p, F_bar)


@kernel
def pull_measures(m_bar, F, F_bar, bounds):
    """Compute the bars of F of the points bounds[0] .. bounds[1] - 1."""
    for p in range(bounds[0], bounds[1]):
        put_mat(F_bar, p, measure_bars(row(m_bar, p), mat(F, p, LIKE)))


@parallel
def _measures(F, out):
    for c in prange(CHUNKS):
        measure(F, out, chunk(c, len(F)))


@parallel
def _stresses(g, F, tau):
    for c in prange(CHUNKS):
        respond(g, F, tau, chunk(c, len(F)))


@parallel
def _pull(G, g, F, g_bar, F_bar):
    for c in prange(CHUNKS):
        pull(G, (g, F), (g_bar, F_bar), chunk(c, len(F)))


@parallel
def _pull_measures(m_bar, F, F_bar):
    for c in prange(CHUNKS):
        pull_measures(m_bar, F, F_bar, chunk(c, len(F)))


@kernel
def slope(z):
    """Return the derivative of softplus at z."""
    return 1.0 / (1.0 + exp(-z))


@kernel
def value_and_slopes(m, law):
    """Return N and its slopes at measures m."""
    z, a = before_last(m, law)
    sizes, w, k, value = law.sizes, len(law.W), len(z), 0.0
    g = law.W[w - len(a):].copy()
    for j in range(len(a)):
        value += a[j] * g[j]
    w -= len(a)
    for l in range(len(sizes) - 3, -1, -1):
        n, h = sizes[l], sizes[l + 1]
        w, k = w - n * h, k - h
        below = np.zeros(n)
        for i in range(n):
            for j in range(h):
                below[i] += law.W[w + i * h + j] * slope(z[k + j]) * g[j]
        g = below
    return value, (g[0], g[1], g[2], g[3])


@kernel
def before_last(m, law):
    """Return z of all layers but the last in a row, and what the last layer reads."""
    sizes, z = law.sizes, law.b[:len(law.b) - 1].copy()
    a, w, k = np.empty(MEASURES), 0, 0
    for i in range(MEASURES):
        a[i] = m[i]
    for l in range(len(sizes) - 2):
        n, h = sizes[l], sizes[l + 1]
        above = np.empty(h)
        for i in range(n):
            for j in range(h):
                z[k + j] += a[i] * law.W[w + i * h + j]
        for j in range(h):
            above[j] = softplus(z[k + j])
        a, w, k = above, w + n * h, k + h
    return z, a


@kernel
def psi(F, law):
    """Return the energy per rest volume [J/m^3]; inf unless det F > 0."""
    F_cut, _ = cut(F, law.low, law.high)
    if not det(F_cut) > 0.0:
        return inf
    value, _ = value_and_slopes(measures(F_cut), law)
    return law.unit * (value - law.rest)


@kernel
def kirchhoff(F, law):
    """Return tau = (dpsi/dF) F^T [Pa]; NaN unless det F > 0."""
    F_cut, _ = cut(F, law.low, law.high)
    _, g = value_and_slopes(measures(F_cut), law)
    return mlin(law.unit, stress(g, F_cut), 0.0, F_cut)


@kernel
def wave(law):
    """Return lam + 2 mu at rest [Pa]."""
    return law.lam + 2.0 * law.mu


@kernel
def at_rest(law):
    """Return lam + 2 mu and 3 lam + 2 mu [Pa]."""
    return law.lam + 2.0 * law.mu, 3.0 * law.lam + 2.0 * law.mu


registry.psi.method(EnergyLaw, psi)
registry.kirchhoff.method(EnergyLaw, kirchhoff)
stiffness.method(EnergyLaw, wave)
moduli_at_rest.method(EnergyLaw, at_rest)
