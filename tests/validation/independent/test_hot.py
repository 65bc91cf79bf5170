"""HOT's second implementations: they agree with the package, and each has a fact of its own."""

import numpy as np
import pytest

from validation.independent import agreement_hot as agreement
from validation.independent import (
    characteristic_norm,
    galerkin,
    implicit_step,
    lbfgs_start,
    projected_hessian,
)

MU, LAM = 2.0, 3.0


def bound(part):
    return agreement.RECORDS[part][0]


@pytest.fixture(params=(2, 3))
def d(request):
    return request.param


# Agreement with the package.

@pytest.mark.parametrize("method", agreement.METHODS)
def test_steps_agree(d, method):
    assert agreement.step_difference(d, method) <= bound("implicit_step")


def test_characteristic_norms_agree(d):
    assert agreement.norm_difference(d) <= bound("characteristic_norm")


@pytest.mark.parametrize("implementation", agreement.IMPLEMENTATIONS)
def test_hierarchies_and_cycles_agree(d, implementation):
    matrices, cycles = agreement.hierarchy_differences(d, implementation)
    assert matrices <= bound("galerkin")
    assert cycles <= bound("galerkin.cycle")


@pytest.mark.parametrize("factor", agreement.FACTORS)
def test_iterates_of_lbfgs_agree(d, factor):
    difference, halvings = agreement.iterate_difference(d, factor)
    assert difference <= bound("lbfgs_start")
    assert (halvings > 0) == (factor > 1.0)


def test_derivatives_of_stress_agree(d):
    assert agreement.hessian_difference(d) <= bound("projected_hessian")


def test_derivatives_of_stress_agree_through_inversion(d):
    assert agreement.passage_difference(d) <= bound("projected_hessian.passage")


def test_projected_hessians_agree(d):
    assert agreement.assembled_difference(d) <= bound("projected_hessian.assembled")


def test_every_part_has_a_record():
    yielded = [name for name, _ in agreement.parts(2)]
    assert yielded == [*agreement.RECORDS]


# Facts that neither code contains.

def nothing_fixed(nodes):
    return np.zeros(len(nodes), bool)


def test_free_block_keeps_its_momentum_and_gains_its_weight(d):
    before, _ = agreement.block(agreement.SMALL[d])
    dt, g = 0.01, np.linspace(1.0, 2.0, d)
    _, _, after = implicit_step.implicit_step(before, agreement.DX, dt, g, nothing_fixed)
    gained = before.m @ (after.v - before.v)
    np.testing.assert_allclose(gained, before.m.sum() * dt * g, rtol=1e-10)


def test_block_at_rest_stays_at_rest(d):
    before, _ = agreement.block(agreement.SMALL[d])
    rest = before._replace(v=0.0 * before.v, C=0.0 * before.C, F=np.eye(d) + 0.0 * before.F)
    _, v, after = implicit_step.implicit_step(rest, agreement.DX, 0.01, np.zeros(d), nothing_fixed)
    assert np.abs(v).max() <= 1e-13
    np.testing.assert_allclose(after.F, rest.F, atol=1e-14)


def test_stress_is_the_derivative_of_the_energy(d):
    before, _ = agreement.block(agreement.SMALL[d])
    dF = np.random.default_rng(1).normal(size=before.F.shape)
    energy, _ = implicit_step.response(before.F + 1e-30j * dF, before.moduli)
    _, P = implicit_step.response(before.F, before.moduli)
    np.testing.assert_allclose(energy.imag / 1e-30, (P * dF).sum(axis=(1, 2)), rtol=1e-10)


def test_stiffness_at_rest_is_the_norm_of_isotropic_elasticity(d):
    """dP = 2 mu sym dF + lam tr(dF) I: eigenvalues 2 mu + d lam once, 2 mu, and 0 for the spins."""
    strains = d * (d + 1) // 2 - 1
    expected = np.sqrt(strains * 4 * MU**2 + (2 * MU + d * LAM) ** 2)
    assert characteristic_norm.rest_stiffness(MU, LAM, d) == pytest.approx(expected, rel=1e-14)


def test_printed_length_of_a_node():
    """HOT-eq9 prints 24 dx^2 in 3D."""
    w, one = np.eye(1), np.ones(1)
    kappa = characteristic_norm.characteristic_norms(w, one, 5.0 * one, 0.1, 0.02, 3)
    assert kappa == pytest.approx(5.0 * 24.0 * 0.1**2 * 0.02, rel=1e-14)


def test_residual_has_no_unit():
    g, kappa = np.random.default_rng(0).normal(size=(7, 3)), np.linspace(1.0, 2.0, 7)
    residual = characteristic_norm.residual(g, kappa)
    assert characteristic_norm.residual(1e3 * g, 1e3 * kappa) == pytest.approx(residual, rel=1e-14)
    doubled = characteristic_norm.residual(np.tile(g, (2, 1)), np.tile(kappa, 2))
    assert doubled == pytest.approx(residual, rel=1e-14)


def nodes_of(shape):
    return np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(
        -1, len(shape)) - 3


def test_prolongation_reproduces_linear_fields(d):
    index = nodes_of((7, 6, 5)[:d])
    W, coarse = galerkin.embedding(index)
    np.testing.assert_allclose(W.sum(axis=1), 1.0, rtol=1e-15)
    np.testing.assert_allclose(W @ (2.0 * coarse), index, atol=1e-14)
    assert (W > 0.0).sum(axis=0).max() == 3**d      # HOT-nnz


