"""LDM's reduced step with the nonlinear projection, on a map by a decoder network.

    g(X; xhat) = X + mean + std f((X - low) / span, xhat),    f with ELU       LDM-eq14, LDM-appB
    vhat = argmin_w sum_M |dg/dxhat w - v_trial|^2                             LDM-eq21
    xhat = argmin_y sum_M |g(X; y) - x_trial|^2                                LDM-eq22, LDM-alg6

F and dg/dxhat are complex steps. The velocity of a state is dg/dxhat vhat where vhat was fitted.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

SPLINE = BSpline.basis_element([-1.5, -0.5, 0.5, 1.5], extrapolate=False)      # quadratic
TINY, EPS = 1e-30, 1e-15        # complex step, relative tolerance of the minimum


class DecodedBody(NamedTuple):
    """A fixed corotated body of n particles in 3D, free of walls, and its decoder."""

    X: np.ndarray           # (n, 3)    positions at rest [m]
    m: np.ndarray           # (n,)      masses [kg]
    V0: np.ndarray          # (n,)      volumes at rest [m^3]
    layers: list            # [(W (in, out), b (out,))]
    units: tuple            # low, span of X; mean, std of displacements; (3,) each [m]
    mu: float               # [Pa]
    lam: float              # [Pa]
    dx: float               # [m]       spacing of the grid
    gravity: np.ndarray     # (3,)      [m/s^2]


def decode(layers, units, X, xhat):
    """Return g(X; xhat) (n, 3) [m] of points X (n, 3) [m]; either may be complex."""
    low, span, mean, std = units
    a = np.hstack([(X - low) / span, np.broadcast_to(xhat, (len(X), len(xhat)))])
    for W, b in layers[:-1]:
        z = a @ W + b
        a = np.where(z.real > 0.0, z, np.expm1(z))
    return X + mean + std * (a @ layers[-1][0] + layers[-1][1])


def slopes(f, y):
    """Return the derivatives (.., r) of f(y) by the r numbers along the last axis of y."""
    steps = 1j * TINY * np.eye(y.shape[-1])
    return np.stack([f(y + step).imag / TINY for step in steps], axis=-1)


def weights(x, dx):
    """Return nodes (k, 3) [m], W (n, k) and its gradient dW (n, k, 3) [1/m] at x (n, 3) [m]."""
    low, high = np.floor(x.min(axis=0) / dx) - 1, np.ceil(x.max(axis=0) / dx) + 1
    nodes = np.indices((high - low + 1).astype(int)).reshape(3, -1).T + low
    z = x[:, None] / dx - nodes
    N, dN = (np.nan_to_num(s(z)) for s in (SPLINE, SPLINE.derivative()))
    others = np.stack([np.delete(N, a, axis=2).prod(axis=2) for a in range(3)], axis=2)
    return dx * nodes, N.prod(axis=2), dN * others / dx


def trial(body, state, samples, dt):
    """Return positions [m] and velocities [m/s] of samples (m, 3) after a step by PIC (LDM-alg5).

    state: xhat (r,), vhat (r,), and the coordinates (r,) that vhat was fitted at.
    """
    xhat, vhat, before = state
    x = decode(body.layers, body.units, body.X, xhat)
    v = slopes(lambda y: decode(body.layers, body.units, body.X, y), before) @ vhat
    F = slopes(lambda X: decode(body.layers, body.units, X, xhat), body.X)
    left, _, right = np.linalg.svd(F)
    J = np.linalg.det(F)[:, None, None]
    P = 2.0 * body.mu * (F - left @ right) + body.lam * J * (J - 1.0) * np.linalg.inv(F).mT
    _, W, dW = weights(x, body.dx)
    active = W[samples].any(axis=0)
    W, dW = W[:, active], dW[:, active]
    force = -np.einsum("p,pab,pcb,pic->ia", body.V0, P, F, dW, optimize=True)
    v_new = (W.T @ (body.m[:, None] * v) + dt * force) / (body.m @ W)[:, None] + dt * body.gravity
    return x[samples] + dt * W[samples] @ v_new, W[samples] @ v_new


def nearest(place, x, guess):
    """Return argmin_y |place(y) - x|^2 (r,), searched from a guess; y may be complex."""
    return least_squares(lambda y: place(y) - x, guess, "cs", ftol=EPS, xtol=EPS, gtol=EPS).x


def run(body, state, samples, dt):
    """Return xhat (steps, r) after each step of dt [s] from a state (see `trial`), with the numbers
    (m,) of each step's `samples`.
    """
    states = []
    for chosen in samples:
        xhat, _, before = state
        x, v = trial(body, state, chosen, dt)

        def place(y, X=body.X[chosen]):
            return decode(body.layers, body.units, X, y).ravel()

        vhat = np.linalg.lstsq(slopes(place, xhat), v.ravel(), rcond=None)[0]
        state = nearest(place, x.ravel(), 2.0 * xhat - before), vhat, xhat      # LDM-sec3.2.3-gn
        states.append(state[0])
    return np.array(states)
