"""A golden file of implicit steps, and another code: the plain twin with SciPy's multigrid."""

from dataclasses import replace

import h5py
import numpy as np
from hot_steps import DT, DX, block, conditions, unit

from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.levelset import half_space
from mpm_ref.explicit import Scheme
from mpm_ref.hot.methods import PRINTED, SolverOptions, printed
from mpm_ref.hot.multigrid.hierarchy import hierarchy
from mpm_ref.oracle import accepted_step, implicit_recording, recording
from mpm_ref.oracle.implicit_twin import ImplicitTwin, embedding_weights, prolongate
from mpm_ref.problem import Clock, Problem

STEPS = 2
EPS = 1e-9
SIDE = {2: 8, 3: 3}


def problem_of(d, kind="slip", **rules):
    """Two blocks, the second stiffer, on a floor askew; held on a side if it is "slip". Solves
    start as HOT prints it.
    """
    shift = SIDE[d] * DX / 2 * np.array(unit(d, 0))
    soft = block(d, 1e5, np.zeros(d), SIDE[d])._replace(name="soft")
    hard = block(d, 1e6, shift, SIDE[d])._replace(name="hard")
    g = -9.8 * np.array(unit(d, d - 1))
    held = conditions(d) if kind == "slip" else floor(d, kind)
    scheme = rules.pop("scheme", Scheme(transfer="apic"))
    return Problem((soft, hard), DX, Clock(dt=DT, steps=9), g, scheme, held,
                   integrator="implicit", solver=printed("hot"), **rules)


def floor(d, kind):
    """A floor of some kind, askew."""
    normal = np.array(unit(d, d - 1)) + 0.2 * np.array(unit(d, 0))
    return Conditions((Collider(half_space((0.0,) * d, tuple(normal)), kind),), ())


def bodies_at(problem, golden, k):
    """The bodies at the start of step k of a golden file: for k > 0, the end of the one before."""
    bodies = recording.copy_problem(problem, 1).bodies
    for body in bodies:
        first = golden[f"bodies/{body.name}"]
        last = golden[f"steps/{k - 1}/{body.name}"] if k else first
        for field in ("x", "v", "C", "F", "y", "m", "V0"):
            source = last if field in last else first
            if field in source:
                getattr(body.particles, field)[:] = source[field][()]
    return bodies


def given(step, level=None):
    """The vector that a file gives for a level's operators, or all three of the finest."""
    if level:
        return step[f"probe{level}"][()]
    return [step[name][()] for name in ("trial", "probe", "load")]


def step_of(problem, golden, k, real=np.float64):
    """What another code computes in step k: {key: array}, as `oracle.write` takes it."""
    step = golden[f"steps/{k}"]
    posed = replace(problem, bodies=bodies_at(problem, golden, k))
    stepper, (t, dt) = recording.start_stepper(posed), (step.attrs["t"], step.attrs["dt"])
    pose = stepper.problem(posed.bodies, t, dt)
    system, twin = stepper.system(pose), ImplicitTwin(posed, pose.unknowns, dt, real)
    seen = twin.grid_arrays() | twin.conditions() | {"kappa": twin.kappa(), "nodes": system.index}
    trial, probe, load = given(step)
    for name, dv in (("start", system.start), ("trial", trial)):
        E, g = twin.potential(dv.astype(real))
        product = twin.hessian_product(twin.tangents(dv.astype(real)), probe.astype(real))
        seen |= {f"E_{name}": E, f"gradient_{name}": g, f"product_{name}": product}
    seen |= multigrid(step, system, load)
    options = accepted_step.second_method(stepper.options, golden.attrs["eps"])
    pose, dv = accepted_step.solve_with(stepper, posed.bodies, (t, dt), options)
    seen["dv"] = dv
    return seen | twin.after_solve((pose.unknowns.v + dv).astype(real))


def multigrid(step, system, load):
    """{key: array} of multigrid on SciPy matrices."""
    A = system.matrix(system.start)
    grids = hierarchy(A, system.index, implementation="scipy")
    seen = {"cycle": grids.cycle(load)}
    g = system.evaluate(system.start)[1]
    options = SolverOptions(implementation="scipy", **PRINTED)
    seen["direction"] = implicit_recording.first_direction(system, A, g, options)
    for k, (fine, coarse) in enumerate(zip(grids.levels, grids.levels[1:]), 1):
        W = embedding_weights(fine.index, coarse.index, "linear")
        u = given(step, k)
        seen[f"prolonged{k}"] = prolongate(W, fine.B, u)
        seen[f"coarse{k}"] = (coarse.A @ u.reshape(-1)).reshape(u.shape)
        seen[f"nodes{k}"] = coarse.index
    return seen


def steps_of(problem, path, real=np.float64):
    """All steps of a golden file by the other code."""
    with h5py.File(path) as golden:
        return [step_of(problem, golden, k, real) for k in range(len(golden["steps"]))]
