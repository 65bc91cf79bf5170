"""What a neural law reads: invariance, rest, and the gradient of it all, also where singular values
are repeated.
"""

import numba
import numpy as np
import pytest
from adjoints import rate

from mpm_ref.core.jit import set_threads
from mpm_ref.materials.learned.invariants import count, invariants, pull_back, rotations, spectrum

MOST = numba.config.NUMBA_NUM_THREADS
H = 1e-2 * 0.5 ** np.arange(5)

# Singular values, the first two of them in 2D. Where some are repeated single ones have kinks.
APART = {"generic": (1.3, 1.1, 0.8), "inverted": (1.3, 1.0, -0.6), "singular": (1.2, 0.9, 0.0),
         "nearly singular": (1.2, 0.9, 1e-9)}
REPEATED = {"I": (1.0, 1.0, 1.0), "1.01 I": (1.01, 1.01, 1.01), "lower two": (1.2, 0.9, 0.9),
            "upper two": (1.2, 1.2, 0.9), "round-off apart": (1.1 + 2e-16, 1.1, 0.7)}
SINGULAR_2D = {"inverted": (1.3, -0.6), "singular": (1.2, 0.0), "nearly singular": (1.2, 1e-9)}


def turns(n, d, rng):
    """n random proper rotations."""
    Q = np.linalg.qr(rng.normal(size=(n, d, d)))[0]
    Q[:, :, 0] *= np.linalg.det(Q)[:, None]
    return Q


def built(name, n, d, rng):
    """n matrices of the singular values of that name, turned at random on both sides."""
    s = {**APART, **REPEATED}[name][:d]
    s = SINGULAR_2D.get(name, s) if d == 2 else s
    return np.ascontiguousarray(turns(n, d, rng) * np.array(s) @ turns(n, d, rng))


def near_rest(n, d, rng):
    return np.eye(d) + 0.2 * rng.normal(size=(n, d, d))


def told(F):
    """a and R of F."""
    of = spectrum(F)
    return invariants(F, of), rotations(of)


def bars_of(F, a_bar, R_bar):
    return pull_back(F, spectrum(F), a_bar, R_bar)


def remainder_order(F, a_bar, rng):
    """Observed order of the remainder of <a_bar, a(F)> + <R_bar, R(F)>."""
    R_bar, dF = rng.normal(size=(2, *F.shape))

    def loss(h):
        a, R = told(F + h * dF)
        return float((a_bar * a).sum() + (R_bar * R).sum())

    return rate(loss, float((bars_of(F, a_bar, R_bar) * dF).sum()), H)


# Values.

def test_numbers_are_those_of_numpy(d, rng):
    """NCLAW-alg4, NCLAW-input-norm."""
    F = near_rest(9, d, rng)
    a, R = told(F)
    assert a.shape == (9, count(d))
    assert count(3) == 13
    U, s, Vt = np.linalg.svd(F)
    assert (np.linalg.det(F) > 0.0).all()
    stretch = (F.transpose(0, 2, 1) @ F - np.eye(d)).reshape(9, -1)
    expected = np.hstack([s - 1.0, stretch, np.linalg.det(F)[:, None] - 1.0])
    assert a == pytest.approx(expected, abs=1e-14)
    assert R == pytest.approx(U @ Vt, abs=1e-14)


def test_of_inverted_points_the_last_singular_value_is_negative(rng):
    a, R = told(built("inverted", 5, 3, rng))
    assert a[:, :3] + 1.0 == pytest.approx(np.tile(APART["inverted"], (5, 1)), abs=1e-14)
    assert np.linalg.det(R) == pytest.approx(1.0)


@pytest.mark.parametrize("name", [*APART, *REPEATED])
def test_rotations_leave_all_numbers_alone(d, name, rng):
    """NCLAW-eq22 to NCLAW-eq32."""
    F, Q = built(name, 7, d, rng), turns(7, d, rng)
    (a, R), (of_turned, turned) = told(F), told(Q @ F)
    assert of_turned == pytest.approx(a, abs=2e-14)
    assert turned == pytest.approx(Q @ R, abs=1e-14)


