"""Bars of stress and return map in any floating type, computed unlike in the kernels.

In principal axes F = U diag(s) V^T both are functions of s and, for each pair of axes, quotients:

    F' = U diag(s') V^T     dF'_kl = a (X_kl + X_lk)/2 + b (X_kl - X_lk)/2,  X = U^T dF V
                            a = (s'_k - s'_l)/(s_k - s_l),  b = (s'_k + s'_l)/(s_k + s_l)
    tau = U diag(t) U^T     dtau_kl = c (s_l X_kl + s_k X_lk),
                            c = (t_k - t_l)/(s_k - s_l)/(s_k + s_l)

What depends on s, on the history and on parameters alone is differentiated by complex steps. The
bar of a field is the gradient of the loss by it; parameters have one bar for each particle.
"""

from typing import NamedTuple

import numpy as np

from ..plain.flows import FLOWS, cast, intact
from ..plain.laws import energy_and_stress, volume
from ..plain.tensors import svd
from .differential import COMPLEX, NEAR, TINY, jacobian, mean_slope

AGREEMENT = 64  # units of round-off by which a quotient and its mean may differ


class ReturnMapBars(NamedTuple):
    """Bars of the inputs of a return map."""

    F: np.ndarray           # (N, d, d)  of F_trial
    y: np.ndarray | None    # (N,)       of the history, where there is one
    law: tuple              # of (N,), in the order of the law's parameters
    flow: tuple             # of (N,), in the order of the flow's


class StressBars(NamedTuple):
    """Bars of the inputs of a stress."""

    F: np.ndarray           # (N, d, d), or (N,) of J
    law: tuple              # of (N,)


def return_map_adjoint(q, F_trial, dt, F_bar, y_bar):
    """Return the `ReturnMapBars` from the bars F_bar (N, d, d) and y_bar (N,), or None, after it.

    The particles q have the history before the step.
    """
    none = np.zeros(len(F_trial), F_trial.dtype)
    if type(q.flow).__name__ == "NoFlow":
        return ReturnMapBars(F_bar, y_bar, tuple(none for _ in q.law), ())
    U, s, V = svd(F_trial)
    X = rotate_into(U, F_bar, V)
    bars = np.einsum("paa->pa", X), none if y_bar is None else y_bar

    def change(s, y, law, flow):
        s, y = complex_return_map(s, y, dt, law, flow)
        along = (bars[0] * s.imag).sum(axis=1) + (0 if y is None else bars[1] * y.imag)
        return along / s.real.dtype.type(TINY)

    inputs = s, q.y, q.law, q.flow
    s_bar = np.stack([change(complex_step(s, k), *inputs[1:]) for k in range(s.shape[1])], axis=1)
    y_before_bar = None if y_bar is None else change(as_complex(s), complex_step(q.y), *inputs[2:])
    law_bar, flow_bar = (parameter_bars(change, inputs, place) for place in (2, 3))
    Y = off_diagonal(X, s, complex_return_map(as_complex(s), q.y, dt, q.law, q.flow)[0].real,
                     divided_differences(
                         lambda s: complex_return_map(s, q.y, dt, q.law, q.flow)[0], s))
    Y = with_diagonal(Y, s_bar)
    F_trial_bar = rotate_into(np.swapaxes(U, 1, 2), Y, np.swapaxes(V, 1, 2))
    return ReturnMapBars(F_trial_bar, y_before_bar, law_bar, flow_bar)


def parameter_bars(change, inputs, place):
    """Return the bars (N,) of each parameter of the record inputs[place], law or flow.

    inputs = (s, y, law, flow) are the arguments of `change`.
    """
    s, record = as_complex(inputs[0]), inputs[place]
    out = []
    for k in range(len(record)):
        shifted = list(map(s.dtype.type, record))
        shifted[k] += s.real.dtype.type(TINY) * 1j
        out.append(change(s, *inputs[1:place], type(record)(*shifted), *inputs[place + 1:]))
    return tuple(out)


