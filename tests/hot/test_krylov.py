"""Preconditioned conjugate gradients, their stop tests and simple preconditioners."""

import numpy as np
import pytest
import scipy.sparse as sp
from hot_toys import lattice, random_quadratic

from mpm_ref.hot.krylov import (
    JACOBI,
    CGOptions,
    block_jacobi,
    newton_tolerance,
    no_preconditioner,
    one_half,
    pcg,
    scalar_jacobi,
    stiffest_tolerance,
)
from mpm_ref.hot.linearization import matrix_product, symmetric_gauss_seidel
from mpm_ref.hot.multigrid.blocks.sparse import blocks_of
from mpm_ref.hot.multigrid.projectors import diagonal_blocks


def tight(size):
    return 1e-12


@pytest.fixture
def problem():
    """Matrix of a lattice with held and slipping nodes, and a right-hand side it can reach."""
    toy = lattice(stiff=100.0)
    g = toy.evaluate(toy.start)[1]
    return toy.matrix(toy.start), -g, toy


def answer(A, b):
    return np.linalg.lstsq(A.toarray(), b.reshape(-1))[0].reshape(b.shape)


@pytest.mark.parametrize("jacobi", sorted(JACOBI))
def test_pcg_solves_what_is_free(problem, jacobi):
    A, b, toy = problem
    solved = pcg(matrix_product(A), b, JACOBI[jacobi](diagonal_blocks(A)), CGOptions(tight))
    assert solved.message is None
    assert np.abs(solved.x - answer(A, b)).max() < 1e-9 * np.abs(solved.x).max()
    assert np.abs(toy.project(solved.x) - solved.x).max() < 1e-12


def test_pcg_of_a_small_matrix_ends_after_as_many_steps_as_there_are_unknowns():
    toy = random_quadratic(np.random.default_rng(0), decades=1)
    A, b = toy.matrix(toy.start), -toy.evaluate(toy.start)[1]
    solved = pcg(matrix_product(A), b, no_preconditioner(None), CGOptions(lambda size: 1e-10))
    assert solved.iterations == b.size
    assert np.allclose(solved.x, answer(A, b), rtol=1e-9)


@pytest.mark.parametrize("flexible", [False, True])
def test_pcg_ends_when_it_is_enough(problem, flexible):
    """The question is put after each iteration, with the energy of its x."""
    A, b, _ = problem
    energies = []

    def enough(x, k, energy):
        energies.append((np.sum(x * matrix_product(A)(x)), energy))
        return k == 7

    inverse = block_jacobi(diagonal_blocks(A))
    rule = CGOptions(tight, flexible=flexible, enough=enough)
    solved = pcg(matrix_product(A), b, inverse, rule)
    capped = pcg(matrix_product(A), b, inverse, CGOptions(tight, cap=7, flexible=flexible))
    assert (solved.iterations, solved.message) == (7, None)
    assert solved.x.tobytes() == capped.x.tobytes()
    assert len(energies) == 7
    assert np.allclose(*np.transpose(energies), rtol=1e-10)


@pytest.mark.parametrize("k", [0.5, 1e-2, 1e-5])
def test_pcg_stops_at_the_first_iterate_within_the_energy_norm(problem, k):
    A, b, _ = problem
    inverse = block_jacobi(diagonal_blocks(A))

    def energy(x):
        r = b - matrix_product(A)(x)
        return np.sqrt(np.sum(r * inverse(r)))

    solved = pcg(matrix_product(A), b, inverse, CGOptions(lambda size: k))
    before = pcg(matrix_product(A), b, inverse,
                 CGOptions(lambda size: k, cap=solved.iterations - 1))
    assert energy(solved.x) <= k * energy(0 * b) * (1 + 1e-9) < energy(before.x)
    assert before.message == f"CG reached its cap of {solved.iterations - 1} iterations"


def test_pcg_asks_its_tolerance_with_the_energy_norm_of_the_right_hand_side(problem):
    A, b, _ = problem
    inverse, asked = block_jacobi(diagonal_blocks(A)), []
    pcg(matrix_product(A), b, inverse, CGOptions(lambda size: asked.append(size) or 0.5))
    assert asked == [pytest.approx(np.sqrt(np.sum(b * inverse(b))))]


def test_tolerance_of_newton_as_printed():                             # HOT-sec5.3-k
    assert newton_tolerance(0.01, 1e-9) == pytest.approx(0.1)       # sqrt(size)
    assert newton_tolerance(1e-9, 1e-4) == pytest.approx(1e-2)      # sqrt(tau)
    assert newton_tolerance(100.0, 1e-9) == 0.5                     # at most 1/2
    assert one_half(1e-9) == 0.5
    kappa = np.array([1.0, 4.0, 2.0, 0.1])
    assert stiffest_tolerance(1e-7, kappa) == pytest.approx(1e-7 * np.sqrt(4) * 4.0)


