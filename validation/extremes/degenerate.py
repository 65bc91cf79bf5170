"""Degenerate deformation: inverted or collapsed particles in a run, and return maps at the tip of
the cone, in pure expansion and far outside of the yield surface.
"""

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.energy import elastic, energy
from mpm_ref.explicit import deform_body
from mpm_ref.materials import Hencky, lame, make_flow, make_law, stiffness

from ..common.registry import experiment
from .blocks import DX, NO_GRAVITY, fixed_clock, problem, square, step_limits
from .outcome import FINISHED, UNFIT, outcome

CELLS = 4
PARTICLE = 27               # the one that is deformed
# F of one particle in the middle of a block at rest: a run must go on from it, or refuse it.
BROKEN = {
    "inverted": np.diag([1.0, -1.0]), "rank 1": np.diag([1.0, 0.0]), "zero": np.zeros((2, 2)),
    "tiny": 1e-150 * np.eye(2), "huge": 1e150 * np.eye(2), "NaN": np.full((2, 2), np.nan),
}
FINITE_ENERGY = ("inverted", "rank 1", "zero", "tiny")       # where fixed corotated has an energy


@experiment("extremes.explicit.degenerate", title="One particle with an impossible deformation",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 20})
def degenerate(run):
    """Check that fixed corotated goes on and gains no energy, and that neo-Hookean refuses and
    names the particle.
    """
    rows, scale = [], f"2D, block of {CELLS} x {CELLS} cells, one particle deformed"
    for law in ("fixed_corotated", "neo_hookean"):
        for name, F in BROKEN.items():
            end, E, J = run_with_deformed_particle(make_law(law, E=1e6, nu=0.3), F, 2000)
            rows.append((law, name, end.kind, end.step, E, J, end.message))
            if law == "fixed_corotated" and name in FINITE_ENERGY:
                record_energy(run, name, (end, E, J), scale)
            else:
                record_refusal(run, law, name, end, scale)
    run.table("runs", ("law", "F", "end", "step", "energy", "J", "message"), rows)


def record_energy(run, name, result, scale):
    """Record the energy of a run that law and scheme can continue."""
    end, E, J = result
    run.record(f"extremes.explicit.degenerate.fixed_corotated.{_id(name)}",
               E if end.kind == FINISHED else np.inf, comparator="<=", bound=1.0 + 1e-9,
               scale=f"{scale}, {end.step} steps",
               note=f"final over initial energy. The particle's J ends at {J:.3g}: "
                    "the law would turn it back, but F <- (I + dt L) F cannot change J's sign, "
                    "nor bring back a J of zero, while det(I + dt L) > 0: a particle that is "
                    "inverted in an explicit run stays inverted, under stress")


def record_refusal(run, law, name, end, scale):
    """Record whether the run stopped before its first step and named the particle."""
    named = f"particle {PARTICLE}" in end.message
    right = end.kind in ("J", UNFIT) and end.step == 0 and named
    run.record(f"extremes.explicit.degenerate.{law}.{_id(name)}", int(right), paper=1,
               comparator="=", scale=scale, note=f"it must stop at once and name particle "
               f"{PARTICLE}; its message: {end.message or end.kind}")


def _id(name):
    return name.replace(" ", "_").lower()


def run_with_deformed_particle(law, F, count):
    """Return the `ExplicitOutcome` of a run in which one particle has this F, its final over
    initial energy, and the particle's final J.
    """
    body = square(CELLS, DX, law)
    dt = 0.2 * step_limits(body, DX).dt
    body.particles.F[PARTICLE] = F
    with np.errstate(all="ignore"):
        block_problem = problem(body, DX, fixed_clock(count, dt), allow_unstable=True)
        first = energy((body,), NO_GRAVITY).sum
        end = outcome(block_problem)
        index = int(np.flatnonzero(body.id == PARTICLE)[0])
        J = float(np.linalg.det(body.particles.F[index]))
        return end, energy((body,), NO_GRAVITY, block_problem.inertia).sum / first, J


LAW = Hencky(*lame(1e6, 0.3))
SIGMA_Y = 1e3                   # [Pa]
STRAIN = 1e3 * SIGMA_Y / (2.0 * LAW.mu)     # 2 mu STRAIN is 1000 times the yield stress


