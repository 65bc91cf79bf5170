"""Stages of the adjoint of a step of deformation that blocks of particles share (see `blocks`):
reading the step, singular values for the particles that other formulas do not fit, and storing.
"""

from ..jit import kernel
from ..tensor import mat, mlin
from .blocks import entries, put_entries
from .deform import principal_bar, put_trial_bar, trial


@kernel
def load(step, bars, like, bounds, F, T):
    """F of the step and tau_bar of a block."""
    for p in range(bounds[0], bounds[1]):
        put_entries(trial(step, p, like), p - bounds[0], F)
        put_entries(mat(bars.tau, p, like), p - bounds[0], T)


@kernel
def fall_back(stress, block_bars, law, row, n):
    """The bars of F and of the moduli in singular values, where fits is 0: stress = (F, tau_bar),
    block_bars = (F_bar, of_law, fits), row = (sums, c) of the moduli, in place of of_law.
    """
    (F, tau_bar), (F_bar, of_law, fits), (sums, c) = stress, block_bars, row
    for k in range(n):
        if fits[k] == 0.0:
            put_entries(principal_bar(entries(F, k), entries(tau_bar, k), law, sums, c), k, F_bar)
            of_law[0, k], of_law[1, k] = 0.0, 0.0


@kernel
def store(step, bars, like, bounds, F_bar):
    """The bars of the state before the step."""
    for p in range(bounds[0], bounds[1]):
        of_stress = entries(F_bar, p - bounds[0])
        put_trial_bar(step, bars, p, mlin(1.0, mat(bars.F, p, like), 1.0, of_stress), like)
