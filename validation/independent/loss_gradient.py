"""Gradient of NCLaw's position loss by complex steps through a run.

    L = sum over steps n of the mean over points and axes of (x_n - x_n^true)^2      NCLAW-loss
    dL/dw_j = Im L(w + i h e_j) / h                                                  NCLAW-eq5

With h = 1e-30 the truncation error, of order h^2, is far below round-off, and nothing is
subtracted. The weights may be any numbers that a run starts from.
"""

import numpy as np

STEP = 1e-30


def loss(x, target):
    """Return L [m^2] of positions x (steps, n, 3) [m] and the true ones; x may be complex."""
    return ((np.asarray(x) - target) ** 2).mean(axis=(1, 2)).sum()


def gradient(positions, w, target, chosen):
    """Return dL/dw_j (m,) for the entries j of `chosen` (m,).

    positions: function of weights w (k,) -> x (steps, n, 3) [m], which passes complex numbers.
    """
    slopes = []
    for j in chosen:
        shifted = w.astype(complex)
        shifted[j] += 1j * STEP
        slopes.append(loss(positions(shifted), target).imag / STEP)
    return np.array(slopes)
