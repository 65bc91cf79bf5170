"""What a neural law answers: formulas, symmetry, equivariance under rotations, gradients."""

import numpy as np
import pytest

from mpm_ref.materials.learned.invariants import count, invariants, rotations, spectrum
from mpm_ref.materials.learned.response import (
    ALPHA,
    Bars,
    Correction,
    PlainCorrection,
    PlainStress,
    Stress,
    SymmetricStress,
    answers,
    pull_back,
)
from tests.nclaw.test_invariants import near_rest, turns

N = 6
KINDS = (Stress(3.0), SymmetricStress(3.0), PlainStress(3.0), Correction(0.2), PlainCorrection(0.2))
TURNING = (Stress(), SymmetricStress(), Correction(0.5))
PLAIN = (PlainStress(), PlainCorrection(0.5))


def of_type(kind):
    return type(kind).__name__


@pytest.fixture(params=KINDS, ids=of_type)
def kind(request):
    return request.param


def transposed(A):
    return np.swapaxes(A, 1, 2)


def inputs(d, rng):
    """Y, F and R of F."""
    F = near_rest(N, d, rng)
    return rng.normal(size=(N, d, d)), F, rotations(spectrum(F))


def expected(Y, F, R, kind):
    """The formulas of `response`, in NumPy."""
    T, across = 0.5 * (Y + transposed(Y)), {
        Stress: transposed(F), SymmetricStress: transposed(R), PlainStress: transposed(F)}
    turned = Y if isinstance(kind, PlainStress | PlainCorrection) else R @ T
    if type(kind) in across:
        return kind.unit * turned @ across[type(kind)]
    return F + kind.alpha * turned


def test_answers_are_those_of_the_formulas(d, kind, rng):
    """NCLAW-alg4; the plain ones are those of NCLAW-ablation."""
    of = inputs(d, rng)
    assert answers(*of, kind) == pytest.approx(expected(*of, kind), abs=1e-13)


def test_the_papers_step_of_the_plastic_law():
    assert (Correction().alpha, PlainCorrection().alpha, ALPHA) == (1e-3, 1e-3, 1e-3)
    assert (Stress().unit, SymmetricStress().unit, PlainStress().unit) == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("name", Bars._fields)
def test_gradients_are_central_differences(d, kind, name, rng):
    """Answers are polynomials of degree 2 at most in each input: central differences are exact."""
    of = dict(zip(Bars._fields, inputs(d, rng)))
    G, direction = rng.normal(size=(2, N, d, d))

    def loss(h):
        return float((G * answers(**{**of, name: of[name] + h * direction}, kind=kind)).sum())

    slope = float((getattr(pull_back(G, **of, kind=kind), name) * direction).sum())
    assert slope == pytest.approx(0.5 * (loss(1.0) - loss(-1.0)), rel=1e-12, abs=1e-12)


def law(F, kind):
    """A law whose network is some smooth function of the invariants."""
    of, d = spectrum(F), F.shape[1]
    W = np.random.default_rng(1).normal(size=(count(d), d * d))
    Y = np.tanh(invariants(F, of) @ W).reshape(F.shape)
    return answers(Y, F, rotations(of), kind)


def off_when_turned(kind, d, rng):
    """Largest departure from answers that turn with the body."""
    F, Q = near_rest(N, d, rng), turns(N, d, rng)
    turned, before = law(Q @ F, kind), law(F, kind)
    with_it = Q @ before if hasattr(kind, "alpha") else Q @ before @ transposed(Q)
    return abs(turned - with_it).max()


@pytest.mark.parametrize("kind", TURNING, ids=of_type)
def test_answers_turn_with_the_body(d, kind, rng):
    """NCLAW-eq33 to NCLAW-eq37: F turns from the left, tau = P F^T from both sides."""
    assert off_when_turned(kind, d, rng) < 1e-13


@pytest.mark.parametrize("kind", PLAIN, ids=of_type)
def test_plain_answers_do_not(d, kind, rng):
    assert off_when_turned(kind, d, rng) > 0.3


@pytest.mark.parametrize("kind", TURNING, ids=of_type)
def test_at_rest_there_is_no_answer(d, kind, rng):
    """NCLAW-rest, with a network that vanishes there: E(R) = 0 and P(R) = R."""
    Q = turns(N, d, rng)
    rest = Q if hasattr(kind, "alpha") else np.zeros_like(Q)
    assert law(Q, kind) == pytest.approx(rest, abs=1e-13)


def skewness(A):
    """Size of the skew part beside the whole."""
    return np.linalg.norm(A - transposed(A)) / np.linalg.norm(A)


def test_which_stresses_are_symmetric(d, rng):
    """R T F^T is not, unless T and S commute (NCLAW-X5); R T R^T always is."""
    Y, F, R = inputs(d, rng)
    assert skewness(answers(Y, F, R, Stress())) > 0.05
    assert skewness(answers(Y, F, R, SymmetricStress())) < 1e-15
    S = transposed(R) @ F
    assert skewness(answers(S @ S - 3.0 * S, F, R, Stress())) < 1e-14
