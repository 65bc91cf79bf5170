"""Inverted and degenerate deformation, and return maps far outside of the yield surface."""

import numpy as np

from mpm_ref.core.law import kirchhoff_hat, project
from mpm_ref.core.spectral import svd
from mpm_ref.explicit import deform_body, initial_stress
from mpm_ref.materials import Hencky, NoFlow, lame, make_flow, make_law

from ..registry import experiment
from .blocks import bounds, problem, square, steps
from .outcome import FINISHED, outcome

DX, CELLS = 0.125, 4
# F of one particle in the middle of a block at rest: what a run must recover from, or refuse.
BROKEN = {
    "inverted": np.diag([1.0, -1.0]), "rank 1": np.diag([1.0, 0.0]), "zero": np.zeros((2, 2)),
    "tiny": 1e-150 * np.eye(2), "huge": 1e150 * np.eye(2), "NaN": np.full((2, 2), np.nan),
}
RECOVERS = ("inverted", "rank 1", "zero", "tiny")       # where fixed corotated is defined


@experiment("extremes.explicit.degenerate", title="One particle with an impossible deformation",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 20})
def degenerate(run):
    """Fixed corotated recovers, neo-Hookean refuses and names the particle."""
    rows, scale = [], f"2D, block of {CELLS} x {CELLS} cells, one particle broken, 2000 steps"
    for name, F in BROKEN.items():
        end, J = recovery(make_law("fixed_corotated", E=1e6, nu=0.3), F, 2000)
        rows.append(("fixed_corotated", name, end.kind, end.step, J, end.particle, end.said))
        if name in RECOVERS:
            run.record(f"extremes.explicit.degenerate.fixed_corotated.{_id(name)}",
                       J if end.kind == FINISHED else np.nan, paper=1.0, comparator="band",
                       bound=(0.5, 1.5), scale=scale,
                       note=f"volume ratio of the particle at the end; it was {np.linalg.det(F):g}. "
                            "Calibrated: 0.9 to 1.1")
        else:
            record_refusal(run, "fixed_corotated", name, end, scale)
    for name, F in BROKEN.items():
        end, J = recovery(make_law("neo_hookean", E=1e6, nu=0.3), F, 10)
        rows.append(("neo_hookean", name, end.kind, end.step, J, end.particle, end.said))
        record_refusal(run, "neo_hookean", name, end, scale)
    run.table("runs", ("law", "F", "end", "step", "J", "particle", "said"), rows)


def record_refusal(run, law, name, end, scale):
    """Whether the run stopped before its first step and named the particle."""
    right = end.kind in ("J", "not finite") and end.step == 0 and end.particle == PARTICLE
    run.record(f"extremes.explicit.degenerate.{law}.{_id(name)}", int(right), paper=1,
               comparator="=", scale=scale, note=f"it must stop at once and name particle "
               f"{PARTICLE}; it said: {end.said or end.kind}")


def _id(name):
    return name.replace(" ", "_").lower()


PARTICLE = 27


def recovery(law, F, count):
    """`Outcome` of a run in which one particle has this F, and its J at the end."""
    made = square(CELLS, DX, law)
    dt = 0.2 * bounds(made, DX).dt
    made.particles.F[PARTICLE] = F
    with np.errstate(all="ignore"):
        end = outcome(problem(made, DX, steps(count, dt), allow_unstable=True))
        at = int(np.flatnonzero(made.id == PARTICLE)[0])
        return end, float(np.linalg.det(made.particles.F[at]))


LAW = Hencky(*lame(1e6, 0.3))
SIGMA_Y = 1e3                   # [Pa]
STRAIN = 1e3 * SIGMA_Y / (2.0 * LAW.mu)     # 2 mu STRAIN is 1000 times the yield stress


@experiment("extremes.explicit.return_maps", title="Return maps at the tip and far outside",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 30})
def return_maps(run):
    """Admissible, dissipative and frame-indifferent through the loop that a run uses."""
    count = run.choose(quick=500, standard=20000)
    for d in (2, 3):
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
    """Trial F (count, d, d): random log strains of a size, random axes and rotations; a tenth of them
    exactly spherical.
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
    scale = f"{len(F)} random trial states"
    returned = deformed(F, flow)
    stress = np.abs(returned.tau).max() + 1e-300
    size = max(float(np.abs(kirchhoff_of(F)).max()), SIGMA_Y)
    run.record(f"extremes.explicit.return_maps.{name}.admissible", outside(returned.tau, flow) / size,
               comparator="<=", bound=1e-10, scale=scale,
               note="largest excess over the yield surface, over the largest trial stress")
    lost = psi_of(F) - psi_of(returned.F)
    run.record(f"extremes.explicit.return_maps.{name}.dissipation",
               float(lost.min()) / max(float(np.abs(psi_of(F)).max()), 1e-300), comparator=">=",
               bound=-1e-12, scale=scale, note="smallest loss of elastic energy in the return, over "
                                               "the largest trial energy: never negative")
    Q = rotations(run.rng, 1, F.shape[1])[0]
    turned = deformed(Q @ F, flow)
    change = np.abs(turned.tau - Q @ returned.tau @ Q.T).max() / max(stress, 1e-12 * size)
    run.record(f"extremes.explicit.return_maps.{name}.frame", float(change), comparator="<=",
               bound=frame_bound(name), scale=scale,
               note="largest change of tau under a rotation of the trial F, over the largest tau")


def frame_bound(name):
    """1e-12 as planned, where stress is of the size of the trial stress; at a yield stress of 1e-3 of
    it, rounding of the trial strain is 1e3 times as large, and at the tip stress is the rounding.
    """
    return 1e-9 if name.startswith("von_mises") else 1e-12