@experiment("extremes.explicit.return_maps", title="Return maps at the tip and far outside",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 30})
def return_maps(run):
    """Check that returns in the loop of a run are admissible, dissipative, frame-indifferent."""
    count = run.choose(quick=500, standard=20000)
    for d in run.choose(quick=(2,), standard=(2, 3)):
        cases = {
            "drucker_prager.tip": (make_flow("drucker_prager", LAW, d, friction_angle=30.0),
                                   trials(run.rng, count, d, 1e-10, 0.0)),
            "drucker_prager.expansion": (make_flow("drucker_prager", LAW, d, friction_angle=30.0),
                                         trials(run.rng, count, d, 0.0, 0.3)),
            "von_mises": (make_flow("von_mises", LAW, d, tau_y=SIGMA_Y),
                          trials(run.rng, count, d, STRAIN, 0.0)),
        }
        for name, (flow, F) in cases.items():
            record_map(run, f"{name}.{d}d", flow, F)


def trials(rng, count, d, deviatoric, expansion):
    """Return trial F (count, d, d): random log strains of a size, random axes and rotations; a
    tenth of them exactly spherical.
    """
    eps = rng.normal(size=(count, d)) * deviatoric
    eps -= eps.mean(axis=1, keepdims=True)
    eps[: count // 10] = 0.0
    eps += expansion * rng.random((count, 1))
    U, V = rotations(rng, count, d), rotations(rng, count, d)
    return U @ (np.exp(eps)[:, :, None] * V.transpose(0, 2, 1))


def rotations(rng, count, d):
    """Return random rotations (count, d, d)."""
    Q, R = np.linalg.qr(rng.normal(size=(count, d, d)))
    Q = Q * np.sign(np.einsum("pii->pi", R))[:, None, :]
    Q[:, :, 0] *= np.linalg.det(Q)[:, None]
    return Q


def record_map(run, name, flow, F):
    """Record excess, dissipation and frame indifference of a flow over many trials."""
    scale, modulus = f"{len(F)} random trial states", stiffness(LAW)
    returned, energy_before, energy_after = apply_return_map(F, flow)
    run.record(f"extremes.explicit.return_maps.{name}.admissible",
               yield_excess(returned, flow) / getattr(flow, "tau_y", modulus), comparator="<=",
               bound=1e-10, scale=scale, note="largest excess of |dev tau| over the yield surface, "
               "over the yield stress, or over lam + 2 mu where there is none (facts: 1e-10)")
    size = max(float(energy_before.max()), modulus * np.finfo(float).eps)
    run.record(f"extremes.explicit.return_maps.{name}.dissipation",
               float((energy_before - energy_after).min()) / size, comparator=">=", bound=-1e-12,
               scale=scale, note="smallest loss of elastic energy in the return, over the largest "
                                 "trial energy: never negative but for rounding")
    Q = rotations(run.rng, 1, F.shape[1])[0]
    change = np.abs(apply_return_map(Q @ F, flow)[0] - Q @ returned @ Q.T).max() / modulus
    run.record(f"extremes.explicit.return_maps.{name}.frame", float(change), comparator="<=",
               bound=1e-12, scale=scale, note="largest change of Q^T tau Q under a rotation Q of "
                                              "the trial F, over lam + 2 mu (facts: 1e-12)")


def apply_return_map(F, flow):
    """Return tau (N, d, d) [Pa] after the return, and the elastic energies before and after it
    [J/m^3].
    """
    n, d = F.shape[:2]
    q = particles_at(np.zeros((n, d)), np.zeros((n, d)), np.ones(n), np.ones(n))
    body = Body("trial", q._replace(F=np.ascontiguousarray(F)), LAW, flow, np.arange(n))
    before = elastic(body)
    deform_body(body, 0.0)          # no time, no growth: the return map alone
    return body.particles.tau, before, elastic(body)


def yield_excess(tau, flow):
    """Return the largest excess over the yield surface [Pa]."""
    d = tau.shape[1]
    tr = np.einsum("paa->p", tau)
    dev = np.linalg.norm(tau - tr[:, None, None] / d * np.eye(d), axis=(1, 2))
    return float(np.max(dev - (flow.tau_y if hasattr(flow, "tau_y") else -flow.alpha * tr)))
