"""Treatments of nodes that hardly touch matter: out of the unknowns, or with more mass.

`light_nodes` shows that such nodes make the slow modes of HOT's multigrid. Here they are treated
before the solve:

    falls       they take the increment dt g and are no unknowns
    heavier     their mass is raised to the threshold, LIGHT of the median mass of a node

The error of the particles is that against the exact increment of the step as it is, so that it
contains what the treatment changes.
"""

from functools import partial
from statistics import geometric_mean, median
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.hot.methods import minimise, printed
from mpm_ref.hot.potential import Potential

from ..common.registry import experiment
from .light_nodes import DX, LIGHT, STEPS, E
from .one_step import particle_errors, solve_step, step_after
from .stiffness import bar
from .warm_states import following_steps, warm_state

TREATMENTS = ("none", "falls", "heavier")
METHODS = ("hot", "hot-plus")
SCENES = ("faceless", "twist", "wheel", "boxes", "armacat_stiff")
EXACT = {"eps": 1e-10, "flexible": True, "max_iterations": 1000, "max_cg_iterations": 20000}
FEWER = 0.9         # mean iterations over those without treatment, at which one would be adopted
CELLS = 1e-3        # error that it may add to the displacement of a particle [dx]
REPEATS = 3


class TreatedSolve(NamedTuple):
    """A solve of a step by a method with a treatment of its light nodes."""

    scene: str
    method: str
    treatment: str
    particles: int
    light: float        # share of the nodes
    iterations: int
    converged: bool
    cpu: float          # median of repeats in turn [s]
    cells: float        # largest error of a particle's displacement [dx]


def light_nodes_of(unknowns):
    """Return which nodes (n,) are light, among those that conditions leave free."""
    free = (unknowns.B == np.eye(unknowns.B.shape[1])).all(axis=(1, 2))
    return free & (unknowns.m < LIGHT * np.median(unknowns.m))


def treated(step, treatment):
    """Return the pose of an `ImplicitStep` without friction, with its light nodes treated and a
    potential of its own.
    """
    pose, q = step.pose, step.pose.unknowns
    light = light_nodes_of(q)
    if treatment == "falls":
        q = q._replace(B=np.where(light[:, None, None], 0.0, q.B),
                       dv0=np.where(light[:, None], pose.gravity_increment, q.dv0))
    elif treatment == "heavier":
        q = q._replace(m=np.where(light, LIGHT * np.median(q.m), q.m))
    potential = Potential(step.bodies, q, pose.potential.stencil, step.dt, step.stepper.gravity,
                          step.stepper.options.return_map)
    return pose._replace(unknowns=q, potential=potential)


def solve_in_turn(step, method, repeats):
    """Return {treatment: (CPU seconds, `Solution`)} of a step by a method; kernels are compiled."""
    seconds = {treatment: [] for treatment in TREATMENTS}
    for _ in range(repeats):
        solutions = {}
        for treatment in TREATMENTS:
            pose, start = treated(step, treatment), process_time()
            solutions[treatment] = minimise(step.stepper.system(pose), printed(method))
            seconds[treatment].append(process_time() - start)
    return {treatment: (median(seconds[treatment]), solutions[treatment])
            for treatment in TREATMENTS}


def measured(name):
    """Return the `TreatedSolve`s of a step of the bar or of a scene."""
    step = step_of(name)
    exact = solve_step(step, "pn-mgpcg", **EXACT)
    if not exact.report.converged:
        raise RuntimeError(f"{name}: the exact solve stopped at {exact.report.message}")
    light = float(light_nodes_of(step.pose.unknowns).mean())
    solve_in_turn(step, METHODS[-1], 1)
    return [TreatedSolve(name, method, treatment, step.particles, light,
                         solution.report.iterations, solution.report.converged, cpu,
                         particle_errors(step, solution.dv, exact.dv).cells_max)
            for method in METHODS
            for treatment, (cpu, solution) in solve_in_turn(step, method, REPEATS).items()]


def step_of(name):
    """Return the `ImplicitStep` of the bar of `light_nodes`, or of a small scene in its motion."""
    if name == "bar":
        return step_after(bar(DX, E, "hot", STEPS), STEPS)
    return next(following_steps(*warm_state(name, "quick"), 1))


@experiment("hot.light-node-treatments", title="Nodes at the rim out of the unknowns, or heavier",
            profiles=("standard",), budget={"standard": 400})
def light_node_treatments(run):
    """Record times and errors with each treatment, and how many of them would be adopted."""
    names, solves = ("bar", *SCENES), []
    for name in run.progress(names, "scenes"):
        solves += [TreatedSolve(*values) for values in run.cached(name, partial(measured, name))]
    adopted = [record_treatment(run, treatment, method, solves)
               for treatment in TREATMENTS[1:] for method in METHODS]
    run.record("hot.light-node-treatments.adopted", sum(adopted), unit="1", comparator="<=",
               bound=0, scale=f"{len(names)} steps, {len(METHODS)} methods",
               note=f"treatments, each by each method, that take at most {FEWER} of the "
               f"iterations and add at most {CELLS:g} dx of error; decision 32: none")
    run.table("solves", TreatedSolve._fields, solves)


def record_treatment(run, treatment, method, solves):
    """Record the mean iterations of a treatment over those of none; return whether to adopt it."""
    pairs = [(find(solves, scene, method, "none"), find(solves, scene, method, treatment))
             for scene in {solve.scene: None for solve in solves}]
    ratio = geometric_mean([one.iterations / none.iterations for none, one in pairs])
    time = geometric_mean([one.cpu / none.cpu for none, one in pairs])
    added = max(one.cells - none.cells for none, one in pairs)
    solved = all(one.converged >= none.converged for none, one in pairs)
    counts = ", ".join(f"{none.scene} {none.iterations} to {one.iterations}" for none, one in pairs)
    run.record(f"hot.light-node-treatments.{treatment}.{method}", ratio, unit="x",
               comparator="info", scale=f"{len(pairs)} steps; up to "
               f"{max(solve.particles for solve in solves)} particles",
               note=f"mean iterations over those without: {counts}; CPU time x {time:.2f}; it adds "
               f"up to {added:.1e} dx of error" + ("" if solved else "; fewer solves converge"))
    return solved and ratio <= FEWER and added <= CELLS


def find(solves, scene, method, treatment):
    """Return the `TreatedSolve` of a scene, a method and a treatment."""
    return next(solve for solve in solves
                if (solve.scene, solve.method, solve.treatment) == (scene, method, treatment))
