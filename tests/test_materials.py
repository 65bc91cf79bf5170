"""Elastic laws, over the table of laws and d = 2, 3."""

import re

import numpy as np
import pytest
from constitutive import (
    LAW,
    deviator,
    diagonal,
    evaluate,
    lame_of,
    rate,
    rotations,
    states,
    transpose,
)

from mpm_ref.core.law import dpk1, pressure, psi_volume
from mpm_ref.materials import (
    LAWS,
    FixedCorotated,
    Fluid,
    bulk_modulus,
    lame,
    make_law,
    principal,
    recovers,
    stiffness,
)

STEPS = np.geomspace(1e-2, 1e-4, 5)
EPS = 1e-13     # round-off of some dozen operations


@pytest.fixture(params=LAWS)
def law(request):
    return LAW[request.param]


def close(a, b, scale=10.0):
    """Equal to round-off; E = 10 sets the scale of the stresses."""
    return np.abs(np.asarray(a) - b).max() <= EPS * scale


def directions(d):
    """The d^2 unit matrices, (d^2, d, d)."""
    return np.eye(d * d).reshape(-1, d, d)


def matrix(law, F, name="differential"):
    """The differential as a (d^2, d^2) matrix, for each F of (N, d, d)."""
    d = F.shape[-1]
    columns = getattr(evaluate(law, F[:, None].repeat(d * d, axis=1), directions(d)), name)
    return columns.reshape(len(F), d * d, d * d)


def test_every_law_of_the_table_is_tested():
    assert set(LAW) == set(LAWS)


def test_no_stress_at_rest(law, d, rng):
    R = np.concatenate([np.eye(d)[None], rotations(rng, 10, d)])
    at = evaluate(law, R)
    assert close(at.psi, 0.0)
    assert close(at.P, 0.0)
    assert close(at.tau, 0.0)
    # exactly: a body at rest must stay there to the last bit
    assert not at.tau[0].any()


# Derivatives, by Taylor tests: the remainder of a first-order expansion must fall as h^2.

def remainders(law, F, dF):
    """Remainders of psi and P for each h of STEPS, largest over the states."""
    at = evaluate(law, F, dF)
    beyond = evaluate(law, F[:, None] + STEPS[:, None, None] * dF[:, None])
    slope = (at.P * dF).sum(axis=(1, 2))
    of_psi = np.abs(beyond.psi - at.psi[:, None] - STEPS * slope[:, None])
    of_P = beyond.P - at.P[:, None] - STEPS[:, None, None] * at.differential[:, None]
    return of_psi.max(axis=0), np.abs(of_P).max(axis=(0, 2, 3))


def test_stress_and_differential_are_derivatives(law, d, rng):
    F, dF = states(rng, 20, d), rng.standard_normal((20, d, d))
    for error in remainders(law, F, dF):
        assert 1.95 < rate(STEPS, error) < 2.05


REPEATED = {"rest": (1, 1, 1), "scaled": (1.01, 1.01, 1.01), "two": (1.7, 1.7, 0.6),
            "two smaller": (1.7, 0.6, 0.6), "nearly": (1.2, 1.2 - 1e-9, 1.2 - 2e-9)}


@pytest.mark.parametrize("s", REPEATED.values(), ids=REPEATED)
def test_differential_at_repeated_singular_values(law, d, rng, s):
    F = rotations(rng, 4, d) @ diagonal(s[:d]) @ rotations(rng, 4, d)
    for error in remainders(law, F, rng.standard_normal((4, d, d))):
        assert 1.9 < rate(STEPS, error) < 2.1


def test_differential_is_smooth_where_singular_values_meet(law, d, rng):
    gaps = np.array([0.0, 1e-4, 1e-15, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5])
    s = np.ones((len(gaps), d)) * 1.3
    s[:, 0] += gaps
    Q, dF = rotations(rng, 2, d), rng.standard_normal((d, d))
    change = evaluate(law, Q[0] @ diagonal(s) @ Q[1], dF).differential
    change = np.abs(change - change[0]).max(axis=(1, 2))
    slope = change[1] / gaps[1]
    assert (np.abs(change - slope * gaps) < 1e-3 * slope * gaps + 100 * EPS).all()