def stress_adjoint(F, y, material, tau_bar):
    """Return the `StressBars` from the bar of the stress of F, of a material (law, flow) with y."""
    law, flow = material
    if F.ndim == 1:
        return pressure_adjoint(F, law, tau_bar)
    U, s, V = svd(F)
    T = rotate_into(U, tau_bar, U)
    T = T if y is None else T * intact(y, flow)[:, None, None]
    diagonal = np.einsum("paa->pa", T)
    c = divided_differences(lambda s: energy_and_stress(s, law)[1], s)
    c = c / (s[:, :, None] + s[:, None, :])
    Y = (T + np.swapaxes(T, 1, 2)) * c * s[:, None, :]
    A = jacobian(lambda s: energy_and_stress(s, law)[1], s)
    Y = with_diagonal(Y, np.einsum("pk,pkl->pl", diagonal, A))
    out = rotate_into(np.swapaxes(U, 1, 2), Y, np.swapaxes(V, 1, 2))
    return StressBars(out, tuple((diagonal * a).sum(axis=1) for a in stress_by_moduli(s, law)))


def pressure_adjoint(J, law, tau_bar):
    """Return the `StressBars` of a fluid, which carries J (N,); tau_bar (N,) is isotropic."""
    slope = energy_and_stress(complex_step(J[:, None]), law)[1][:, 0].imag / J.dtype.type(TINY)
    return StressBars(tau_bar * slope,
                    tuple(tau_bar * a[:, 0] for a in stress_by_moduli(J[:, None], law)))


def stress_by_moduli(s, law):
    """Return the derivatives (N, d) of the principal stresses by each modulus of the law."""
    step, z = s.dtype.type(TINY), as_complex(s)
    shifted = [list(map(z.dtype.type, law)) for _ in law]
    for k, moduli in enumerate(shifted):
        moduli[k] += step * 1j
    return [energy_and_stress(z, type(law)(*moduli))[1].imag / step for moduli in shifted]


def complex_return_map(s, y, dt, law, flow):
    """Return complex s and y after the return map of `plain.flows`."""
    real = s.dtype.type
    s_new, y = FLOWS[type(flow).__name__](s, y, real(dt), cast(law, real), cast(flow, real))
    if type(flow).__name__ == "HerschelBulkley":
        s_new = keep_volume(s_new, s)
    return s_new, y


def keep_volume(s_new, s):
    """Return s_new with the volume of s, by one Newton step in a shift of all s_new^2.

    The bisection of the return map ignores imaginary parts.
    """
    b = s_new * s_new
    slope = sum(volume(np.delete(b, k, axis=1)) for k in range(b.shape[1]))
    return np.sqrt(b + (volume(s * s) - volume(b)) / slope)


def as_complex(a):
    """Return real numbers as complex ones; None stays."""
    return None if a is None else a.astype(COMPLEX[a.dtype])


def complex_step(a, k=None):
    """Return complex numbers, an imaginary step away from a: in all entries, or in column k."""
    out = as_complex(a)
    out[... if k is None else (slice(None), k)] += a.dtype.type(TINY) * 1j
    return out


def divided_differences(f, s):
    """(f_k - f_l)/(s_k - s_l) (N, d, d) of an isotropic f; the diagonal is 0 and unused.

    If s_k and s_l are close, the mean slope between them, unless the quotient shows it to be wrong:
    a return map may have a kink in between.
    """
    out, value, d = np.zeros((*s.shape, s.shape[1]), s.dtype), f(as_complex(s)).real, s.shape[1]
    for k, l in zip(*np.tril_indices(d, -1)):
        gap = s[:, k] - s[:, l]
        far = (value[:, k] - value[:, l]) / np.where(gap == 0, 1, gap)
        mean = mean_slope(f, s, k, l)
        off = AGREEMENT * np.finfo(s.dtype).eps * abs(value).max(axis=1)
        near = (abs(gap) < NEAR) & ((gap == 0) | (abs((mean - far) * gap) <= off))
        out[:, k, l] = out[:, l, k] = np.where(near, mean, far)
    return out


def off_diagonal(X, s, s_new, a):
    """Y_kl = a (X_kl + X_lk)/2 + b (X_kl - X_lk)/2, b = (s'_k + s'_l)/(s_k + s_l) (N, d, d)."""
    X_T = np.swapaxes(X, 1, 2)
    b = (s_new[:, :, None] + s_new[:, None, :]) / (s[:, :, None] + s[:, None, :])
    return a * (X + X_T) / 2 + b * (X - X_T) / 2


def with_diagonal(A, diagonal):
    """Return A (N, d, d) with another diagonal (N, d)."""
    axis, out = np.arange(A.shape[1]), A.copy()
    out[:, axis, axis] = diagonal
    return out


def rotate_into(U, A, V):
    """Return U^T A V (N, d, d)."""
    return np.einsum("pba,pbc,pcd->pad", U, A, V)
