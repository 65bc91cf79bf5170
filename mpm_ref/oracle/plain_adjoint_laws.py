"""Bars of stress and return map in any floating type, by another way than the kernels'.

In principal axes F = U diag(s) V^T both are functions of s and, for each pair of axes, quotients:

    F' = U diag(s') V^T     dF'_kl = a (X_kl + X_lk)/2 + b (X_kl - X_lk)/2,  X = U^T dF V
                            a = (s'_k - s'_l)/(s_k - s_l),  b = (s'_k + s'_l)/(s_k + s_l)
    tau = U diag(t) U^T     dtau_kl = c (s_l X_kl + s_k X_lk),
                            c = (t_k - t_l)/(s_k - s_l)/(s_k + s_l)

What depends on s, on the history and on parameters alone is differentiated by complex steps. A bar
is the gradient of a loss by the field of the same name; parameters have one for each particle.
"""

from typing import NamedTuple

import numpy as np

from ..plain.flows import FLOWS, cast, intact
from ..plain.laws import energy_and_stress, volume
from ..plain.tensors import svd
from .differential import COMPLEX, NEAR, TINY, derivatives, mean_slope

ROOM = 64       # units of round-off by which a quotient and its mean may differ


class Returned(NamedTuple):
    """Bars before a return map."""

    F: np.ndarray           # (N, d, d)  of F_trial
    y: np.ndarray | None    # (N,)       of the history, where there is one
    law: tuple              # of (N,), in the order of the law's parameters
    flow: tuple             # of (N,), in the order of the flow's


class Stressed(NamedTuple):
    """Bars of what a stress is computed from."""

    F: np.ndarray           # (N, d, d), or (N,) of J
    law: tuple              # of (N,)


def of_return(q, F_trial, dt, F_bar, y_bar):
    """`Returned` from the bars F_bar (N, d, d) and y_bar (N,) or None after the return map of the
    particles q, whose history is that before the step.
    """
    none = np.zeros(len(F_trial), F_trial.dtype)
    if type(q.flow).__name__ == "NoFlow":
        return Returned(F_bar, y_bar, tuple(none for _ in q.law), ())
    U, s, V = svd(F_trial)
    X = within(U, F_bar, V)
    bars = np.einsum("paa->pa", X), none if y_bar is None else y_bar

    def change(s, y, law, flow):
        s, y = returned(s, y, dt, law, flow)
        along = (bars[0] * s.imag).sum(axis=1) + (0 if y is None else bars[1] * y.imag)
        return along / s.real.dtype.type(TINY)

    at = s, q.y, q.law, q.flow
    s_bar = np.stack([change(nudged(s, k), *at[1:]) for k in range(s.shape[1])], axis=1)
    y_new_bar = None if y_bar is None else change(whole(s), nudged(q.y), *at[2:])
    of_law, of_flow = (parameters(change, at, place) for place in (2, 3))
    Y = across(X, s, returned(whole(s), q.y, dt, q.law, q.flow)[0].real,
               divided(lambda s: returned(s, q.y, dt, q.law, q.flow)[0], s))
    return Returned(within(np.swapaxes(U, 1, 2), on_diagonal(Y, s_bar), np.swapaxes(V, 1, 2)),
                    y_new_bar, of_law, of_flow)


def parameters(change, at, place):
    """The changes by each parameter of the record at `place`, law or flow."""
    s, record = whole(at[0]), at[place]
    out = []
    for k in range(len(record)):
        moved = list(map(s.dtype.type, record))
        moved[k] += s.real.dtype.type(TINY) * 1j
        out.append(change(s, *at[1:place], type(record)(*moved), *at[place + 1:]))
    return tuple(out)


