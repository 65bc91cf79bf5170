"""Adjoint of laws and return maps of the whole F, as `deform` has it for those of principal axes.

    F_trial = (I + dt L) F,   F' = returned(F_trial),   tau = kirchhoff(F')

Their bars are those of F alone: no parameter of the law or the flow gets one.
"""

from ..jit import CHUNKS, chunk, kernel, parallel, prange
from ..law import kirchhoff_bar, returned, returned_bar
from ..tensor import mat, mlin, put_mat
from .deform import like_of, put_trial_bar, trial


def elastic(step, bars, law):
    """Adjoint of `core.deform.elastic`."""
    _elastic(step, bars, law, like_of(step.L))


def plastic(step, bars, law, flow):
    """Adjoint of `core.deform.full`."""
    _plastic(step, bars, law, flow, like_of(step.L))


def initial_stress(F, bars, law):
    """Adjoint of tau = kirchhoff(F): adds to bars.F."""
    _initial_stress(F, bars, law, like_of(F))


@kernel
def with_stress_bar(F, p, bars, law, like):
    """Return the bar of F after the step: its own, and that of its stress."""
    of_stress = kirchhoff_bar(F, mat(bars.tau, p, like), law)
    return mlin(1.0, mat(bars.F, p, like), 1.0, of_stress)


@kernel
def elastic_bars(step, bars, law, like, c):
    """Compute the bars of chunk c without a return map."""
    start, stop = chunk(c, len(step.F))
    for p in range(start, stop):
        F_bar = with_stress_bar(trial(step, p, like), p, bars, law, like)
        put_trial_bar(step, bars, p, F_bar, like)


@kernel
def plastic_bars(step, bars, law, flow, like, c):
    """Compute the bars of chunk c with a return map."""
    start, stop = chunk(c, len(step.F))
    for p in range(start, stop):
        F = trial(step, p, like)
        F_new_bar = with_stress_bar(returned(F, flow), p, bars, law, like)
        put_trial_bar(step, bars, p, returned_bar(F, F_new_bar, flow), like)


@kernel
def initial_stress_bars(F, bars, law, like, c):
    """Add the bars of chunk c."""
    start, stop = chunk(c, len(F))
    for p in range(start, stop):
        put_mat(bars.F, p, with_stress_bar(mat(F, p, like), p, bars, law, like))


@parallel
def _elastic(step, bars, law, like):
    for c in prange(CHUNKS):
        elastic_bars(step, bars, law, like, c)


@parallel
def _plastic(step, bars, law, flow, like):
    for c in prange(CHUNKS):
        plastic_bars(step, bars, law, flow, like, c)


@parallel
def _initial_stress(F, bars, law, like):
    for c in prange(CHUNKS):
        initial_stress_bars(F, bars, law, like, c)
