"""Adjoint of `deform`: gradients of a scalar loss through deformation, return map and stress.

    F_trial = (I + dt L) F,   F', y' = project(F_trial, y),   tau = kirchhoff(F')

For every quantity X, `X_bar` (in arrays: bars.X) is d loss / dX. Given the bars of what `deform`
leaves, these functions put in their place those of what it found, write the bar of L, and add the
bars of the parameters. NCLaw's training differentiates the same step (NCLAW-eq5).

The step is differentiated in the principal axes F_trial = U diag(s) V^T (for some laws without
them, see `adjoint.corotated`), where it falls apart into a function of s and, for each pair of
axes, two numbers:
(s'_i - s'_j)/(s_i - s_j) for the symmetric part and (s'_i + s'_j)/(s_i + s_j) for the skew part.
The laws give the first in closed form, so that repeated singular values need no care. A return map
is differentiated in the branch that it takes.

Chunk c of the particles adds to row c of sums (CHUNKS, n), whose columns are the parameters of the
law, then of the flow: the same bits for any number of threads. Their bars are sums.sum(axis=0).
"""

from typing import NamedTuple

import numpy as np

from ..deform import recall, remember
from ..jit import CHUNKS, chunk, kernel, parallel, prange
from ..law import (
    d_pressure,
    gap_ratio,
    intact,
    kirchhoff_hat,
    kirchhoff_vjp,
    pressure,
    project,
    project_vjp,
    units,
)
from ..spectral import UNDETERMINED, mixed, svd
from ..state import growth
from ..tensor import (
    cofactor,
    det,
    diagonal,
    dot,
    mat,
    mlin,
    mm,
    mmt,
    put_mat,
    transpose,
)


class DeformBars(NamedTuple):
    """Bars of N particles in d dimensions; of a fluid that carries J alone, F and tau are (N,)."""

    F: np.ndarray       # (N, d, d)  of F after the step; on return before it
    tau: np.ndarray     # (N, d, d)  of tau after the step; left alone
    L: np.ndarray       # (N, d, d)  on return of the velocity gradient of the step
    y: np.ndarray       # (N,)       as F, where the return map has a memory, else as in `state`
    C: np.ndarray       # (N, d, d)  that of L is added to it in place of L, or (0,)


class DeformStep(NamedTuple):
    """State before a step of deformation, and the sums to which bars of parameters are added."""

    F: np.ndarray       # (N, d, d), or (N,) of J
    y: np.ndarray       # (N,), or no history
    L: np.ndarray       # (N, d, d)
    sums: np.ndarray    # (CHUNKS, n)
    dt: float           # [s]


def fluid(step, bars, law):
    """Adjoint of `deform.fluid`."""
    _fluid(step, bars, law, like_of(step.L))


def elastic(step, bars, law):
    """Adjoint of `deform.elastic`."""
    _elastic(step, bars, law, like_of(step.L))


def plastic(step, bars, law, flow):
    """Adjoint of `deform.plastic`."""
    _plastic(step, bars, law, flow, like_of(step.L))


def initial_stress(F, y, bars, law, flow, sums):
    """Adjoint of `deform.initial_stress`: adds to bars.F."""
    _initial_stress(DeformStep(F, y, F, sums, 0.0), bars, law, flow, like_of(F))


def like_of(a):
    """Return a tuple as long as the last axis of an array."""
    return tuple(range(a.shape[-1]))


@kernel
def fluid_vjp(step, bars, law, like, c):
    """Adjoint of J' = det(I + dt L) J, tau = pressure(J')."""
    start, stop = chunk(c, len(step.F))
    for p in range(start, stop):
        G = growth(step.L, p, step.dt, like)
        grown = det(G)
        J = step.F[p] * grown
        J_bar = bars.F[p] + pressure_vjp(J, bars.tau[p], law, step.sums, c)
        bars.F[p] = J_bar * grown
        L_bar = mlin(step.dt * J_bar * step.F[p], cofactor(G), 0.0, G)
        put_gradient_bar(bars.L, bars.C, p, L_bar)


@kernel
def elastic_vjp(step, bars, law, like, c):
    """Adjoint of F' = (I + dt L) F, tau = kirchhoff(F')."""
    start, stop = chunk(c, len(step.F))
    for p in range(start, stop):
        F_bar = principal_bar(trial(step, p, like), mat(bars.tau, p, like), law, step.sums, c)
        put_trial_bar(step, bars, p, mlin(1.0, mat(bars.F, p, like), 1.0, F_bar), like)


@kernel
def plastic_vjp(step, bars, law, flow, like, c):
    """Adjoint of F' = U diag(s') V^T, tau = U diag(kirchhoff_hat(s')) U^T, s' the return of s."""
    start, stop = chunk(c, len(step.F))
    for p in range(start, stop):
        U, s, V, _ = svd(trial(step, p, like))
        y = recall(step.y, p)
        s_new, y_new = project(s, y, step.dt, law, flow)
        T = within(U, mat(bars.tau, p, like), U)
        T = mlin(intact(y_new, flow), T, 0.0, T)
        X = within(U, mat(bars.F, p, like), V)
        X = mlin(1.0, X, 1.0, stress_vjp(s_new, T, law, step.sums, c))
        returned = diagonal(X), recall(bars.y, p)
        (s_bar, y_bar), parameters, share = project_vjp((s, y), returned, step.dt, law, flow)
        add(step.sums, c, parameters)
        X = mixed(s_bar, quotients(s, s_new, share, flow), X)
        put_trial_bar(step, bars, p, back(U, X, V), like)
        remember(bars.y, p, y_bar)


