"""Second implementations of explicit steps: they agree with the package, and obey known facts."""

import numpy as np
import pytest

from validation.independent import (
    agreement_explicit,
    contact_step,
    elastic_step,
    fluid_step,
    metal_step,
    sand_step,
)
from validation.independent.agreement_explicit import BOUNDS, DX, PROJECTION, cloud

MU, LAM = elastic_step.lame(1e5, 0.3)


def angular_momentum(x, v, C, m):
    """Sum over particles of m (x cross v) and of the spin m D (C_10 - C_01), quadratic splines."""
    return m @ (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0] + DX**2 / 4 * (C[:, 1, 0] - C[:, 0, 1]))


@pytest.mark.parametrize("name", [*BOUNDS])
def test_package_agrees(name):
    assert getattr(agreement_explicit, name)() <= BOUNDS[name]


# fixed corotated

def test_free_block_keeps_its_momenta():
    start = cloud((5, 5), (3, 3), (0.5, -1.0), 11)
    state, m = [start[name] for name in "xvCF"], start["m"]
    before = m @ state[1], angular_momentum(*state[:3], m)
    problem = elastic_step.ElasticProblem(
        m, start["V0"], E=1e5, nu=0.3, g=np.zeros(2), floor=-1, dx=DX, dt=0.002, shape=(14, 14))
    for _ in range(20):
        state = elastic_step.step(*state, problem)
    assert np.abs(state[3] - start["F"]).max() > 0.005
    assert m @ state[1] == pytest.approx(before[0], rel=1e-12)
    assert angular_momentum(*state[:3], m) == pytest.approx(before[1], rel=1e-12)


def test_stress_is_the_slope_of_the_energy():
    """psi = mu |F - R|^2 + lam/2 (J - 1)^2, where tr S = sqrt(|F|^2 + 2 J) in 2D; complex steps."""
    def psi(F):
        J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
        squares = (F * F).sum()
        return MU * (squares - 2 * np.sqrt(squares + 2 * J) + 2) + LAM / 2 * (J - 1)**2

    F = np.array([[1.1, 0.3], [-0.2, 0.8]])
    units = np.eye(4).reshape(4, 2, 2)
    P = np.array([psi(F + 1e-30j * unit).imag / 1e-30 for unit in units]).reshape(2, 2)
    assert elastic_step.kirchhoff(F[None], 1e5, 0.3)[0] == pytest.approx(P @ F.T, rel=1e-12)


# sand

def test_sand_yields_as_mohr_coulomb_in_triaxial_compression():
    phi = np.radians(35.0)
    eps, = sand_step.returned(np.array([[-0.09, 0.02, 0.02]]), sand_step.cone_slope(phi, MU, LAM))
    tau = 2 * MU * eps + LAM * eps.sum()
    assert tau[0] / tau[1] == pytest.approx((1 + np.sin(phi)) / (1 - np.sin(phi)), rel=1e-12)


def test_return_map_of_sand_is_a_projection_in_two_regions_alone():
    distances = agreement_explicit.sand_returns()
    assert all(len(one) > 10 for one in distances.values())
    assert distances["on the cone"].max() <= PROJECTION
    assert distances["at the tip"].max() <= PROJECTION
    assert distances["pressed, any trace"].min() > 1e-3
    assert distances["between"].min() > 1e-3


# fluid

@pytest.mark.parametrize("flip", [0.0, 0.7, 1.0])
def test_falling_fluid_gains_momentum_by_gravity_alone(flip):
    start, g, dt = cloud((5, 6), (3, 3), (0.5, 0.0), 12), np.array([0.0, -9.8]), 0.002
    m, first = start["m"], start["m"] @ start["v"]
    problem = fluid_step.FluidProblem(
        m, start["V0"], lam=2e4, g=g, low=1, high=14, flip=flip, dx=DX, dt=dt, count=16)
    state = start["x"], start["v"], np.full(len(m), 0.98)
    for _ in range(20):
        state = fluid_step.step(*state, problem)
    assert np.abs(state[2] - 0.98).max() > 0.01
    assert m @ state[1] == pytest.approx(first + 20 * dt * m.sum() * g, rel=1e-12)


# metal

@pytest.mark.parametrize("number", [100, 1000])
def test_metal_hardens_by_its_modulus_in_shear(number):
    """The yield stress tends to (y_0 + 2 mu xi gamma)/(1 + xi), with gamma = |eps_hat| in all."""
    xi, y_0, gamma = 0.2, 2e3, 0.1
    growth = np.diag(np.exp(np.array([1.0, -1.0, 0.0]) / np.sqrt(2) * gamma / number))
    F, y = np.eye(3)[None], np.array([y_0])
    for _ in range(number):
        F, y = metal_step.flow(growth @ F, y, MU, xi)
    assert y == pytest.approx((y_0 + 2 * MU * xi * gamma) / (1 + xi), rel=0.2 / number)
    assert np.linalg.det(F) == pytest.approx(1.0, abs=1e-12)


# contact

def test_bodies_that_rub_keep_their_momenta():
    lower, upper = cloud((4, 4), (4, 3), (0, 0), 13), cloud((4.6, 7.0), (3, 3), (1, -1), 14)
    bodies = [{**body, "mu": MU, "lam": LAM} for body in (lower, upper)]

    def momenta(bodies):
        return np.sum([[*(body["m"] @ body["v"]),
                        angular_momentum(*(body[name] for name in "xvCm"))] for body in bodies], 0)

    before = momenta(bodies)
    for _ in range(20):
        bodies = contact_step.step(bodies, friction=0.3, g=np.zeros(2), dx=DX, dt=0.002, count=14)
    assert lower["m"] @ bodies[0]["v"][:, 0] > 1.0          # dragged along
    assert momenta(bodies) == pytest.approx(before, rel=1e-12)
