"""Manufactured solutions: the body force that makes a given motion exact, derived symbolically.

For a motion x(X, t) of a hyperelastic body the momentum balance asks for

    b = d2x/dt2 - Div P / rho0,     P = dpsi/dF,     F = dx/dX,

which sympy derives from the motion and the energy density alone and turns into NumPy functions.
`by_differences` evaluates b without any derivation, to check it: it shares with the symbolic
forcing only the definition of a problem, its motion and its energy density. `follow` measures how
well a body follows a motion.
"""

from math import ceil

import mpmath as mp
import numpy as np
import sympy as sp

from mpm_ref.core.grid import OutOfRange

from ..common.scenes import threads_for
from .convergence import rms

MU, LAM, RHO0, T = sp.symbols("mu lambda rho0 t", positive=True)

DIGITS = 80          # of the differences: three levels, each of which loses 15 digits or so
STEP = mp.mpf(10) ** -15
CHECKS = 20          # times at which the error is taken
LOST = 1.0           # error [m] at which a body has nothing to do with its motion: it has this size


def log_neo_hookean(F):
    """psi = mu/2 (F : F - d) - mu log J + lam/2 log^2 J of a symbolic F; see materials."""
    log_J = sp.log(F.det())
    return MU / 2 * (sum(f**2 for f in F) - F.rows) - MU * log_J + LAM / 2 * log_J**2


def pk1(psi, F):
    """Return P = dpsi/dF at the symbolic deformation gradient F, for an energy density psi(F)."""
    A = sp.Matrix(F.rows, F.cols, lambda i, j: sp.Symbol(f"F{i}{j}"))
    P = sp.Matrix(F.rows, F.cols, lambda i, j: sp.diff(psi(A), A[i, j]))
    return P.subs(dict(zip(A, F, strict=True)), simultaneous=True)


def body_force(x, X, psi):
    """Return the expressions of b for a motion x, expressions in the symbols X and `T`."""
    P = pk1(psi, sp.Matrix(x).jacobian(X))
    return [
        sp.diff(x_i, T, 2) - sum(sp.diff(P[i, j], X_j) for j, X_j in enumerate(X)) / RHO0
        for i, x_i in enumerate(x)
    ]


def function(arguments, expressions):
    """Return the NumPy function of k expressions: of numbers or arrays (N,), an array (N, k)."""
    compiled = sp.lambdify(arguments, expressions, modules="numpy", cse=True)

    def evaluate(*values):
        return np.stack(np.broadcast_arrays(*compiled(*values)), axis=-1)

    return evaluate


def energy_density(law):
    """Return psi(F) of the law of `log_neo_hookean` for a list of lists of mpmath numbers."""

    def psi(F):
        log_J = mp.log(mp.det(mp.matrix(F)))
        square = sum(f * f for row in F for f in row)
        return law.mu / 2 * (square - len(F)) - law.mu * log_J + law.lam / 2 * log_J**2

    return psi


def by_differences(motion, psi, rho0, X, t):
    """Return b [m/s^2] at the point X (d numbers) and time t, by differences in 80 digits.

    The differences are central, accurate to more digits than a float has. motion(X, t) and psi(F)
    are functions of mpmath numbers: a list of d coordinates, and the energy density of a list of d
    lists.
    """
    with mp.workdps(DIGITS):
        X, t = [mp.mpf(float(c)) for c in X], mp.mpf(float(t))

        def F(Y):
            columns = [_difference(lambda Z: motion(Z, t), Y, j) for j in range(len(Y))]
            return [list(row) for row in zip(*columns, strict=True)]

        def P_column(Y, j):
            return [_slope(psi, F(Y), i, j) for i in range(len(Y))]

        div = [_difference(lambda Y, j=j: P_column(Y, j), X, j) for j in range(len(X))]
        a = _second_difference(lambda s: motion(X, s), t)
        return [float(a_i - sum(d) / rho0) for a_i, *d in zip(a, *div, strict=True)]


def _difference(f, X, j):
    """Return df/dX_j of a vector-valued f."""
    up, down = (f([c + side * STEP * (i == j) for i, c in enumerate(X)]) for side in (1, -1))
    return [(u - d) / (2 * STEP) for u, d in zip(up, down, strict=True)]


def _slope(psi, F, i, j):
    """Return dpsi/dF_ij."""
    up, down = ([[f + side * STEP * ((k, l) == (i, j)) for l, f in enumerate(row)]
                 for k, row in enumerate(F)] for side in (1, -1))
    return (psi(up) - psi(down)) / (2 * STEP)


def _second_difference(f, t):
    """Return d2f/dt2 of a vector-valued f."""
    up, center, down = f(t + STEP), f(t), f(t - STEP)
    return [(u - 2 * c + d) / STEP**2 for u, c, d in zip(up, center, down, strict=True)]


def step_count(end, dt):
    """Return the number of steps to time `end` with at most dt each that meet all checks."""
    return CHECKS * ceil(end / dt / CHECKS)


def put_on(particles, motion, dt):
    """Put particles on the motion at time 0.

    A symplectic Euler step takes v from t - dt/2 to t + dt/2 as it takes x from t to t + dt: so the
    velocities are those of time -dt/2, which makes the time integration of second order.
    """
    particles.x[:], particles.F[:] = motion.position(0.0), motion.gradient(0.0)
    particles.v[:] = motion.velocity(-0.5 * dt)
    if particles.C.ndim == 3:
        growth = (motion.gradient(0.0) - motion.gradient(-dt)) / dt
        particles.C[:] = growth @ np.linalg.inv(motion.gradient(-0.5 * dt))


def follow(body, motion, stepper, end, dt):
    """Return the largest RMS error of the positions [m] at `CHECKS` times, at most `LOST`.

    end: length of the run [s]. A motion has position, velocity, gradient and body_force of its
    particles at any time; the index `measured`; and `hold`, which resets those that are not free.
    """
    steps = step_count(end, dt)
    put_on(body.particles, motion, end / steps)
    stepper.start([body])
    worst = 0.0
    with threads_for([body]):
        try:
            for error in errors(body, motion, stepper, end / steps, steps):
                worst = max(worst, error)
                if not worst < LOST:
                    return LOST
        except OutOfRange:
            return LOST
    return worst


def errors(body, motion, stepper, dt, steps):
    """Advance by `steps` steps and yield the RMS error of the positions [m] at `CHECKS` times."""
    q = body.particles
    for k in range(1, steps + 1):
        q.b[:] = motion.body_force((k - 1) * dt)
        stepper.step([body], (k - 1) * dt, dt)
        motion.hold(q)
        if k % (steps // CHECKS) == 0:
            yield rms((q.x - motion.position(k * dt))[motion.measured])
