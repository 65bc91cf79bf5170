"""One element under homogeneous deformation: uniaxial, shear, isochoric, rotation, plastic.

Elastic stresses against closed forms; plastic paths by the pass over particles that a run uses.
"""

from math import asinh, log, pi, sqrt

import numpy as np
import pytest
from constitutive import LAW, evaluate, rotations

from mpm_ref.body import particles_at
from mpm_ref.core import deform
from mpm_ref.materials import NoFlow, make_flow

EPS = 1e-12     # round-off of E = 10 times some dozen operations
FC, HENCKY, NEO = LAW["fixed_corotated"], LAW["hencky"], LAW["neo_hookean"]
LOG_NEO, FLUID = LAW["log_neo_hookean"], LAW["fluid"]


def tau(law, F):
    return evaluate(law, np.asarray(F, dtype=float)[None]).tau[0]


# Elastic paths.

@pytest.mark.parametrize("a", [0.3, 0.8, 1.0, 1.5, 3.0])
def test_uniaxial_strain(a, d):
    F = np.eye(d)
    F[0, 0] = a
    fixed, hencky, fluid = tau(FC, F), tau(HENCKY, F), tau(FLUID, F)
    assert abs(fixed[0, 0] - (2 * FC.mu + FC.lam) * a * (a - 1)) < EPS
    assert abs(fixed[1, 1] - FC.lam * a * (a - 1)) < EPS
    assert abs(hencky[0, 0] - (2 * HENCKY.mu + HENCKY.lam) * log(a)) < EPS
    assert abs(hencky[1, 1] - HENCKY.lam * log(a)) < EPS
    assert np.abs(fluid - FLUID.lam * a * (a - 1) * np.eye(d)).max() < EPS
    stretched = NEO.mu * a ** (-2 / d) * (a**2 - 1)
    volume = NEO.kappa / 2 * (a**2 - 1)
    neo = tau(NEO, F)
    assert abs(neo[0, 0] - volume - stretched * (1 - 1 / d)) < EPS
    assert abs(neo[1, 1] - volume + stretched / d) < EPS
    log_neo = tau(LOG_NEO, F)
    assert abs(log_neo[0, 0] - LOG_NEO.mu * (a**2 - 1) - LOG_NEO.lam * log(a)) < EPS
    assert abs(log_neo[1, 1] - LOG_NEO.lam * log(a)) < EPS


@pytest.mark.parametrize("gamma", [-2.0, 1e-6, 0.1, 1.0, 10.0])
def test_simple_shear(gamma, d):
    """tau_12 and the normal stress difference; the rotation turns with half the angle of shear."""
    F = np.eye(d)
    F[0, 1] = gamma
    root = sqrt(4 + gamma**2)
    # fixed corotated: tau = 2 mu (b - sqrt(b)), and sqrt(b) = (b + I)/sqrt(tr b + 2) in the plane
    fixed = tau(FC, F)
    assert abs(fixed[0, 1] - 2 * FC.mu * gamma * (1 - 1 / root)) < EPS
    assert abs(fixed[0, 0] - fixed[1, 1] - 2 * FC.mu * gamma**2 * (1 - 1 / root)) < 10 * EPS
    # Hencky: principal strains +-asinh(gamma/2), axes at the angle theta with tan 2 theta = 2/gamma
    hencky, strain = tau(HENCKY, F), asinh(gamma / 2)
    assert abs(hencky[0, 1] - 4 * HENCKY.mu * strain / root) < EPS
    assert abs(hencky[0, 0] - hencky[1, 1] - 4 * HENCKY.mu * strain * gamma / root) < EPS
    assert abs(np.trace(hencky)) < EPS
    for law in (NEO, LOG_NEO):      # linear in shear, quadratic in normal stress
        neo = tau(law, F)
        assert abs(neo[0, 1] - law.mu * gamma) < EPS
        assert abs(neo[0, 0] - neo[1, 1] - law.mu * gamma**2) < 10 * EPS
    assert np.abs(tau(FLUID, F)).max() < EPS


@pytest.mark.parametrize("a", [0.5, 1.1, 2.0])
def test_isochoric_stretch(a, d):
    s = np.array([a, 1 / a, 1.0][:d])
    F = np.diag(s)
    assert np.abs(tau(FC, F) - 2 * FC.mu * np.diag(s * (s - 1))).max() < EPS
    assert np.abs(tau(HENCKY, F) - 2 * HENCKY.mu * np.diag(np.log(s))).max() < EPS
    assert np.abs(tau(NEO, F) - NEO.mu * np.diag(s**2 - (s**2).mean())).max() < EPS
    assert np.abs(tau(FLUID, F)).max() < EPS


