"""Return maps in principal stretches, for the laws of `laws`.

F_trial = U diag(s) V^T becomes U diag(s_new) V^T. A map takes s (N, d), the history y (N,) or
None, dt, the law's and the flow's parameters, and returns s_new and y. e = log s is the principal
strain, e_hat its deviator; parameters are those of the classes in `materials`.
"""

import numpy as np

from .laws import volume
from .tensors import compose, svd


def no_flow(s, y, dt, law, flow):
    """Elastic (NCLAW-eq13)."""
    return s, y


def drucker_prager(s, y, dt, law, flow):
    """Tension: s = 1; outside of the cone: back to it at constant volume (NSF-F3, NCLAW-eq16)."""
    s = np.maximum(s, flow.s_min) if flow.s_min > 0 else s
    e, e_hat, size = strain(s)
    tr, d = e.sum(axis=1, keepdims=True), s.shape[1]
    dgamma = size + flow.alpha * (d * law.lam + 2 * law.mu) / (2 * law.mu) * tr
    on_cone = np.exp(e - dgamma * direction(e_hat, size))
    return np.where(tr > 0, 1, np.where(dgamma > 0, on_cone, s)), y


def von_mises(s, y, dt, law, flow):
    """Back to |e_hat| = tau_y/(2 mu) (NCLAW-eq19)."""
    return radial_return(s, flow.tau_y, law, flow)[0], y


def hardening(s, y, dt, law, flow):
    """The same with the particle's own yield stress y, which grows by 2 mu xi dgamma (NSF-F4)."""
    s, dgamma = radial_return(s, y[:, None], law, flow)
    return s, y + 2 * law.mu * flow.xi * dgamma[:, 0]


def softening(s, y, dt, law, flow):
    """The same with y falling by theta dgamma; at y = 0 the strain is released (NSF-F4)."""
    s, dgamma = radial_return(s, y[:, None], law, flow)
    y = np.maximum(y - flow.theta * dgamma[:, 0], 0)
    return np.where(y[:, None] > 0, s, 1), y


def herschel_bulkley(s, y, dt, law, flow):
    """|dev tau| beyond tau_y relaxes over dt, at constant volume (NSF-F5)."""
    scale = volume(s) ** (2 / s.dtype.type(s.shape[1]))
    b = s * s / scale
    D = deviator(b)
    size = law.mu * norm(D)
    relaxed = size - (size - flow.tau_y) / (1 + flow.eta / (2 * law.mu * dt))
    D = D * (relaxed / np.where(size > 0, size, 1))
    return np.where(size > flow.tau_y, np.sqrt(scale * (D + unimodular(D))), s), y


def unimodular(D):
    """The c with prod(D_k + c) = 1 and all D_k + c > 0, (N, 1): bisection, to the last bit."""
    low = -D.min(axis=1, keepdims=True)
    high = low + 1
    for _ in range(2 * np.finfo(D.dtype).nmant):
        middle = (low + high) / 2
        below = volume(D + middle) < 1
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2


def fluid_projection(s, y, dt, law, flow):
    """All s = J^(1/d) (NCLAW-eq21)."""
    return volume(s) ** (1 / s.dtype.type(s.shape[1])) * np.ones_like(s), y


def snow_clamp(s, y, dt, law, flow):
    """Singular values kept in [s_min, s_max] (HOT-material)."""
    return np.clip(s, flow.s_min, flow.s_max), y


def fixed_corotated_von_mises(s, y, dt, law, flow):
    """dev tau = 2 mu dev x, x = s (s - 1), is scaled to the surface at frozen J (HOT-vonmises)."""
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
    """x - mean(x) of each row."""
    return x - x.sum(axis=1, keepdims=True) / x.shape[1]


def norm(x):
    """Length of each row, (N, 1)."""
    return np.sqrt((x * x).sum(axis=1, keepdims=True))


def direction(x, size):
    """x / size, 0 for x = 0."""
    return x / np.where(size > 0, size, 1)


def strain(s):
    """Principal strains, their deviators, and the size of these."""
    e = np.log(s)
    e_hat = deviator(e)
    return e, e_hat, norm(e_hat)


def radial_return(s, tau_y, law, flow):
    """s on the surface |e_hat| = tau_y/(2 mu), or s inside of it; and the plastic strain dgamma."""
    e, e_hat, size = strain(np.maximum(s, flow.s_min) if flow.s_min > 0 else s)
    dgamma = np.maximum(size - tau_y / (2 * law.mu), 0)
    returned = np.exp(e - dgamma * direction(e_hat, size))
    return np.where(dgamma > 0, returned, s), dgamma


def in_type(parameters, real):
    """The same parameters in another floating type."""
    return type(parameters)(*map(real, parameters))


def project(F, y, dt, law, flow):
    """F (N, d, d) and y after the return map; a fluid's J (N,) has none."""
    name = type(flow).__name__
    if name == "NoFlow" or F.ndim == 1:
        return F, y
    real = F.dtype.type
    U, s, V = svd(F)
    s, y = FLOWS[name](s, y, real(dt), in_type(law, real), in_type(flow, real))
    return compose(U, s, V), y


def intact(y, flow):
    """1, or 0 where a softening material has failed (N,)."""
    return (y > 0).astype(y.dtype) if type(flow).__name__ == "Softening" else np.ones_like(y)