def test_nothing_to_solve_takes_no_iteration(problem):
    A, b, _ = problem
    solved = pcg(matrix_product(A), 0.0 * b, block_jacobi(diagonal_blocks(A)), CGOptions(one_half))
    assert (solved.iterations, solved.message) == (0, None)
    assert not solved.x.any()


def test_pcg_names_a_matrix_and_a_preconditioner_that_are_not_positive(problem):
    A, b, _ = problem
    solved = pcg(lambda u: -u, b, no_preconditioner(None), CGOptions(one_half))
    assert "p.A p = -" in solved.message
    assert np.array_equal(solved.x, b)          # the preconditioned right-hand side
    assert "r.P r = -" in pcg(matrix_product(A), b, lambda r: -r, CGOptions(one_half)).message
    assert "nan" in pcg(matrix_product(A), b, lambda r: r * np.nan, CGOptions(one_half)).message


def test_pcg_keeps_the_last_iterate_before_negative_curvature():
    b = np.array([[1.0, 1.0]])
    H = np.array([[1.0, 0.0], [0.0, -0.5]])
    solved = pcg(lambda u: u @ H, b, no_preconditioner(None), CGOptions(tight))
    assert solved.iterations == 1
    assert np.allclose(solved.x, 4.0 * b)       # b.b / b.H b, the exact step along b


def test_flexible_pcg_bears_a_preconditioner_that_varies(problem):
    A, b, _ = problem
    jacobi = block_jacobi(diagonal_blocks(A))

    def needed(flexible):
        def varying(r):
            return pcg(matrix_product(A), r, jacobi, CGOptions(one_half)).x
        rule = CGOptions(lambda size: 1e-6, 1000, flexible)
        return pcg(matrix_product(A), b, varying, rule).iterations

    assert 10 * needed(True) < needed(False)


def test_both_paths_of_products_and_sweeps_are_twins(problem):
    A, b, toy = problem
    for make in (lambda path: matrix_product(A, path),
                 lambda path: symmetric_gauss_seidel(A, toy.index, path)):
        slow, fast = make("scipy"), make("blocks")
        assert np.abs(fast(b) - slow(b)).max() < 1e-13 * np.abs(slow(b)).max()
        kept, copy = fast(b), fast(b).copy()
        fast(2.0 * b)
        assert np.array_equal(kept, copy)           # what was handed out stays as it is


@pytest.mark.parametrize("d", [1, 4])
def test_products_with_blocks_that_kernels_do_not_know_are_left_to_scipy(d):
    A = sp.bsr_array(np.arange(4.0 * d * d).reshape(2 * d, 2 * d), blocksize=(d, d))
    u = np.linspace(-1.0, 2.0, 2 * d).reshape(2, d)
    assert np.allclose(matrix_product(A)(u), (A.toarray() @ u.reshape(-1)).reshape(2, d))
    with pytest.raises(ValueError, match=r"expected \(2, 2\) or \(3, 3\)"):
        blocks_of(A)


def test_pcg_takes_no_iteration_where_the_rule_is_met_at_zero(problem):
    A, b, _ = problem
    inverse = block_jacobi(diagonal_blocks(A))
    solved = pcg(matrix_product(A), b, inverse, CGOptions(lambda size: 1.0))
    assert (solved.iterations, solved.message) == (0, None)
    assert not solved.x.any()


@pytest.mark.parametrize("make", [
    lambda A, _: block_jacobi(diagonal_blocks(A)), lambda A, _: scalar_jacobi(diagonal_blocks(A)),
    symmetric_gauss_seidel, lambda A, index: symmetric_gauss_seidel(A, index, "scipy")])
def test_preconditioners_are_symmetric_positive_and_keep_to_what_is_free(problem, make):
    A, _, toy = problem
    inverse, rng = make(A, toy.index), np.random.default_rng(0)
    a, b = (toy.project(rng.standard_normal(toy.start.shape)) for _ in range(2))
    assert np.sum(a * inverse(b)) == pytest.approx(np.sum(b * inverse(a)), rel=1e-11)
    assert np.sum(a * inverse(a)) > 0.0
    assert np.abs(toy.project(inverse(a)) - inverse(a)).max() < 1e-13 * np.abs(inverse(a)).max()


def test_sweeps_save_iterations_over_jacobi(problem):
    A, b, toy = problem
    rule = CGOptions(lambda size: 1e-6)
    few, many = (pcg(matrix_product(A), b, inverse, rule).iterations for inverse in
                 (symmetric_gauss_seidel(A, toy.index), block_jacobi(diagonal_blocks(A))))
    assert few < many
