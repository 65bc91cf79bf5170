"""Plastic flow as return maps in principal stretches, for the laws of `laws`.

A step first deforms a material elastically, to F_trial = U diag(s) V^T. The return map moves the
stretches s back to where the yield condition admits them, s', and F = U diag(s') V^T is the elastic
deformation gradient after the step. All maps have the same form:

    s' (N, d), y' (N,) = map(s, y, dt, law, flow)

with the plastic history y (None for materials that have none), dt [s] and the parameters of the
law and of the flow, records of `mpm_ref.materials`. Most maps work on the principal strains
e_k = log s_k and their deviator e_hat = e - mean(e).
"""

import numpy as np

from .laws import volume
from .tensors import compose, svd


def no_flow(s, y, dt, law, flow):
    """s' = s: an elastic material (NCLAW-eq13)."""
    return s, y


def drucker_prager(s, y, dt, law, flow):
    """Sand: tension is released, and shear is limited by pressure (NSF-F3, NCLAW-eq16).

    s' = 1 in tension, sum_k e_k > 0. Otherwise, with
    dgamma = |e_hat| + alpha (d lam + 2 mu)/(2 mu) sum_k e_k, the distance outside of the cone:
    e' = e - dgamma e_hat/|e_hat| if dgamma > 0, which keeps the volume, and e' = e if not.
    """
    s = np.maximum(s, flow.s_min) if flow.s_min > 0 else s
    e, e_hat, size = principal_strains(s)
    tr, d = e.sum(axis=1, keepdims=True), s.shape[1]
    dgamma = size + flow.alpha * (d * law.lam + 2 * law.mu) / (2 * law.mu) * tr
    on_cone = np.exp(e - dgamma * unit_vectors(e_hat, size))
    return np.where(tr > 0, 1, np.where(dgamma > 0, on_cone, s)), y


def von_mises(s, y, dt, law, flow):
    """Metal: |e_hat| is limited to tau_y/(2 mu), see `radial_return` (NCLAW-eq19)."""
    return radial_return(s, flow.tau_y, law, flow)[0], y


def hardening(s, y, dt, law, flow):
    """Von Mises flow whose yield stress y grows: y' = y + 2 mu xi dgamma (NSF-F4)."""
    s, dgamma = radial_return(s, y[:, None], law, flow)
    return s, y + 2 * law.mu * flow.xi * dgamma[:, 0]


def softening(s, y, dt, law, flow):
    """Von Mises flow whose yield stress falls: y' = max(y - theta dgamma, 0) (NSF-F4).

    At y' = 0 the material has failed and its strain is released, s' = 1.
    """
    s, dgamma = radial_return(s, y[:, None], law, flow)
    y = np.maximum(y - flow.theta * dgamma[:, 0], 0)
    return np.where(y[:, None] > 0, s, 1), y


def herschel_bulkley(s, y, dt, law, flow):
    """Paste: |dev tau| above tau_y relaxes over dt, at constant volume (NSF-F5).

    With b_k = s_k^2 J^(-2/d) and its deviator D, |dev tau| = mu |D| becomes
    mu |D| - (mu |D| - tau_y)/(1 + eta/(2 mu dt)), and b' = D' + c with det b' = 1.
    """
    scale = volume(s) ** (2 / s.dtype.type(s.shape[1]))
    b = s * s / scale
    D = deviator(b)
    size = law.mu * norm(D)
    relaxed = size - (size - flow.tau_y) / (1 + flow.eta / (2 * law.mu * dt))
    D = D * (relaxed / np.where(size > 0, size, 1))
    return np.where(size > flow.tau_y, np.sqrt(scale * (D + unimodular_shift(D))), s), y


def unimodular_shift(D):
    """Return the c (N, 1) with prod_k (D_k + c) = 1 and all D_k + c > 0, for D (N, d).

    Bisection to the last bit.
    """
    low = -D.min(axis=1, keepdims=True)
    high = low + 1
    for _ in range(2 * np.finfo(D.dtype).nmant):
        middle = (low + high) / 2
        below = volume(D + middle) < 1
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2


