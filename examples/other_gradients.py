"""Compute the adjoint of the step of other_code.py by hand; check_my_gradients.py checks it."""

import numpy as np
from other_code import FLOOR, GRAVITY, GRID, LAM, MU, OFFSETS, step


def pull_back(s, seed, dx, dt):
    """Return the gradients of sum <seed, state after a step of the state s> for `oracle.write`."""
    done, D_inv, eye = step(dict(s), dx, dt), 4 / dx**2, np.eye(2)
    w, base, mass = done["weights"], done["base"], done["mass"]
    f = s["x"] / dx - base
    r = (OFFSETS - f[:, None]) * dx
    dw, at = slopes(f) / dx, tuple(np.moveaxis(base[:, None] + OFFSETS, -1, 0))
    gradients = {"origin": (0, 0), "mass": mass, "F_trial_grad": seed["F"]}

    L = gradients["L_grad"] = dt * seed["F"] @ s["F"].swapaxes(1, 2)
    F = gradients["F_strain_grad"] = (eye + dt * done["C"]).swapaxes(1, 2) @ seed["F"]

    B = D_inv * (seed["C"] + L)                                 # in MLS-MPM C and L are the same
    U = (seed["v"] + dt * seed["x"])[:, None] + np.einsum("pab,psb->psa", B, r)
    v, v_i = np.zeros((GRID, GRID, 2)), done["velocity_bc"][at]
    np.add.at(v, at, w[..., None] * U)
    gradients["velocity_bc_grad"] = v.copy()
    x = seed["x"] + np.einsum("psa,psa,psb->pb", v_i, U, dw) - np.einsum(
        "ps,psa,pab->pb", w, v_i, B)
    gradients["x_g2p_grad"] = x

    v[:, np.arange(GRID) * dx <= FLOOR * (1 + 1e-6), 1] = 0     # the floor takes what goes down
    mv = v / np.where(mass > 0, mass, 1)[..., None]
    m = -((done["velocity"] - dt * GRAVITY) * mv).sum(axis=-1)
    gradients |= {"velocity_grad": v, "momentum_grad": mv, "mass_grad": m, "force_grad": dt * mv,
              "gravity_grad": dt * v[mass > 0].sum(axis=0)}

    m_p, V0, q, phi = s["m"], D_inv * s["V0"], mv[at], m[at]
    phi = phi + np.einsum("psa,psa->ps", q, s["v"][:, None] + np.einsum(
        "pab,psb->psa", s["C"], r))
    tau, mean = kirchhoff(s["F"]), np.einsum("ps,psa->pa", w, q)
    T = -dt * np.einsum("ps,psa,psb->pab", w, q, r)
    Q = m_p[:, None, None] * s["C"] - dt * V0[:, None, None] * tau
    pushed = m_p[:, None] * phi - dt * V0[:, None] * np.einsum("psa,pab,psb->ps", q, tau, r)
    x = x + np.einsum("ps,psa->pa", pushed, dw) - np.einsum("pab,pa->pb", Q, mean)
    tau_bar = V0[:, None, None] * T
    stress, law = stress_back(s["F"], tau_bar)
    return gradients | {
        "x_grad": x, "v_grad": m_p[:, None] * mean, "tau_grad": tau_bar, "F_grad": F + stress,
        "C_grad": np.einsum("p,ps,psa,psb->pab", m_p, w, q, r), "law_grad": law,
        "m_grad": (w * phi).sum(axis=1), "V0_grad": D_inv * (tau * T).sum(axis=(1, 2))}


def slopes(f):
    """Return dw/dx dx of the nodes (N, 9, 2), for positions f [cells] from the first of them."""
    n = np.stack([(1.5 - f) ** 2 / 2, 0.75 - (f - 1) ** 2, (f - 0.5) ** 2 / 2])
    dn = np.stack([f - 1.5, -2 * (f - 1), f - 0.5])
    a, b = OFFSETS.T
    return np.stack([dn[a, :, 0] * n[b, :, 1], n[a, :, 0] * dn[b, :, 1]], axis=-1).swapaxes(0, 1)


def rotation(F):
    """Return R of F = R S in 2D, the nearest matrix (c, -s; s, c), and |(tr F, curl F)|."""
    a, b = F[:, 0, 0] + F[:, 1, 1], F[:, 1, 0] - F[:, 0, 1]
    size = np.hypot(a, b)
    return np.moveaxis(np.array([[a, -b], [b, a]]) / size, -1, 0), size


def by_moduli(F):
    """Return the stresses of mu = 1 and of lam = 1 alone."""
    J = np.linalg.det(F)[:, None, None]
    return 2 * (F - rotation(F)[0]) @ F.swapaxes(1, 2), (J - 1) * J * np.eye(2)


def kirchhoff(F):
    """Return tau = 2 mu (F - R) F^T + lam (J - 1) J I."""
    of_mu, of_lam = by_moduli(F)
    return MU * of_mu + LAM * of_lam


def stress_back(F, T):
    """Return the gradients by F, and by mu and lam, from the gradient T by the stress."""
    (R, size), J = rotation(F), np.linalg.det(F)[:, None, None]
    turned = R @ np.array([[0.0, -1.0], [1.0, 0.0]])            # dR/d angle, and size d angle/dF
    of_angle = -(T @ F * turned).sum(axis=(1, 2)) / size
    shear = T @ F + T.swapaxes(1, 2) @ (F - R) + of_angle[:, None, None] * turned
    cofactor = np.array([[F[:, 1, 1], -F[:, 1, 0]], [-F[:, 0, 1], F[:, 0, 0]]])
    volume = np.trace(T, axis1=1, axis2=2)[:, None, None] * (2 * J - 1) * np.moveaxis(
        cofactor, -1, 0)
    return 2 * MU * shear + LAM * volume, np.array([(T * a).sum() for a in by_moduli(F)])
