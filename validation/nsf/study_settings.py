"""Settings of NSF's studies and networks: table 1, section 6 and appendices A, B, D and E, as far
as they are printed.
"""

from mpm_ref.rom.fields import architecture
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import step_count
from mpm_ref.rom.train.schedule import PRINTED

from ..common import targets
from .reduced_runs import FASTER
from .studies import ball, bread, cake, jelly, metal, sand, toothpaste
from .unseen_runs import ANGLES

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


def of_studies():
    """{target id: our value} of all studies."""
    found = {}
    for name, made in STUDIES.items():
        found |= of_study(name, made())
    for target, angle in zip(("ok", "bad"), ANGLES, strict=True):
        found[f"nsf.appB.sand.extrap_{target}"] = angle
    return found


def of_study(name, study):
    """The same of one: latent coordinates, runs, samples, steps."""
    found = {f"table1.{name}.r": study.sizes.r, f"appA.{name}.train": len(study.train),
             f"appA.{name}.test": len(study.test)}
    found |= dict(zip(SAMPLES.get(name, ()), (study.samples, study.later), strict=False))
    found |= dict(zip(ENDS.get(name, ()), (study.train[0], study.train[-1]), strict=False))
    if name in LONGER:
        clock = nsf_full_model(study.run(study.test[0])).problem.clock
        found |= {f"{name}.dt_factor": FASTER,
                  f"{name}.steps_reduced": step_count(clock, FASTER)}
    return {f"nsf.{target}": value for target, value in found.items()}


def of_networks():
    """{target id: our value} of the networks' sizes and the learning rates."""
    known = targets.load()
    found = {f"appD.lr.{k}": rate for k, rate in enumerate(PRINTED)}
    found |= {"appE.hidden_layers": architecture.DEPTH, "appE.enc_kernel": architecture.KERNEL,
              "appE.enc_stride": architecture.NSF_STRIDE,
              "appE.enc_channels": architecture.NSF_ROWS,
              "appE.enc_stop": architecture.NSF_LONGEST, "appE.enc_fc": architecture.FEATURES}
    for own, outputs in OUTPUTS.items():
        found[f"appE.{own}.out"] = outputs
        for name in STUDIES:
            id = f"table1.{name}.mlp.{own}"
            layers = architecture.hidden(int(known[f"nsf.{id}.beta"].value), outputs)
            found |= {f"{id}.layers": len(layers), f"{id}.width": layers[0]}
    return {f"nsf.{target}": value for target, value in found.items()}
