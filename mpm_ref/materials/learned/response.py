"""Stress or deformation gradient from the outputs of a neural law, rotated by R of F = R S.

With the d x d numbers Y that a network gives and T = (Y + Y^T)/2 (NCLAW-alg4, NCLAW-eq33 to
NCLAW-eq37):

    Stress              tau = unit R T F^T      the paper's P = R T, times F^T
    SymmetricStress     tau = unit R T R^T      ours: symmetric for any T; R T F^T is only where T
                                                and S commute (NCLAW-X5)
    Correction          F' = F + alpha R T      the plastic law
    PlainStress         tau = unit Y F^T        without R, as the paper's ablation has them
    PlainCorrection     F' = F + alpha Y

`bars` gives the gradients of Y, F and R from that of the stress or deformation gradient.
"""

from typing import NamedTuple

import numpy as np

from ...core.jit import CHUNKS, by_type, chunk, kernel, parallel, prange
from ...core.tensor import mat, mlin, mm, mmt, put_mat, transpose

ALPHA = 1e-3        # of the plastic law (NCLAW-alg4)


class Stress(NamedTuple):
    """Kirchhoff stress of NCLAW-alg4."""

    unit: float = 1.0       # of Y [Pa]


class SymmetricStress(NamedTuple):
    """Kirchhoff stress that is symmetric."""

    unit: float = 1.0       # of Y [Pa]


class PlainStress(NamedTuple):
    """Kirchhoff stress that does not turn with the body."""

    unit: float = 1.0       # of Y [Pa]


class Correction(NamedTuple):
    """Deformation gradient of NCLAW-alg4."""

    alpha: float = ALPHA


class PlainCorrection(NamedTuple):
    """Deformation gradient that does not turn with the body."""

    alpha: float = ALPHA


STRESSES = Stress, SymmetricStress, PlainStress
CORRECTIONS = Correction, PlainCorrection


class Bars(NamedTuple):
    """Gradients of what an answer is made of; (n, d, d) each."""

    Y: np.ndarray
    F: np.ndarray
    R: np.ndarray


answer = by_type("answer")      # (Y, F, R, kind) -> d x d
bars = by_type("bars")          # (G, Y, F, R, kind) -> gradients of Y, F, R; G that of the answer


def answers(Y, F, R, kind):
    """Return the answers (n, d, d) to the networks' Y (n, d, d) at F (n, d, d) = R S."""
    out = np.empty_like(F)
    _answers((Y, F, R), kind, out, tuple(range(F.shape[1])))
    return out


def pull_back(G, Y, F, R, kind):
    """Return the `Bars` of gradients G (n, d, d) of answers."""
    result = Bars(*(np.empty_like(F) for _ in Bars._fields))
    _pull(G, (Y, F, R), kind, result, tuple(range(F.shape[1])))
    return result


@kernel
def symmetric(Y):
    """Return (Y + Y^T)/2."""
    return mlin(0.5, Y, 0.5, transpose(Y))


@kernel
def scaled(a, A):
    """Return the product a A."""
    return mlin(a, A, 0.0, A)


@kernel
def stress(Y, F, R, kind):
    """Return tau = unit R T F^T."""
    return scaled(kind.unit, mmt(mm(R, symmetric(Y)), F))


@kernel
def stress_bars(G, Y, F, R, kind):
    """Return (R^T G F)_sym, G^T R T and G F T, in units."""
    G, T = scaled(kind.unit, G), symmetric(Y)
    return symmetric(mm(transpose(R), mm(G, F))), mm(transpose(G), mm(R, T)), mm(G, mm(F, T))


@kernel
def symmetric_stress(Y, F, R, kind):
    """Return tau = unit R T R^T."""
    return scaled(kind.unit, mmt(mm(R, symmetric(Y)), R))


@kernel
def symmetric_stress_bars(G, Y, F, R, kind):
    """Return (R^T G R)_sym, 0 and (G + G^T) R T, in units."""
    G = scaled(kind.unit, G)
    both = mlin(1.0, G, 1.0, transpose(G))
    return symmetric(mm(transpose(R), mm(G, R))), scaled(0.0, F), mm(both, mm(R, symmetric(Y)))


@kernel
def plain_stress(Y, F, R, kind):
    """Return tau = unit Y F^T."""
    return scaled(kind.unit, mmt(Y, F))


@kernel
def plain_stress_bars(G, Y, F, R, kind):
    """Return G F, G^T Y and 0, in units."""
    G = scaled(kind.unit, G)
    return mm(G, F), mm(transpose(G), Y), scaled(0.0, R)


@kernel
def correction(Y, F, R, kind):
    """Return F' = F + alpha R T."""
    return mlin(1.0, F, kind.alpha, mm(R, symmetric(Y)))


@kernel
def correction_bars(G, Y, F, R, kind):
    """Return alpha (R^T G)_sym, G and alpha G T."""
    return (scaled(kind.alpha, symmetric(mm(transpose(R), G))), G,
            scaled(kind.alpha, mm(G, symmetric(Y))))


@kernel
def plain_correction(Y, F, R, kind):
    """Return F' = F + alpha Y."""
    return mlin(1.0, F, kind.alpha, Y)


@kernel
def plain_correction_bars(G, Y, F, R, kind):
    """Return alpha G, G and 0."""
    return scaled(kind.alpha, G), G, scaled(0.0, R)


for _kind, _answer, _bars in ((Stress, stress, stress_bars),
                              (SymmetricStress, symmetric_stress, symmetric_stress_bars),
                              (PlainStress, plain_stress, plain_stress_bars),
                              (Correction, correction, correction_bars),
                              (PlainCorrection, plain_correction, plain_correction_bars)):
    answer.method(_kind, _answer)
    bars.method(_kind, _bars)


@kernel
def respond(inputs, kind, out, like, bounds):
    """Compute the answers of the points bounds[0] .. bounds[1] - 1, of = (Y, F, R)."""
    Y, F, R = inputs
    for p in range(bounds[0], bounds[1]):
        put_mat(out, p, answer(mat(Y, p, like), mat(F, p, like), mat(R, p, like), kind))


@kernel
def pull(G, inputs, kind, out, like, bounds):
    """Compute the `Bars` of the points bounds[0] .. bounds[1] - 1, of = (Y, F, R)."""
    Y, F, R = inputs
    for p in range(bounds[0], bounds[1]):
        Y_bar, F_bar, R_bar = bars(mat(G, p, like), mat(Y, p, like), mat(F, p, like),
                                   mat(R, p, like), kind)
        put_mat(out.Y, p, Y_bar)
        put_mat(out.F, p, F_bar)
        put_mat(out.R, p, R_bar)


@parallel
def _answers(inputs, kind, out, like):
    for c in prange(CHUNKS):
        respond(inputs, kind, out, like, chunk(c, len(out)))


@parallel
def _pull(G, inputs, kind, out, like):
    for c in prange(CHUNKS):
        pull(G, inputs, kind, out, like, chunk(c, len(G)))
