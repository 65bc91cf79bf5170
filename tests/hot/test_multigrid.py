"""The V-cycle: against dense algebra, against pyamg, and what it is as a map."""

from functools import cache
from itertools import pairwise, product

import numpy as np
import pyamg
import pytest
import scipy.sparse as sp
from multigrid_matrices import case, dense, free_basis

from mpm_ref.hot.multigrid import coarsest
from mpm_ref.hot.multigrid.embedding import embed
from mpm_ref.hot.multigrid.hierarchy import hierarchy, hierarchy_from_matrices
from mpm_ref.hot.multigrid.smoothers import SLAB, coloured

PATHS = ("scipy", "blocks")
SMOOTHERS = ("gauss-seidel", "jacobi", "chebyshev")


@cache
def small(d, held=True):
    """A lump of a few hundred nodes at most."""
    return case(d, size=7 if d == 2 else 2, held=held)


def close(a, b, tolerance=1e-12):
    assert abs(a - b).max() <= tolerance * abs(b).max()


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("kernel", ["linear", "quadratic"])
def test_coarse_operators_are_galerkin_products(d, kernel, path):      # HOT-eq5, HOT-eq6
    c = small(d)
    levels = hierarchy(c.A, c.index, 3, kernel, path).levels
    A, index = c.A.toarray(), c.index
    for level in levels[1:]:
        R = np.kron(embed(index, kernel).W.toarray().T, np.eye(d))
        A = R @ A @ R.T                                 # held directions are zero already
        coarse = embed(index, kernel).index.tolist()
        kept = [coarse.index(node) for node in level.index.tolist()]
        rows = (np.array(kept)[:, None] * d + np.arange(d)).reshape(-1)
        gone = np.setdiff1d(np.arange(len(A)), rows)
        assert abs(A[gone]).max(initial=0.0) <= 1e-15 * abs(A).max()   # no weight, no node
        A, index = A[rows][:, rows], level.index
        close(level.A.toarray(), A)
        if path == "blocks":
            assert (level.A != level.A.T).nnz == 0


def test_rows_keep_at_most_5_to_the_d_blocks(d):                       # HOT-nnz
    c = small(d)
    for level in hierarchy(c.A, c.index, 4).levels:
        assert np.diff(level.A.indptr).max() <= 5**d


def pyamg_twin(grids, d):
    """The same hierarchy in pyamg, its unknowns in the order of our sweeps."""
    orders = [(coloured(level.index)[:, None] * d + np.arange(d)).reshape(-1)
              for level in grids.levels]
    levels = []
    for k, level in enumerate(grids.levels):
        twin = pyamg.multilevel.MultilevelSolver.Level()
        A = sp.csr_matrix(level.A)[orders[k]][:, orders[k]]
        twin.A = A.tobsr((d, d))
        if level.P is not None:
            twin.P = sp.csr_matrix(level.P)[orders[k]][:, orders[k + 1]].tobsr((d, d))
            twin.R = twin.P.T.tobsr((d, d))
        levels.append(twin)
    for fine, coarse in pairwise(levels):
        close(coarse.A.toarray(), (fine.R @ fine.A @ fine.P).toarray())
    twin = pyamg.multilevel.MultilevelSolver(levels, coarse_solver="cholesky")
    smoother = ("block_gauss_seidel", {"sweep": "symmetric", "blocksize": d})
    pyamg.relaxation.smoothing.change_smoothers(twin, smoother, smoother)
    return twin, orders[0]


def test_the_cycle_is_that_of_pyamg(d, rng):                           # HOT-alg2
    c = small(d, held=False)
    grids = hierarchy(c.A, c.index, 3, implementation="scipy", coarsest="direct")
    twin, order = pyamg_twin(grids, d)
    b = rng.standard_normal(c.index.shape)
    u = np.empty(b.size)
    u[order] = twin.solve(b.reshape(-1)[order], maxiter=1, tol=0.0)
    close(grids.cycle(b).reshape(-1), u)


@pytest.mark.parametrize(("path", "word", "precision"), [
    *product(PATHS, SMOOTHERS, ["double"]), ("blocks", "gauss-seidel", "single")])
