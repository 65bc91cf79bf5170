"""Manufactured solutions: the body force that makes a given motion exact, derived symbolically.

For a motion x(X, t) of a hyperelastic body the momentum balance asks for

    b = d2x/dt2 - Div P / rho0,     P = dpsi/dF,     F = dx/dX,

which sympy derives from the motion and the energy density alone and turns into NumPy functions.
"""

import numpy as np
import sympy as sp

MU, LAM, RHO0, T = sp.symbols("mu lambda rho0 t", positive=True)


def log_neo_hookean(F):
    """psi = mu/2 (F : F - d) - mu log J + lam/2 log^2 J of a symbolic F; see materials."""
    log_J = sp.log(F.det())
    return MU / 2 * (sum(f**2 for f in F) - F.rows) - MU * log_J + LAM / 2 * log_J**2


def pk1(psi, F):
    """P = dpsi/dF at the symbolic deformation gradient F."""
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
    """NumPy function of arrays or numbers -> array (N, k) of the k expressions at N points."""
    compiled = sp.lambdify(arguments, expressions, modules="numpy", cse=True)

    def evaluate(*values):
        return np.stack(np.broadcast_arrays(*compiled(*values)), axis=-1)

    return evaluate
