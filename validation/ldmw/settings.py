"""Printed settings of the workshop paper's experiments and network, compared with this code."""

import numpy as np

from mpm_ref.rom.fields.architecture import HIDDEN
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import record_settings
from ..ldm.networks import SHARES, nets
from ..ldm.workshop_studies import PUSHES, SHEAR3, SHEAR17
from .poke import HYPER, NET
from .shear import HYPER as SHEAR_HYPER
from .shear import LOSSES

SCENE = "ldm_poke"
PRINTED_WEIGHTS = (100.0, 0.01)     # of the loss; networks have shares of them (LDM-defaults-train)


@experiment("ldmw.settings", title="Settings of the workshop paper's experiments and network",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 5})
def settings(run):
    """Settings of the unit tests, of the poking test and of the networks."""
    record_settings(run, SCENE, {**table_settings(), **specimen_settings(), **angle_bounds(),
                                 **poke_settings()})
    snapshots = len(PUSHES.mu) * (PUSHES.scene(*PUSHES.mu[0]).steps + 1)
    run.record("ldmw.poke.snapshots", snapshots, scale=f"scenes/{SCENE}.toml",
               note="all 36 steps of all runs and their starts; 945 are 35 of each (LDMW-X1)")


def table_settings():
    """Return the settings of Tables 1 and 2."""
    steps = {study.scene(*study.mu[0]).steps for study in (SHEAR3, SHEAR17)}
    weights = {row: np.multiply(SHARES[terms], PRINTED_WEIGHTS).tolist() for row,
               terms in LOSSES.items()}
    return {**{f"ldmw.table1.{row}.lambda{k + 1}": own[k] for row, own in weights.items()
               for k in (0, 1)},
            "ldmw.table1.points": points(SHEAR3), "ldmw.table2.points": points(SHEAR17),
            "ldmw.table2.hyper": SHEAR_HYPER, "ldmw.unit.steps": max(steps),
            "ldmw.net.layers": len(HIDDEN) + 1}


def specimen_settings():
    """Return the settings of Table 3."""
    body = PUSHES.scene(*PUSHES.mu[0]).body[0]
    return {"ldmw.table3.radius": 100.0 * body.shape.radius,
            "ldmw.table3.height": 100.0 * (body.shape.end[2] - body.shape.start[2]),
            "ldmw.table3.youngs": body.material.E, "ldmw.table3.poisson": body.material.nu}


def angle_bounds():
    """Return the bounds of the poke's magnitude and angles."""
    return {f"ldmw.poke.{name}_{end.__name__}": end(values)
            for name, values in zip(("rho", "theta", "phi"), PUSHES.mu.T.tolist(), strict=True)
            for end in (min, max)}


def poke_settings():
    """Return the settings of the poking test."""
    scene, n, r = PUSHES.scene(*PUSHES.mu[0]), points(PUSHES), nets()[NET].r
    return {"ldmw.poke.n_sims": len(PUSHES.mu), "ldmw.poke.n_train": len(PUSHES.train),
            "ldmw.poke.n_test": len(PUSHES.test), "ldmw.poke.steps": scene.steps,
            "ldmw.poke.duration": scene.steps * scene.dt, "ldmw.poke.dt": scene.dt,
            "ldmw.poke.levels_per_dim": len(set(PUSHES.mu[:, 0])), "ldmw.poke.particles": n,
            "ldmw.poke.r": r, "ldmw.poke.hyper_points": HYPER,
            "ldmw.poke.reduction": scene.dim * n / r}


def points(study):
    """Return the number of a study's points."""
    return len(build(study.scene(*study.mu[0])).bodies[0].particles.x)