def test_the_cycle_is_symmetric_positive_and_zero_where_held(d, path, word, precision):
    c = small(d)
    M = dense(hierarchy(c.A, c.index, 3, implementation=path, smoother=word, coarsest="direct",
                        precision=precision), c.index.shape)
    close(M, M.T, 1e-13)
    Q = free_basis(c.B)
    close(Q @ (Q.T @ M @ Q) @ Q.T, M, 1e-13)              # nothing in, nothing out where held
    M = Q.T @ M @ Q
    size = np.diagonal(M) ** 0.5                          # light nodes move far: seen on one scale
    assert np.linalg.eigvalsh(M / np.outer(size, size)).min() > 1e-3


@pytest.mark.parametrize("path", PATHS)
def test_the_cycle_is_linear_with_an_exact_coarse_solve(d, path, rng):
    c = small(d)
    cycle = hierarchy(c.A, c.index, implementation=path, coarsest="direct").cycle
    a, b = rng.standard_normal((2, *c.index.shape))
    close(cycle(2.0 * a - b), 2.0 * cycle(a) - cycle(b), 1e-13)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("word", SMOOTHERS)
def test_held_nodes_leave_no_trace(d, word, path, rng):                # HOT-bc: no identity leaks
    c = small(d)
    free = np.flatnonzero(c.B.any(axis=(1, 2)))
    rows = (free[:, None] * d + np.arange(d)).reshape(-1)
    removed = sp.bsr_array(sp.csr_array(c.A)[rows][:, rows], blocksize=(d, d))
    removed.sort_indices()
    b = rng.standard_normal(c.index.shape)
    here = hierarchy(c.A, c.index, implementation=path, smoother=word)
    there = hierarchy(removed, c.index[free], implementation=path, smoother=word)
    close(here.cycle(b)[free], there.cycle(b[free]))


def free_cycle(c, index, b):
    """V-cycle over two levels written in the free directions, dense and by the book."""
    d = c.B.shape[1]
    Q = free_basis(c.B)
    A = Q.T @ c.A.toarray() @ Q
    node = np.argmax(abs(Q), axis=0) // d
    place = np.argsort(coloured(index))[node]
    lower = np.where(place[:, None] >= place[None, :], A, 0.0)
    D = np.where(node[:, None] == node[None, :], A, 0.0)
    M = np.linalg.inv(lower.T) @ D @ np.linalg.inv(lower)
    P = Q.T @ np.kron(embed(index).W.toarray(), np.eye(d))
    P = P[:, P.any(axis=0)]
    coarse = P.T @ A @ P
    scale = np.diagonal(coarse) ** -0.5 * np.eye(len(coarse))
    exact = P @ scale @ np.linalg.pinv(scale @ coarse @ scale, 1e-12, hermitian=True) @ scale @ P.T
    u = M @ (Q.T @ b.reshape(-1))
    u = u + exact @ (Q.T @ b.reshape(-1) - A @ u)
    u = u + M @ (Q.T @ b.reshape(-1) - A @ u)
    return (Q @ u).reshape(b.shape)


@pytest.mark.parametrize("path", PATHS)
def test_the_cycle_is_the_textbook_s_in_free_coordinates(d, path, rng):        # HOT-eq3, HOT-eq4
    c = small(d)
    b = rng.standard_normal(c.index.shape)
    u = hierarchy(c.A, c.index, 2, implementation=path, coarsest="direct").cycle(b)
    close(u, free_cycle(c, c.index, b))


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("preconditioner", ["block", "scalar"])
def test_the_coarsest_cg_stops_at_its_tolerance(d, preconditioner, path, rng):  # HOT-sec5.3-coarse
    c = small(d)
    b = np.einsum("iab,ib->ia", c.B, rng.standard_normal(c.index.shape))
    for tolerance in (0.5, 1e-6):
        grids = hierarchy(c.A, c.index, 1, implementation=path, tolerance=tolerance,
                          preconditioner=preconditioner)
        u = grids.cycle(b)
        r = b - (c.A @ u.reshape(-1)).reshape(b.shape)
        norm = [np.einsum("ia,iab,ib->", q, grids.D_inv, q) ** 0.5 for q in (r, b)]
        assert norm[0] <= tolerance * norm[1] * (1 + 1e-6)
        assert grids.iterations > 0


