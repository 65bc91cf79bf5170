"""Logic of HOT's experiments: the frozen system, the measured CG, patterns of hierarchies."""

import numpy as np
import pytest
import scipy.sparse as sp
from multigrid_matrices import assembled, case, dense, lump, points

from mpm_ref.hot.krylov import block_jacobi
from mpm_ref.hot.multigrid.embedding import embed
from mpm_ref.hot.multigrid.hierarchy import hierarchy
from validation.common import targets
from validation.hot.held_nodes import (
    TREATMENTS,
    constrained_matrix,
    cycle_quality,
    mean_diagonal,
    on_free,
    treated_hierarchy,
)
from validation.hot.hierarchy_levels import LEVELS, galerkin, geometric_levels, particle_pattern
from validation.hot.linear_system import (
    CGLimits,
    cg,
    convergence_factor,
    frozen,
    rigid_modes,
    spectrum,
)
from validation.hot.warm_states import PRINTED, SOFT_CAT, scene

TIGHT = CGLimits(1e-12, 200)


@pytest.fixture(scope="module")
def clamped():
    """A lump in two dimensions whose lowest nodes are held."""
    c = case(2, 6, held=False)
    free = c.index[:, -1] > -2
    mask = sp.diags_array(np.repeat(free, 2).astype(float))
    A = sp.bsr_array(sp.csr_array(mask @ c.A @ mask), blocksize=(2, 2))
    A.sort_indices()
    b = free[:, None] * np.random.default_rng(1).standard_normal(c.index.shape)
    return constrained_matrix(A, c.index, b, 0)


@pytest.fixture(scope="module")
def system(clamped):
    """Its free nodes."""
    return clamped.system


def two_grid(system):
    return hierarchy(system.A, system.index, 2, coarsest="direct", implementation="scipy")


def product(system, grids):
    """The dense M A of a hierarchy's cycle M."""
    return dense(grids, system.index.shape) @ system.A.toarray()


def test_held_nodes_are_gone_and_the_rest_is_regular(system):
    assert system.index[:, -1].min() == -1
    assert np.linalg.eigvalsh(system.A.toarray())[0] > 0.0


def test_nodes_free_in_part_are_refused():
    c = case(2, 6)
    with pytest.raises(ValueError, match="some directions"):
        frozen(c.A, c.index, np.zeros(c.index.shape), 0)


def test_rigid_modes_meet_no_elastic_force(d):
    x = points(lump(d, 3, 0.85, np.random.default_rng(0)))
    stiff, index = assembled(x, np.ones(len(x)))
    mass, _ = assembled(x, np.zeros(len(x)))
    modes = rigid_modes(index)
    assert np.linalg.matrix_rank(modes) == d * (d + 1) // 2
    assert abs((stiff - mass) @ modes).max() < 1e-13 * abs(stiff @ modes).max()


@pytest.mark.parametrize("flexible", [False, True])
def test_cg_solves_and_stops_in_the_norm_of_the_diagonal_blocks(system, flexible):
    x = np.linalg.solve(system.A.toarray(), system.b.reshape(-1)).reshape(system.b.shape)
    history = cg(system, two_grid(system).cycle, TIGHT, flexible)
    assert history.converged
    np.testing.assert_allclose(history.x, x, atol=1e-10 * abs(x).max())

    def size(u):
        r = system.b - (system.A @ u.reshape(-1)).reshape(u.shape)
        return np.einsum("ia,iab,ib->", r, system.D_inv, r) ** 0.5
    early = cg(system, two_grid(system).cycle, CGLimits(1e-3, 200), flexible)
    before = cg(system, two_grid(system).cycle, CGLimits(1e-3, early.iterations - 1), flexible)
    assert size(early.x) <= 1e-3 * size(0.0 * x) < size(before.x)
    assert early.converged
    assert not before.converged


def test_flexible_cg_is_cg_where_the_preconditioner_stays(system):
    # few iterations: with more, round-off grows until the two part
    plain, flexible = (cg(system, block_jacobi(system.D), CGLimits(cap=8), word)
                       for word in (False, True))
    np.testing.assert_allclose(flexible.steps, plain.steps, rtol=1e-10)


def test_spectrum_is_that_of_the_preconditioned_matrix(system):
    values = np.linalg.eigvals(np.linalg.solve(block(system.D), system.A.toarray())).real
    low, high = spectrum(cg(system, block_jacobi(system.D), TIGHT))
    np.testing.assert_allclose((low, high), (values.min(), values.max()), rtol=1e-6)


def block(D):
    """The dense matrix of diagonal blocks."""
    n, d = D.shape[:2]
    full = np.zeros((n, d, n, d))
    full[np.arange(n), :, np.arange(n)] = D
    return full.reshape(n * d, n * d)


