"""Advance MLS-MPM in 2D by one step: the "other code" that check_my_backend.py checks."""

import numpy as np

GRID = 16                       # nodes per axis, the first one at the origin
GRAVITY = np.array([0.0, -9.8])
E, NU, FLOOR = 1e5, 0.3, 0.1    # of golden.toml
MU, LAM = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))
OFFSETS = np.array([(i, j) for i in range(3) for j in range(3)])


def step(s, dx, dt):
    """Advance the particles s in place by one step and return the stages for `oracle.write`."""
    stages, real = {}, s["x"].dtype
    dx, dt, inverse_D = real.type(dx), real.type(dt), real.type(4 / dx**2)
    m, V0 = s["m"][:, None], s["V0"][:, None, None]
    stages["base"] = base = np.floor(s["x"] / dx - real.type(0.5)).astype(int)
    f = s["x"] / dx - base.astype(real)
    per_axis = np.stack([(1.5 - f) ** 2 / 2, 0.75 - (f - 1) ** 2, (f - 0.5) ** 2 / 2])
    stages["weights"] = w = per_axis[OFFSETS[:, 0], :, 0].T * per_axis[OFFSETS[:, 1], :, 1].T
    r = (OFFSETS[None].astype(real) - f[:, None]) * dx
    at = tuple(np.moveaxis(base[:, None] + OFFSETS, -1, 0))

    tau = kirchhoff(s["F"])
    mass, momentum, force = (np.zeros((GRID, GRID, *k), real) for k in ((), (2,), (2,)))
    np.add.at(mass, at, w * m)
    carried = s["v"][:, None] + np.einsum("pab,psb->psa", s["C"], r)
    np.add.at(momentum, at, (w * m)[..., None] * carried)
    np.add.at(force, at, -w[..., None] * np.einsum("pab,psb->psa", V0 * inverse_D * tau, r))
    v = (momentum + dt * force) / np.where(mass > 0, mass, 1)[..., None]
    v += (dt * GRAVITY).astype(real)
    stages |= {"origin": (0, 0), "mass": mass, "momentum": momentum, "force": force}
    stages["velocity"] = v.copy()
    v[:, np.arange(GRID) * dx <= FLOOR * (1 + 1e-6), 1] = 0
    stages["velocity_bc"] = v

    s["v"] = np.einsum("ps,psa->pa", w, v[at])
    s["C"] = np.einsum("ps,psa,psb->pab", w, v[at], r) * inverse_D
    s["x"] = s["x"] + dt * s["v"]
    s["F"] = (np.eye(2, dtype=real) + dt * s["C"]) @ s["F"]
    return stages | {name: s[name] for name in "xvCF"} | {"tau": kirchhoff(s["F"])}


def kirchhoff(F):
    """Return the fixed corotated stress tau = 2 mu (F - R) F^T + lam (J - 1) J I."""
    U, _, Vt = np.linalg.svd(F)
    J = np.linalg.det(F)[:, None, None]
    return 2 * MU * (F - U @ Vt) @ F.swapaxes(1, 2) + LAM * (J - 1) * J * np.eye(2, dtype=F.dtype)