def fluid_projection(s, y, dt, law, flow):
    """s'_k = J^(1/d): a fluid keeps its volume and forgets its shape (NCLAW-eq21)."""
    return volume(s) ** (1 / s.dtype.type(s.shape[1])) * np.ones_like(s), y


def snow_clamp(s, y, dt, law, flow):
    """s'_k = min(max(s_k, s_min), s_max) (HOT-material)."""
    return np.clip(s, flow.s_min, flow.s_max), y


def fixed_corotated_von_mises(s, y, dt, law, flow):
    """Limit |dev tau| of the fixed corotated law to tau_y, at frozen J (HOT-vonmises).

    dev tau = 2 mu x_hat with x_k = s_k (s_k - 1) and its deviator x_hat. If |x_hat| is larger than
    tau_y/(2 mu), x_hat is scaled to that length, and s'_k = (1 + sqrt(1 + 4 x'_k))/2.
    """
    x = s * s - s
    x_hat = deviator(x)
    size, radius = norm(x_hat), flow.tau_y / (2 * law.mu)
    x = x - x_hat + x_hat * (radius / np.where(size > 0, size, 1))
    return np.where(size > radius, (1 + np.sqrt(1 + 4 * x)) / 2, s), y


FLOWS = {
    "NoFlow": no_flow,
    "DruckerPrager": drucker_prager,
    "VonMises": von_mises,
    "Hardening": hardening,
    "Softening": softening,
    "HerschelBulkley": herschel_bulkley,
    "FluidProjection": fluid_projection,
    "SnowClamp": snow_clamp,
    "FixedCorotatedVonMises": fixed_corotated_von_mises,
}


def deviator(x):
    """Return x - mean(x) of each row of x (N, d)."""
    return x - x.sum(axis=1, keepdims=True) / x.shape[1]


def norm(x):
    """Return the Euclidean length (N, 1) of each row of x (N, d)."""
    return np.sqrt((x * x).sum(axis=1, keepdims=True))


def unit_vectors(x, size):
    """Return x / size, the directions of the rows of x (N, d) with lengths size; 0 for x = 0."""
    return x / np.where(size > 0, size, 1)


def principal_strains(s):
    """Return e = log s (N, d), its deviator e_hat (N, d) and the size |e_hat| (N, 1)."""
    e = np.log(s)
    e_hat = deviator(e)
    return e, e_hat, norm(e_hat)


def radial_return(s, tau_y, law, flow):
    """Return s' on the surface |e_hat| = tau_y/(2 mu), or s inside of it; and dgamma (N, 1).

    dgamma = max(|e_hat| - tau_y/(2 mu), 0) is the plastic strain of the step, and
    e' = e - dgamma e_hat/|e_hat|.
    """
    e, e_hat, size = principal_strains(np.maximum(s, flow.s_min) if flow.s_min > 0 else s)
    dgamma = np.maximum(size - tau_y / (2 * law.mu), 0)
    returned = np.exp(e - dgamma * unit_vectors(e_hat, size))
    return np.where(dgamma > 0, returned, s), dgamma


def cast(parameters, real):
    """Return a record of parameters with its numbers in the floating type `real`."""
    return type(parameters)(*map(real, parameters))


def return_map(F, y, dt, law, flow):
    """F = U diag(s') V^T and y' from F_trial (N, d, d) and y (N,), by the map of the flow.

    A fluid, which carries J (N,) alone, is returned as it is.
    """
    name = type(flow).__name__
    if name == "NoFlow" or F.ndim == 1:
        return F, y
    real = F.dtype.type
    U, s, V = svd(F)
    s, y = FLOWS[name](s, y, real(dt), cast(law, real), cast(flow, real))
    return compose(U, s, V), y


def intact(y, flow):
    """Return 1 where a material carries stress, and 0 where a softening one has failed (N,)."""
    return (y > 0).astype(y.dtype) if type(flow).__name__ == "Softening" else np.ones_like(y)