@pytest.mark.parametrize("a", [0.5, 1.2, 2.0])
def test_hydrostatic(a, d):
    J, F = a**d, a * np.eye(d)
    for law, expected in (
        (FC, 2 * FC.mu * a * (a - 1) + FC.lam * J * (J - 1)),
        (HENCKY, (2 * HENCKY.mu + d * HENCKY.lam) * log(a)),
        (NEO, NEO.kappa / 2 * (J**2 - 1)),
        (LOG_NEO, LOG_NEO.mu * (a**2 - 1) + LOG_NEO.lam * log(J)),
        (FLUID, FLUID.lam * J * (J - 1)),
    ):
        assert np.abs(tau(law, F) - expected * np.eye(d)).max() < 100 * EPS * max(J, 1.0)


@pytest.mark.parametrize("law", LAW.values(), ids=LAW)
def test_rotation_turns_the_stress_with_the_body(law, d):
    """Half a turn in 36 steps of a stretched element."""
    s = np.array([1.3, 0.8, 1.1][:d])
    rest = tau(law, np.diag(s))
    for angle in np.linspace(0.0, pi, 37):
        Q = np.eye(d)
        Q[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        assert np.abs(tau(law, Q @ np.diag(s)) - Q @ rest @ Q.T).max() < EPS


# Plastic paths in 3D. An element is driven by its velocity gradient; the frame Q is arbitrary.

class Element:
    """One particle of a material, deformed in a turned frame."""

    def __init__(self, law, flow, rng, y=None):
        x = np.zeros((1, 3))
        q = particles_at(x, x, np.ones(1), np.ones(1))
        self.q = q if y is None else q._replace(y=np.array([y]))
        self.law, self.flow = law, flow
        self.Q = rotations(rng, 1, 3)[0]

    def step(self, growth):
        """F <- growth F, projected, with its stress; growth (3, 3) in the element's own frame."""
        self.q.L[0] = self.Q @ (growth - np.eye(3)) @ self.Q.T
        deform.plastic(self.q, self.law, self.flow, 1.0, (0, 0, 0))

    @property
    def tau(self):
        return self.Q.T @ self.q.tau[0] @ self.Q

    @property
    def volume(self):
        return np.linalg.det(self.q.F[0])


def deviatoric(A):
    """|dev A| in the Frobenius norm."""
    return np.linalg.norm(A - np.trace(A) / 3 * np.eye(3))


AXES = np.array([1.0, -0.5, -0.5]) / sqrt(1.5)      # isochoric stretch of unit size


def stretch(de):
    return np.diag(np.exp(de * AXES))


def test_perfect_plasticity_in_isochoric_stretch(rng):
    element = Element(HENCKY, make_flow("von_mises", HENCKY, 3, tau_y=0.4), rng)
    for k in range(1, 41):
        element.step(stretch(0.005))
        expected = min(2 * HENCKY.mu * 0.005 * k, 0.4) * AXES
        assert np.abs(element.tau - np.diag(expected)).max() < EPS
    assert abs(element.volume - 1.0) < EPS


def test_perfect_plasticity_forgets_and_unloads_elastically(rng):
    """Stretch into yield, back through the elastic range of width 2 tau_y, into yield again."""
    element = Element(HENCKY, make_flow("von_mises", HENCKY, 3, tau_y=0.4), rng)
    element.step(stretch(0.3))
    width = 2 * 0.4 / (2 * HENCKY.mu)
    element.step(stretch(-0.5 * width))
    assert np.abs(element.tau).max() < EPS
    element.step(stretch(-width))
    assert np.abs(element.tau + np.diag(0.4 * AXES)).max() < EPS


@pytest.mark.parametrize("xi", [0.0, 0.2, 0.5])
def test_hardening_slope(xi, rng):
    """2 mu xi / (1 + xi): the yield stress lags a step (NSF-F4), its slope does not."""
    flow = make_flow("von_mises_hardening", HENCKY, 3, tau_y=0.4, xi=xi)
    element = Element(HENCKY, flow, rng, y=0.4)
    sizes = []
    for _ in range(120):
        element.step(stretch(0.005))
        sizes.append(deviatoric(element.tau))
    slope = np.diff(sizes)[-10:] / 0.005
    assert np.abs(slope - 2 * HENCKY.mu * xi / (1 + xi)).max() < 1e-9
    assert abs(element.q.y[0] - sizes[-1] - slope[-1] * 0.005) < 1e-9


def test_softening_element_fails_and_carries_nothing(rng):
    flow = make_flow("von_mises_softening", HENCKY, 3, tau_y=0.4, theta=2.0)
    element = Element(HENCKY, flow, rng, y=0.4)
    sizes = []
    for _ in range(120):
        element.step(stretch(0.005))
        sizes.append(deviatoric(element.tau))
    peak = int(np.argmax(sizes))
    assert abs(max(sizes) - 0.4) < 0.005 * 2 * HENCKY.mu
    assert (np.diff(sizes[peak:]) <= EPS).all()
    assert element.q.y[0] == 0.0
    assert not element.q.tau.any()
    element.step(2.0 * np.eye(3))
    assert not element.q.tau.any()


def test_softening_in_log_strain_on_fixed_corotated_is_the_mix_of_the_public_code(rng):
    """The strain returns as with Hencky; the stress is the law's own, and not on that surface."""
    elements = []
    for own in (FC, HENCKY):
        flow = make_flow("von_mises_softening", own, 3, tau_y=0.4, theta=0.3)
        elements.append(Element(own, flow, rng, y=0.4))
    mixed, pure = elements
    for _ in range(40):
        mixed.step(stretch(0.005))
        pure.step(stretch(0.005))
    assert 0.0 < pure.q.y[0] < 0.4
    assert mixed.q.y == pytest.approx(pure.q.y, rel=1e-12)
    s, of_pure = (np.linalg.svd(one.q.F[0])[1] for one in elements)
    assert s == pytest.approx(of_pure, rel=1e-12)
    F = mixed.q.F[0]
    U, s, Vt = np.linalg.svd(F)
    J = np.linalg.det(F)
    tau = 2.0 * FC.mu * (F - U @ Vt) @ F.T + FC.lam * (J - 1.0) * J * np.eye(3)
    assert np.abs(mixed.q.tau[0] - tau).max() < EPS
    assert abs(deviatoric(mixed.tau) / mixed.q.y[0] - 1.0) > 1e-3


def test_sand_in_uniaxial_compression_slides_along_the_cone(rng):
    """Volume is elastic, so that tr tau is known; dev tau stays on the cone once it is reached."""
    flow = make_flow("drucker_prager", HENCKY, 3, friction_angle=20.0)
    element = Element(HENCKY, flow, rng)
    bulk = 3 * HENCKY.lam + 2 * HENCKY.mu
    for k in range(1, 31):
        element.step(np.diag([np.exp(-0.01), 1.0, 1.0]))
        trace = np.trace(element.tau)
        assert abs(trace + bulk * 0.01 * k) < 10 * EPS
        elastic = 2 * HENCKY.mu * sqrt(2 / 3) * 0.01 * k        # without flow
        assert elastic > -flow.alpha * trace                    # so that it flows at once
        assert abs(deviatoric(element.tau) + flow.alpha * trace) < 10 * EPS
    element.step(1.5 * np.eye(3))
    assert np.abs(element.tau).max() < EPS                      # and tension lets it go


@pytest.mark.parametrize("rate", [0.05, 0.2])
def test_toothpaste_in_steady_shear(rate, rng):
    """Bingham's law |dev tau| = tau_y + eta |D|, D = sym L, where elastic strains are small."""
    flow = make_flow("herschel_bulkley", NEO, 3, tau_y=0.02, eta=0.5)
    element = Element(NEO, flow, rng)
    growth = np.eye(3)
    growth[0, 1] = rate * 0.01
    for _ in range(400):
        element.q.L[0] = element.Q @ (growth - np.eye(3)) @ element.Q.T / 0.01
        deform.plastic(element.q, NEO, flow, 0.01, (0, 0, 0))
    steady = 0.02 + 0.5 * rate / sqrt(2)
    # of second order in the elastic strain steady / (2 mu), at most 1.2 %
    assert abs(deviatoric(element.tau) / steady - 1) < 1e-3
    assert abs(element.volume - 1) < EPS


def test_pure_rotation_makes_nothing_flow(rng):
    flow = make_flow("von_mises", HENCKY, 3, tau_y=0.4)
    element = Element(HENCKY, flow, rng)
    element.step(stretch(0.05))                     # just inside: 2 mu 0.05 = 0.385
    angle = pi / 50
    turn = np.eye(3)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    start = element.tau
    for _ in range(100):                            # a whole turn
        element.step(turn)
    assert np.abs(element.tau - start).max() < EPS


def test_elastic_pass_and_plastic_pass_agree(rng):
    """A flow that does nothing, and no flow at all, along one random path."""
    one = Element(HENCKY, NoFlow(), rng)
    other = Element(HENCKY, make_flow("von_mises", HENCKY, 3, tau_y=1e9), rng)
    other.Q = one.Q
    for growth in np.eye(3) + 0.02 * rng.standard_normal((20, 3, 3)):
        one.step(growth)
        other.step(growth)
    assert np.abs(one.tau - other.tau).max() < EPS
    assert np.abs(one.tau - one.Q.T @ tau(HENCKY, one.q.F[0]) @ one.Q).max() < 10 * EPS
