import numpy as np
import pytest
from constitutive import rotations

from mpm_ref.core import logarithm
from mpm_ref.core.jit import kernel
from mpm_ref.core.logarithm import LEAST_STRETCH, RADIUS, SMALL, exponential, hencky_strain
from mpm_ref.core.spectral import svd
from mpm_ref.core.tensor import mat, mmt, put_mat, scale_columns
from mpm_ref.materials.log_strain import log_strain
from mpm_ref.plain import tensors

ROUND_OFF = 4e-16       # of strains below 1/2; seen: 3.4e-16, of singular values 6.2e-16


@kernel
def fill_strains(F_all, like, eps, moderate):
    for p in range(len(F_all)):
        strain, ok = hencky_strain(mat(F_all, p, like))
        put_mat(eps, p, strain)
        moderate[p] = ok


@kernel
def fill_spectral(F_all, like, eps):
    for p in range(len(F_all)):
        U, s, _, _ = svd(mat(F_all, p, like))
        put_mat(eps, p, mmt(scale_columns(U, log_strain(s)), U))


@kernel
def fill_exponentials(N_all, size, like, out):
    for p in range(len(N_all)):
        put_mat(out, p, exponential(mat(N_all, p, like), size[p]))


def strains(F):
    """eps (N, d, d) of `hencky_strain`, and whether it is one (N,)."""
    F = np.ascontiguousarray(F)
    eps, moderate = np.empty_like(F), np.empty(len(F), dtype=bool)
    fill_strains(F, axes(F), eps, moderate)
    return eps, moderate


def spectral_strains(F):
    """eps (N, d, d) from singular values."""
    eps = np.empty_like(F)
    fill_spectral(np.ascontiguousarray(F), axes(F), eps)
    return eps


def exact_strains(F):
    """eps (N, d, d) in extended precision."""
    U, s, _ = tensors.svd(F.astype(np.longdouble))
    return tensors.compose(U, np.log(s), U)


def axes(F):
    return tuple(range(F.shape[-1]))


def transpose(A):
    return np.swapaxes(A, -1, -2)


def directions(rng, n, d):
    """Principal strains of size 1 (n, d): at random, the same in all axes, and along one axis."""
    eps = rng.standard_normal((n, d))
    eps[0], eps[1], eps[2:4] = 1.0, -1.0, 0.0
    eps[2, 0], eps[3, 0] = 1.0, -1.0
    return eps / np.linalg.norm(eps, axis=1, keepdims=True)


def gradients(rng, size, d, n=60):
    """F (n, d, d) with |eps| = size and random axes."""
    s = np.exp(size * directions(rng, n, d))
    return rotations(rng, n, d) * s[:, None, :] @ rotations(rng, n, d)


@pytest.mark.parametrize("rule", [logarithm.FEW, logarithm.MANY])
def test_rules_are_those_of_gauss_and_legendre(rule):
    """n nodes integrate all powers below 2 n, which no other rule does."""
    t, w = np.array(rule, dtype=np.longdouble)
    k = np.arange(2 * len(t))
    assert np.abs((w * t ** k[:, None]).sum(axis=1) - 1 / (k + np.longdouble(1))).max() < 1e-16


SIZES = [1e-12, 1e-6, 1e-3, 0.01, 0.0247, 0.0253, 0.03, 0.1, 0.2, 0.3, 0.4, RADIUS * (1 - 1e-9)]


@pytest.mark.parametrize("size", SIZES)
def test_strain_is_exact_to_round_off(size, d, rng):
    F = gradients(rng, size, d)
    eps, moderate = strains(F)
    assert moderate.all()
    assert np.abs(eps - exact_strains(F)).max() < ROUND_OFF
    assert (eps == transpose(eps)).all()


def test_both_rules_are_used(d, rng):
    A = [np.linalg.norm(F @ transpose(F) - np.eye(d), axis=(1, 2))
         for F in (gradients(rng, size, d) for size in SIZES)]
    assert (A[4] < SMALL).any()
    assert (A[5] > SMALL).any()