@kernel
def initial_stress_vjp(step, bars, law, flow, like, c):
    """Adjoint of tau = kirchhoff(F), 0 where the material has failed."""
    start, stop = chunk(c, len(step.F))
    for p in range(start, stop):
        U, s, V, _ = svd(mat(step.F, p, like))
        T = within(U, mat(bars.tau, p, like), U)
        T = mlin(intact(recall(step.y, p), flow), T, 0.0, T)
        X = stress_vjp(s, T, law, step.sums, c)
        put_mat(bars.F, p, mlin(1.0, mat(bars.F, p, like), 1.0, back(U, X, V)))


@kernel
def initial_pressure_vjp(J, bars, law, sums, c):
    """Adjoint of tau = pressure(J)."""
    start, stop = chunk(c, len(J))
    for p in range(start, stop):
        bars.F[p] += pressure_vjp(J[p], bars.tau[p], law, sums, c)


@kernel
def principal_bar(F, tau_bar, law, sums, c):
    """F_bar of tau_bar, in principal axes; the bars of the moduli join the sums of chunk c."""
    U, s, V, _ = svd(F)
    return back(U, stress_vjp(s, within(U, tau_bar, U), law, sums, c), V)


@kernel
def trial(step, p, like):
    """F_trial of particle p."""
    return mm(growth(step.L, p, step.dt, like), mat(step.F, p, like))


@kernel
def put_trial_bar(step, bars, p, trial_bar, like):
    """The bars of F and L of particle p from that of F_trial = (I + dt L) F."""
    G, F = growth(step.L, p, step.dt, like), mat(step.F, p, like)
    put_mat(bars.F, p, mm(transpose(G), trial_bar))
    put_gradient_bar(bars.L, bars.C, p, mlin(step.dt, mmt(trial_bar, F), 0.0, F))


@kernel
def put_gradient_bar(L, C, p, L_bar):
    """Store the bar of L, or add it to that of C where both are one field."""
    if C.ndim == 3:
        put_mat(C, p, mlin(1.0, mat(C, p, L_bar), 1.0, L_bar))
    else:
        put_mat(L, p, L_bar)


@kernel
def within(U, A, V):
    """U^T A V."""
    return mm(transpose(U), mm(A, V))


@kernel
def back(U, X, V):
    """U X V^T."""
    return mmt(mm(U, X), V)


@kernel
def stress_vjp(s, T, law, sums, c):
    """U^T F_bar V of T = U^T tau_bar U; the bars of the moduli join the sums of chunk c."""
    alone = units(law)
    for k in range(len(alone)):
        sums[c, k] += dot(diagonal(T), kirchhoff_hat(s, alone[k]))
    return kirchhoff_vjp(s, T, law)


@kernel
def pressure_vjp(J, tau_bar, law, sums, c):
    """J_bar; the bars of the moduli join the sums of chunk c."""
    alone = units(law)
    for k in range(len(alone)):
        sums[c, k] += tau_bar * pressure(J, alone[k])
    return tau_bar * d_pressure(J, law)


@kernel
def add(sums, c, parameters):
    """Add the bars of all parameters to the sums of chunk c."""
    for k in range(len(parameters)):
        sums[c, k] += parameters[k]


@kernel
def quotients(s, s_new, share, flow):
    """Difference quotients of a return map s -> s_new for every pair, which `mixed` takes."""
    if len(s) == 2:
        return (_quotients(s, s_new, 0, 1, share, flow),)
    else:
        return (_quotients(s, s_new, 0, 1, share, flow),
                _quotients(s, s_new, 0, 2, share, flow),
                _quotients(s, s_new, 1, 2, share, flow))


@kernel
def _quotients(s, s_new, i, j, share, flow):
    total = s[i] + s[j]
    skew = (s_new[i] + s_new[j]) / total if total > UNDETERMINED * s[0] else 0.0
    return gap_ratio(s, s_new, i, j, share, flow), skew


@parallel
def _fluid(step, bars, law, like):
    for c in prange(CHUNKS):
        fluid_vjp(step, bars, law, like, c)


@parallel
def _elastic(step, bars, law, like):
    for c in prange(CHUNKS):
        elastic_vjp(step, bars, law, like, c)


@parallel
def _plastic(step, bars, law, flow, like):
    for c in prange(CHUNKS):
        plastic_vjp(step, bars, law, flow, like, c)


@parallel
def _initial_stress(step, bars, law, flow, like):
    for c in prange(CHUNKS):
        initial_stress_vjp(step, bars, law, flow, like, c)


@parallel
def initial_pressure(J, bars, law, sums):
    """Adjoint of `deform.initial_pressure`: adds to bars.F (N,)."""
    for c in prange(CHUNKS):
        initial_pressure_vjp(J, bars, law, sums, c)