def of_stress(F, y, material, tau_bar):
    """`Stressed` from the bar of the stress of F, of a material (law, flow) with history y."""
    law, flow = material
    if F.ndim == 1:
        return of_pressure(F, law, tau_bar)
    U, s, V = svd(F)
    T = within(U, tau_bar, U)
    T = T if y is None else T * intact(y, flow)[:, None, None]
    diagonal = np.einsum("paa->pa", T)
    c = divided(lambda s: energy_and_stress(s, law)[1], s) / (s[:, :, None] + s[:, None, :])
    Y = (T + np.swapaxes(T, 1, 2)) * c * s[:, None, :]
    A = derivatives(lambda s: energy_and_stress(s, law)[1], s)
    Y = on_diagonal(Y, np.einsum("pk,pkl->pl", diagonal, A))
    out = within(np.swapaxes(U, 1, 2), Y, np.swapaxes(V, 1, 2))
    return Stressed(out, tuple((diagonal * a).sum(axis=1) for a in by_moduli(s, law)))


def of_pressure(J, law, tau_bar):
    """The same of a fluid, of which J (N,) is carried; tau is isotropic."""
    slope = energy_and_stress(nudged(J[:, None]), law)[1][:, 0].imag / J.dtype.type(TINY)
    return Stressed(tau_bar * slope,
                    tuple(tau_bar * a[:, 0] for a in by_moduli(J[:, None], law)))


def by_moduli(s, law):
    """The derivatives of the principal stresses by each modulus of the law, (N, d) each."""
    step, z = s.dtype.type(TINY), whole(s)
    moved = [list(map(z.dtype.type, law)) for _ in law]
    for k, moduli in enumerate(moved):
        moduli[k] += step * 1j
    return [energy_and_stress(z, type(law)(*moduli))[1].imag / step for moduli in moved]


def returned(s, y, dt, law, flow):
    """Complex s and y after the return map of `plain.flows`."""
    real = s.dtype.type
    s_new, y = FLOWS[type(flow).__name__](s, y, real(dt), cast(law, real), cast(flow, real))
    if type(flow).__name__ == "HerschelBulkley":
        s_new = at_volume(s_new, s)
    return s_new, y


def at_volume(s_new, s):
    """s_new with the volume of s: one Newton step in a shift of all s_new^2, since the bisection of
    the return map does not see imaginary parts.
    """
    b = s_new * s_new
    slope = sum(volume(np.delete(b, k, axis=1)) for k in range(b.shape[1]))
    return np.sqrt(b + (volume(s * s) - volume(b)) / slope)


def whole(a):
    """Real numbers as complex ones; None stays."""
    return None if a is None else a.astype(COMPLEX[a.dtype])


def nudged(a, k=None):
    """Complex numbers a step away: in all entries, or in column k."""
    out = whole(a)
    out[... if k is None else (slice(None), k)] += a.dtype.type(TINY) * 1j
    return out


def divided(f, s):
    """(f_k - f_l)/(s_k - s_l) of an isotropic f (N, d, d), the diagonal unused.

    Of near stretches the mean slope between them, unless the quotient shows it to be wrong: a
    return map may have a kink on that way.
    """
    out, here, d = np.zeros((*s.shape, s.shape[1]), s.dtype), f(whole(s)).real, s.shape[1]
    for k, l in zip(*np.tril_indices(d, -1)):
        gap = s[:, k] - s[:, l]
        far = (here[:, k] - here[:, l]) / np.where(gap == 0, 1, gap)
        mean = mean_slope(f, s, k, l)
        off = ROOM * np.finfo(s.dtype).eps * abs(here).max(axis=1)
        near = (abs(gap) < NEAR) & ((gap == 0) | (abs((mean - far) * gap) <= off))
        out[:, k, l] = out[:, l, k] = np.where(near, mean, far)
    return out


def across(X, s, s_new, a):
    """a (X_kl + X_lk)/2 + b (X_kl - X_lk)/2 of all pairs."""
    X_T = np.swapaxes(X, 1, 2)
    b = (s_new[:, :, None] + s_new[:, None, :]) / (s[:, :, None] + s[:, None, :])
    return a * (X + X_T) / 2 + b * (X - X_T) / 2


def on_diagonal(A, diagonal):
    """A with another diagonal."""
    axis, out = np.arange(A.shape[1]), A.copy()
    out[:, axis, axis] = diagonal
    return out


def within(U, A, V):
    """U^T A V."""
    return np.einsum("pba,pbc,pcd->pad", U, A, V)
