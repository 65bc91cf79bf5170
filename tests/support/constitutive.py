"""The laws and flows over arrays of states: what the tests of materials and of paths share."""

from typing import NamedTuple

import numpy as np

from mpm_ref.core.jit import kernel
from mpm_ref.core.law import dpk1, intact, kirchhoff, kirchhoff_hat, pk1, project, psi
from mpm_ref.core.spectral import svd
from mpm_ref.core.tensor import mat, mmt, put_mat, put_vec, scale_columns, vec
from mpm_ref.materials import Fluid, NeoHookean, dpk1_spd, make_law, wave_modulus
from mpm_ref.materials.principal import pk1_hat

YOUNG, NU = 10.0, 0.3
STEPS = np.geomspace(1e-2, 1e-4, 5)     # of Taylor tests
EPS = 1e-13     # round-off of some dozen operations on numbers of order 1
LAW = {
    "fixed_corotated": make_law("fixed_corotated", E=YOUNG, nu=NU),
    "hencky": make_law("hencky", E=YOUNG, nu=NU),
    "neo_hookean": make_law("neo_hookean", E=YOUNG, nu=NU),
    "log_neo_hookean": make_law("log_neo_hookean", E=YOUNG, nu=NU),
    "fluid": make_law("fluid", E=YOUNG, nu=NU),
}


class Values(NamedTuple):
    """Everything a law says about N states F in the directions dF."""

    psi: np.ndarray         # (N,)
    P: np.ndarray           # (N, d, d), as all below but W
    tau: np.ndarray
    P_of_s: np.ndarray      # from pk1_hat
    tau_of_s: np.ndarray    # from kirchhoff_hat
    differential: np.ndarray
    projected: np.ndarray
    W: np.ndarray           # (N,)


@kernel
def fill_values(F_all, dF_all, law, like, out):
    for p in range(len(F_all)):
        F, dF = mat(F_all, p, like), mat(dF_all, p, like)
        U, s, V, _ = svd(F)
        out.psi[p] = psi(F, law)
        put_mat(out.P, p, pk1(F, law))
        put_mat(out.tau, p, kirchhoff(F, law))
        put_mat(out.P_of_s, p, mmt(scale_columns(U, pk1_hat(s, law)), V))
        put_mat(out.tau_of_s, p, mmt(scale_columns(U, kirchhoff_hat(s, law)), U))
        put_mat(out.differential, p, dpk1(F, dF, law))
        put_mat(out.projected, p, dpk1_spd(F, dF, law))
        out.W[p] = wave_modulus(s, law)


def evaluate(law, F, dF=None):
    """`Values` of F (.., d, d); leading axes are kept."""
    *lead, d, _ = np.shape(F)
    F = np.ascontiguousarray(np.reshape(F, (-1, d, d)), dtype=float)
    dF = np.zeros_like(F) if dF is None else np.broadcast_to(dF, (*lead, d, d))
    dF = np.ascontiguousarray(np.reshape(dF, F.shape), dtype=float)
    out = Values(*(np.empty(len(F)) if name in ("psi", "W") else np.empty_like(F)
                   for name in Values._fields))
    fill_values(F, dF, law, tuple(range(d)), out)
    return Values(*(a.reshape(*lead, *a.shape[1:]) for a in out))


@kernel
def fill_projected(s_all, y_all, dt, law, flow, out):
    for p in range(len(s_all)):
        s, y = project(vec(s_all, p, out[3]), y_all[p], dt, law, flow)
        put_vec(out[0], p, s)
        out[1][p] = y
        out[2][p] = intact(y, flow)


def returned(law, flow, s, y=0.0, dt=1.0):
    """s (N, d), y (N,) and intact (N,) after the return map."""
    s = np.ascontiguousarray(np.atleast_2d(s), dtype=float)
    y = np.full(len(s), y) if np.ndim(y) == 0 else np.asarray(y, dtype=float)
    out = np.empty_like(s), np.empty(len(s)), np.empty(len(s)), tuple(range(s.shape[1]))
    fill_projected(s, y, dt, law, flow, out)
    return out[:3]


def lame_of(law):
    """mu, lam of the small-strain limit in 3D."""
    if isinstance(law, Fluid):
        return 0.0, law.lam
    if isinstance(law, NeoHookean):
        return law.mu, law.kappa - 2.0 / 3.0 * law.mu
    return law.mu, law.lam


def rotations(rng, n, d):
    """n random proper rotations (n, d, d)."""
    Q = np.linalg.qr(rng.standard_normal((n, d, d)))[0]
    Q[:, 0] *= np.linalg.det(Q)[:, None]
    return Q


def states(rng, n, d, spread=0.3):
    """n deformation gradients with log-normal singular values and random rotations (n, d, d)."""
    s = np.exp(spread * rng.standard_normal((n, d)))
    return rotations(rng, n, d) * s[:, None, :] @ rotations(rng, n, d)


def diagonal(s):
    """Diagonal matrices (.., d, d) of s (.., d)."""
    return np.asarray(s)[..., None] * np.eye(np.shape(s)[-1])


def transpose(A):
    """A^T of the last two axes."""
    return np.swapaxes(A, -1, -2)


def deviator(x):
    """x - mean(x) along the last axis."""
    return x - x.mean(axis=-1, keepdims=True)


def rate(h, error):
    """Fitted exponent of error ~ h^rate."""
    return np.polyfit(np.log(h), np.log(error), 1)[0]


def close(a, b, scale=10.0):
    """Equal to round-off; E = 10 sets the scale of the stresses."""
    return np.abs(np.asarray(a) - b).max() <= EPS * scale


def remainders(law, F, dF):
    """Remainders of psi and P for each h of STEPS, largest over the states."""
    at = evaluate(law, F, dF)
    beyond = evaluate(law, F[:, None] + STEPS[:, None, None] * dF[:, None])
    slope = (at.P * dF).sum(axis=(1, 2))
    of_psi = np.abs(beyond.psi - at.psi[:, None] - STEPS * slope[:, None])
    of_P = beyond.P - at.P[:, None] - STEPS[:, None, None] * at.differential[:, None]
    return of_psi.max(axis=0), np.abs(of_P).max(axis=(0, 2, 3))
