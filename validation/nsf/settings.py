"""Printed settings of NSF's scenes, studies and networks: table 1, section 6 and appendices A, B, D
and E (NSF-X1 to NSF-X18), compared with those of this code.
"""

from mpm_ref.rom.fields import architecture
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import step_count
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import catalogue_scene, record_settings
from .reduced_runs import FASTER
from .studies import ball, bread, cake, jelly, metal, sand, toothpaste
from .unseen_runs import ANGLES

PARTICLES = {       # where the scene has the printed number
    "bread": ("table1.bread.particles", "bread.particles"),
    "cake": ("table1.cake.particles", "cake.particles"),
    "sand": ("sand.particles_text",),                   # NSF-X1
    "toothpaste": ("toothpaste.particles_text",),       # NSF-X2
    "jelly": ("table1.jelly.particles", "jelly.particles"),
}
STAND_INS = {       # where the shape is not published, and ours has nearly as many
    "metal": ("metal.particles", "a lattice of beams with particles of the paper's size: the "
              "shape of its metal frame is not published"),
    "ball": ("table1.ball.particles", "a sphere with 32 tentacles: the ball's mesh is not "
             "published"),
}
STUDIES = {"bread": bread, "cake": cake, "sand": sand, "metal": metal, "toothpaste": toothpaste,
           "jelly": jelly, "ball": ball}
OUTPUTS = {"g": 3, "h": 6, "l": 9}      # of the networks in 3D
SAMPLES = {"bread": ("bread.samples",), "cake": ("cake.samples_first", "cake.samples_second"),
           "metal": ("metal.samples.50",), "toothpaste": ("toothpaste.samples.50",),
           "ball": ("ball.samples",)}
ENDS = {"bread": ("table1.bread.E_min", "table1.bread.E_max"),
        "metal": ("table1.metal.xi_min", "table1.metal.xi_max"),
        "sand": ("appB.sand.train_min", "appB.sand.train_max")}
LONGER = "cake", "metal"        # whose reduced runs are printed with their steps


@experiment("nsf.settings", title="Settings of NSF's scenes",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 10})
def settings(run):
    """Settings of the scenes nsf_*.toml, of the studies of them, and of the networks."""
    for name in STUDIES:
        scene = catalogue_scene(f"nsf_{name}")
        record_settings(run, f"nsf_{name}", printed_settings(name, scene))
        if name in STAND_INS:
            target, note = STAND_INS[name]
            run.record(f"nsf.{target}", particles(scene), scale=f"scenes/nsf_{name}.toml",
                       note=note)
    for values, scale in ((studied_settings(),
                           "studies of the standard profile at the printed resolution"),
                          (network_settings(), "mpm_ref/rom/fields/architecture.py")):
        for target, value in values.items():
            run.record(target, value, scale=scale)


def printed_settings(name, scene):
    """Return {target id: our value} of a scene's printed settings."""
    values = {f"nsf.table1.{name}.dx": scene.dx, f"nsf.table1.{name}.dt": scene.dt}
    values |= {f"nsf.{target}": particles(scene) for target in PARTICLES.get(name, ())}
    return values | {f"nsf.{target}": value
                     for target, value in particular_settings(name, scene).items()}


def particular_settings(name, scene):
    """Return {target id without "nsf.": value} of the settings that only this scene has."""
    material = scene.body[0].material
    flow = material.flow
    match name:
        case "cake":
            return {"table1.cake.tau_y": flow.tau_y, "table1.cake.theta": flow.theta,
                    "cake.steps_full": scene.steps}
        case "metal":
            return {"table1.metal.tau_y": flow.tau_y, "metal.steps_full": scene.steps}
        case "toothpaste":
            return {"table1.toothpaste.tau_y": flow.sigma_y, "table1.toothpaste.eta": flow.eta,
                    "fig11.angle": scene.collider[0].motion.angle}
        case "jelly" | "ball":
            return {f"table1.{name}.E": material.E}
        case _:
            return {}


def particles(scene):
    """Return the number of particles of a scene."""
    return sum(len(body.particles.x) for body in build(scene).bodies)


def studied_settings():
    """Return {target id: our value} of all studies."""
    values = {}
    for name, make in STUDIES.items():
        values |= study_settings(name, make())
    for target, angle in zip(("ok", "bad"), ANGLES, strict=True):
        values[f"nsf.appB.sand.extrap_{target}"] = angle
    return values


def study_settings(name, study):
    """Return {target id: our value} of a study: latent coordinates, runs, samples, steps."""
    values = {f"table1.{name}.r": study.sizes.r, f"appA.{name}.train": len(study.train),
              f"appA.{name}.test": len(study.test)}
    values |= dict(zip(SAMPLES.get(name, ()), (study.samples, study.later), strict=False))
    values |= dict(zip(ENDS.get(name, ()), (study.train[0], study.train[-1]), strict=False))
    if name in LONGER:
        clock = nsf_full_model(study.run(study.test[0])).problem.clock
        values |= {f"{name}.dt_factor": FASTER,
                   f"{name}.steps_reduced": step_count(clock, FASTER)}
    return {f"nsf.{target}": value for target, value in values.items()}


def network_settings():
    """Return {target id: our value} of the networks' architecture.

    The printed widths and learning rates are not here: no network of that width is trained, and
    none by that schedule.
    """
    values = {"appE.hidden_layers": architecture.DEPTH, "appE.enc_kernel": architecture.KERNEL,
              "appE.enc_stride": architecture.NSF_STRIDE,
              "appE.enc_channels": architecture.NSF_ROWS,
              "appE.enc_stop": architecture.NSF_LONGEST, "appE.enc_fc": architecture.FEATURES}
    values |= {f"appE.{network}.out": outputs for network, outputs in OUTPUTS.items()}
    return {f"nsf.{target}": value for target, value in values.items()}
