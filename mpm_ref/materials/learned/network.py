"""Trained networks as materials: records that kernels are compiled for, without PyTorch.

    tau = answer(net(a), F, R),    F' = answer(net'(a'), F_trial, R')

with a of `invariants`, the layers of `layers` and the answers of `response` (NCLAW-alg2,
NCLAW-alg4), point by point. All is in double, but for the layers of a record whose weights are
single (`with_single_layers`).

Such a stress has no energy. Its stiffness is computed at rest alone, by finite differences.
"""

from math import exp, log1p
from typing import NamedTuple

import numpy as np

from ...core import law as names
from ...core.jit import borrowing, kernel
from ...core.lanes import stack
from ...core.tensor import mmt
from ..no_flow import never_fails
from ..waves import moduli_at_rest, stiffness
from . import response
from .guard import NONE, cut_factors, with_half_the_rest
from .invariants import count, describe
from .layers import outputs
from .response import answer

STEP = 1e-6             # of the differences at rest
INPUTS = 16             # room for them, and for outputs


class NeuralLaw(NamedTuple):
    """F -> tau [Pa], with the answer of a kind of `response`, which each subclass fixes."""

    sizes: np.ndarray   # widths of the layers, inputs first, outputs last; integer
    W: np.ndarray       # weights: of layer l an array (sizes[l], sizes[l + 1]), flattened
    b: np.ndarray       # biases: of layer l an array (sizes[l + 1],)
    unit: float         # of the network's answer [Pa]
    wave: float         # at rest: modulus of a compression wave, lam + 2 mu [Pa], 0 if negative
    largest: float      # ... and the largest for any velocity gradient [Pa]
    low: np.ndarray = NONE      # bounds of strains (see `guard`)
    high: np.ndarray = NONE

    @property
    def dim(self):
        """Number of space dimensions."""
        return dim_of_inputs(self.sizes[0])


class NeuralStress(NeuralLaw):
    """A law with the answer of `response.Stress`."""


class NeuralSymmetricStress(NeuralLaw):
    """A law with the answer of `response.SymmetricStress`."""


class NeuralPlainStress(NeuralLaw):
    """A law with the answer of `response.PlainStress`."""


class NeuralFlow(NamedTuple):
    """F_trial -> F, a return map of the whole deformation gradient; classes as of `NeuralLaw`."""

    sizes: np.ndarray
    W: np.ndarray
    b: np.ndarray
    alpha: float        # what the network's answer is multiplied with
    low: np.ndarray = NONE      # bounds of strains (see `guard`)
    high: np.ndarray = NONE

    @property
    def dim(self):
        """Number of space dimensions."""
        return dim_of_inputs(self.sizes[0])


class NeuralCorrection(NeuralFlow):
    """A flow with the answer of `response.Correction`."""


class NeuralPlainCorrection(NeuralFlow):
    """A flow with the answer of `response.PlainCorrection`."""


LAW_CLASSES = {response.Stress: NeuralStress, response.SymmetricStress: NeuralSymmetricStress,
            response.PlainStress: NeuralPlainStress}
FLOW_CLASSES = {response.Correction: NeuralCorrection,
               response.PlainCorrection: NeuralPlainCorrection}


def dim_of_inputs(inputs):
    """Return the number of space dimensions of a law with this number of inputs."""
    return {inputs_of(d): d for d in (2, 3) for inputs_of in (count, squared)}[int(inputs)]


def squared(d):
    """Return the number of inputs of a law that reads F alone."""
    return d * d


def build_law(trained):
    """Return the `NeuralLaw` of a `LawWeights`. Raises ValueError for one that gives no stress."""
    law = _made(LAW_CLASSES, trained, 0.0, 0.0)
    wave, largest = moduli_of(law)
    return law._replace(wave=wave, largest=largest)


def build_flow(trained):
    """Return the `NeuralFlow` of a `LawWeights`. Raises ValueError for one that gives no F."""
    return _made(FLOW_CLASSES, trained)


def _made(classes, trained, *more):
    try:
        kind = classes[type(trained.kind)]
    except KeyError:
        raise ValueError(f"answers of kind {type(trained.kind).__name__}: expected "
                         f"{' or '.join(known.__name__ for known in classes)}") from None
    return kind(*flatten(trained.layers), *trained.kind, *more)


