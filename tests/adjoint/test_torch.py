"""One step of MLS-MPM written anew in torch: its automatic gradients are those of the adjoint."""

from itertools import product

import numpy as np
import pytest
from adjoint_runs import impact, splash
from problems import DT, DX

from mpm_ref.adjoint import StepAdjoint, zero_bars, zero_sums
from mpm_ref.core.boundary import BoxWalls, Conditions
from mpm_ref.explicit import Scheme

torch = pytest.importorskip("torch")

LOW, HIGH, EPS = 4, 7, 1e-3
FIELDS = ("x", "v", "C", "F", "tau")        # what a step reads and changes


def jelly(F, law):
    """Kirchhoff stress 2 mu (F - R) F^T + lam (J - 1) J I in 2D (NCLAW-eq12)."""
    mu, lam = law
    a, b = F[:, 0, 0] + F[:, 1, 1], F[:, 1, 0] - F[:, 0, 1]
    R = torch.stack([torch.stack([a, -b], 1), torch.stack([b, a], 1)], 1)
    R = R / torch.sqrt(a**2 + b**2)[:, None, None]
    J = torch.det(F)[:, None, None]
    return 2 * mu * (F - R) @ F.mT + lam * (J - 1) * J * torch.eye(2)


def fluid(J, law):
    """lam (J - 1) J (NCLAW-eq20)."""
    return law[0] * (J - 1) * J


def nodes_and_weights(x):
    """Index (N, 3^d, d), w (N, 3^d) and r (N, 3^d, d) of the nodes around points (N, d)."""
    d = x.shape[1]
    base = torch.floor(x.detach() / DX - 0.5)
    f = x / DX - base
    w = torch.stack([(1.5 - f) ** 2 / 2, 0.75 - (f - 1) ** 2, (f - 0.5) ** 2 / 2], 2)
    k = torch.tensor(list(product(range(3), repeat=d)))
    w_ip = torch.stack([w[:, a, k[:, a]] for a in range(d)]).prod(0)
    return (base[:, None] + k).long(), w_ip, (k - f[:, None]) * DX


def torch_step(q, constants, law, gravity, kirchhoff):
    """x, v, C, F, tau after a step, of one body in walls."""
    m, V0 = constants
    x, v, C, F, tau = q
    d, D_inv = x.shape[1], 4 / DX**2
    index, w, r = nodes_and_weights(x)
    flat = (index * torch.tensor([40**a for a in range(d)])).sum(2).reshape(-1)
    full = tau[:, None, None] * torch.eye(d) if tau.ndim == 1 else tau
    Q = m[:, None, None] * C - DT * D_inv * V0[:, None, None] * full
    mv = w[..., None] * ((m[:, None] * v)[:, None] + torch.einsum("pab,pkb->pka", Q, r))
    grid_m = torch.zeros(40**d).index_add(0, flat, (w * m[:, None]).reshape(-1))
    grid_mv = torch.zeros(40**d, d).index_add(0, flat, mv.reshape(-1, d))
    u = (grid_mv[flat] / (grid_m[flat] + EPS)[:, None] + DT * gravity).reshape(*w.shape, d)
    stop = ((index < LOW) & (u < 0)) | ((index > HIGH) & (u > 0))
    u = torch.where(stop, torch.zeros_like(u), u)
    v = (w[..., None] * u).sum(1)
    L = D_inv * torch.einsum("pk,pka,pkb->pab", w, u, r)
    growth = torch.eye(d) + DT * L
    F = torch.det(growth) * F if F.ndim == 1 else growth @ F
    return x + DT * v, v, L, F, kirchhoff(F, law)


def state_of(case, rng):
    """A strained, spinning body of a run alone in walls, and the law in torch."""
    run, k, kirchhoff = (impact(), 0, jelly) if case == "jelly 2d" else (splash(), 1, fluid)
    body, d = run.bodies[k], len(run.gravity)
    q = body.particles
    q.x[:] += 0.1 * DX * rng.normal(size=q.x.shape)
    q.C[:] = rng.normal(size=q.C.shape)
    q.F[:] += 0.05 * rng.normal(size=q.F.shape)
    q.tau[:] = 1e3 * rng.normal(size=q.tau.shape)
    walls = Conditions(walls=BoxWalls((LOW,) * d, (HIGH,) * d))
    return run._replace(bodies=(body,), scheme=Scheme(mass_eps=EPS), conditions=walls), kirchhoff


@pytest.mark.usefixtures("doubles_by_default")
@pytest.mark.parametrize("case", ["jelly 2d", "fluid 3d"])
def test_gradients_equal_those_of_torch(case, rng):
    run, kirchhoff = state_of(case, rng)
    body, bar = run.bodies[0], zero_bars(run.bodies[0])
    q, sums = body.particles, zero_sums(body)
    seeds = {name: rng.normal(size=getattr(q, name).shape) for name in FIELDS}
    seeds["tau"] *= 1e-4
    for name in FIELDS:
        getattr(bar, name)[:] = seeds[name]
    of_gravity = StepAdjoint(run.stepper()).pull_back([body], [bar], [sums], 0.0, DT)
    ours = [getattr(bar, n) for n in (*FIELDS, "m", "V0")] + [sums.sum(axis=0), of_gravity]

    given = [getattr(q, n) for n in (*FIELDS, "m", "V0")] + [np.array(body.law), run.gravity]
    leaves = [torch.tensor(a, requires_grad=True) for a in given]
    after = torch_step(leaves[:5], leaves[5:7], leaves[7], leaves[8], kirchhoff)
    sum((a * torch.tensor(seeds[n])).sum() for n, a in zip(FIELDS, after)).backward()
    for a, leaf in zip(ours, leaves):
        theirs = leaf.grad.numpy()
        assert abs(theirs).max() > 0.0
        assert abs(a - theirs).max() <= 1e-10 * abs(theirs).max()
