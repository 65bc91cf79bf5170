"""Geometric multigrid: its coarse matrices, conditions and cycles, and the methods upon them."""

from functools import cache, partial

import numpy as np
import pytest
from hot_cases import CASES, DEGREES, coarser_unknowns, problem_of
from hot_steps import DT, pose_of, stepper_of
from hot_steps import walls as walls_of
from multigrid_matrices import dense, free_basis

from mpm_ref.core.boundary import Conditions
from mpm_ref.hot.methods import minimise, options_of
from mpm_ref.hot.multigrid import geometric
from mpm_ref.hot.multigrid.embedding import embed, embed_onto
from mpm_ref.hot.multigrid.geometric import CoarseGrids, coarse_conditions
from mpm_ref.hot.multigrid.hierarchy import IMPLEMENTATIONS, hierarchy, hierarchy_from_matrices
from mpm_ref.hot.system import System

WORDS = ("lbfgs-gmg", "pn-gmg-pcg")


def levels_of(case, level=1):
    """The finest matrix of a case without conditions and that of a coarser level, both without
    masses; the node indices of both; and the nodes' masses on the coarser.
    """
    problem = problem_of(case, length=8.0)
    potential, d = problem.potential, case.d
    finest = CoarseGrids(potential, partial(coarser_unknowns, problem, case.degree))
    tangent = potential.tangent(problem.dv)
    (H, index), = finest.matrices(tangent.modes, level + 1)[level - 1 : level]
    m = finest.grid(level).unknowns.m
    fine = tangent.matrix().toarray() - np.diag(np.repeat(potential.unknowns.m, d))
    return fine, H.toarray() - np.diag(np.repeat(m, d)), (potential.unknowns.index, index), m


def test_linear_splines_give_the_galerkin_product():
    """Linear splines of spacing 2 dx are sums of those of spacing dx: both are one space."""
    K, K_coarse, (index, coarse), _ = levels_of(DEGREES[0])
    P = np.kron(embed_onto(index, coarse).toarray(), np.eye(2))
    assert np.abs(K_coarse - P.T @ K @ P).max() < 1e-13 * np.abs(K).max()


@pytest.mark.parametrize("case", CASES[::2], ids=lambda case: case.name)
def test_coarse_matrix_is_symmetric_and_semidefinite(case):
    for level in (1, 2):
        _, K, _, m = levels_of(case, level)
        assert np.array_equal(K, K.T)
        assert np.linalg.eigvalsh(K)[0] > -1e-13 * np.abs(K).max()
        assert (m > 0.0).all()


@pytest.mark.parametrize("case", CASES[::2], ids=lambda case: case.name)
def test_affine_motions_cost_the_same_on_every_level(case):
    """Splines keep linear fields, so that every particle feels the same velocity gradient."""
    G = np.random.default_rng(1).normal(size=(case.d, case.d))
    for level in (1, 2):
        K, K_coarse, (index, coarse), _ = levels_of(case, level)
        u, u_coarse = (index @ G.T).reshape(-1), (2**level * coarse @ G.T).reshape(-1)
        assert u_coarse @ K_coarse @ u_coarse == pytest.approx(u @ K @ u, rel=1e-12)


def test_quadratic_splines_come_near_the_galerkin_product_at_second_order():
    """The spaces differ: kernels of 3 cells against 2.5 (HOT-sec4.2-kernel). The wider one feels
    less of a wave: 20 % less of one of 4 coarse cells, and about a quarter of that per doubling.
    """
    K, K_coarse, (index, coarse), _ = levels_of(CASES[0])
    P = np.kron(embed_onto(index, coarse).toarray(), np.eye(2))
    lost = []
    for cells in (4, 8, 16, 32):
        phase = 2 * np.pi * coarse[:, 0] / cells
        u = np.stack([np.sin(phase), np.cos(phase)], axis=1).reshape(-1)
        lost.append(1.0 - (u @ K_coarse @ u) / (u @ P.T @ K @ P @ u))
    assert 0.15 < lost[0] < 0.25
    falls = np.array(lost[:-1]) / lost[1:]
    assert np.all((falls > 3.0) & (falls < 5.0)), falls