def test_convergence_factor_is_the_spectral_radius_of_the_iteration(system):
    grids = two_grid(system)
    iteration = np.eye(system.b.size) - product(system, grids)
    radius = abs(np.linalg.eigvals(iteration)).max()
    assert 0.0 < radius < 1.0
    assert convergence_factor(cg(system, grids.cycle, TIGHT)) == pytest.approx(radius, rel=1e-6)


def coarse(grids):
    """Blocks of the second level's matrix by pairs of world indices, {(i, j): (d, d)}."""
    level = grids.levels[1]
    A, index = level.A, [tuple(i) for i in level.index]
    row = np.repeat(np.arange(len(index)), np.diff(A.indptr))
    return {(index[i], index[j]): block
            for i, j, block in zip(row, A.indices, A.data, strict=True)}


@pytest.mark.parametrize(("treatment", "size"), [("leaking", 1.0), ("leaking-scaled", None)])
def test_leak_adds_the_identity_of_held_nodes_to_the_coarse_matrix(clamped, treatment, size):
    masked, leaking = (coarse(treated_hierarchy(clamped, word, 2))
                       for word in ("masked", treatment))
    size = mean_diagonal(clamped) if size is None else size
    W = embed(clamped.index)
    leak = (W.W.T @ sp.diags_array(size * ~clamped.is_free) @ W.W).toarray()
    none = np.zeros((2, 2))
    for i, a in enumerate(map(tuple, W.index)):
        for j, b in enumerate(map(tuple, W.index)):
            more = leaking.get((a, b), none) - masked.get((a, b), none)
            np.testing.assert_allclose(more, leak[i, j] * np.eye(2), atol=1e-12 * size)
    assert leak.any()


@pytest.mark.parametrize("treatment", TREATMENTS)
def test_factor_of_a_cycle_is_that_on_free_nodes(clamped, treatment):
    A, shape = clamped.system.A.toarray(), clamped.system.b.shape
    inverse = on_free(clamped, treated_hierarchy(clamped, treatment, 2))
    M = np.stack([inverse(e.reshape(shape)).reshape(-1) for e in np.eye(len(A))], axis=1)
    np.testing.assert_allclose(M, M.T, atol=1e-13 * abs(M).max())
    radius = abs(np.linalg.eigvals(np.eye(len(A)) - M @ A)).max()
    quality = cycle_quality(clamped, treatment, 2, noise(shape))
    assert quality.converged
    assert quality.factor == pytest.approx(radius, rel=1e-6)


def test_masked_cycle_is_that_of_the_free_nodes_alone(clamped):
    alone, b = two_grid(clamped.system), clamped.system.b
    u = on_free(clamped, treated_hierarchy(clamped, "masked", 2))(b)
    np.testing.assert_allclose(u, alone.cycle(b), atol=1e-12 * abs(u).max())


def test_leak_makes_two_grids_slower(clamped):
    factors = [cycle_quality(clamped, treatment, 2, noise(clamped.system.b.shape)).factor
               for treatment in ("masked", "leaking")]
    assert factors[0] < factors[1]


def noise(shape):
    return np.random.default_rng(2).standard_normal(shape)


@pytest.mark.parametrize("kernel", ["linear", "quadratic"])
def test_pattern_is_that_of_the_galerkin_matrices(kernel):
    x = points(lump(2, 9, 0.85, np.random.default_rng(0)))
    A, index = assembled(x, np.ones(len(x)))
    levels = hierarchy(A, index, 3, kernel, implementation="scipy").levels
    pattern, nodes = particle_pattern(0.1 * x, 0.1)
    for level in levels:
        np.testing.assert_array_equal(nodes, level.index)
        assert pattern.nnz == level.A.nnz // 4
        pattern, nodes = galerkin(pattern, nodes, kernel)


def test_two_distant_particles_share_nodes_on_the_coarse_grids():
    rows = geometric_levels(np.array([[0.3, 0.4, 5.0], [0.7, 0.4, 5.0]]), 0.1)
    assert (rows[0].rows, rows[0].per_row) == (2 * 81, 81.0)
    assert (rows[-1].rows, rows[-1].per_row) == (81, 81.0)
    assert len(rows) == LEVELS


def test_rows_of_table_3_are_the_printed_ones():
    printed = {target.split(".")[2] for target in targets.load()
               if target.startswith("hot.table3.")}
    assert set(PRINTED) == printed


def test_soft_cat_is_soft_alone():
    soft, stiff = (scene(f"armacat_{word}", "quick").body for word in ("soft", "stiff"))
    changed = [(a.name, a.material.E) for a, b in zip(soft, stiff, strict=True) if a != b]
    assert changed == [("cat", SOFT_CAT)]
