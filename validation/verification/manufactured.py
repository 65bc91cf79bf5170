"""Manufactured solutions: the body force that makes a given motion exact, derived symbolically.

For a motion x(X, t) of a hyperelastic body the momentum balance asks for

    b = d2x/dt2 - Div P / rho0,     P = dpsi/dF,     F = dx/dX,

which sympy derives from the motion and the energy density alone and turns into NumPy functions.
`by_differences` evaluates the same b without any derivation, to check it.
"""

import mpmath as mp
import numpy as np
import sympy as sp

MU, LAM, RHO0, T = sp.symbols("mu lambda rho0 t", positive=True)

DIGITS = 80          # of the differences: three levels, each of which loses 15 digits or so
STEP = mp.mpf(10) ** -15


def log_neo_hookean(F):
    """psi = mu/2 (F : F - d) - mu log J + lam/2 log^2 J of a symbolic F; see materials."""
    log_J = sp.log(F.det())
    return MU / 2 * (sum(f**2 for f in F) - F.rows) - MU * log_J + LAM / 2 * log_J**2


def pk1(psi, F):
    """P = dpsi/dF at the symbolic deformation gradient F, for an energy density psi(F)."""
    A = sp.Matrix(F.rows, F.cols, lambda i, j: sp.Symbol(f"F{i}{j}"))
    P = sp.Matrix(F.rows, F.cols, lambda i, j: sp.diff(psi(A), A[i, j]))
    return P.subs(dict(zip(A, F, strict=True)), simultaneous=True)


def body_force(x, X, psi):
    """b of the motion x (list of expressions in the symbols X and `T`), a list of expressions."""
    P = pk1(psi, sp.Matrix(x).jacobian(X))
    return [
        sp.diff(x_i, T, 2) - sum(sp.diff(P[i, j], X_j) for j, X_j in enumerate(X)) / RHO0
        for i, x_i in enumerate(x)
    ]


def function(arguments, expressions):
    """NumPy function of numbers or arrays (N,): the k expressions as an array (N, k)."""
    compiled = sp.lambdify(arguments, expressions, modules="numpy", cse=True)

    def evaluate(*values):
        return np.stack(np.broadcast_arrays(*compiled(*values)), axis=-1)

    return evaluate


def by_differences(motion, psi, rho0, X, t):
    """b [m/s^2] at the point X (d numbers) and time t, by central differences in 80 digits.

    motion(X, t) and psi(F) are functions of mpmath numbers: a list of d coordinates, and the energy
    density of a list of d lists. Accurate to more digits than a float has.
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
    """df/dX_j of a vector-valued f."""
    up, down = (f([c + side * STEP * (i == j) for i, c in enumerate(X)]) for side in (1, -1))
    return [(u - d) / (2 * STEP) for u, d in zip(up, down, strict=True)]


def _slope(psi, F, i, j):
    """dpsi/dF_ij."""
    up, down = ([[f + side * STEP * ((k, l) == (i, j)) for l, f in enumerate(row)]
                 for k, row in enumerate(F)] for side in (1, -1))
    return (psi(up) - psi(down)) / (2 * STEP)


def _second_difference(f, t):
    """d2f/dt2 of a vector-valued f."""
    up, here, down = f(t + STEP), f(t), f(t - STEP)
    return [(u - 2 * h + d) / STEP**2 for u, h, d in zip(up, here, down, strict=True)]
