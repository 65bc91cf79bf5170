"""A code that leaves its gradients to automatic differentiation agrees with a golden file, stage by
stage: what a stage hands on keeps its gradient, and what several stages read is copied for each.
"""

import numpy as np
import pytest
from adjoint_runs import splash
from goldens_adjoint import STEP, problem_of, strained
from problems import DX

from mpm_ref import oracle
from mpm_ref.core.boundary import BoxWalls, Conditions
from mpm_ref.oracle import adjoint_recording, recording
from tests.adjoint.test_torch import fluid, jelly, nodes_and_weights

torch = pytest.importorskip("torch")

LOW, HIGH, SIDE = 4, 7, 40
FIELDS = ("x", "v", "C", "F")


def walled(problem):
    """A problem of one body with sticking walls."""
    d = problem.dim
    walls = Conditions(walls=BoxWalls((LOW,) * d, (HIGH,) * d))
    return type(problem)(problem.bodies[-1:], DX, problem.clock, problem.gravity, problem.scheme,
                         walls)


CASES = {"jelly 2d": (lambda: walled(strained(2)), jelly),
         "fluid 3d": (lambda: walled(problem_of(splash())), fluid)}


class Kept:
    """Tensors whose gradients are wanted, by the names of the golden file."""

    def __init__(self):
        self.tensors = {}

    def __call__(self, name, tensor):
        """A copy of the tensor: its gradient is that of what reads the copy."""
        self.tensors[name] = copy = tensor.clone()
        copy.retain_grad()
        return copy


def on_nodes(a, flat):
    """Sums over the pairs (N, S, ..) at each node."""
    out = torch.zeros(SIDE**flat[1], *a.shape[2:])
    return out.index_add(0, flat[0], a.reshape(-1, *a.shape[2:]))


def step(q, law, gravity, kirchhoff, keep):
    """x, v, C, F after a step of MLS-MPM; `q` are leaves, `keep` names what is in between."""
    x, d, D_inv = keep("x_g2p", q["x"]), q["x"].shape[1], 4 / DX**2
    tau = keep("tau", kirchhoff(q["F"], law))
    index, w, r = nodes_and_weights(q["x"])
    flat = (index * torch.tensor([SIDE**a for a in range(d)])).sum(2).reshape(-1), d
    full = tau[:, None, None] * torch.eye(d) if tau.ndim == 1 else tau
    carried = q["v"][:, None] + torch.einsum("pab,pkb->pka", q["C"], r)
    m = keep("mass", on_nodes(w * q["m"][:, None], flat))
    mv = keep("momentum", on_nodes((w * q["m"][:, None])[..., None] * carried, flat))
    pushed = D_inv * q["V0"][:, None, None] * torch.einsum("pab,pkb->pka", full, r)
    f = keep("force", on_nodes(-w[..., None] * pushed, flat))
    safe = torch.where(m > 0, m, torch.ones_like(m))[:, None]
    v = keep("velocity", (mv + STEP * f) / safe + STEP * gravity)
    node = torch.stack([torch.arange(SIDE**d) // SIDE**a % SIDE for a in range(d)], 1)
    stop = ((node < LOW) & (v < 0)) | ((node > HIGH) & (v > 0))
    v = keep("velocity_bc", torch.where(stop, torch.zeros_like(v), v))
    index, w, r = nodes_and_weights(x)
    u = v[flat[0]].reshape(*w.shape, d)
    new = (w[..., None] * u).sum(1)
    C = D_inv * torch.einsum("pk,pka,pkb->pab", w, u, r)
    growth = torch.eye(d) + STEP * keep("L", C)
    F = keep("F_strain", q["F"])
    F = torch.det(growth) * F if F.ndim == 1 else keep("F_trial", growth @ F)
    return (x + STEP * new, new, C, F), (m, node)


@pytest.mark.usefixtures("doubles_by_default", "one_torch_thread")
@pytest.mark.parametrize("case", CASES)
def test_automatic_gradients_agree(case, tmp_path):
    make, kirchhoff = CASES[case]
    problem = make()
    oracle.record_adjoint(problem, tmp_path / "golden.h5", 1)
    body, = recording.copy_problem(problem, 1).bodies
    seed = adjoint_recording.draw_seeds(problem, body, STEP, 0)
    q = {name: torch.tensor(getattr(body.particles, name), requires_grad=True)
         for name in (*FIELDS, "m", "V0")}
    law = torch.tensor(np.array(body.law), requires_grad=True)
    gravity, keep = torch.tensor(problem.gravity, requires_grad=True), Kept()
    after, (m, node) = step(q, law, gravity, kirchhoff, keep)
    sum((a * torch.tensor(getattr(seed, n))).sum() for n, a in zip(FIELDS, after)).backward()

    full = (m > 0).numpy()
    found = {f"{name}_grad": a.grad.numpy() for name, a in (keep.tensors | q).items()}
    found = {name: a[full] if len(a) == len(full) else a for name, a in found.items()}
    found |= {"law_grad": law.grad.numpy(), "gravity_grad": gravity.grad.numpy(),
              "nodes": node.numpy()[full]}
    oracle.write(tmp_path / "other.h5", [found])
    report = oracle.check(tmp_path / "golden.h5", tmp_path / "other.h5")
    assert report.agrees, str(report)
    assert not [name for name in report.missing if name.endswith("_grad")]
