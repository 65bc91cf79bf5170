"""Printed settings of NCLaw and its release, of environments, networks, trainings and tasks,
compared with those of this code.

Not here: what was weighed, kneaded and filmed for the dough, what other papers used, and that laws
learn from one trajectory, which nothing here could have otherwise.
"""

from math import prod

import numpy as np

from mpm_ref.materials.learned.weights import PARTS
from mpm_ref.sampling import points
from mpm_ref.scene import build
from mpm_ref.shapes.inside import solid

from ..common.registry import experiment
from ..common.scenes import catalogue_scene, record_settings
from ..common.weights_needed import load_available
from .environments import ENVIRONMENTS
from .gallery import contact, large, pool
from .identified import POINTS
from .runtime import REPEATS
from .simulators import COUNTS, named
from .tasks import FASTEST, LONG, SEEDS, slope
from .trained_laws import trained

AXES = "xyz"
JELLY = "jelly"     # any environment: all four have the same grid, steps and recipe
GRAPHS = named(JELLY, COUNTS[0])


@experiment("nclaw.settings", title="Settings that NCLaw's text prints",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 6})
def settings(run):
    """Settings of the scenes nclaw_*.toml, of trained weights, and of the tasks."""
    scenes = {name: catalogue_scene(f"nclaw_{name}") for name in ENVIRONMENTS}
    jelly = scenes[JELLY]
    record_settings(run, f"nclaw_{JELLY}", environment_settings(jelly, len(scenes)))
    record_settings(run, "nclaw_*", release_settings(scenes))
    models = load_available(run, (JELLY, GRAPHS), trained)
    if JELLY in models:
        record(run, f"weights {JELLY}.npz", {**network_settings(models[JELLY]),
                                             **training_settings(models[JELLY].about["recipe"])})
    if GRAPHS in models:
        record(run, f"weights {GRAPHS}.npz", graph_settings(models[GRAPHS], jelly))
    record(run, "validation/nclaw/tasks.py", task_settings(jelly))
    record(run, "validation/nclaw/gallery.py", body_settings())
    record(run, "validation/nclaw", measurement_settings())


def record(run, scale, values):
    """Record {target id: our value}; scale: the file that has it."""
    for target, value in values.items():
        run.record(target, value, scale=scale)


def environment_settings(scene, materials):
    """Return the settings of section 4.1 and appendix D.1, from one of `materials` scenes, whose
    walls, in cells from the origin, are as far from both ends of the box.
    """
    low, high = scene.body[0].shape.lower, scene.body[0].shape.upper
    walls = scene.walls
    return {
        "nclaw.sec4_1.train_points": len(build(scene).bodies[0].particles.x),
        "nclaw.sec4_1.steps": scene.steps, "nclaw.sec4_1.dt": scene.dt,
        "nclaw.sec4_1.materials": materials, "nclaw.sec4_1.loss_stride": scene.every,
        "nclaw.appD1.cube_edge": high[0] - low[0], "nclaw.appD1.grid_per_dim": round(1 / scene.dx),
        "nclaw.appD1.box_edge": scene.dx * (walls.low[0] + walls.high[0]),
        "nclaw.appD1.dx": scene.dx, "nclaw.appD1.gravity": scene.gravity[1],
        "nclaw.appD1.bc_threshold": walls.low[0],
        "nclaw.appF1.real_time": scene.steps * scene.dt, "nclaw.appF1.steps_ours": scene.steps}


