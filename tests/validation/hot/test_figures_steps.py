"""Logic of the experiments that follow one step of HOT: iterates, errors, slices, sums."""

import numpy as np
import pytest

from mpm_ref.hot.methods import minimise, printed
from mpm_ref.hot.norms import scaled_norm
from validation.common.scenes import evenly
from validation.hot import coarse_grids, first_step, stretched_box
from validation.hot.coarse_grids import MultigridCost
from validation.hot.iterates import (
    EPS,
    initial_step,
    iterate_errors,
    iterates,
    setups,
    solve_note,
)
from validation.hot.stretched_box import HIGH, LOW, stretched

CELLS = 4


@pytest.fixture(scope="module")
def step():
    return initial_step(stretched("particle", 1.0 / CELLS))


@pytest.fixture(scope="module")
def descents(step):
    """Iterates of the step by method."""
    return {setup.name: iterates(step, setup) for setup in setups("hot", "pn-pcg")}


@pytest.mark.parametrize("method", ["hot", "pn-pcg"])
def test_iterates_are_those_of_the_method(step, descents, method):
    system, descent = step.stepper.system(step.pose), descents[method]
    solution = minimise(system, printed(method))
    np.testing.assert_array_equal(descent.dv[-1], solution.dv)
    assert descent.report.residuals == solution.report.residuals
    assert descent.cg[-1] == solution.report.cg_iterations
    for dv, residual in zip(descent.dv, descent.report.residuals, strict=True):
        assert scaled_norm(system.evaluate(dv)[1], system.kappa) == residual


def test_iterates_are_the_accepted_ones_where_a_search_goes_back():
    """Points that were tried and refused are no iterates."""
    step = initial_step(stretched("particle", 1.0 / CELLS, nu=0.48, E=1e7))
    descent, system = iterates(step, setups("lbfgs-h")[0]), step.stepper.system(step.pose)
    assert descent.report.backtracks > 0
    for dv, residual in zip(descent.dv, descent.report.residuals, strict=True):
        assert scaled_norm(system.evaluate(dv)[1], system.kappa) == residual


def test_rows_grow_to_the_tolerance(descents):
    descent = descents["pn-pcg"]
    k = descent.first(EPS)
    assert k == descent.report.iterations
    assert descent.first(0.0) is None
    for column in list(zip(*descent.rows, strict=True))[:3]:
        assert list(column) == sorted(column)
    assert descent.report.residuals[k] <= EPS < descent.report.residuals[k - 1]


def test_errors_fall_to_that_of_the_solution(step, descents):
    curve = iterate_errors(step, descents["hot"], descents["hot"].dv[-1])
    assert set(curve) == set(range(len(descents["hot"].dv)))
    assert curve[0][0] == pytest.approx(1.0)        # from rest, the increment is all
    assert curve[len(curve) - 1] == (0.0, 0.0)


def test_even_indices_have_both_ends():
    assert evenly(1001, 5) == [0, 250, 500, 750, 1000]
    assert evenly(3, 300) == [0, 1, 2]
    assert evenly(0, 5) == []


def test_a_solve_that_did_not_converge_is_noted(step):
    report = iterates(step, setups("hot")[0], max_iterations=1).report
    assert solve_note("here", report).startswith("here; 1 iterations, the cap")
    assert solve_note("here", report._replace(converged=True, capped_solves=0)) == "here"


def test_an_error_counts_from_where_it_stays_below():
    curve = {0: (1.0, 0.0), 1: (0.05, 0.0), 2: (0.5, 0.0), 4: (0.01, 0.0), 6: (0.001, 0.0)}
    assert first_step.first_below(curve, 0.1) == 4
    assert first_step.first_below(curve, 2.0) == 0
    assert first_step.first_below(curve, 1e-4) is None
    assert first_step.error_near(curve, 5) in (0.01, 0.001)
    assert first_step.error_near(curve, 2) == 0.5


@pytest.mark.parametrize("variant", ["body", "particle"])
def test_stretches_are_within_the_printed_bounds(variant):
    F = stretched(variant, 1.0 / CELLS, seed=3).bodies[0].particles.F
    stretches = np.einsum("paa->pa", F)
    assert F.sum() == pytest.approx(stretches.sum())
    assert ((LOW <= stretches) & (stretches <= HIGH)).all()
    assert (np.ptp(stretches, axis=0) == 0.0).all() == (variant == "body")


def test_an_unknown_reading_is_refused():
    with pytest.raises(ValueError, match="variant = 'cell'"):
        stretched("cell")


def test_slowly_varying_residuals_differ_from_others(step):
    system = step.stepper.system(step.pose)
    smooth = np.outer(system.kappa, (1.0, 0.0, 0.0))
    blocks = len(np.unique(system.index // stretched_box.BLOCK, axis=0))
    assert stretched_box.slow_residual(system, smooth) == pytest.approx(blocks**0.5)
    rough = smooth * (-1.0) ** system.index.sum(axis=1, keepdims=True)
    assert stretched_box.slow_residual(system, rough) < 0.5 * blocks**0.5


def test_a_slice_holds_the_residuals_of_its_nodes(step):
    system = step.stepper.system(step.pose)
    g = system.evaluate(system.start)[1]
    rows = stretched_box.middle_slice(system, g)
    sides = np.ptp(system.index, axis=0) + 1
    assert len(rows) == sides[0] * sides[1]
    size = np.linalg.norm(g, axis=1) / system.kappa
    assert {r for _, _, r in rows} <= set(size.tolist())


def test_totals_and_ratios_are_over_all_steps():
    costs = [MultigridCost("a", 0, "hot", 2, 0, 1.0, True),
             MultigridCost("a", 1, "hot", 4, 0, 1.0, False),
             MultigridCost("a", 0, "lbfgs-gmg", 9, 0, 5.0, True)]
    assert coarse_grids.total(costs, "hot", "iterations") == 6
    assert coarse_grids.ratio(costs, "iterations") == 1.5
    assert coarse_grids.ratio(costs, "cpu") == 2.5
    assert not coarse_grids.all_converged(costs, "hot")
    assert coarse_grids.all_converged(costs, "lbfgs-gmg")
