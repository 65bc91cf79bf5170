"""Learn a law with a custom loss, by gradients through a whole run; this needs PyTorch.

A spinning cube falls on the floor of a box, and only its corners are observed, a few times. The
learned law has two moduli, which a network of 42 weights makes depend on the strain:

    tau = mu dev(b) + k log(J) I,    (mu, k) = UNIT exp(WIDE tanh(net(tr dev(b)^2, log J))),

with b = F F^T and J = det F. The observed motion is that of another law, fixed corotated.
`rollout.step` is a step of MPM as a function of PyTorch, so that any loss of its states will do.
"""

from math import log

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.core.boundary import Conditions, nclaw_walls
from mpm_ref.explicit import Scheme
from mpm_ref.materials import NoFlow, make_law
from mpm_ref.nclaw.batched_step import make_nodes, make_world
from mpm_ref.problem import Clock, Problem
from mpm_ref.trajectories import observed

try:
    import torch
except ModuleNotFoundError:
    raise SystemExit('this example learns with PyTorch, which is not installed: pip install '
                     '"mpm_ref[learn]", or `make learn` in the repository') from None

from mpm_ref.nclaw.train.identified_laws import IdentifiedLaw
from mpm_ref.nclaw.train.observations import trajectory_of
from mpm_ref.nclaw.train.rollout import LawPair, step

DX, DT, STEPS, OBSERVED = 0.05, 1e-3, 60, (15, 30, 45, 60)
SPACING, RHO, E, NU = 0.05, 1000.0, 1e5, 0.3        # [m], [kg/m^3], [Pa]
CORNERS = [0, 2, 6, 8, 18, 20, 24, 26]
UNIT, WIDE = 2e4, 3.0       # moduli are looked for from UNIT exp(-WIDE) to UNIT exp(WIDE) [Pa]
ROUNDS = 120                # of L-BFGS, at most


class SmallLaw(torch.nn.Module):
    """A law with two moduli that depend on the strain: F (n, 3, 3) -> tau (n, 3, 3) [Pa]."""

    def __init__(self):
        super().__init__()
        layers = torch.nn.Linear(2, 8), torch.nn.Tanh(), torch.nn.Linear(8, 2)
        self.net = torch.nn.Sequential(*layers).double()

    def moduli(self, dev, log_J):
        """Return mu and k (n,) each [Pa] from dev(b) (n, 3, 3) and log J (n,)."""
        strain = torch.stack([(dev**2).sum(dim=(1, 2)), log_J], dim=1)
        return UNIT * torch.exp(WIDE * torch.tanh(self.net(strain))).T

    def forward(self, F):
        """Return tau (n, 3, 3) [Pa] of F (n, 3, 3)."""
        b, log_J, one = F @ F.mT, torch.logdet(F), torch.eye(3, dtype=torch.float64)
        dev = b - torch.einsum("nii->n", b)[:, None, None] / 3.0 * one
        mu, k = self.moduli(dev, log_J)
        return mu[:, None, None] * dev + (k * log_J)[:, None, None] * one


def unchanged(F):
    """Return F: the return map of an elastic material."""
    return F


def thrown_cube():
    """Return the `Problem` of the cube in the box of NCLAW-sim, with the true law."""
    r = SPACING * (np.indices((3, 3, 3)).reshape(3, -1).T - 1.0)
    v = np.array((0.5, -3.0, 0.2)) + np.cross((4.0, 2.0, -6.0), r)
    V0 = np.full(len(r), SPACING**3)
    q = particles_at(r + (0.5, 0.24, 0.5), v, RHO * V0, V0)
    body = Body("cube", q, make_law("fixed_corotated", E=E, nu=NU), NoFlow(), np.arange(len(r)))
    return Problem((body,), DX, Clock(dt=DT, steps=STEPS, every=1), np.array((0.0, -9.8, 0.0)),
                   Scheme(mass_eps=1e-7, gravity_on_empty=True),
                   Conditions(walls=nclaw_walls(20, 3)), (np.full(3, 0.025), np.full(3, 0.975)))


class CornerLoss(torch.nn.Module):
    """The mean squared distance of the corners from their observations [spacings^2]."""

    def __init__(self, problem):
        super().__init__()
        self.world, self.run = make_world(problem), trajectory_of(observed(problem))

    def forward(self, law):
        """Return the loss of a law."""
        state, nodes, total = self.run.states([0]), make_nodes(self.world, 1), 0.0
        for n in range(1, STEPS + 1):
            state = step(LawPair(law, unchanged), self.world, state, nodes)
            if n in OBSERVED:
                off = state[0][0, CORNERS] - self.run.x[n, CORNERS]
                total = total + (off**2).sum(dim=1).mean() / SPACING**2
        return total / len(OBSERVED)


def learn(rounds=ROUNDS):
    """Return a trained `SmallLaw` and its losses from run to run."""
    torch.manual_seed(0)
    law, corner_loss, losses = SmallLaw(), CornerLoss(thrown_cube()), []
    search = torch.optim.LBFGS(law.parameters(), max_iter=rounds, line_search_fn="strong_wolfe")

    def closure():
        search.zero_grad()
        loss = corner_loss(law)
        loss.backward()
        losses.append(loss.item())
        return loss

    search.step(closure)
    return law, losses


def compare(law):
    """Compare a `SmallLaw` with the true law.

    Returns its mu and k [Pa] at rest, those of the true law, and the error of its stress over the
    motion, relative to that stress.
    """
    unit, rest = make_law("fixed_corotated", E=1.0, nu=NU), torch.zeros(1, dtype=torch.float64)
    F = CornerLoss(thrown_cube()).run.F.flatten(0, 1)
    with torch.no_grad():
        tau = IdentifiedLaw(unit, log(E))(F)
        moduli = law.moduli(rest[:, None, None].expand(1, 3, 3), rest).squeeze(1).tolist()
        error = (law(F) - tau).norm() / tau.norm()
    return moduli, (E * unit.mu, E * (unit.lam + 2.0 / 3.0 * unit.mu)), error.item()


if __name__ == "__main__":
    law, losses = learn()
    (mu, k), (true_mu, true_k), error = compare(law)
    print(f"loss {losses[0]:.2g} -> {losses[-1]:.2g} spacings^2, "
          f"in {len(losses)} runs with gradients")
    print(f"at rest: mu {mu:.4g} Pa, true {true_mu:.4g}; k {k:.4g} Pa, true {true_k:.4g}")
    print(f"stress over the motion of the cube: relative error {error:.1%}")
