"""Advance APIC in 2D by a backward Euler step; check_my_implicit_backend.py checks this code.

It uses Newton's method with a dense projected Hessian, without multigrid.
"""

import numpy as np

GRAVITY = np.array([0.0, -9.8])
E, NU, FLOOR = 1e5, 0.3, 0.1    # of golden_implicit.toml
MU, LAM = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))
XI = np.sqrt(8 * MU**2 + (2 * MU + 2 * LAM) ** 2)      # ||dP/dF|| at rest (HOT-sec5.2)
OFFSETS = np.array([(i, j) for i in range(3) for j in range(3)])


class Step:
    """One step of the particles s = {x, v, C, F, m, V0} on a list of nodes."""

    def __init__(self, s, dx, dt):
        self.s, self.dx, self.dt = s, dx, dt
        self.base = np.floor(s["x"] / dx - 0.5).astype(int)
        f = s["x"] / dx - self.base
        n = np.stack([(1.5 - f) ** 2 / 2, 0.75 - (f - 1) ** 2, (f - 0.5) ** 2 / 2])
        dn = np.stack([f - 1.5, -2 * (f - 1), f - 0.5]) / dx
        i, j = OFFSETS.T
        self.w = n[i, :, 0].T * n[j, :, 1].T
        self.dw = np.stack([dn[i, :, 0] * n[j, :, 1], n[i, :, 0] * dn[j, :, 1]], -1).swapaxes(0, 1)
        self.r = (OFFSETS - f[:, None]) * dx
        stencils = (self.base[:, None] + OFFSETS).reshape(-1, 2)
        self.nodes, at = np.unique(stencils, axis=0, return_inverse=True)
        self.at = at.reshape(self.w.shape)
        self.to_grid()
        self.fixed = np.zeros((len(self.nodes), 2), bool)
        self.fixed[:, 1] = self.nodes[:, 1] * dx <= FLOOR * (1 + 1e-6)
        self.start = np.where(self.fixed, -self.v, 0.0)      # slip: no velocity through the floor
        self.kappa = np.full(len(self.m), XI * 8 * dx * dt)

    def to_grid(self):
        """Compute masses and velocities of the nodes."""
        self.m, p = np.zeros(len(self.nodes)), np.zeros((len(self.nodes), 2))
        carried = self.s["v"][:, None] + np.einsum("pab,psb->psa", self.s["C"], self.r)
        np.add.at(self.m, self.at, self.w * self.s["m"][:, None])
        np.add.at(p, self.at, (self.w * self.s["m"][:, None])[..., None] * carried)
        self.momentum, self.v = p, p / self.m[:, None]

    def velocity_gradient(self, u):
        """Return sum_i u_i dw_ip^T of every particle."""
        return np.einsum("psa,psb->pab", u[self.at], self.dw)

    def deformed(self, dv):
        """Return F of every particle at an increment of the velocities."""
        return (np.eye(2) + self.dt * self.velocity_gradient(self.v + dv)) @ self.s["F"]

    def evaluate(self, dv):
        """Return E and its gradient on the free components (HOT-eq1, HOT-eq2)."""
        F, V0, m = self.deformed(dv), self.s["V0"], self.m[:, None]
        E = (m * dv**2).sum() / 2 - self.dt * (m * GRAVITY * (self.v + dv)).sum()
        T = V0[:, None, None] * pk1(F) @ self.s["F"].swapaxes(1, 2)
        g = m * (dv - self.dt * GRAVITY)
        np.add.at(g, self.at, self.dt * np.einsum("pab,psb->psa", T, self.dw))
        return E + (V0 * density(F)).sum(), np.where(self.fixed, 0.0, g)

    def hessian(self, dv):
        """Return the dense projected Hessian on the free components."""
        C, n = projected(self.deformed(dv)), len(self.m)
        G = np.einsum("psb,pbc->psc", self.dw, self.s["F"])     # dF = u_i (F^T dw_ip)^T
        K = np.einsum("p,psb,pabcd,ptd->psatc", self.dt**2 * self.s["V0"], G, C, G)
        H = np.zeros((n, 2, n, 2))
        H[np.arange(n), :, np.arange(n), :] = self.m[:, None, None] * np.eye(2)
        for p, at in enumerate(self.at):
            H[at[:, None], :, at[None, :], :] += K[p].transpose(0, 2, 1, 3)
        free = ~self.fixed.reshape(-1)
        return H.reshape(2 * n, 2 * n) * free * free[:, None]

    def minimise(self, eps):
        """Return the increment at which Newton's method converges."""
        dv, identity = self.start, np.diag(self.fixed.reshape(-1).astype(float))
        for _ in range(50):
            E, g = self.evaluate(dv)
            if np.linalg.norm(g / self.kappa[:, None]) <= eps * np.sqrt(len(g)):
                break
            p = -np.linalg.solve(self.hessian(dv) + identity, g.reshape(-1)).reshape(g.shape)
            while self.evaluate(dv + p)[0] > E + 1e-12 * abs(E):
                p /= 2
            dv = dv + p
        return dv