def release_settings(scenes):
    """Return the constants that the text leaves out and the authors' release sets."""
    materials = {name: scene.body[0].material for name, scene in scenes.items()}
    v = scenes[JELLY].body[0].velocity
    return {
        "nclaw.ext.jello.E": materials["jelly"].E, "nclaw.ext.jello.nu": materials["jelly"].nu,
        "nclaw.ext.sand.E": materials["sand"].E, "nclaw.ext.sand.nu": materials["sand"].nu,
        "nclaw.ext.sand.friction_deg": materials["sand"].flow.friction_angle,
        "nclaw.ext.plasticine.E": materials["plasticine"].E,
        "nclaw.ext.plasticine.nu": materials["plasticine"].nu,
        "nclaw.ext.plasticine.yield_stress": materials["plasticine"].flow.tau_y,
        "nclaw.ext.water.E": materials["water"].E, "nclaw.ext.water.nu": materials["water"].nu,
        "nclaw.ext.rho": scenes[JELLY].body[0].density,
        "nclaw.ext.vel_bound_lin": FASTEST, "nclaw.ext.vel_bound_ang": FASTEST,
        **{f"nclaw.ext.vlin.{a}": u for a, u in zip(AXES, v.linear, strict=True)},
        **{f"nclaw.ext.vang.{a}": w for a, w in zip(AXES, v.angular, strict=True)}}


def network_settings(laws):
    """Return the settings of section 4.1, appendices C.1 and D.2, from trained laws. Biases that
    are zero do not count.
    """
    parts = [getattr(laws, part) for part in PARTS]
    (first, _), *_, (last, _) = laws.elastic.layers
    return {
        "nclaw.sec4_1.mlp_layers": len(laws.elastic.layers),
        "nclaw.sec4_1.mlp_width": first.shape[1], "nclaw.appC.net_in": first.shape[0],
        "nclaw.appC.net_out": last.shape[1], "nclaw.appC.alpha": laws.plastic.kind.alpha,
        "nclaw.appD2.networks": len(parts),
        "nclaw.appD2.params": sum(W.size + np.count_nonzero(b)
                                  for part in parts for W, b in part.layers)}


def training_settings(recipe):
    """Return the settings of appendix D.2 from the recipe of trained laws."""
    printed = {"lr_elastic": "elastic_rate", "lr_plastic": "plastic_rate", "epochs": "epochs",
               "grad_clip": "clip", "teacher_start": "first", "teacher_end": "last"}
    return {f"nclaw.appD2.{theirs}": recipe[ours] for theirs, ours in printed.items()}


def graph_settings(simulator, scene):
    """Return the settings of section 4.1, appendices F.1 and F.4: graph network and scene."""
    dt = simulator.reading.dt
    return {
        "nclaw.sec4_1.gnn_step_factor": dt / scene.dt,
        "nclaw.appF1.steps_gnn": scene.steps * scene.dt / dt,
        "nclaw.appF4.data_ratio": COUNTS[-1] / COUNTS[0]}


def task_settings(scene):
    """Return the settings of section 4.3, from tasks and the scene of training. The body of task
    (d) is counted; those of task (c) have 5 to 15 per cent more points.
    """
    count = slope().body[0].sampling.count
    return {
        "nclaw.sec4_3.time_factor": LONG[JELLY] / scene.steps, "nclaw.sec4_3.points": count,
        "nclaw.sec4_3.points_factor": count / prod(scene.body[0].sampling.counts),
        "nclaw.sec4_3.velocity_draws": len(SEEDS)}


def body_settings():
    """Return the settings of sections 4.4 and 4.5: bodies, and points in them."""
    dragon, (duck, water) = large(), pool().body
    body, filled = dragon.body[0], prod(water.sampling.counts)
    return {
        "nclaw.fig3.toys": len(contact().body),
        "nclaw.sec4_4.dragon_points": len(points(body.sampling, solid(body.shape), dragon.dx, 0)),
        "nclaw.sec4_5.duck": duck.sampling.count, "nclaw.sec4_5.water": filled,
        "nclaw.sec4_5.total": duck.sampling.count + filled}


def measurement_settings():
    """Return the settings of appendices F.1 and F.3: repeated timings, drawn gradients."""
    return {"nclaw.appF1.repeats": REPEATS["standard"], "nclaw.appF3.samples": POINTS}
