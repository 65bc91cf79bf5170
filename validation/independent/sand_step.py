"""Sand in 3D: APIC with cubic B-splines, Hencky elasticity, Drucker-Prager flow, a rough floor.

One step (NSF-alg-mpm), with r_ip = x_i - x_p and D = dx^2/3:

    m_i = sum_p w_ip m_p,  m_i v_i = sum_p w_ip m_p (v_p + C_p r_ip)
    v_i <- v_i - dt/m_i sum_p V0_p tau_p dw_ip + dt g,  and the floor
    v_p = sum_i w_ip v_i,  x_p <- x_p + dt v_p,  C_p = sum_i w_ip v_i r_ip^T/D
    F_p <- Z((I + dt sum_i v_i dw_ip^T) F_p)

Z is the return map of NSF-F3 on the logarithmic strains, and tau their stress (NSF-F2).
The floor stops nodes that approach it and rubs on them by Coulomb's law.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import minimize

SPLINE = BSpline.basis_element(np.arange(5) - 2.0, extrapolate=False)
SIZES = 1.0, 0.03       # of starts on the axis of the cone


class SandProblem(NamedTuple):
    """The constants of all steps; node (j, k, l) lies at (j, k, l) dx."""
    m: np.ndarray       # (N,)  masses [kg]
    V0: np.ndarray      # (N,)  volumes at rest [m^3]
    moduli: tuple       # Lame's mu and lam [Pa]
    angle: float        # of friction in the sand [rad]
    g: np.ndarray       # (3,)  gravity [m/s^2]
    floor: int          # layer of nodes on the floor, which goes on below
    friction: float     # coefficient of the floor
    dx: float           # [m]
    dt: float           # [s]
    shape: tuple        # numbers of nodes along the axes


def cone_slope(angle, mu, lam):
    """Return k of the cone |eps_hat| <= -k tr eps for an angle of friction [rad]."""
    alpha = np.sqrt(2 / 3) * 2 * np.sin(angle) / (3 - np.sin(angle))
    return alpha * (3 * lam + 2 * mu) / (2 * mu)


def returned(eps, k):
    """Return the strains (N, 3) after flow, for trial strains eps (N, 3)."""
    tr = eps.sum(1, keepdims=True)
    hat = eps - tr / 3
    norm = np.linalg.norm(hat, axis=1, keepdims=True)
    too_far = np.maximum(norm + k * tr, 0) / np.where(norm > 0, norm, 1)
    return np.where(tr > 0, 0, eps - too_far * hat)


def nearest(eps, k, weight, keeps_trace):
    """Return the strain (3,) of the cone that is nearest to eps (3,), which is of size 1 or so.

    The distance is |a|^2 + weight b^2, with a and b the differences of eps_hat and of tr eps; if
    keeps_trace, b = 0. The tip is tried by itself. SLSQP starts from SIZES, since from a
    single one its rounding lets it stall at the tip for a few strains.
    """
    basis = np.array([[1, 1, 1], [1, -1, 0], [1, 1, -2]]) / np.sqrt([[3], [2], [6]])
    goal, metric, cone = basis @ eps, *np.array([[3 * weight, 1, 1], [3 * k**2, -1, -1]])
    inside = {"type": "ineq", "fun": lambda y: cone @ y**2, "jac": lambda y: 2 * cone * y}
    bounds = [(goal[0],) * 2 if keeps_trace else (None, 0), *[(None, None)] * 2]

    def distance(y):
        return metric @ (y - goal)**2

    found = [minimize(distance, [-size * abs(goal[0]), 0, 0], method="SLSQP", bounds=bounds,
                      jac=lambda y: 2 * metric * (y - goal), constraints=inside, tol=1e-16).x
             for size in SIZES]
    return min(found if keeps_trace else [*found, np.zeros(3)], key=distance) @ basis


def splines(x, dx, shape):
    """Return the weights (N, n) at x (N, 3), and their gradients (N, n, 3) [1/m]."""
    s = [x[:, a, None] / dx - np.arange(shape[a]) for a in range(3)]
    w, dw = ([np.nan_to_num(f(q)) for q in s] for f in (SPLINE, SPLINE.derivative()))
    product = [np.einsum("pi,pj,pk->pijk", *(dw[b] if a == b else w[b] for b in range(3)))
               .reshape(len(x), -1) for a in range(4)]
    return product[3], np.stack(product[:3], -1) / dx


def step(x, v, C, F, problem):
    """Return x (N, 3) [m], v (N, 3) [m/s], C (N, 3, 3) [1/s] and elastic F after a step."""
    m, V0, (mu, lam), angle, g, floor, friction, dx, dt, shape = problem
    W, dW = splines(x, dx, shape)
    nodes = np.indices(shape).reshape(3, -1).T
    squares, Q = np.linalg.eigh(F @ F.swapaxes(1, 2))
    eps = np.log(squares) / 2
    tau = (Q * (2 * mu * eps + lam * eps.sum(1, keepdims=True))[:, None]) @ Q.swapaxes(1, 2)
    affine = np.tensordot(W.T, m[:, None, None] * C, 1) @ (nodes * dx)[..., None]       # at x_i
    momentum = (W.T @ (m[:, None] * (v - (C @ x[..., None])[..., 0])) + affine[..., 0]
                - dt * (dW @ (V0[:, None, None] * tau)).sum(0))
    m_i = (W.T @ m)[:, None]
    v_i = np.divide(momentum, m_i, out=np.zeros_like(momentum), where=m_i > 0) + dt * g
    hits = (nodes[:, 2] <= floor) & (v_i[:, 2] < 0)
    speed = np.linalg.norm(v_i[hits, :2], axis=1)
    slowed = np.maximum(speed + friction * v_i[hits, 2], 0) / np.where(speed > 0, speed, 1)
    v_i[hits] *= np.column_stack([slowed, slowed, 0 * slowed])
    v = W @ v_i
    moment = np.tensordot(W, v_i[..., None] * nodes[:, None] * dx, 1)           # (N, 3, 3)
    trial = F + dt * v_i.T @ dW @ F
    squares, Q = np.linalg.eigh(trial @ trial.swapaxes(1, 2))
    Z = np.exp(returned(np.log(squares) / 2, cone_slope(angle, mu, lam)))
    stretch = (Q * (Z / np.sqrt(squares))[:, None]) @ Q.swapaxes(1, 2)
    return x + dt * v, v, (moment - v[..., None] * x[:, None]) * 3 / dx**2, stretch @ trial
