"""Every method on small systems: the same minimiser, its directions, and an honest report."""

import numpy as np
import pytest
from hot_toys import DESCENTS, Exact, bar, exactly, quadratic, scalar, tight

from mpm_ref.hot.krylov import block_jacobi, newton_tolerance, stiffest_tolerance
from mpm_ref.hot.lbfgs import LBFGS, CurvaturePair, two_loop
from mpm_ref.hot.methods import METHODS, descent_method, minimise
from mpm_ref.hot.newton import Forcing
from mpm_ref.hot.norms import scaled_norm
from mpm_ref.hot.report import Profiler, combined_report

NEWTON = sorted(word for word, options in METHODS.items() if options.descent == "newton")


@pytest.fixture(autouse=True)
def hierarchies(monkeypatch):
    """The hierarchies that a test has built."""
    return exactly(monkeypatch)


@pytest.fixture(scope="module")
def minimum():
    """Of `bar`, by Newton's method with dense matrices: ten times closer than `tight` asks."""
    toy = bar()
    dv = toy.start
    for _ in range(12):
        g = toy.evaluate(dv)[1].reshape(-1)
        H = toy.dense(dv).reshape(g.size, g.size)
        dv = dv - (np.linalg.pinv(H, hermitian=True) @ g).reshape(dv.shape)
    assert scaled_norm(toy.evaluate(dv)[1], toy.kappa) < 1e-12
    return dv


# The same minimiser, whatever the way.

@pytest.mark.parametrize("word", DESCENTS)
def test_every_method_finds_the_minimiser(word, minimum):
    toy = bar()
    solution = minimise(toy, tight(word))
    assert solution.report.converged
    assert solution.report.message == "converged"
    assert solution.report.method == word
    assert np.abs(solution.dv - minimum).max() < 1e-8
    assert np.abs(toy.project(solution.dv - toy.start) - (solution.dv - toy.start)).max() < 1e-12


@pytest.mark.parametrize("word", DESCENTS)
def test_nothing_to_do_takes_no_step_and_no_matrix(word):
    toy = quadratic(np.eye(6).reshape(3, 2, 3, 2), np.zeros((3, 2)))
    solution = minimise(toy, word)
    report = solution.report
    assert (report.converged, report.iterations, report.cg_iterations) == (True, 0, 0)
    assert (report.evaluations, report.hessians, report.residuals) == (1, 0, (0.0,))
    assert not solution.dv.any()


@pytest.mark.parametrize("word", DESCENTS)
def test_last_step_is_not_added_twice(word):
    toy = bar()
    solution = minimise(toy, word)
    dv, E = toy.visited[-1]
    assert np.array_equal(solution.dv, dv)
    assert solution.E == E == toy.energy(solution.dv)
    at_end = scaled_norm(toy.evaluate(solution.dv)[1], toy.kappa)
    assert solution.report.residuals[-1] == at_end


def test_accepted_energies_never_rise():
    toy = bar(seed=3)
    seen = minimise(toy, "lbfgs-h").report
    assert seen.backtracks == 0                  # so that all evaluations are accepted iterates
    assert np.all(np.diff([E for _, E in toy.visited]) < 0)


# Directions.

def test_first_direction_of_hot_is_the_cycle_of_the_gradient(hierarchies):     # HOT-alg3
    toy = bar()
    g = toy.evaluate(toy.start)[1]
    minimise(toy, "hot", max_iterations=1)
    assert np.array_equal(hierarchies[0].calls[0], -g)
    first_trial = next(dv for dv, _ in toy.visited[2:])
    p = toy.project(Exact(toy.matrix(toy.start)).cycle(-g))
    assert np.allclose(first_trial - toy.start, p, atol=1e-14)


def test_hot_builds_one_hierarchy_per_solve_and_cycles_once_per_iteration(hierarchies):
    # HOT-alg3, which so pays HOT-cost once
    report = minimise(bar(), "hot").report
    assert report.hessians == len(hierarchies) == 1
    assert len(hierarchies[0].calls) == report.iterations > 3
    assert report.cg_iterations == 0


def test_two_loop_is_the_update_of_broyden_fletcher_goldfarb_and_shanno():     # HOT-alg3
    rng = np.random.default_rng(0)
    H = np.diag(rng.uniform(1.0, 2.0, 6))
    inverse, pairs = H.copy(), []
    for _ in range(4):
        s = rng.standard_normal((3, 2))
        y = s * rng.uniform(0.5, 2.0, (3, 2))
        rho = 1.0 / np.sum(s * y)
        pairs.append(CurvaturePair(s, y, rho))
        V = np.eye(6) - rho * np.outer(y, s)
        inverse = V.T @ inverse @ V + rho * np.outer(s, s)
    q = rng.standard_normal((3, 2))
    found = two_loop(q, pairs, lambda r: (H @ r.reshape(-1)).reshape(r.shape))
    assert np.allclose(found.reshape(-1), inverse @ q.reshape(-1), rtol=1e-12)


def test_window_holds_the_newest_pairs_of_positive_curvature():
    method = LBFGS(build=None, window=3, rebuild_every=0)
    s = np.ones((2, 2))
    for curvature in (1.0, -1.0, 2.0, 0.0, 3.0, 4.0):
        method.update(s, curvature * s)
    assert [1.0 / (pair.rho * 4.0) for pair in method.pairs] == [2.0, 3.0, 4.0]


def test_pairs_save_iterations():
    assert 2 * minimise(bar(), "lbfgs-h").report.iterations < minimise(
        bar(), "lbfgs-h", window=0).report.iterations