# Algebra.

def test_kirchhoff_is_pk1_times_transposed_deformation(law, d, rng):
    F = states(rng, 50, d)
    at = evaluate(law, F)
    assert close(at.tau, at.P @ transpose(F), 100)
    assert close(at.tau, transpose(at.tau), 100)


def test_principal_values_give_the_same_stress(law, d, rng):
    at = evaluate(law, states(rng, 50, d))
    assert close(at.P, at.P_of_s, 100)
    assert close(at.tau, at.tau_of_s, 100)


def test_objectivity(law, d, rng):
    F, Q, dF = states(rng, 30, d), rotations(rng, 30, d), rng.standard_normal((30, d, d))
    at, turned = evaluate(law, F, dF), evaluate(law, Q @ F, Q @ dF)
    assert close(turned.psi, at.psi, 100)
    assert close(turned.P, Q @ at.P, 100)
    assert close(turned.tau, Q @ at.tau @ transpose(Q), 100)
    assert close(turned.differential, Q @ at.differential, 1000)
    assert close(turned.projected, Q @ at.projected, 1000)


def test_isotropy(law, d, rng):
    F, Q, dF = states(rng, 30, d), rotations(rng, 30, d), rng.standard_normal((30, d, d))
    at, turned = evaluate(law, F, dF), evaluate(law, F @ Q, dF @ Q)
    assert close(turned.psi, at.psi, 100)
    assert close(turned.P, at.P @ Q, 100)
    assert close(turned.tau, at.tau, 100)
    assert close(turned.differential, at.differential @ Q, 1000)


def test_differential_is_symmetric(law, d, rng):
    H = matrix(law, states(rng, 20, d))
    assert close(H, transpose(H), 1000)


def test_projected_differential_has_no_negative_eigenvalue(law, d, rng):
    F = states(rng, 60, d, spread=0.6)
    exact, spd = matrix(law, F), matrix(law, F, "projected")
    w, Q = np.linalg.eigh(0.5 * (exact + transpose(exact)))
    size = np.abs(w).max(axis=1)[:, None, None]
    assert (w < -1e-3).any(), "no state of this test needs the projection"
    # the eigenvalues of the blocks are those of the whole: negative ones to zero, nothing else
    clamped = Q * np.maximum(w, 0.0)[:, None] @ transpose(Q)
    assert np.abs((spd - clamped) / size).max() < 1e-12
    assert (np.linalg.eigvalsh(0.5 * (spd + transpose(spd))) / size[:, 0] > -1e-14).all()


def test_projected_differential_is_exact_where_nothing_is_clamped(law, d, rng):
    if isinstance(law, Fluid):
        pytest.skip("in every state with J != 1 one eigenvalue of a fluid is negative")
    F, dF = states(rng, 30, d, spread=0.03), rng.standard_normal((30, d, d))
    convex = np.linalg.eigvalsh(matrix(law, F)).min(axis=1) > 0.0
    at = evaluate(law, F, dF)
    assert convex.sum() > 5
    # to the bit for laws whose differential is that of `principal`, else to round-off
    assert close(at.differential[convex], at.projected[convex], 100)


@pytest.mark.parametrize("name", ["neo_hookean", "log_neo_hookean"])
def test_differential_without_decomposition_is_that_of_principal_values(name, d, rng):
    law = LAW[name]
    F, dF = states(rng, 3, d), rng.standard_normal((3, d, d))
    for G, dG in zip(*(tuple(tuple(map(tuple, A)) for A in B.tolist()) for B in (F, dF))):
        assert close(dpk1(G, dG, law), np.array(principal.dpk1(G, dG, law)), 100)


# What the laws are at small strains, and to each other.

