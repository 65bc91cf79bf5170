"""Logic of the experiments that follow one step of HOT: iterates kept, errors, slices, sums."""

import numpy as np
import pytest

from mpm_ref.hot.methods import minimise
from mpm_ref.hot.norms import scaled_norm
from validation.hot import coarse_grids, first_step, stretched_map
from validation.hot.coarse_grids import Cost
from validation.hot.iterates import EPS, errors, first, iterates, noted, spread, ways
from validation.hot.stretched import HIGH, LOW, stretched

CELLS = 4


@pytest.fixture(scope="module")
def step():
    return first(stretched("particle", 1.0 / CELLS))


@pytest.fixture(scope="module")
def made(step):
    """Iterates of the step by word."""
    return {way.name: iterates(step, way) for way in ways("hot", "pn-pcg")}


@pytest.mark.parametrize("method", ["hot", "pn-pcg"])
def test_iterates_are_those_of_the_method(step, made, method):
    system, kept = step.stepper.system(step.pose), made[method]
    solution = minimise(system, method)
    np.testing.assert_array_equal(kept.dv[-1], solution.dv)
    assert kept.report.residuals == solution.report.residuals
    assert kept.cg[-1] == solution.report.cg_iterations
    for dv, residual in zip(kept.dv, kept.report.residuals, strict=True):
        assert scaled_norm(system.evaluate(dv)[1], system.kappa) == residual


def test_iterates_are_kept_where_a_search_goes_back():
    """What is kept is what was accepted, not what was tried."""
    step = first(stretched("particle", 1.0 / CELLS, nu=0.48, E=1e7))
    kept, system = iterates(step, ways("lbfgs-h")[0]), step.stepper.system(step.pose)
    assert kept.report.backtracks > 0
    for dv, residual in zip(kept.dv, kept.report.residuals, strict=True):
        assert scaled_norm(system.evaluate(dv)[1], system.kappa) == residual


def test_rows_grow_to_the_tolerance(made):
    k = made["pn-pcg"].first(EPS)
    assert k == made["pn-pcg"].report.iterations
    assert made["pn-pcg"].first(0.0) is None
    for column in list(zip(*made["pn-pcg"].rows, strict=True))[:3]:
        assert list(column) == sorted(column)
    assert made["pn-pcg"].report.residuals[k] <= EPS < made["pn-pcg"].report.residuals[k - 1]


def test_errors_fall_to_that_of_the_solution(step, made):
    curve = errors(step, made["hot"], made["hot"].dv[-1])
    assert set(curve) == set(range(len(made["hot"].dv)))
    assert curve[0][0] == pytest.approx(1.0)        # from rest, the increment is all
    assert curve[len(curve) - 1] == (0.0, 0.0)


def test_a_spread_has_both_ends():
    assert spread(1000, 5) == [0, 250, 500, 750, 1000]
    assert spread(2, 300) == [0, 1, 2]


def test_what_did_not_converge_is_noted(step):
    report = iterates(step, ways("hot")[0], max_iterations=1).report
    assert noted("here", report).startswith("here; 1 iterations, the cap")
    assert noted("here", report._replace(converged=True, capped_solves=0)) == "here"


def test_an_error_counts_as_reached_where_it_stays_below():
    curve = {0: (1.0, 0.0), 1: (0.05, 0.0), 2: (0.5, 0.0), 4: (0.01, 0.0), 6: (0.001, 0.0)}
    assert first_step.reached(curve, 0.1) == 4
    assert first_step.reached(curve, 2.0) == 0
    assert first_step.reached(curve, 1e-4) is None
    assert first_step.level(curve, 5) in (0.01, 0.001)
    assert first_step.level(curve, 2) == 0.5


@pytest.mark.parametrize("variant", ["body", "particle"])
def test_stretches_are_within_what_is_printed(variant):
    F = stretched(variant, 1.0 / CELLS, seed=3).bodies[0].particles.F
    stretches = np.einsum("paa->pa", F)
    assert F.sum() == pytest.approx(stretches.sum())
    assert ((LOW <= stretches) & (stretches <= HIGH)).all()
    assert (np.ptp(stretches, axis=0) == 0.0).all() == (variant == "body")


def test_an_unknown_reading_is_refused():
    with pytest.raises(ValueError, match="variant = 'cell'"):
        stretched("cell")


def test_what_varies_slowly_is_told_from_what_does_not(step):
    system = step.stepper.system(step.pose)
    smooth = np.outer(system.kappa, (1.0, 0.0, 0.0))
    blocks = len(np.unique(system.index // stretched_map.BLOCK, axis=0))
    assert stretched_map.slowly(system, smooth) == pytest.approx(blocks**0.5)
    rough = smooth * (-1.0) ** system.index.sum(axis=1, keepdims=True)
    assert stretched_map.slowly(system, rough) < 0.5 * blocks**0.5


def test_a_slice_holds_the_residuals_of_its_nodes(step):
    system = step.stepper.system(step.pose)
    g = system.evaluate(system.start)[1]
    rows = stretched_map.slice_of(system, g)
    sides = np.ptp(system.index, axis=0) + 1
    assert len(rows) == sides[0] * sides[1]
    size = np.linalg.norm(g, axis=1) / system.kappa
    assert {r for _, _, r in rows} <= set(size.tolist())


def test_totals_and_ratios_are_over_all_steps():
    costs = [Cost("a", 0, "hot", 2, 0, 1.0, True), Cost("a", 1, "hot", 4, 0, 1.0, False),
             Cost("a", 0, "lbfgs-gmg", 9, 0, 5.0, True)]
    assert coarse_grids.total(costs, "hot", "iterations") == 6
    assert coarse_grids.ratio(costs, "iterations") == 1.5
    assert coarse_grids.ratio(costs, "cpu") == 2.5
    assert not coarse_grids.all_converged(costs, "hot")
    assert coarse_grids.all_converged(costs, "lbfgs-gmg")
