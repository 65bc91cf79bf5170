"""Every method on the incremental potential of particles, with the multigrid."""

import gc
from functools import partial

import numpy as np
import pytest
from hot_cases import CASES, coarser_unknowns, problem_of
from hot_toys import lattice, tight

from mpm_ref.hot.methods import METHODS, minimise, options_of
from mpm_ref.hot.multigrid.blocks.hierarchy import BlockHierarchy
from mpm_ref.hot.multigrid.geometric import CoarseGrids
from mpm_ref.hot.multigrid.hierarchy import Hierarchy
from mpm_ref.hot.multigrid.options import CycleOptions
from mpm_ref.hot.norms import characteristic_norms
from mpm_ref.hot.system import System

ADMM = {"penalty": 4.0}     # strains are so large that a weaker one cycles: see test_hot_admm
WITH_GRIDS = sorted(word for word, options in METHODS.items() if options.inverse == "cycle")


@pytest.fixture(scope="module")
def system():
    """Two bodies of two laws on one grid; some nodes held, one slipping along an oblique plane."""
    q = problem_of(CASES[0])
    B = q.unknowns.B.copy()
    B[:4] = 0.0
    B[20] -= 0.5
    unknowns = q.unknowns._replace(B=B)
    q.potential.unknowns = unknowns
    kappa = characteristic_norms(q.bodies, unknowns, q.potential.stencil, q.potential.dt)
    grids = CoarseGrids(q.potential, partial(coarser_unknowns, q, CASES[0].degree))
    return System(q.potential, unknowns, kappa, unknowns.dv0, grids)


@pytest.fixture(scope="module")
def answer(system):
    return minimise(system, tight("pn-pcg", 1e-13))


@pytest.mark.parametrize("word", sorted(METHODS))
def test_every_method_finds_the_minimiser_of_a_step(system, answer, word):     # HOT-methods
    solution = minimise(system, tight(word, 1e-12), **ADMM if word == "admm" else {})
    assert answer.report.converged
    assert solution.report.converged, solution.report.message
    assert solution.E == pytest.approx(answer.E, rel=1e-12)
    m = system.unknowns.m[:, None]
    apart, size = (np.sqrt(np.sum(m * u**2)) for u in (solution.dv - answer.dv, answer.dv))
    assert apart < 1e-7 * size


def test_smoothers_in_single_precision_lead_to_the_same_minimiser(system, answer):
    solution = minimise(system, tight("hot", 1e-12), cycle=CycleOptions(precision="single"))
    assert solution.report.converged, solution.report.message
    assert solution.E == pytest.approx(answer.E, rel=1e-12)


@pytest.mark.parametrize("word", WITH_GRIDS)
@pytest.mark.parametrize("shape", [(10, 21), (5, 5, 9)])
def test_multigrid_methods_find_the_minimiser_of_a_lattice(word, shape):
    toy = lattice(shape, stiff=100.0)
    solution = minimise(toy, tight(word, 1e-10))
    assert solution.report.converged
    jacobi = minimise(lattice(shape, stiff=100.0), tight("pn-pcg", 1e-10))
    assert np.abs(solution.dv - jacobi.dv).max() < 1e-6
    direct = METHODS[word].cycle.coarsest == "direct"
    assert (solution.report.coarse_iterations > 0) != direct


def test_cycle_direction_takes_fewer_steps_than_jacobi():
    shape = (10, 21)
    hot = minimise(lattice(shape, stiff=1e4), "hot").report
    plain = minimise(lattice(shape, stiff=1e4), options_of("hot", inverse="jacobi")).report
    assert hot.converged
    assert 2 * hot.iterations < plain.iterations


def test_paths_of_multigrid_agree():
    blocks, scipy = (minimise(lattice((10, 21)), "hot", implementation=word)
                     for word in ("blocks", "scipy"))
    assert blocks.report.iterations == scipy.report.iterations
    assert np.allclose(blocks.dv, scipy.dv, atol=1e-10)


def hierarchies():
    return sum(type(thing) in (Hierarchy, BlockHierarchy) for thing in gc.get_objects())


@pytest.mark.parametrize("implementation", ["blocks", "scipy"])
def test_the_levels_of_a_solve_are_freed_when_it_ends(implementation):
    """Not only when Python looks for cycles of references: levels are large and such cycles few."""
    toy = lattice((10, 21))
    gc.collect()
    before = hierarchies()
    gc.disable()
    try:
        minimise(toy, "hot", implementation=implementation)
        assert hierarchies() == before
    finally:
        gc.enable()


def test_choices_reach_the_hierarchy():
    cycle = METHODS["hot"].cycle
    direct = minimise(lattice((10, 21)), "hot", cycle=cycle._replace(coarsest="direct")).report
    assert direct.converged
    assert direct.coarse_iterations == 0
    with pytest.raises(ValueError, match="smoother = 'magic'"):
        options_of("hot", cycle=cycle._replace(smoother="magic"))