def test_masses_and_nodes_are_those_of_the_coarser_transfer(d):
    pose = pose_of(d)
    finer = pose.unknowns.index
    for level in (1, 2):
        q = pose.coarse_grids.grid(level).unknowns
        assert q.dx == 2**level * pose.unknowns.dx
        assert q.m.sum() == pytest.approx(pose.unknowns.m.sum(), rel=1e-13)
        there = set(map(tuple, q.index.tolist()))
        assert {tuple(c) for c in embed(finer).index.tolist()} <= there
        finer = q.index


def test_conditions_are_met_at_the_coarse_nodes(d):
    pose = pose_of(d)
    for level in (1, 2):
        q = pose.coarse_grids.grid(level).unknowns
        x = q.index * q.dx
        held = x[:, 0] <= 0.15
        assert held.any()
        assert not q.B[held].any()
        assert np.allclose(q.v[held] + q.dv0[held], 0.0)
        normal = np.eye(d)[d - 1] + 0.2 * np.eye(d)[0]
        normal /= np.linalg.norm(normal)
        slips = ~held & (x @ normal <= 1e-9)
        assert slips.any()
        assert np.allclose(q.B[slips], np.eye(d) - np.outer(normal, normal))
        free = ~held & ~slips
        assert (q.B[free] == np.eye(d)).all()
        (A, _), = pose.coarse_grids.matrices(system_of(pose).tangent(pose.unknowns.dv0).modes,
                                          level + 1)[level - 1 : level]
        rows = A.toarray().reshape(len(x), d, -1)
        assert not rows[held].any()
        assert np.abs(np.einsum("a,nac->nc", normal, rows[slips])).max() < 1e-12 * A.data.max()


def system_of(pose):
    return System(pose.potential, pose.unknowns, pose.kappa, pose.unknowns.dv0, pose.coarse_grids)


@pytest.mark.parametrize(("low", "high"), [(1, 4), (2, 5), (-3, None), (None, 7)])
def test_walls_stay_where_they_are_when_counted_in_coarser_nodes(low, high):
    conditions = Conditions(walls=walls_of(2, low, high))
    for factor in (2, 4):
        walls = coarse_conditions(conditions, factor).walls
        for c in range(-10, 11):
            for k, k_fine, beyond in ((walls.low[1], low, int.__lt__),
                                      (walls.high[1], high, int.__gt__)):
                assert k is None if k_fine is None else beyond(c, k) == beyond(factor * c, k_fine)


def test_levels_end_where_nothing_gets_coarser():
    pose = pose_of(2, side=2)
    sizes = [A.shape[0] for A, _ in system_of(pose).matrices(pose.unknowns.dv0, 9)]
    assert 2 < len(sizes) < 9
    assert np.all(np.diff(sizes) < 0)


def test_what_does_not_change_is_made_once(monkeypatch):
    made = []
    space_of = geometric.coarse_grid
    monkeypatch.setattr(geometric, "coarse_grid", lambda *a: made.append(0) or space_of(*a))
    pose = pose_of(2)
    report = minimise(system_of(pose), "pn-gmg-pcg").report
    assert report.hessians > 1
    assert len(made) == 2


def test_system_without_coarser_grids_says_so():
    problem = problem_of(CASES[0])
    q = problem.unknowns
    with pytest.raises(ValueError, match="geometric multigrid on a System without coarser grids"):
        minimise(System(problem.potential, q, np.ones(len(q.m)), q.dv0), "lbfgs-gmg")


# The cycle.

SMOOTHERS = ("gauss-seidel", "jacobi")