@pytest.fixture(scope="module")
def levels():
    """A positive definite matrix on a rectangle of nodes, with neighbours coupled, in 3 levels."""
    index = nodes_of((12, 7))
    distance = np.abs(index[:, None] - index).max(axis=-1)
    A = np.kron(np.where(distance == 0, 9.0, -1.0 * (distance == 1)), np.eye(2))
    return galerkin.hierarchy(A, index, 3)


def test_v_cycle_is_symmetric_and_contracts(levels):
    A = levels[0].A
    V = galerkin.v_cycle(levels, np.eye(len(A)), np.linalg.solve)
    np.testing.assert_allclose(V, V.T, atol=1e-14)
    rates = np.linalg.eigvals(np.eye(len(A)) - V @ A).real
    assert 0.0 <= rates.min() + 1e-12
    assert rates.max() < 0.3


def test_v_cycle_solves_what_one_level_has(levels):
    A, b = levels[-1].A, np.arange(float(len(levels[-1].A)))
    u = galerkin.v_cycle([galerkin.DenseLevel(A, levels[-1].index, None)], b, np.linalg.solve)
    np.testing.assert_allclose(A @ u, b, rtol=1e-12, atol=1e-12)


def test_krylov_takes_the_first_iterate_within_half():
    """Of a diagonal matrix that is the first one, the solution itself."""
    b = np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(galerkin.krylov(np.diag([1.0, 5.0, 9.0]), b), b / [1.0, 5.0, 9.0],
                               rtol=1e-14)
    rng = np.random.default_rng(0)
    X = rng.normal(size=(20, 20))
    A, b = X @ X.T + np.eye(20), rng.normal(size=20)
    r = b - A @ galerkin.krylov(A, b)
    assert r @ (r / np.diag(A)) <= 0.25 * b @ (b / np.diag(A))


def test_lbfgs_from_the_exact_inverse_needs_one_step():
    A, b = np.diag([1.0, 4.0, 9.0]), np.ones(3)
    path = lbfgs_start.iterates(lambda u: 0.5 * u @ A @ u - b @ u, lambda u: A @ u - b,
                                np.linalg.inv(A), np.zeros(3), 3, 1)
    np.testing.assert_allclose(path[-1], np.linalg.solve(A, b), rtol=1e-15)


def test_inverse_satisfies_the_secant_equation():
    rng = np.random.default_rng(0)
    H, s, y = np.eye(4), *rng.normal(size=(2, 4))
    y = y if y @ s > 0.0 else -y
    np.testing.assert_allclose(lbfgs_start.updated(H, s, y) @ y, s, rtol=1e-13)
    assert lbfgs_start.updated(H, s, -y) is H


def test_line_search_takes_the_first_half_that_does_not_climb():
    assert lbfgs_start.step_length(lambda u: u @ u, np.ones(1), np.array([-9.0])) == 0.125
    assert lbfgs_start.step_length(lambda u: u @ u, np.ones(1), np.array([-2.0])) == 1.0


def signed_svd(F):
    """U, signed stretches and V^T with det U = det V = 1, the last stretch of the sign of det F."""
    U, s, Vt = np.linalg.svd(F)
    d = len(s)
    signs_U, signs_V = np.ones(d), np.ones(d)
    signs_U[-1], signs_V[-1] = np.linalg.det(U), np.linalg.det(Vt)
    return U * signs_U, s * np.round(signs_U * signs_V), signs_V[:, None] * Vt


def energy(F):
    """psi from singular values."""
    _, s, _ = signed_svd(F)
    return MU * ((s - 1.0) ** 2).sum() + 0.5 * LAM * (s.prod() - 1.0) ** 2


@pytest.mark.parametrize("last", [0.4, 1e-3, -0.3])
def test_hessian_has_the_second_differences_of_the_energy(d, last):
    rng = np.random.default_rng(0)
    F = agreement.gradient_of((1.4, 0.9, last)[3 - d:], rng)
    dF, h = rng.normal(size=F.shape), 1e-4
    slope = (energy(F + h * dF) - energy(F - h * dF)) / (2.0 * h)
    curvature = (energy(F + h * dF) - 2.0 * energy(F) + energy(F - h * dF)) / h**2
    H = projected_hessian.hessian(F, MU, LAM)
    assert (projected_hessian.pk1(F, MU, LAM) * dF).sum() == pytest.approx(slope, rel=1e-6)
    assert dF.ravel() @ H @ dF.ravel() == pytest.approx(curvature, rel=1e-5)


def test_positive_part_is_the_nearest_semidefinite_matrix():
    """What is taken away is semidefinite as well, and orthogonal to what stays."""
    F = agreement.gradient_of((1.4, 0.5, -0.3), np.random.default_rng(0))
    H = projected_hessian.hessian(F, MU, LAM)
    positive = projected_hessian.positive_part(H)
    rest = positive - H
    assert np.linalg.eigvalsh(positive).min() >= -1e-12
    assert np.linalg.eigvalsh(rest).min() >= -1e-12
    assert np.linalg.eigvalsh(rest).max() > 1.0
    assert abs((positive * rest).sum()) <= 1e-10


def test_translations_meet_the_mass_alone():
    rng = np.random.default_rng(0)
    before, _ = agreement.block(agreement.SMALL[2])
    _, w, y = implicit_step.weights(before.x, agreement.DX)
    A = rng.normal(size=(len(w), 4, 4))
    m = before.m @ w
    H = projected_hessian.assembled(m, y, A + A.swapaxes(1, 2))
    np.testing.assert_allclose(H, H.T, atol=1e-8)
    np.testing.assert_allclose(H @ np.tile([1.0, 2.0], len(m)), np.outer(m, [1.0, 2.0]).ravel(),
                               atol=1e-8)
