"""Laws that thermodynamics admits, of networks, as laws of `core.law` for runs without PyTorch; 3D.

    tau of an energy of measures of F (`energetic`); a return map that contracts (`contraction`)

The stress has an energy, so that runs account for theirs. What networks stand for is written there;
here they are evaluated, in doubles: the energy's with its slopes, backwards through its layers

    a_{l+1} = softplus(a_l W_l + b_l),   N = a_{L-1} W_{L-1},   g_l = (g_{l+1} softplus'(z_l)) W_l^T

How stiff such a law is, is known at rest, as of other learned laws.
"""

from math import exp, inf, log1p
from typing import NamedTuple

import numpy as np

from ...core import law as names
from ...core.jit import kernel
from ...core.spectral import svd
from ...core.tensor import det, mlin, mmt, scale_columns
from ..no_flow import never_fails
from ..waves import moduli_at_rest, stiffness
from .contraction import Contraction, left, read
from .energetic import MEASURES, Energetic, measures, stress
from .network import network, outputs


class EnergyLaw(NamedTuple):
    """F -> psi [J/m^3], tau [Pa]."""

    sizes: np.ndarray   # widths of the layers, inputs first, outputs last; integer
    W: np.ndarray       # weights >= 0, as of `network.NeuralLaw`
    b: np.ndarray
    unit: float         # of N [Pa]
    rest: float         # N at rest
    mu: float           # moduli at rest [Pa]
    lam: float

    @property
    def dim(self):
        """Number of space dimensions."""
        return 3


class ContractionFlow(NamedTuple):
    """F_trial -> F, a return map of the whole deformation gradient."""

    sizes: np.ndarray
    W: np.ndarray
    b: np.ndarray
    strain: float       # see `contraction.Contraction`

    @property
    def dim(self):
        """Number of space dimensions."""
        return 3


def elastic(trained):
    """`EnergyLaw` of a `weights.Trained` of kind `Energetic`."""
    law = EnergyLaw(*network(trained.layers), trained.kind.unit, 0.0, 0.0, 0.0)
    value, (q, r, u, w) = value_and_slopes((0.0, 0.0, 0.0, 0.0), law)
    return law._replace(rest=value, mu=2.0 * law.unit * (q + r),
                        lam=law.unit * (4.0 * r + 2.0 * u + w))


def plastic(trained):
    """`ContractionFlow` of a `weights.Trained` of kind `Contraction`."""
    return ContractionFlow(*network(trained.layers), trained.kind.strain)


MADE = {Energetic: elastic, Contraction: plastic}


@kernel
def softplus(z):
    """log(1 + exp z)."""
    return max(z, 0.0) + log1p(exp(-abs(z)))


@kernel
def slope(z):
    """Of softplus at z."""
    return 1.0 / (1.0 + exp(-z))


@kernel
def value_and_slopes(m, law):
    """N and its slopes at measures m."""
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
    """z of all layers but the last in a row, and what the last layer reads."""
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
    """Energy per rest volume [J/m^3]; inf unless det F > 0."""
    if not det(F) > 0.0:
        return inf
    value, _ = value_and_slopes(measures(F), law)
    return law.unit * (value - law.rest)


@kernel
def kirchhoff(F, law):
    """tau = (dpsi/dF) F^T [Pa]; NaN unless det F > 0."""
    _, g = value_and_slopes(measures(F), law)
    return mlin(law.unit, stress(g, F), 0.0, F)


@kernel
def returned(F, flow):
    """F after the return; NaN unless det F > 0."""
    U, s, V, _ = svd(F)
    x = np.array(read(s, flow.strain))
    y = outputs(x, flow.sizes, flow.W, flow.b)
    return mmt(scale_columns(U, left(s, softplus(y[0]), softplus(y[1]))), V)


@kernel
def wave(law):
    """lam + 2 mu at rest [Pa]."""
    return law.lam + 2.0 * law.mu


@kernel
def at_rest(law):
    """lam + 2 mu and 3 lam + 2 mu [Pa]."""
    return law.lam + 2.0 * law.mu, 3.0 * law.lam + 2.0 * law.mu


for _name, _method in ((names.psi, psi), (names.kirchhoff, kirchhoff), (stiffness, wave),
                       (moduli_at_rest, at_rest)):
    _name.method(EnergyLaw, _method)
names.returned.method(ContractionFlow, returned)
names.intact.method(ContractionFlow, never_fails)