@pytest.mark.parametrize("path", PATHS)
def test_the_stop_of_the_release_counts_what_smoothing_did(path, rng):
    c = small(2)
    b = rng.standard_normal(c.index.shape)
    loose = hierarchy(c.A, c.index, implementation=path, stop="load", sweeps=4)
    tight = hierarchy(c.A, c.index, implementation=path, stop="residual", sweeps=4)
    loose.cycle(b), tight.cycle(b)
    assert loose.iterations < tight.iterations


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("solver", ["pcg", "direct"])
def test_odd_hierarchies_stay_finite(d, solver, path, rng):
    c = small(d)
    n = len(c.index)
    odd = np.flatnonzero((c.index % 2 != 0).any(axis=1))               # P loses rank
    rows = (odd[:, None] * d + np.arange(d)).reshape(-1)
    alone = sp.bsr_array(sp.csr_array(c.H)[rows][:, rows], blocksize=(d, d))
    alone.sort_indices()
    scale = sp.diags_array(10.0 ** -rng.integers(0, 12, n).repeat(d))     # nodes of tiny mass
    tiny = sp.bsr_array(sp.csr_array(scale @ c.H @ scale), blocksize=(d, d))
    tiny.sort_indices()
    nothing = sp.bsr_array((0.0 * c.A.data, c.A.indices, c.A.indptr), shape=c.A.shape)
    one = sp.bsr_array(np.eye(d), blocksize=(d, d))
    for A, index in ((alone, c.index[odd]), (tiny, c.index), (nothing, c.index),
                     (one, np.full((1, d), -3))):
        b = rng.standard_normal(index.shape)
        grids = hierarchy(A, index, 9, implementation=path, coarsest=solver)
        u = grids.cycle(b)
        assert np.isfinite(u).all()
        assert (u == 0.0).all() if A is nothing else np.vdot(u, b) > 0.0


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("dense_up_to", [0, 10_000])
def test_a_lone_node_hangs_on_more_coarse_nodes_than_it_fixes(d, dense_up_to, path, monkeypatch):
    monkeypatch.setattr(coarsest, "DENSE", dense_up_to)
    c = small(d, held=False)
    index = np.vstack([c.index, np.full((1, d), 31)])                  # coarse matrix: singular
    A = sp.bsr_array(sp.block_diag([sp.csr_array(c.A), 0.3 * np.eye(d)]), blocksize=(d, d))
    A.sort_indices()
    b = np.cos(np.arange(index.size)).reshape(index.shape)
    u = hierarchy(A, index, 3, implementation=path, coarsest="direct").cycle(b)
    np.testing.assert_allclose(u[-1], b[-1] / 0.3, rtol=1e-13)
    close(u[:-1], hierarchy(c.A, c.index, 3, implementation=path, coarsest="direct").cycle(b[:-1]))


def test_slabs_of_one_colour_do_not_couple(d):                         # HOT-smoother
    c = small(d)
    slab = c.index[:, 0] // SLAB
    row = np.repeat(np.arange(len(c.index)), np.diff(c.A.indptr))
    pairs = slab[row], slab[c.A.indices]
    assert (pairs[0] != pairs[1]).any()
    assert ((pairs[0] - pairs[1]) % 2 != 0)[pairs[0] != pairs[1]].all()
    order = coloured(c.index)
    assert sorted(order) == list(range(len(order)))
    assert (np.diff(slab[order] % 2) >= 0).all()


@pytest.mark.parametrize(("wrong", "said"), [
    ({"implementation": "gpu"}, "implementation = 'gpu': expected one of scipy, blocks"),
    ({"smoother": "ilu"}, "smoother = 'ilu': expected one of gauss-seidel, jacobi, chebyshev"),
    ({"precision": "half"}, "precision = 'half': expected one of double, single"),
    ({"coarse": "pcg"}, "no option 'coarse': expected one of smoother, "),
    ({"kernel": "cubic"}, "kernel = 'cubic'"),
    ({"levels": 0}, "levels = 0"),
    ({"tolerance": 1.0}, r"a tolerance in \[0, 1\)"),
])
def test_wrong_words_are_refused(wrong, said):
    c = small(2)
    with pytest.raises(ValueError, match=said):
        hierarchy(c.A, c.index, **wrong)


@pytest.mark.parametrize("path", PATHS)
def test_wrong_matrices_are_refused(path):
    c = small(2)
    with pytest.raises(ValueError, match=r"expected .* in blocks"):
        hierarchy(c.A, c.index[1:], implementation=path)
    blown = c.A.copy()
    blown.data[:] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        hierarchy(blown, c.index, implementation=path)
    with pytest.raises(ValueError, match="not finite"):
        hierarchy_from_matrices([(blown, c.index)], path)
