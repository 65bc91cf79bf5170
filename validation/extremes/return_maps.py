"""Return maps at the tip of the cone, in pure expansion, and far outside of the yield surface."""

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.energy import elastic
from mpm_ref.explicit import deform_body
from mpm_ref.materials import Hencky, lame, make_flow, stiffness

from ..common.registry import experiment

LAW = Hencky(*lame(1e6, 0.3))
SIGMA_Y = 1e3                   # [Pa]
STRAIN = 1e3 * SIGMA_Y / (2.0 * LAW.mu)     # 2 mu STRAIN is 1000 times the yield stress


@experiment("extremes.explicit.return_maps", title="Return maps at the tip and far outside",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 30})
def return_maps(run):
    """Admissible, dissipative and frame-indifferent through the loop that a run uses."""
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
    """Trial F (count, d, d): random log strains of a size, random axes and rotations; a tenth
    of them exactly spherical.
    """
    eps = rng.normal(size=(count, d)) * deviatoric
    eps -= eps.mean(axis=1, keepdims=True)
    eps[: count // 10] = 0.0
    eps += expansion * rng.random((count, 1))
    U, V = rotations(rng, count, d), rotations(rng, count, d)
    return U @ (np.exp(eps)[:, :, None] * V.transpose(0, 2, 1))


def rotations(rng, count, d):
    """Random rotations (count, d, d)."""
    Q, R = np.linalg.qr(rng.normal(size=(count, d, d)))
    Q = Q * np.sign(np.einsum("pii->pi", R))[:, None, :]
    Q[:, :, 0] *= np.linalg.det(Q)[:, None]
    return Q


def record_map(run, name, flow, F):
    """Three numbers of a flow over many trials."""
    scale, modulus = f"{len(F)} random trial states", stiffness(LAW)
    returned, energy_before, energy_after = deformed(F, flow)
    run.record(f"extremes.explicit.return_maps.{name}.admissible",
               outside(returned, flow) / getattr(flow, "tau_y", modulus), comparator="<=",
               bound=1e-10, scale=scale, note="largest excess of |dev tau| over the yield surface, "
               "over the yield stress, or over lam + 2 mu where there is none (facts: 1e-10)")
    size = max(float(energy_before.max()), modulus * np.finfo(float).eps)
    run.record(f"extremes.explicit.return_maps.{name}.dissipation",
               float((energy_before - energy_after).min()) / size, comparator=">=", bound=-1e-12,
               scale=scale, note="smallest loss of elastic energy in the return, over the largest "
                                 "trial energy: never negative but for rounding")
    Q = rotations(run.rng, 1, F.shape[1])[0]
    change = np.abs(deformed(Q @ F, flow)[0] - Q @ returned @ Q.T).max() / modulus
    run.record(f"extremes.explicit.return_maps.{name}.frame", float(change), comparator="<=",
               bound=1e-12, scale=scale, note="largest change of Q^T tau Q under a rotation Q of "
                                              "the trial F, over lam + 2 mu (facts: 1e-12)")


def deformed(F, flow):
    """tau after the return (N, d, d) [Pa], and the elastic energies before and after it [J/m^d]."""
    n, d = F.shape[:2]
    q = particles_at(np.zeros((n, d)), np.zeros((n, d)), np.ones(n), np.ones(n))
    body = Body("trial", q._replace(F=np.ascontiguousarray(F)), LAW, flow, np.arange(n))
    before = elastic(body)
    deform_body(body, 0.0)          # no time, no growth: the return map alone
    return body.particles.tau, before, elastic(body)


def outside(tau, flow):
    """Largest excess over the yield surface [Pa]."""
    d = tau.shape[1]
    tr = np.einsum("paa->p", tau)
    dev = np.linalg.norm(tau - tr[:, None, None] / d * np.eye(d), axis=(1, 2))
    return float(np.max(dev - (flow.tau_y if hasattr(flow, "tau_y") else -flow.alpha * tr)))