def flatten(layers):
    """Return sizes, W, b of layers [(W (in, out), b (out,))]."""
    sizes = [len(layers[0][0]), *(len(b) for _, b in layers)]
    W, b = (np.concatenate([np.ravel(a) for a in arrays]).astype(float)
            for arrays in zip(*layers, strict=True))
    return np.array(sizes), W, b


def with_single_layers(law):
    """Return a law or a flow whose layers compute in single precision. Its moduli stay those of its
    layers in double, since differences at rest lose the digits that single has.
    """
    return law._replace(W=law.W.astype(np.float32), b=law.b.astype(np.float32))


def has_single_layers(law):
    """Return whether a law or a flow has layers that compute in single precision."""
    return getattr(law, "W", np.empty(0)).dtype == np.float32


def moduli_of(law):
    """Return the `NeuralLaw.wave` and `NeuralLaw.largest`, of its tangents at rest: along the
    stiffest axis, and the norm of the whole map from strains to stresses. Pull and push differ,
    since singular values are read in their order.
    """
    d = law.dim
    rest, strains = np.eye(d), np.eye(d * d).reshape(-1, d, d)
    tau = stress_of(rest, law)
    tangents = [np.array([(stress_of(rest + h * e, law) - tau).ravel() for e in strains]) / h
                for h in (STEP, -STEP)]
    along = max(float(np.diag(tangent)[:: d + 1].max()) for tangent in tangents)
    return max(along, 0.0), max(float(np.linalg.norm(tangent, 2)) for tangent in tangents)


def stress_of(F, law):
    """Return tau (d, d) of one F (d, d)."""
    return np.array(kirchhoff(tuple(map(tuple, F.tolist())), law))


@kernel
def softplus(z):
    """Return log(1 + exp z)."""
    return max(z, 0.0) + log1p(exp(-abs(z)))


@borrowing
def read_inputs(F, s, sizes, a):
    """Set the first numbers of a to the inputs of a network at F with singular values s: its
    invariants, or F - I.
    """
    d = len(F)
    if sizes[0] == d * d:
        for i in range(d):
            for j in range(d):
                a[d * i + j] = F[i][j] - (1.0 if i == j else 0.0)
    else:
        describe(F, s, a)


@borrowing
def network_answer(F, factors, net):
    """Return the network's Y at F, whose `svd` has the factors (U, s, V), and R; NaN where F is not
    finite.
    """
    U, s, V = factors
    a = stack(F[0][0], INPUTS)
    read_inputs(F, s, net.sizes, a)
    outputs(a, net.sizes, net.W, net.b)
    return square(a, F), mmt(U, V)


@borrowing
def square(a, like):
    """Return the first d x d entries of an array as a matrix, row by row."""
    if len(like) == 2:
        return (a[0], a[1]), (a[2], a[3])
    else:
        return (a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8])


@borrowing
def respond(F, factors, law):
    """Return the answer of a law or a flow at F with its factors (U, s, V)."""
    Y, R = network_answer(F, factors, law)
    return answer(Y, F, R, law)


@borrowing
def kirchhoff(F, law):
    """Return tau = P F^T."""
    F_cut, factors, _ = cut_factors(F, law.low, law.high)
    return respond(F_cut, factors, law)


@borrowing
def returned(F, flow):
    """Return F after the return map."""
    F_cut, factors, is_cut = cut_factors(F, flow.low, flow.high)
    F_new = respond(F_cut, factors, flow)
    return with_half_the_rest(F, F_cut, F_new) if is_cut else F_new


@kernel
def wave(law):
    """Return lam + 2 mu at rest [Pa]."""
    return law.wave


@kernel
def at_rest(law):
    """Return the `NeuralLaw.wave` and `NeuralLaw.largest` [Pa]."""
    return law.wave, law.largest


for _kind, _class in LAW_CLASSES.items():
    answer.method(_class, answer.methods[_kind])
    names.kirchhoff.method(_class, kirchhoff)
    stiffness.method(_class, wave)
    moduli_at_rest.method(_class, at_rest)
for _kind, _class in FLOW_CLASSES.items():
    answer.method(_class, answer.methods[_kind])
    names.returned.method(_class, returned)
    names.intact.method(_class, never_fails)
