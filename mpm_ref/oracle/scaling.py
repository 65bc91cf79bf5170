"""The scales of all arrays of one step, from those of its inputs."""

import numpy as np

from ..plain import transfer
from . import scales
from .plain_twin import on
from .scales import size

EPS = float(np.finfo(np.float64).eps)


def of_step(twin, before, done, contacts, errors):
    """{key: scale} of a step of a `Twin` that went from the bodies `before` to where it stands.

    done is its `Step`, contacts are those of its nodes; errors[k] has the measured errors of what
    body k brought into the step (see `scales.inputs`). Grid arrays lie over the step's box.
    """
    S = [scales.inputs(q, e, EPS) for q, e in zip(before, errors)]
    W = [scales.weights(ip, twin.method, s.x) for ip, s in zip(done.clouds, S)]
    found = on_grid(twin, before, done, contacts, (S, W))
    for k, name in enumerate(twin.names):
        new = particles(twin, before[k], done, k, (S[k], W[k], found))
        new["weights"] = W[k].w
        new["energy"] = scales.energies(twin.bodies[k], twin.method, twin.gravity, new,
                                        new.pop("psi"))
        found |= {f"{name}/{field}": a for field, a in new.items()}
    return found


def on_grid(twin, before, done, contacts, S_W):
    """Scales of the grid arrays; `swing` of mass times velocity before forces."""
    nodes, method, bodies = done.nodes, twin.method, list(zip(before, done.clouds, *S_W))
    m = np.where(nodes.m > 0, nodes.m + method.mass_eps, 1)
    v = nodes.mv / m[..., None]
    rows = [scales.to_grid(q, ip, nodes.box, method, S, W) for q, ip, S, W in bodies]
    found = {name: sum(a) for name, a in zip(("mass", "momentum", "force"), zip(*rows))}
    found["swing"] = sum(scales.swing(q, ip, nodes.box, v, (S, W)) for q, ip, S, W in bodies)
    found["velocity"] = scales.velocity(nodes, found, twin.gravity, done.dt, m)
    found["velocity_bc"] = scales.held(nodes, found["velocity"], contacts)
    return found


def particles(twin, q, done, k, S_W_grid):
    """Scales of the arrays of body k; those of its energy density under `psi`."""
    S, W, grid = S_W_grid
    ip, nodes, method, dt = done.clouds[k], done.nodes, twin.method, done.dt
    at = transfer.at(ip, nodes.box)
    v, S_v = size(nodes.v, nodes.m.ndim)[at], grid["velocity_bc"][at]
    new = {"v": scales.gathered(v, S_v, ip, W)}
    new["x"] = size(done.moved[k].x) + S.x + dt * new["v"]
    new["C"] = scales.affine(v, S_v, ip, W) / method.moment
    new["L"] = new["C"] if method.transfer == "mls" else scales.gradient(v, S_v, W)
    if method.transfer == "flip":
        new["v"] = new["v"] + method.flip * (size(q.v) + S.v + old(nodes, grid, ip, W))
    F, L = size(q.F[:, None]), size(done.moved[k].L)
    new["F_trial"] = F + S.F + dt * ((L + new["L"]) * F + L * S.F)
    F_trial = done.deformed[k].F_trial
    new["F"], new["tau"], new["psi"], *y = scales.deformation(q, F_trial, new["F_trial"], dt)
    return new | ({"y": y[0]} if y else {})


def old(nodes, grid, ip, W):
    """Scale of sum_i w_ip v_old_i, the velocity before forces (FLIP)."""
    m, at = np.where(nodes.m > 0, nodes.m, 1), transfer.at(ip, nodes.box)
    v, S_v = size(nodes.mv, nodes.m.ndim) / m, grid["swing"] / m
    return scales.gathered(v[at], S_v[at], ip, W)


def listed(found, box, nodes):
    """Scales with those of grid arrays on the given nodes (M, d), all as float64."""
    return {key: (a if "/" in key else on(a, box, nodes)).astype(float)
            for key, a in found.items()}
