"""Second implementations of reduced steps: agreement with the package, and facts of their own."""

import numpy as np
import pytest

from validation.independent import (
    cubature_weights,
    evolved_gradient,
    inversion,
    linear_projection,
    nonlinear_projection,
    preimages,
)
from validation.independent.agreement_rom import (
    CHECKS,
    decoded_body,
    smooth_modes,
)

DT, STEPS, DX, RHO = 0.01, 6, 0.1, 900.0
GRAVITY, START = np.array([1.0, -2.0, -9.8]), np.array([0.3, 0.2, -0.1])


@pytest.mark.parametrize("name", CHECKS)
def test_the_package_agrees(name):
    agreement, bound, _, _ = CHECKS[name]
    assert agreement() <= bound


# Facts that neither code has written.

def shift_after(k):
    """Displacement of a body in free fall after k steps of symplectic Euler [m]."""
    return k * DT * START + 0.5 * k * (k + 1) * DT**2 * GRAVITY


def falling_body(n=40):
    """Points, masses and volumes of a body, and modes that shift it along the axes."""
    rng = np.random.default_rng(0)
    V0 = rng.uniform(0.5, 1.5, n) * 1e-4
    return rng.uniform(size=(n, 3)) * 0.3, RHO * V0, V0, np.tile(np.eye(3), (n, 1, 1))


def test_linear_projection_falls_freely():
    X, m, V0, U = falling_body()
    body = linear_projection.ModalBody(X, m, V0, U, np.zeros((40, 3, 3, 3)), 1e4, 2e4, DX, GRAVITY,
                                       lambda nodes: nodes[:, 0] < -10.0)
    xhat = linear_projection.run(body, np.tile(START, (40, 1)), [np.arange(5)] * STEPS, DT)
    assert xhat == pytest.approx(np.array([shift_after(k) for k in range(STEPS + 1)]), abs=1e-14)


def test_nonlinear_projection_falls_freely():
    """A decoder without hidden layers that adds xhat to X."""
    X, m, V0, _ = falling_body()
    layers = [(np.vstack([np.zeros((3, 3)), np.eye(3)]), np.zeros(3))]
    units = np.zeros(3), np.ones(3), np.zeros(3), np.ones(3)
    body = nonlinear_projection.DecodedBody(X, m, V0, layers, units, 1e4, 2e4, DX, GRAVITY)
    state = np.zeros(3), START, -DT * START
    xhat = nonlinear_projection.run(body, state, [np.arange(5)] * STEPS, DT)
    assert xhat == pytest.approx(np.array([shift_after(k + 1) for k in range(STEPS)]), abs=1e-12)


def test_nonlinear_projection_recovers_coordinates_on_the_manifold():
    X, layers, units, xhat, _ = decoded_body()

    def place(y):
        return nonlinear_projection.decode(layers, units, X[:5], y).ravel()

    assert nonlinear_projection.nearest(place, place(xhat), 0.0 * xhat) == pytest.approx(xhat)


def test_eulerian_points_have_the_mass_of_a_stretched_box():
    """A box that is stretched to twice its length still fills whole sub-cells."""
    stretch, high = np.array([2.0, 1.0, 1.0]), np.array([0.2, 0.2, 0.1])
    corners = np.indices((3, 2, 2)).reshape(3, -1).T / (2, 1, 1) * high
    points = preimages.quadrature(lambda X: stretch * X, (corners, corners, RHO),
                                  lambda X: (np.abs(X - 0.5 * high) <= 0.5 * high).all(), DX)
    assert len(points.x) == 8 * 4 * 2
    assert points.V0.sum() == pytest.approx(high.prod())
    assert points.m.sum() == pytest.approx(RHO * high.prod())
    assert points.X * stretch == pytest.approx(points.x)


def test_inversion_falls_freely():
    X, m, V0, _ = falling_body()
    none = np.zeros((40, 3, 3))
    fields = inversion.ThreeFields(lambda y: X + y, lambda y: none, lambda y: none, np.zeros(3))
    xhat = inversion.run(fields, (m, V0, GRAVITY), np.tile(START, (40, 1)), np.arange(5),
                         (DT, DX, STEPS))
    assert xhat == pytest.approx(np.array([shift_after(k) for k in range(STEPS + 1)]), abs=1e-10)


def test_inversion_keeps_the_momentum_of_stressed_points():
    """A step of all points changes the mean velocity by gravity alone, whatever tau and C are."""
    X, m, V0, _ = falling_body()
    rng = np.random.default_rng(1)
    v, tau, C = rng.normal(size=(40, 3)), 1e3 * rng.normal(size=(40, 3, 3)), rng.normal(
        size=(40, 3, 3))
    x = inversion.trial_positions((X, v, tau + tau.mT, C), (m, V0, GRAVITY), np.arange(40), DT, DX)
    assert m @ (x - X) / DT == pytest.approx(m @ v + DT * m.sum() * GRAVITY)


def test_fields_of_all_modes_pass_through_their_snapshots():
    rng, X = np.random.default_rng(0), np.zeros((9, 3))
    x, tau, C = rng.normal(size=(6, 9, 3)), rng.normal(size=(6, 9, 3, 3)), rng.normal(
        size=(6, 9, 3, 3))
    tau = tau + tau.mT
    fields = inversion.fit_fields(X, (x, tau, C), 2, (6, 6, 6), 0.0)
    for wanted, function in ((x, fields.place), (tau, fields.stress), (C, fields.affine)):
        assert function(fields.start) == pytest.approx(wanted[0])


def test_weights_are_those_of_a_minimum():
    """Without a weight the residual does not fall along a point, with a weight it has no slope."""
    U, points = smooth_modes(), np.arange(0, 150, 5)
    A, b = cubature_weights.equations(U, 4)
    w, misfit = cubature_weights.weights(U, 4, points)
    slope = A[:, points].T @ (A[:, points] @ w - b)
    assert 0.01 < misfit < 1.0
    assert np.abs(slope[w > 0.0]).max() < 1e-12
    assert slope.min() > -1e-12
    assert (w == 0.0).any()


def test_all_points_need_no_weights():
    U = smooth_modes()
    assert cubature_weights.equal_weights(U, 4, np.arange(150)) < 1e-12


def test_evolved_gradients_ignore_those_of_the_map():
    """A body in free fall stays without strain, although its map claims some."""
    X, m, V0, U = falling_body()
    D = np.random.default_rng(1).normal(size=(40, 3, 3, 3))
    body = X, m, V0, (1e4, 2e4), DX, GRAVITY
    states = evolved_gradient.run(body, (U, D), (np.zeros(3), START), [np.arange(40)] * STEPS, DT)
    for k, state in enumerate(states):
        assert state.xhat == pytest.approx(shift_after(k + 1), abs=1e-13)
        assert state.F == pytest.approx(np.tile(np.eye(3), (40, 1, 1)), abs=1e-12)
