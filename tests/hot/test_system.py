"""The potential under conditions: matrix, product and diagonal agree and know nothing held."""

import numpy as np
import pytest
from hot_cases import CASES, problem_of

from mpm_ref.hot.system import System


@pytest.fixture(params=CASES, ids=lambda case: case.name, scope="module")
def at(request):
    """A system with some nodes held and some on oblique planes, and a random increment."""
    problem = problem_of(request.param)
    q, rng = problem.unknowns, np.random.default_rng(4)
    B = q.B.copy()
    B[::5] = 0.0
    for i in range(2, len(B), 5):
        n = rng.normal(size=B.shape[1])
        n /= np.linalg.norm(n)
        B[i] = np.eye(len(n)) - np.outer(n, n)
    q = q._replace(B=B)
    return System(problem.potential, q, np.ones(len(q.m)), q.dv0), problem.dv


def dense(B):
    """The block-diagonal projector."""
    n, d = B.shape[:2]
    full = np.zeros((n, d, n, d))
    full[np.arange(n), :, np.arange(n)] = B
    return full.reshape(n * d, n * d)


def test_matrix_is_the_hessian_between_projectors(at):
    system, dv = at
    B = dense(system.unknowns.B)
    H = system.potential.tangent(dv).matrix().toarray()
    A = system.matrix(dv).toarray()
    assert np.abs(A - B @ H @ B).max() <= 1e-14 * np.abs(H).max()
    assert np.abs(A - A.T).max() <= 1e-15 * np.abs(H).max()
    assert np.linalg.eigvalsh(0.5 * (A + A.T))[0] >= -1e-14 * np.abs(H).max()


def test_product_and_diagonal_are_those_of_the_matrix(at):
    system, dv = at
    A = system.matrix(dv)
    u = np.random.default_rng(5).normal(size=dv.shape)
    scale, Au = np.abs(A.data).max(), (A @ u.reshape(-1)).reshape(u.shape)
    assert np.abs(system.product(dv)(u) - Au).max() < 1e-12 * scale
    n, d = dv.shape
    blocks = A.toarray().reshape(n, d, n, d)[np.arange(n), :, np.arange(n)]
    assert np.abs(system.diagonal(dv) - blocks).max() < 1e-13 * scale


def test_exact_product_is_the_slope_of_the_gradient(at):
    """The projected one is not: the states are strained enough for negative eigenvalues."""
    system, dv = at
    w, h = system.project(np.random.default_rng(6).normal(size=dv.shape)), 1e-6 * np.abs(dv).max()
    slope = (system.evaluate(dv + h * w)[1] - system.evaluate(dv - h * w)[1]) / (2.0 * h)
    exact, scale = system.product(dv, projected=False)(w), np.abs(slope).max()
    assert np.abs(exact - slope).max() < 1e-6 * scale
    assert np.abs(system.product(dv)(w) - slope).max() > 1e-3 * scale


def test_gradient_has_no_part_along_what_is_held(at):
    system, dv = at
    g = system.evaluate(dv)[1]
    free = np.einsum("nab,nb->na", system.unknowns.B, g)
    assert np.abs(free - g).max() <= 1e-15 * np.abs(g).max()
    assert not g[::5].any()