def test_they_read_a_direction_of_the_material(rng):
    """Rotations from the right do change F^T F (NCLAW-X6)."""
    F, Q = near_rest(7, 3, rng), turns(7, 3, rng)
    assert abs(told(F @ Q)[0] - told(F)[0])[:, 3:12].max() > 0.1
    assert told(F @ Q)[0][:, [0, 1, 2, 12]] == pytest.approx(told(F)[0][:, [0, 1, 2, 12]])


def test_at_rest_all_are_zero(d, rng):
    a, R = told(np.eye(d)[None])
    assert not a.any()
    assert np.array_equal(R[0], np.eye(d))
    Q = turns(7, d, rng)
    a, R = told(Q)
    assert abs(a).max() < 1e-14
    assert R == pytest.approx(Q, abs=1e-14)


def test_what_is_not_finite_stays_visible(d):
    F = np.tile(np.eye(d), (3, 1, 1))
    F[1, 0, 1] = np.nan
    a, R = told(F)
    assert np.isnan(a[1]).any()
    assert np.isnan(R[1]).all()
    assert not a[[0, 2]].any()


# Gradients.

@pytest.mark.parametrize("name", APART)
def test_remainder_is_of_second_order(d, name, rng):
    F = built(name, 20, d, rng)
    assert remainder_order(F, rng.normal(size=(20, count(d))), rng) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("name", REPEATED)
def test_remainder_is_of_second_order_where_singular_values_are_repeated(d, name, rng):
    """For losses that are symmetric in the singular values; others have a kink."""
    F, a_bar = built(name, 20, d, rng), rng.normal(size=(20, count(d)))
    a_bar[:, :d] = a_bar[:, :1]
    assert remainder_order(F, a_bar, rng) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("c", [1.0, 1.01, 1.0 + 1e-7])
def test_gradient_of_the_rotation_of_a_multiple_of_one(d, c, rng):
    """dL/dF = A/(s_i + s_j) with A = G - G^T, where s_i = c; for c Q, turned."""
    G, Q = rng.normal(size=(7, d, d)), turns(7, d, rng)
    none = np.zeros((7, count(d)))
    expected = (G - G.transpose(0, 2, 1)) / (2.0 * c)
    found = bars_of(np.tile(c * np.eye(d), (7, 1, 1)), none, G)
    assert found == pytest.approx(expected, rel=1e-14, abs=1e-14)
    assert bars_of(c * Q, none, Q @ G) == pytest.approx(Q @ expected, rel=1e-13, abs=1e-14)


def test_gradient_is_zero_where_there_is_no_rotation(d, rng):
    G, none = rng.normal(size=(2, d, d)), np.zeros((2, count(d)))
    line = np.zeros((d, d))
    line[0, 0] = 2.0
    at_a_point, on_a_line = bars_of(np.stack([np.zeros((d, d)), line]), none, G)
    assert not at_a_point.any()
    assert not on_a_line[1:, 1:].any()
    assert on_a_line[0, 1] == pytest.approx((G[1, 0, 1] - G[1, 1, 0]) / 2.0)


def test_gradients_are_those_of_torch(d, rng):
    torch = pytest.importorskip("torch")
    F = near_rest(9, d, rng)
    a_bar, R_bar = rng.normal(size=(9, count(d))), rng.normal(size=(9, d, d))
    leaf = torch.tensor(F, requires_grad=True)
    U, s, Vt = torch.linalg.svd(leaf)
    stretch = (leaf.mT @ leaf - torch.eye(d)).flatten(1)
    a = torch.cat([s - 1.0, stretch, torch.det(leaf)[:, None] - 1.0], dim=1)
    loss = (a * torch.from_numpy(a_bar)).sum() + ((U @ Vt) * torch.from_numpy(R_bar)).sum()
    loss.backward()
    assert bars_of(F, a_bar, R_bar) == pytest.approx(leaf.grad.numpy(), rel=1e-10, abs=1e-11)


@pytest.mark.skipif(MOST < 2, reason="one core")
def test_two_threads_give_the_same_bits(rng):
    F, R_bar = near_rest(500, 3, rng), rng.normal(size=(500, 3, 3))
    a_bar, found = rng.normal(size=(500, 13)), []
    for threads in (1, 2):
        set_threads(threads)
        found.append((*told(F), bars_of(F, a_bar, R_bar)))
    assert all(map(np.array_equal, *found))
