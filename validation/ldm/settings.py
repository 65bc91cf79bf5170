"""Printed settings of LDM's experiments and networks, compared with those of this code."""

import numpy as np

from mpm_ref.rom.fields.architecture import FEATURES, HIDDEN, KERNEL, SHORTEST, STRIDE, lengths
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import record_settings
from .networks import nets
from .studies import GRAVITY, PHI, POKE, POKES, TORSION, TOWER, poked_again
from .tower import GRIDS, POINTS, scene_of

SECTIONS = {"gravity": "sec5_1", "torsion": "sec5_2", "poke": "sec5_3"}
TABLE = "ldm.table2.tower"
ROWS = (1368, 1757, 3076115)        # numbers of points whose convolutions the table gives


@experiment("ldm.settings", title="Settings of LDM's experiments and networks",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 5})
def settings(run):
    """Settings of the scenes, of the studies made of them, and of the networks."""
    for study in (GRAVITY, TORSION, POKES):
        scene = study.scene(*study.mu[-1])
        record_settings(run, f"ldm_{study.name}", {**table_settings(study, scene),
                                                   **study_settings(study)})
    record_settings(run, "ldm_gravity", gravity_settings())
    record_settings(run, "ldm_torsion", torsion_settings())
    record_settings(run, "ldm_poke", poke_settings())
    record_settings(run, "ldm_gravity", network_settings())
    record_tower(run)


def table_settings(study, scene):
    """Return the settings of Table 2, from a scene of a study."""
    material, name = scene.body[0].material, f"ldm.table2.{study.name}"
    return {f"{name}.youngs": material.E, f"{name}.poisson": material.nu,
            f"{name}.particles": len(build(scene).bodies[0].particles.x), f"{name}.dx": scene.dx,
            f"{name}.dt": scene.dt, f"{name}.steps": scene.steps,
            f"{name}.n_train": len(study.train), f"{name}.n_test": len(study.test)}


def study_settings(study):
    """Return the counts that the text prints of a study."""
    name, steps = f"ldm.{SECTIONS[study.name]}", study.scene(*study.mu[0]).steps
    return {f"{name}.n_sims": len(study.mu), f"{name}.steps": steps,
            f"{name}.snapshots": len(study.mu) * (steps + 1), f"{name}.n_train": len(study.train),
            f"{name}.n_test": len(study.test)}


def gravity_settings():
    """Return the settings of section 5.1."""
    shape = GRAVITY.scene(1.0).body[0].shape
    return {"ldm.sec5_1.radius": shape.radius, "ldm.sec5_1.height": shape.end[0] - shape.start[0],
            "ldm.sec5_1.g_min": GRAVITY.mu.min(), "ldm.sec5_1.g_max": GRAVITY.mu.max()}


def torsion_settings():
    """Return the settings of section 5.2."""
    shape, (v, w) = TORSION.scene(0.0, 0.0).body[0].shape, TORSION.mu.T
    sides = np.subtract(shape.upper, shape.lower)
    return {**dict(zip(("ldm.sec5_2.wx", "ldm.sec5_2.wy", "ldm.sec5_2.h"), sides, strict=True)),
            "ldm.sec5_2.v_min": v.min(), "ldm.sec5_2.v_max": v.max(), "ldm.sec5_2.w_min": w.min(),
            "ldm.sec5_2.w_max": w.max(), "ldm.sec5_2.samples_per_dim": len(set(v)),
            "ldm.sec5_2.r": nets()["torsion-0"].r}


def poke_settings():
    """Return the settings of section 5.3."""
    scene, again = POKES.scene(0.0), poked_again(np.zeros(10))
    theta, trained = POKES.mu[:, 0], POKES.mu[list(POKES.train), 0]
    return {"ldm.sec5_3.poke_speed": POKE, "ldm.sec5_3.poke_time": scene.fixed[1].until,
            "ldm.sec5_3.phi": PHI, "ldm.sec5_3.theta_step": theta[1] - theta[0],
            "ldm.sec5_3.theta_train_step": trained[1] - trained[0],
            "ldm.sec5_3.duration": scene.steps * scene.dt, "ldm.sec5_3.r": nets()["poke"].r,
            "ldm.sec5_3_2.pokes": len(again.fixed) - 1, "ldm.sec5_3_2.steps": again.steps,
            "ldm.sec5_3_2.duration": again.steps * again.dt}


def record_tower(run):
    """Record the settings of Table 2 and section 5.4: the tower at the paper's size, and the
    parameters drawn for its runs.
    """
    large = scene_of(max(GRIDS))
    table, notes = table_settings(TOWER, large), tower_notes(TOWER.scene(*TOWER.mu[0]))
    also = {"r": "; Figure 15 prints a tenth of it (LDM-X9)"}
    n, name, scale = table[f"{TABLE}.particles"], "ldm.sec5_4", "scenes/ldm_tower.toml"
    table |= {f"{TABLE}.ppc_per_dim": large.body[0].sampling.per_cell,
              f"{name}.n_train": len(TOWER.train), f"{name}.n_test": len(TOWER.test),
              f"{name}.r": nets()["tower"].r, f"{name}.reduction_resolved": n / max(POINTS)}
    for target, value in table.items():
        run.record(target, value, scale=scale, note=notes.get(target, ""))
    for target, value in (("total", n), ("reduction", n / max(POINTS))):
        run.record(f"{name}.remark_{target}", value, scale=scale,
                   note="the print contradicts its Table 2 here (LDM-X8)")
    for parameter, drawn in zip(("r", "theta", "phi"), TOWER.mu.T, strict=True):
        note = f"of {len(drawn)} draws, Latin hypercubes within the range{also.get(parameter, '')}"
        run.record(f"{name}.{parameter}_min", drawn.min(), scale=scale, note=note)
        run.record(f"{name}.{parameter}_max", drawn.max(), scale=scale, note=note)


def tower_notes(trained):
    """Return {target: a note on how the tower differs from the print}, for the scene that its map
    is trained on.
    """
    small = (f"of Figure 16's largest runs; the map's training and Figure 15 have dx {trained.dx:g}"
             f" m, {trained.body[0].sampling.per_cell} points per cell and axis")
    return {f"{TABLE}.dx": f"{small}; printed in cm (LDM-X1)", f"{TABLE}.ppc_per_dim": small,
            f"{TABLE}.particles": f"{small}; of our own shape, the paper's was not published",
            f"{TABLE}.dt": "the printed fraction is lost (LDM-X3)",
            "ldm.sec5_4.reduction_resolved": "the print's remark says ten times as much (LDM-X8)"}


def network_settings():
    """Return the settings of Table 1, and the latent dimensions of section 5.1."""
    rows = {n: lengths(3 * n) for n in ROWS}
    return {"ldm.table1.encoder.kernel": KERNEL, "ldm.table1.encoder.stride": STRIDE,
            "ldm.table1.encoder.dconv_min": SHORTEST, "ldm.table1.encoder.fc1_out": FEATURES,
            "ldm.table1.g.layers": len(HIDDEN) + 1, "ldm.table1.g.width": HIDDEN[0],
            **{f"ldm.table1.encoder.dconv.{n}": row[-1] for n, row in rows.items()},
            **{f"ldm.table1.encoder.nconv.{n}": len(row) - 1 for n, row in rows.items()},
            "ldm.fig7.r": nets()["gravity-r7-no-F"].r, "ldm.fig9.r": nets()["gravity-r4"].r}
