"""What NCLaw and its release print of environments, networks, trainings and tasks, beside what is
run here.

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
    """Of the scenes nclaw_*.toml, of trained weights, and of the tasks."""
    scenes = {name: catalogue_scene(f"nclaw_{name}") for name in ENVIRONMENTS}
    jelly = scenes[JELLY]
    record_settings(run, f"nclaw_{JELLY}", of_environment(jelly, len(scenes)))
    record_settings(run, "nclaw_*", of_release(scenes))
    found = load_available(run, (JELLY, GRAPHS), trained)
    if JELLY in found:
        record(run, f"weights {JELLY}.npz", {**of_networks(found[JELLY]),
                                             **of_training(found[JELLY].about["recipe"])})
    if GRAPHS in found:
        record(run, f"weights {GRAPHS}.npz", of_graphs(found[GRAPHS], jelly))
    record(run, "validation/nclaw/tasks.py", of_tasks(jelly))
    record(run, "validation/nclaw/gallery.py", of_bodies())
    record(run, "validation/nclaw", of_measurements())


def record(run, scale, values):
    """Record {target id: our value}; scale: where it stands."""
    for target, value in values.items():
        run.record(target, value, scale=scale)


def of_environment(scene, materials):
    """Section 4.1 and Appendix D.1: of one of so many scenes, whose walls, in cells from the
    origin, are as far from both ends of the box.
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


def of_release(scenes):
    """Constants that the text leaves out and the authors' release sets."""
    of = {name: scene.body[0].material for name, scene in scenes.items()}
    v = scenes[JELLY].body[0].velocity
    return {
        "nclaw.ext.jello.E": of["jelly"].E, "nclaw.ext.jello.nu": of["jelly"].nu,
        "nclaw.ext.sand.E": of["sand"].E, "nclaw.ext.sand.nu": of["sand"].nu,
        "nclaw.ext.sand.friction_deg": of["sand"].flow.friction_angle,
        "nclaw.ext.plasticine.E": of["plasticine"].E,
        "nclaw.ext.plasticine.nu": of["plasticine"].nu,
        "nclaw.ext.plasticine.yield_stress": of["plasticine"].flow.tau_y,
        "nclaw.ext.water.E": of["water"].E, "nclaw.ext.water.nu": of["water"].nu,
        "nclaw.ext.rho": scenes[JELLY].body[0].density,
        "nclaw.ext.vel_bound_lin": FASTEST, "nclaw.ext.vel_bound_ang": FASTEST,
        **{f"nclaw.ext.vlin.{a}": u for a, u in zip(AXES, v.linear, strict=True)},
        **{f"nclaw.ext.vang.{a}": w for a, w in zip(AXES, v.angular, strict=True)}}


def of_networks(laws):
    """Section 4.1, Appendices C.1 and D.2: of trained laws. Biases that are zero do not count."""
    parts = [getattr(laws, part) for part in PARTS]
    (first, _), *_, (last, _) = laws.elastic.layers
    return {
        "nclaw.sec4_1.mlp_layers": len(laws.elastic.layers),
        "nclaw.sec4_1.mlp_width": first.shape[1], "nclaw.appC.net_in": first.shape[0],
        "nclaw.appC.net_out": last.shape[1], "nclaw.appC.alpha": laws.plastic.kind.alpha,
        "nclaw.appD2.networks": len(parts),
        "nclaw.appD2.params": sum(W.size + np.count_nonzero(b)
                                  for part in parts for W, b in part.layers)}


def of_training(recipe):
    """Appendix D.2: of the recipe of trained laws."""
    printed = {"lr_elastic": "elastic_rate", "lr_plastic": "plastic_rate", "epochs": "epochs",
               "grad_clip": "clip", "teacher_start": "first", "teacher_end": "last"}
    return {f"nclaw.appD2.{theirs}": recipe[ours] for theirs, ours in printed.items()}


def of_graphs(simulator, scene):
    """Section 4.1, Appendices F.1 and F.4: of a trained graph network, beside a scene."""
    dt = simulator.reading.dt
    return {
        "nclaw.sec4_1.gnn_step_factor": dt / scene.dt,
        "nclaw.appF1.steps_gnn": scene.steps * scene.dt / dt,
        "nclaw.appF4.data_ratio": COUNTS[-1] / COUNTS[0]}


def of_tasks(scene):
    """Section 4.3: of tasks, beside the scene of training. The body of task (d) is counted;
    those of task (c) have 5 to 15 per cent more points.
    """
    count = slope().body[0].sampling.count
    return {
        "nclaw.sec4_3.time_factor": LONG[JELLY] / scene.steps, "nclaw.sec4_3.points": count,
        "nclaw.sec4_3.points_factor": count / prod(scene.body[0].sampling.counts),
        "nclaw.sec4_3.velocity_draws": len(SEEDS)}


def of_bodies():
    """Sections 4.4 and 4.5: bodies, and points in them."""
    dragon, (duck, water) = large(), pool().body
    body, filled = dragon.body[0], prod(water.sampling.counts)
    return {
        "nclaw.fig3.toys": len(contact().body),
        "nclaw.sec4_4.dragon_points": len(points(body.sampling, solid(body.shape), dragon.dx, 0)),
        "nclaw.sec4_5.duck": duck.sampling.count, "nclaw.sec4_5.water": filled,
        "nclaw.sec4_5.total": duck.sampling.count + filled}


def of_measurements():
    """Appendices F.1 and F.3: how often times are taken, how many gradients are drawn."""
    return {"nclaw.appF1.repeats": REPEATS["standard"], "nclaw.appF3.samples": POINTS}