def step(s, dx, dt, given, eps):
    """Advance s in place by one step and return the stages for `oracle.write`.

    given: the vectors to which the golden file applies operators, by their names there.
    """
    now = Step(s, dx, dt)
    order = {tuple(i): k for k, i in enumerate(given["nodes"].tolist())}
    order = [order[tuple(i)] for i in now.nodes.tolist()]
    trial, probe = given["trial"][order], given["probe"][order].reshape(-1)
    stages = {"base": now.base, "weights": now.w, "nodes": now.nodes, "mass": now.m,
            "momentum": now.momentum, "velocity_old": now.v, "kappa": now.kappa,
            "start": now.start, "projector": np.eye(2) * ~now.fixed[:, None, :]}
    for name, dv in (("start", now.start), ("trial", trial)):
        E, stages[f"gradient_{name}"] = now.evaluate(dv)
        stages[f"E_{name}"] = np.array([E])
        stages[f"product_{name}"] = (now.hessian(dv) @ probe).reshape(-1, 2)
    u = given["probe1"]                                   # prolongation and coarse matrix R H P
    P = embedding(now.nodes, given["nodes1"])[:, None, :, None] * np.eye(2)[:, None]
    P = (P * ~now.fixed[:, :, None, None]).reshape(now.m.size * 2, -1)
    stages["nodes1"], stages["prolonged1"] = given["nodes1"], (P @ u.reshape(-1)).reshape(-1, 2)
    stages["coarse1"] = (P.T @ now.hessian(now.start) @ P @ u.reshape(-1)).reshape(-1, 2)
    stages["dv"] = now.minimise(eps)

    v = (now.v + stages["dv"])[now.at]
    s["v"] = np.einsum("ps,psa->pa", now.w, v)
    s["C"] = np.einsum("ps,psa,psb->pab", now.w, v, now.r) * 4 / dx**2
    s["x"] = s["x"] + dt * s["v"]
    s["F"] = now.deformed(stages["dv"])
    tau = pk1(s["F"]) @ s["F"].swapaxes(1, 2)
    return stages | {name: s[name] for name in "xvCF"} | {"tau": tau}


def embedding(fine, coarse):
    """Return the linear weights of nodes on those of the next coarser lattice (HOT-eq3)."""
    return np.prod(np.maximum(1 - abs(fine[:, None] / 2 - coarse), 0), axis=-1)


def rotation(F):
    """Return the polar rotations of F, and tr S."""
    a, b = F[:, 0, 0] + F[:, 1, 1], F[:, 1, 0] - F[:, 0, 1]
    r = np.hypot(a, b)
    return np.stack([a, -b, b, a], axis=1).reshape(-1, 2, 2) / r[:, None, None], r


def cofactor(F):
    """Return cof F, linear in 2D."""
    return np.stack([F[:, 1, 1], -F[:, 1, 0], -F[:, 0, 1], F[:, 0, 0]], axis=1).reshape(-1, 2, 2)


def density(F):
    """Return the fixed corotated energy psi = mu |F - R|^2 + lam/2 (J - 1)^2."""
    return MU * ((F - rotation(F)[0]) ** 2).sum(axis=(1, 2)) + LAM / 2 * (np.linalg.det(F) - 1) ** 2


def pk1(F):
    """Return P = 2 mu (F - R) + lam (J - 1) cof F."""
    J = np.linalg.det(F)[:, None, None]
    return 2 * MU * (F - rotation(F)[0]) + LAM * (J - 1) * cofactor(F)


def projected(F):
    """Return dP/dF (N, 2, 2, 2, 2) without its negative eigenvalues, from 4 x 4 matrices."""
    (R, r), J, n = rotation(F), np.linalg.det(F)[:, None], len(F)
    columns = []
    for e in np.eye(4).reshape(4, 2, 2):
        turn = (R.swapaxes(1, 2) @ e)
        spin = ((turn[:, 1, 0] - turn[:, 0, 1]) / r)[:, None, None]
        dR = spin * R @ np.array([[0.0, -1.0], [1.0, 0.0]])
        dJ = (cofactor(F) * e).sum(axis=(1, 2))[:, None, None]
        columns.append(2 * MU * (e - dR) + LAM * (dJ * cofactor(F) + (J[..., None] - 1)
                                                  * cofactor(e[None])))
    w, Q = np.linalg.eigh(np.stack([c.reshape(n, 4) for c in columns], axis=2))
    return (Q * np.maximum(w, 0)[:, None] @ Q.swapaxes(1, 2)).reshape(n, 2, 2, 2, 2)