def test_small_strain_limit_is_hooke(law, d, rng):
    G = rng.standard_normal((d, d))
    e = 0.5 * (G + G.T)
    mu, lam = lame_of(law)
    if d == 2 and hasattr(law, "kappa"):
        lam = law.kappa - law.mu            # the plane form is a model of its own (X-cross-15)
    hooke = 2.0 * mu * e + lam * np.trace(e) * np.eye(d)
    at = evaluate(law, np.eye(d) + STEPS[:, None, None] * G)
    error = np.abs(at.tau - STEPS[:, None, None] * hooke).max(axis=(1, 2))
    assert 1.9 < rate(STEPS, error) < 2.1


@pytest.mark.parametrize("name", ["fixed_corotated", "hencky", "log_neo_hookean", "fluid"])
def test_2d_is_plane_strain(name, rng):
    F = states(rng, 20, 2)
    in_space = np.tile(np.eye(3), (20, 1, 1))
    in_space[:, :2, :2] = F
    flat, full = evaluate(LAW[name], F), evaluate(LAW[name], in_space)
    assert close(flat.psi, full.psi, 100)
    assert close(flat.tau, full.tau[:, :2, :2], 100)


def test_neo_hookean_separates_shear_from_volume(d, rng):
    law = LAW["neo_hookean"]
    F = states(rng, 20, d)
    J = np.linalg.det(F)[:, None, None]
    at, isochoric = evaluate(law, F), evaluate(law, F * J ** (-1.0 / d))
    mean = np.trace(at.tau, axis1=1, axis2=2) / d
    assert close(mean, 0.5 * law.kappa * (J[:, 0, 0] ** 2 - 1.0), 100)
    dev = at.tau - mean[:, None, None] * np.eye(d)
    assert close(dev, isochoric.tau, 100)


def test_fluid_is_fixed_corotated_without_shear(d, rng):
    F, dF = states(rng, 20, d), rng.standard_normal((20, d, d))
    fluid = LAW["fluid"]
    corotated = evaluate(FixedCorotated(0.0, fluid.lam), F, dF)
    for one, other in zip(corotated, evaluate(fluid, F, dF), strict=True):
        assert close(one, other, 100)


def test_fluid_needs_only_the_volume_ratio(d, rng):
    """NCLAW-eq20."""
    fluid, F = LAW["fluid"], states(rng, 5, d)
    at = evaluate(fluid, F)
    for J, psi, tau in zip(np.linalg.det(F), at.psi, at.tau):
        assert close(psi_volume(J, fluid), psi)
        assert close(pressure(J, fluid), tau[0, 0])


# Inversion, singular and non-finite states.

def inverted(rng, n, d):
    """F with det F < 0 and singular values apart from 0."""
    s = np.exp(0.3 * rng.standard_normal((n, d)))
    s[:, -1] *= -0.5
    return rotations(rng, n, d) * s[:, None, :] @ rotations(rng, n, d)


@pytest.mark.parametrize("name", ["fixed_corotated", "fluid"])
def test_derivatives_of_inverted_states(name, d, rng):
    F = inverted(rng, 10, d)
    small = STEPS < 2e-3            # the larger steps reach s_i + s_j = 0, where psi has a kink
    for error in remainders(LAW[name], F, 0.1 * rng.standard_normal((10, d, d))):
        assert 1.9 < rate(STEPS[small], error[small]) < 2.1


def test_fixed_corotated_recovers_from_inversion(d, rng):
    law = LAW["fixed_corotated"]
    F = inverted(rng, 10, d)
    for _ in range(400):                        # steepest descent of psi
        F = F - 0.02 * evaluate(law, F).P
    assert (np.linalg.det(F) > 0.0).all()
    assert evaluate(law, F).psi.max() < 1e-6


@pytest.mark.parametrize("s", [(1, 0), (0, 0), (1, -1), (1, 1, 0), (1, 0, 0), (0, 0, 0),
                               (1, 1, -1), (2, 0.5, -0.5)], ids=str)
