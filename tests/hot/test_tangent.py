"""The Hessian of the incremental potential: exact, projected, as operator and as matrix."""

import numpy as np
import pytest
from constitutive import LAW, evaluate, rate
from hot_cases import CASES, DEGREES, DT, MLS, problem_of
from scipy.sparse import block_diag, bsr_array, csr_array
from threads import by_threads
from variants import slow_but

from mpm_ref.hot.assembly import pattern_of

H = np.geomspace(1e-1, 1e-3, 5)
LONG = 200.0        # cells: many slabs, for threads to meet in
ALL = slow_but(CASES + DEGREES + MLS, *CASES[:2], DEGREES[0], MLS[1])
WIDE = 0.6      # spread of log stretches: then the exact Hessian has negative eigenvalues


@pytest.fixture(params=ALL, ids=lambda case: case.name, scope="module")
def at(request):
    return request.param, problem_of(request.param)


def largest(a):
    return np.abs(a).max()


def gradients_of(body, unknowns, case):
    """The matrix (N d d, n d) that maps nodal velocities to L_p, row by row (NSF-alg-mpm)."""
    ip, d = case.pairs(body.particles.x), body.particles.x.shape[1]
    node = unknowns.number[tuple(np.moveaxis(ip.node - unknowns.origin, -1, 0))]
    p, _, a, b = np.indices((*node.shape, d, d)).reshape(4, -1)
    row, column = (p * d + a) * d + b, np.repeat(node.reshape(-1), d * d) * d + a
    value = np.broadcast_to(ip.dw[:, :, None, :], (*node.shape, d, d)).reshape(-1)
    return csr_array((value, (row, column)), (d * d * len(node), d * len(unknowns.m)))


def differentials_of(name, F, F_n, projected):
    """(N, d d, d d): of (dP/dF : (L F_n)) F_n^T with respect to L, column by column."""
    d, columns = F.shape[1], []
    for unit in np.eye(d * d).reshape(-1, d, d):
        values = evaluate(LAW[name], F, unit @ F_n)
        dP = values.projected if projected else values.differential
        columns.append((dP @ np.swapaxes(F_n, 1, 2)).reshape(len(F), -1))
    return np.stack(columns, axis=2)


def reference(q, case, projected=True):
    """H = M + sum_p dt^2 V0_p G_p^T D_p G_p on SciPy matrices."""
    d, n = case.d, len(q.unknowns.m)
    out = csr_array((np.repeat(q.unknowns.m, d), (np.arange(n * d),) * 2), (n * d, n * d))
    for body in q.bodies:
        G = gradients_of(body, q.unknowns, case)
        L = (G @ (q.unknowns.v + q.dv).reshape(-1)).reshape(-1, d, d)
        F_n = body.particles.F
        if F_n.ndim == 1:
            F_n = F_n[:, None, None] ** (1 / d) * np.eye(d)
        D = differentials_of(body.name, (np.eye(d) + DT * L) @ F_n, F_n, projected)
        D = block_diag(DT**2 * body.particles.V0[:, None, None] * D)
        out = out + G.T @ D @ G
    return out.toarray()


def test_hessian_is_the_slope_of_the_gradient(at):
    """Remainder of first order, as h^2, without projection."""
    _, q = at
    g = q.potential.evaluate(q.dv)[1]
    slope = q.potential.tangent(q.dv, projected=False).product(q.w)
    beyond = [q.potential.evaluate(q.dv + h * q.w)[1] for h in H]
    remainder = [largest(g_h - g - h * slope) for g_h, h in zip(beyond, H)]
    assert rate(H, remainder) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("projected", [True, False])
def test_operator_and_matrix_equal_the_reference(at, projected):
    case, q = at
    expected = reference(q, case, projected)
    tangent = q.potential.tangent(q.dv, projected)
    assert largest(tangent.matrix().toarray() - expected) <= 1e-13 * largest(expected)
    Hw = (expected @ q.w.reshape(-1)).reshape(q.w.shape)
    assert largest(tangent.product(q.w) - Hw) <= 1e-13 * largest(Hw)


