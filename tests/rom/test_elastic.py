"""The deformation-only model that NSF is compared with."""

import numpy as np
import pytest

from mpm_ref.body import Body, particles_at
from mpm_ref.materials import NoFlow, fixed_corotated
from mpm_ref.plain import laws
from mpm_ref.rom.fields.elastic import elastic_modes, elastic_stress, gradients
from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields
from mpm_ref.rom.snapshots import Histories

SOFT, HARD = fixed_corotated.from_E_nu(1.0, 0.3), fixed_corotated.from_E_nu(20.0, 0.2)


def points(d, seed=0):
    """Points of a jittered lattice (n, d)."""
    axes = np.meshgrid(*(d * [np.arange(7.0)]), indexing="ij")
    X = np.stack([a.ravel() for a in axes], axis=1)
    return 0.1 * (X + 0.3 * np.random.default_rng(seed).random(X.shape))


@pytest.mark.parametrize("d", [2, 3])
def test_gradients_of_affine_fields_are_exact(d):
    rng = np.random.default_rng(1)
    X, A = points(d), rng.normal(size=(d, d, 4))
    U = np.einsum("ijr,nj->nir", A, X) + rng.normal(size=(1, d, 4))
    assert np.abs(gradients(X, U) - A).max() < 1e-11


def test_gradients_of_smooth_fields_converge():
    """At the first order, as neighbours lie on one side more than on the other."""
    def off(size):
        X = size * points(3)
        U = np.stack([np.sin(2.0 * X[:, [1]]), *np.zeros((2, len(X), 1))], axis=1)
        return np.abs(gradients(X, U)[:, 0, 1, 0] - 2.0 * np.cos(2.0 * X[:, 1])).max()

    coarse, fine = off(1.0), off(0.5)
    assert coarse < 0.5
    assert fine < 0.6 * coarse


@pytest.mark.parametrize("d", [2, 3])
def test_stress_is_that_of_the_law(d):
    F = np.eye(d) + 0.3 * np.random.default_rng(2).normal(size=(5, d, d))
    assert np.abs(elastic_stress(F, HARD) - laws.kirchhoff(F, HARD)).max() < 1e-12


def body(X, law):
    """A body of points X."""
    n, d = X.shape
    particles = particles_at(X, np.zeros((n, d)), np.ones(n), np.ones(n), "apic")
    return Body("one", particles, law, NoFlow(), np.arange(n))


def stretched(X, ends, law):
    """`Histories` of two runs in which two bodies are stretched, each differently."""
    n, d = X.shape
    at = np.linspace(0.0, 1.0, 5)
    grow = np.where(np.arange(n) < ends, 0.2, -0.1)[:, None] * X
    bend = np.where(np.arange(n) < ends, 0.1, 0.05)[:, None] * X[:, ::-1]
    x = np.stack([X + at[:, None, None] * grow, X + at[:, None, None] * bend])
    some = np.random.default_rng(3).normal(size=(2, 5, n, d * d))
    return Histories(X, np.ones(n), np.ones(n), np.zeros((2, n, d)), np.array([[0.0], [1.0]]), x,
                     some[..., :d * (d + 1) // 2], some, 0.1)


def test_each_body_has_its_own_gradient_and_law():
    """Two bodies in one place: neighbours are those of the same body alone."""
    X = np.concatenate([points(2), points(2, seed=5)])
    ends = len(X) // 2
    runs = stretched(X, ends, SOFT)
    fields, xhat = fit_pod_fields(runs, Sizes(r=2, modes=2, tau=3, C=3), 0.3, follows=False)
    both = elastic_modes(fields, [body(X[:ends], SOFT), body(X[ends:], HARD)])
    some, y = np.arange(ends - 5, ends + 5), xhat[0, -1]
    F = np.where((some < ends)[:, None, None], 1.2 * np.eye(2), 0.9 * np.eye(2))
    assert np.abs(both.F(some, y) - F).max() < 1e-9
    expected = [laws.kirchhoff(F[:1], SOFT)[0], laws.kirchhoff(F[-1:], HARD)[0]]
    assert np.abs(both.stress(some, y)[[0, -1]] - expected).max() < 1e-8
    assert np.array_equal(both.place(some, y), fields.place(some, y))
    assert not both.affine(some, y).any()
    assert (both.dim, both.r) == (2, 2)


@pytest.mark.parametrize(("d", "n"), [(2, 1), (2, 2), (3, 3)])
def test_a_body_of_too_few_points_is_refused(d, n):
    """One has no neighbours at all; two tell nothing across the line through them."""
    X = np.concatenate([points(d), 5.0 + points(d)[:n]])
    fields, _ = fit_pod_fields(stretched(X, len(X) - n, SOFT), Sizes(r=2, modes=2, tau=3, C=3), 0.3,
                        follows=False)
    with pytest.raises(ValueError, match=rf"^points in the body 'one': {n}, too few for a "
                       rf"gradient of the map: expected at least {d + 1}; sample the body"):
        elastic_modes(fields, [body(X[:-n], SOFT), body(X[-n:], HARD)])


@pytest.mark.parametrize("d", [2, 3])
def test_as_few_points_as_can_be_tell_gradients(d):
    X, A = np.vstack([np.zeros(d), np.eye(d)]), np.random.default_rng(1).normal(size=(d, d, 4))
    assert np.abs(gradients(X, np.einsum("ijr,nj->nir", A, X)) - A).max() < 1e-12