def test_rebuild_takes_a_new_hessian_every_k_steps(hierarchies):
    report = minimise(bar(), "hot", rebuild_every=2).report
    assert report.converged
    assert report.hessians == len(hierarchies) == (report.iterations + 1) // 2 > 1
    assert report.restarts == 0


@pytest.mark.parametrize("word", NEWTON)
def test_newton_takes_a_hessian_per_iteration(word):                   # HOT-alg1
    toy = bar()
    report = minimise(toy, word).report
    assert report.hessians == report.iterations
    free = METHODS[word].operator == "matrix-free"
    assert toy.calls["matrix"] == (0 if free else report.iterations)
    assert toy.calls["product"] == toy.calls["diagonal"] == (report.iterations if free else 0)


@pytest.mark.parametrize("norm", ["energy", "L2"])
def test_tolerance_of_newton_depends_on_the_gradient_as_printed(norm):
    toy = bar()
    g = toy.evaluate(toy.start)[1]
    size = {"energy": 0.04, "L2": np.linalg.norm(g)}[norm]
    assert Forcing(norm, 1e-6).relative_tolerance(g)(0.04) == newton_tolerance(size, 1e-6)
    assert Forcing(norm, 1e-6).relative_tolerance(1e-12 * g)(1e-9) == pytest.approx(1e-3)


def test_tolerances_of_newton_look_at_their_own_stop():
    toy = bar()
    plain, gast = (descent_method(toy, METHODS[word], Profiler()).forcing
                   for word in ("pn-pcg", "gast15"))
    assert (plain.norm, plain.tau) == ("energy", stiffest_tolerance(1e-7, toy.kappa))
    assert (gast.norm, gast.tau) == ("L2", 1e-3)


def gentle():
    """The bar in another unit of energy, so that the tolerance of CG is below 1/2."""
    toy, c = bar(), 1e-9
    E, dE, H = toy.functions
    toy.functions = (lambda x: c * E(x), lambda x: c * dE(x), lambda x: c * H(x))
    toy.kappa = c * toy.kappa
    return toy


def test_newton_solves_to_the_printed_tolerance():                     # HOT-sec5.3-k
    toy, eps = gentle(), 1e-7
    g, A = toy.evaluate(toy.start)[1], toy.matrix(toy.start)
    inverse = block_jacobi(toy.diagonal(toy.start))

    def energy(r):
        return np.sqrt(np.sum(r * inverse(r)))

    k = np.sqrt(max(energy(g), stiffest_tolerance(eps, toy.kappa)))
    assert k < 0.1

    def left(cap):
        toy.visited.clear()
        minimise(toy, "pn-pcg", eps=eps, max_iterations=1, max_cg_iterations=cap)
        p = toy.visited[1][0] - toy.start
        return energy(-g - (A @ p.reshape(-1)).reshape(g.shape))

    report = minimise(gentle(), "pn-pcg", eps=eps, max_iterations=1).report
    assert report.cg_iterations > 1
    assert left(10000) <= k * energy(g) < left(report.cg_iterations - 1)


def test_lbfgs_h_solves_to_half_of_the_energy_norm():                  # HOT-sec5.3-coarse
    report = minimise(bar(), "lbfgs-h").report
    assert report.capped_solves == 0
    assert report.iterations < report.cg_iterations < 10 * report.iterations
    assert minimise(bar(), "lbfgs-h", max_cg_iterations=1).report.capped_solves > 0


# Reports.

@pytest.mark.parametrize("word", DESCENTS)
def test_report_counts_what_happened(word):
    toy = bar(seed=1)
    report = minimise(toy, word).report
    assert report.evaluations == toy.calls["energy"] + toy.calls["evaluate"] == len(toy.visited)
    assert report.evaluations == 1 + report.iterations + report.backtracks + toy.calls["energy"]
    assert report.hessians == toy.calls["matrix"] + toy.calls["product"]
    assert len(report.residuals) == report.iterations + 1
    assert report.residuals[0] == scaled_norm(bar(seed=1).evaluate(toy.start)[1], toy.kappa)
    assert {"other", "evaluate", "assembly"} <= set(report.seconds)
    assert min(report.seconds.values()) >= 0.0
    if METHODS[word].inverse == "cycle":
        assert {"hierarchy", "smoothing", "coarse"} <= set(report.seconds)


def test_backtracks_are_counted():
    toy = scalar(lambda x: np.sqrt(1 + x * x), lambda x: x / np.sqrt(1 + x * x),
                 lambda x: (1 + x * x) ** -1.5, start=2.0)      # Newton's full step goes to -8
    report = minimise(toy, "pn-pcg").report
    assert report.converged
    assert report.backtracks == toy.calls["energy"] > 0
    assert report.evaluations == len(toy.visited)


def test_gast_measures_the_plain_gradient():
    toy = bar()
    solution = minimise(toy, "gast15")
    assert np.linalg.norm(toy.evaluate(solution.dv)[1]) <= METHODS["gast15"].eps
    toy.kappa[:] = 1.0
    assert solution.report.iterations == minimise(toy, "gast15").report.iterations


def test_reports_of_solves_in_a_row_add_up():
    first, second = (minimise(bar(seed=seed), "hot").report for seed in (1, 2))
    both = combined_report([first, second])
    assert both.iterations == first.iterations + second.iterations
    assert both.evaluations == first.evaluations + second.evaluations
    assert sum(both.seconds.values()) == pytest.approx(
        sum(first.seconds.values()) + sum(second.seconds.values()))
    assert (both.residuals, both.message) == (second.residuals, second.message)