def test_matrix_is_a_symmetric_block_matrix(at):
    """To the bit; sorted, all diagonal blocks present, int32 indices."""
    case, q = at
    matrix = q.potential.tangent(q.dv).matrix()
    n = len(q.unknowns.m)
    assert isinstance(matrix, bsr_array)
    assert matrix.blocksize == (case.d, case.d)
    assert matrix.shape == (n * case.d, n * case.d)
    assert matrix.indices.dtype == matrix.indptr.dtype == np.int32
    row = np.repeat(np.arange(n), np.diff(matrix.indptr))
    assert (np.diff(row * n + matrix.indices) > 0).all()
    assert np.array_equal(row[row == matrix.indices], np.arange(n))
    dense = matrix.toarray()
    assert np.array_equal(dense, dense.T)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_projection_makes_it_positive(case):
    """At stretches where the exact one is not: H - M has no negative eigenvalue."""
    q = problem_of(case, spread=WIDE)
    lowest = []
    for projected in (False, True):
        H = q.potential.tangent(0 * q.dv, projected).matrix().toarray()
        inertia = np.repeat(q.unknowns.m, case.d)
        w = np.linalg.eigvalsh(H - np.diag(inertia))
        lowest.append(w[0] / w[-1])
    assert lowest[0] < -1e-3
    assert lowest[1] > -1e-14


def test_projection_changes_nothing_at_rest():
    q = problem_of(CASES[2], spread=0.0)
    q.bodies[0].particles.F[:] = np.eye(3)
    q = q._replace(potential=type(q.potential)(q.bodies, q.unknowns, q.potential.stencil, DT,
                                               q.gravity))
    rest = -q.unknowns.v
    exact, projected = (q.potential.tangent(rest, p).matrix() for p in (False, True))
    assert np.array_equal(exact.data, projected.data)


def test_a_translation_meets_the_mass_alone(at):
    """H t = M t: translations are the null space of the elastic part."""
    case, q = at
    t = np.broadcast_to(np.arange(1.0, 1.0 + case.d), q.dv.shape)
    tangent = q.potential.tangent(q.dv)
    Mt = q.unknowns.m[:, None] * t
    stiff = largest(tangent.matrix().data)
    assert largest(tangent.product(t) - Mt) <= 1e-13 * stiff
    assert largest(tangent.matrix() @ t.reshape(-1) - Mt.reshape(-1)) <= 1e-13 * stiff


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_bits_do_not_depend_on_the_number_of_threads(case):
    def evaluate():
        q = problem_of(case, length=LONG)
        tangent = q.potential.tangent(q.dv)
        return tangent.product(q.w).tobytes(), tangent.matrix().data.tobytes()

    one, two = by_threads(evaluate)
    assert one == two


def test_a_tangent_stays_when_the_potential_moves_on():
    q = problem_of(CASES[0])
    tangent = q.potential.tangent(q.dv)
    before = tangent.matrix(), tangent.product(q.w)
    q.potential.evaluate(2 * q.dv)
    assert np.array_equal(before[0].data, tangent.matrix().data)
    assert np.array_equal(before[1], tangent.product(q.w))


@pytest.mark.parametrize(("d", "degree"), [(2, 1), (2, 2), (3, 2), (2, 3)])
def test_pattern_links_nodes_within_reach(d, degree, rng):
    """Every pair of numbered nodes at most `degree` apart on each axis, and no other."""
    number = np.where(rng.random(d * (6,)) < 0.7, 0, -1).astype(np.int32)
    index = np.argwhere(number == 0)
    number[number == 0] = np.arange(len(index))
    pattern = pattern_of(number, degree)
    near = (np.abs(index[:, None] - index[None]) <= degree).all(axis=2)
    assert np.array_equal(np.diff(pattern.indptr), near.sum(axis=1))
    assert np.array_equal(pattern.indices, np.nonzero(near)[1])
    offset = np.stack(np.indices(d * (2 * degree + 1,)), axis=-1).reshape(-1, d) - degree
    row, o = np.nonzero(pattern.block >= 0)
    k = pattern.block[row, o]
    assert np.array_equal(index[pattern.indices[k]] - index[row], offset[o])
    assert np.array_equal(np.sort(k), np.arange(len(pattern.indices)))