@pytest.mark.parametrize("size", [1e-3, 0.1, 0.4])
def test_strain_is_that_of_singular_values(size, d, rng):
    F = gradients(rng, size, d)
    assert np.abs(strains(F)[0] - spectral_strains(F)).max() < 2e-15


def test_strain_of_a_tiny_deformation_has_all_digits(d, rng):
    """Where F = I + D, the absolute error of singular values would be 1e-4 of the strain."""
    D = 2.0**-40 * rng.integers(-8, 9, (50, d, d))
    eps, linear = strains(np.eye(d) + D)[0], (D + transpose(D)) / 2
    second = D @ transpose(D) / 2 - linear @ linear
    assert np.abs(eps - linear - second).max() < 1e-15 * np.abs(D).max()
    assert np.abs(second).max() > 1e-12 * np.abs(D).max()


def test_radius_is_kept_on_both_sides(d, rng):
    assert strains(gradients(rng, RADIUS * (1 - 1e-12), d))[1].all()
    assert not strains(gradients(rng, RADIUS * (1 + 1e-12), d))[1].any()
    for size in (0.5, 0.7, 1.0, 2.0, 5.0, 20.0, 40.0, 100.0, 300.0):
        assert not strains(gradients(rng, size, d))[1].any()


def test_least_stretch_is_a_bound():
    assert np.exp(-RADIUS) - 1e-3 < LEAST_STRETCH < np.exp(-RADIUS)


@pytest.mark.parametrize("scale", [0.0, 1e-300, 1e-150, 1e-30, 1e30, 1e80, 1e150, 1e300])
def test_extreme_sizes_are_refused(scale, d, rng):
    F = gradients(rng, 0.1, d)
    assert not strains(scale * F)[1].any()
    F[:, 0] *= scale
    assert not strains(F)[1].any()


def test_what_has_no_strain_is_refused(d, rng):
    F = gradients(rng, 0.1, d)
    for bad in (np.nan, np.inf, -np.inf):
        for i in range(d * d):
            G = F.copy()
            G.reshape(-1, d * d)[:, i] = bad
            assert not strains(G)[1].any()
    F[:, 0] *= -1.0
    assert not strains(F)[1].any()
    assert not strains(np.diag([-1.0, *[1.0] * (d - 1)])[None])[1].any()


@pytest.mark.parametrize("size", [1e-3, 0.02, 0.2, 0.44])
def test_strain_is_objective_and_isotropic(size, d, rng):
    """Q is orthogonal to a few units of round-off, which depend on LAPACK and enter twice."""
    F = gradients(rng, size, d)
    eps, Q = strains(F)[0], rotations(rng, len(F), d)
    assert np.abs(strains(Q @ F)[0] - Q @ eps @ transpose(Q)).max() < 5e-15
    assert np.abs(strains(F @ Q)[0] - eps).max() < 5e-15


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, SMALL * (1 - 1e-9), SMALL, 0.2, RADIUS])
def test_exponential(size, d, rng):
    N = directions(rng, 60, d)[2:]
    N -= N.mean(axis=1, keepdims=True)
    N *= size / np.linalg.norm(N, axis=1, keepdims=True)
    Q = rotations(rng, len(N), d)
    A = Q * N[:, None, :] @ transpose(Q)
    A = (A + transpose(A)) / 2
    out = np.empty_like(A)
    fill_exponentials(A, np.full(len(A), size), axes(A), out)
    exact, power = np.zeros(A.shape, np.longdouble), np.eye(d, dtype=np.longdouble) + 0 * A
    for k in range(1, 30):
        exact, power = exact + power, power @ A.astype(np.longdouble) / k
    assert np.abs(out - exact).max() < 6e-16        # seen: 3e-16
    assert (out == transpose(out)).all()