def test_fixed_corotated_is_finite_where_the_rotation_is_not_unique(s, rng):
    d = len(s)
    Q = rotations(rng, 2, d)
    at = evaluate(LAW["fixed_corotated"], (Q[0] * s @ Q[1])[None], np.ones((1, d, d)))
    for values in at:
        assert np.isfinite(values).all()
    assert np.abs(at.projected).max() < 100.0


@pytest.mark.parametrize("name", ["hencky", "neo_hookean", "log_neo_hookean"])
@pytest.mark.parametrize("last", [0.0, -0.5, -1.0])
def test_laws_without_inversion_say_so(name, d, last):
    s = np.ones(d)
    s[-1] = last
    at = evaluate(LAW[name], diagonal(s)[None], np.ones((1, d, d)))
    assert np.isposinf(at.psi).all()
    for values in at[1:]:
        assert np.isnan(values).all()


@pytest.mark.filterwarnings("ignore:invalid value")     # of NumPy scalars, where JIT is off
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_state_that_is_not_finite_is_not_hidden(law, d, bad):
    F = np.eye(d)[None].copy()
    F[0, 0, 1] = bad
    at = evaluate(law, F)
    assert not np.isfinite(at.psi).any()
    assert not np.isfinite(at.tau).all()


# Waves.

def test_wave_modulus_at_rest(law, d):
    mu, lam = lame_of(law)
    assert close(stiffness(law), lam + 2.0 * mu)
    plane_form = d == 2 and hasattr(law, "kappa")
    expected = law.kappa + law.mu if plane_form else stiffness(law)
    assert close(evaluate(law, np.eye(d)[None]).W, expected)


def waves(law, F, rng):
    """rho_0 c^2 of 100 waves in each F (N, 100), the first d along the principal axes; and W."""
    n, d = len(F), F.shape[-1]
    u, k = (x / np.linalg.norm(x, axis=-1, keepdims=True)
            for x in rng.standard_normal((2, n, 100, d)))
    u[:, :d] = k[:, :d] = transpose(np.linalg.svd(F)[0])
    dF = u[..., None] * np.einsum("pkj,pjJ->pkJ", k, F)[..., None, :]
    at = evaluate(law, F[:, None].repeat(100, axis=1), dF)
    return (dF * at.differential).sum(axis=(2, 3)), at.W[:, 0]


def test_wave_modulus_bounds_every_wave(law, d, rng):
    every, W = waves(law, states(rng, 20, d), rng)
    fastest = every.max(axis=1)
    assert (fastest <= W + EPS * 100).all()
    # little is given away: measured at most 7 % in W, in 600 random waves per state
    assert (W <= 1.2 * fastest).all()


def test_waves_along_the_axes_are_not_all(d, rng):
    every, _ = waves(LAW["hencky"], states(rng, 20, d, spread=0.6), rng)
    assert (every.max(axis=1) > 2.0 * every[:, :d].max(axis=1)).any()


def test_wave_modulus_of_a_fluid(d, rng):
    F = states(rng, 20, d)
    assert close(evaluate(LAW["fluid"], F).W, LAW["fluid"].lam * np.linalg.det(F) ** 2, 100)


# Prints that are wrong, shown to be so.

def principal_frames(F):
    """U, s, V of numpy; signs do not matter here."""
    U, s, Vt = np.linalg.svd(F)
    return U, s, transpose(Vt)


def test_hencky_as_printed_by_nsf_is_not_a_stress(d, rng):
    """NSF-eq13 ends in V^T; with U^T it is symmetric and equal to P F^T."""
    law, F = LAW["hencky"], states(rng, 20, d)
    U, s, V = principal_frames(F)
    eps = np.log(s)
    tau_hat = 2.0 * law.mu * eps + law.lam * eps.sum(axis=1, keepdims=True)
    printed = U @ diagonal(tau_hat) @ transpose(V)
    right = U @ diagonal(tau_hat) @ transpose(U)
    assert close(evaluate(law, F).tau, right, 100)
    assert np.abs(printed - transpose(printed)).max() > 1.0
    assert np.abs(printed - right).max() > 1.0