@cache
def grids(d, path, smoother="gauss-seidel"):
    """Matrices of three levels and the cycle with an exact coarsest solve."""
    pose = pose_of(d)
    matrices = system_of(pose).matrices(pose.unknowns.dv0, 3)
    return matrices, hierarchy_from_matrices(matrices, path, coarsest="direct", smoother=smoother)


def test_weights_on_given_nodes_are_those_of_the_embedding(d):
    pose = pose_of(d)
    index = pose.unknowns.index
    W, coarse = embed(index)
    more = np.unique(np.concatenate((coarse, coarse + 3)), axis=0)
    at = [np.flatnonzero((more == c).all(axis=1))[0] for c in coarse]
    given = embed_onto(index, more).toarray()
    assert np.array_equal(given[:, at], W.toarray())
    assert np.count_nonzero(given) == W.nnz


@pytest.mark.parametrize("smoother", SMOOTHERS)
@pytest.mark.parametrize("path", sorted(IMPLEMENTATIONS))
def test_cycle_is_symmetric_and_positive_on_what_is_free(d, path, smoother):
    matrices, cycles = grids(d, path, smoother)
    shape = matrices[0][1].shape
    Q = free_basis(cycles.levels[0].B)
    M = Q.T @ dense(cycles, shape) @ Q
    assert np.abs(M - M.T).max() < 1e-9 * np.abs(M).max()
    assert np.linalg.eigvalsh(0.5 * (M + M.T))[0] > 0.0


@pytest.mark.parametrize("smoother", SMOOTHERS)
def test_paths_agree(d, smoother):
    """Also where the right-hand side has a part along what is held."""
    b = np.random.default_rng(0).normal(size=grids(d, "scipy")[0][0][1].shape)
    u, v = (grids(d, path, smoother)[1].cycle(b) for path in IMPLEMENTATIONS)
    assert np.abs(u - v).max() < 1e-10 * np.abs(u).max()


def test_galerkin_matrices_that_are_given_make_the_galerkin_cycle(d):
    A, index = grids(d, "scipy")[0][0]
    made = hierarchy(A, index, 3, implementation="scipy", coarsest="direct")
    given = hierarchy_from_matrices([(level.A, level.index) for level in made.levels], "scipy",
                         coarsest="direct")
    b = np.random.default_rng(0).normal(size=index.shape)
    u, v = made.cycle(b), given.cycle(b)
    assert np.abs(u - v).max() < 1e-9 * np.abs(u).max()


# The methods.

@pytest.mark.parametrize("word", WORDS)
def test_methods_find_the_minimiser_of_a_step(d, word):
    pose = pose_of(d)
    system = system_of(pose)
    answer = minimise(system, "pn-pcg", eps=1e-12)
    solution = minimise(system, word, eps=1e-12)
    assert answer.report.converged
    assert solution.report.converged, solution.report.message
    assert solution.report.coarse_iterations > 0
    assert solution.E == pytest.approx(answer.E, rel=1e-12)
    m = system.unknowns.m[:, None]
    apart, size = (np.sqrt(np.sum(m * u**2)) for u in (solution.dv - answer.dv, answer.dv))
    assert apart < 1e-7 * size


@pytest.mark.parametrize("word", WORDS)
def test_capped_solve_says_so(word):
    pose = pose_of(2)
    report = minimise(system_of(pose), word, max_iterations=1).report
    assert not report.converged
    assert "1 iterations, the cap" in report.message


@pytest.mark.parametrize("word", [*WORDS, "admm"])
def test_whole_steps_agree(word):
    ends = []
    for name in (word, "pn-pcg"):
        stepper, bodies = stepper_of(2, options=options_of(name, eps=1e-11))
        for k in range(3):
            stepper.step(bodies, k * DT, DT)
            assert stepper.report.converged, stepper.report.message
            assert stepper.report.method == name
        ends.append(np.concatenate([body.particles.v for body in bodies]))
    assert np.abs(ends[0] - ends[1]).max() < 1e-6 * np.abs(ends[1]).max()