def test_hencky_as_printed_by_nclaw_is_kirchhoff(d, rng):
    """NCLAW-eq14 and eq17 call the Kirchhoff stress P (NCLAW-X1)."""
    law, F = LAW["hencky"], states(rng, 20, d)
    at = evaluate(law, F)
    h, dF = 1e-6, rng.standard_normal(F.shape)
    slope = (evaluate(law, F + h * dF).psi - evaluate(law, F - h * dF).psi) / (2.0 * h)
    assert np.abs(slope - (at.P * dF).sum(axis=(1, 2))).max() < 1e-6
    assert np.abs(slope - (at.tau * dF).sum(axis=(1, 2))).max() > 1.0


def test_fixed_corotated_stress_needs_the_identity(d, rng):
    """NSF-eq12 lacks the I; with it tau is P F^T of NCLAW-eq12 (NSF-F1, LDM-sec5-material)."""
    law, F = LAW["fixed_corotated"], states(rng, 20, d)
    U, _, V = principal_frames(F)
    J = np.linalg.det(F)[:, None, None]
    shear = 2.0 * law.mu * (F - U @ transpose(V)) @ transpose(F)
    tau = evaluate(law, F).tau
    assert close(tau, shear + law.lam * (J - 1.0) * J * np.eye(d), 100)
    assert np.abs(deviator(np.linalg.eigvalsh(tau - shear))).max() < 1e-12


# Parameters.

def test_moduli():
    """NSF-F0."""
    mu, lam = lame(2.6, 0.3)
    assert close(mu, 1.0)
    assert close(lam, 1.5)
    assert close(bulk_modulus(2.6, 0.3), lam + 2.0 / 3.0 * mu)
    assert close(bulk_modulus(2.6, 0.3), 2.6 / (3 * (1 - 0.6)))
    assert make_law("fluid", lam=3) == Fluid(3.0)
    assert make_law("fluid", E=1e5, nu=0.3).lam == lame(1e5, 0.3)[1]


@pytest.mark.parametrize(("name", "parameters", "said"), [
    ("elastic", {}, "law 'elastic': expected one of fixed_corotated, hencky, neo_hookean"),
    ("hencky", {"E": 1}, "law 'hencky': missing parameter nu"),
    ("hencky", {"E": 1, "nu": 0.2, "rho": 3}, "unknown parameter rho; its parameters are: E, nu"),
    ("hencky", {"E": 0, "nu": 0.2}, "E = 0: expected a finite number > 0"),
    ("neo_hookean", {"E": -1, "nu": 0.2}, "E = -1"),
    ("fixed_corotated", {"E": np.nan, "nu": 0.2}, "E = nan"),
    ("fixed_corotated", {"E": np.inf, "nu": 0.2}, "E = inf"),
    ("fixed_corotated", {"E": 1, "nu": 0.5}, "nu = 0.5: expected -1 < nu < 0.5; take 0.49"),
    ("fixed_corotated", {"E": 1, "nu": -1}, "nu = -1"),
    ("fixed_corotated", {"E": 1, "nu": np.nan}, "nu = nan"),
    ("fluid", {}, "expected the bulk modulus lam, or both E and nu"),
    ("fluid", {"lam": 1, "E": 1, "nu": 0.2}, "expected the bulk modulus lam, or both E and nu"),
    ("fluid", {"E": 1}, "expected the bulk modulus lam, or both E and nu"),
    ("fluid", {"E": 1, "nu": 0}, "lam = 0.0: expected a finite number > 0"),
])
def test_bad_parameters_are_refused_in_a_sentence(name, parameters, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        make_law(name, **parameters)


def test_only_fixed_corotated_recovers():
    assert [name for name, law in LAW.items() if recovers(law)] == ["fixed_corotated"]
