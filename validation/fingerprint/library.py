"""Calls of mpm_ref that the cases need, as plain functions and by position where possible.

Only the modules `library*` import mpm_ref: names that change there change here.
Records are unpacked or listed by position, so that renamed fields need no change at all.
"""

from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.core.jit import set_threads
from mpm_ref.energy import angular_momentum, energy, momentum
from mpm_ref.hot.methods import METHODS, printed
from mpm_ref.scene import build, load
from mpm_ref.scene.overrides import with_values
from mpm_ref.simulate import simulate
from mpm_ref.tape import Seed, Tape

ROOT = Path(__file__).parents[2]
PARTICLES = ("x", "v", "C", "L", "F", "tau", "m", "V0", "y", "b")


@contextmanager
def threads(count):
    """Run kernels on a number of threads, and BLAS on one, within the block."""
    before = numba.get_num_threads()
    set_threads(count)
    try:
        with one_thread():
            yield
    finally:
        set_threads(before)


def scene_names():
    """Return the names of all scenes of the repository."""
    return sorted(path.stem for path in (ROOT / "scenes").glob("*.toml"))


def scene(name, **values):
    """Return a scene with values {path: value} put into it."""
    base = load(ROOT / "scenes" / f"{name}.toml")
    return with_values(base, values) if values else base


def problem(name, values=None):
    """Return the problem of a scene with values {path: value} put into it."""
    return build(scene(name, **(values or {})))


def state_of(bodies):
    """Return {label: array} of all arrays of the particles of bodies, in the order stored."""
    state = {}
    for k, (_, particles, _, _, number) in enumerate(bodies):
        arrays = dict(zip(PARTICLES, particles, strict=True)) | {"number": number}
        state |= {f"body {k} {label}": array for label, array in arrays.items()}
    return state


class _Enough(Exception):
    """Ends a run."""


def simulated(problem, steps):
    """Return the state, energies, momenta and solver's report of a problem after some steps."""
    def stop(state, dt):
        if state.step >= steps:
            raise _Enough

    last = None
    try:
        for frame in simulate(problem, on_step=stop):
            last = frame.state
    except _Enough:
        pass
    bodies = last.bodies
    return state_of(bodies) | {
        "step": last.step, "t": last.t, "stable dt": last.bound,
        "energy": energy(bodies, problem.gravity, problem.inertia), "momentum": momentum(bodies),
        "angular momentum": angular_momentum(bodies, problem.inertia),
        "solver": report_of(last.solve)}


def report_of(solve):
    """Return the counts and residuals of an implicit step's report, without times and text."""
    if solve is None:
        return ()
    _, converged, _, *counts, residuals, _, off, _, _ = solve
    return converged, tuple(counts), np.array(residuals), off


def solvers():
    """Return the options of every implicit method as HOT prints them, in their order."""
    return tuple(map(printed, METHODS))


def with_solver(problem, options, **changes):
    """Return a problem solved by a method's options with changes."""
    return replace(problem, integrator="implicit", solver=replace(options, **changes))


def adjoint_of(problem, steps, dt):
    """Return the state after some explicit steps, and all gradients of a loss of it.

    The loss is sum |x|^2/2 + |v|^2/2 + |F|^2/2, so that its gradients are x, v and F.
    """
    stepper = problem.stepper()
    stepper.start(problem.bodies)
    stepper.sort(problem.bodies)
    tape = Tape(stepper, problem.bodies, every=3, clip=problem.clip)
    for n in range(steps):
        tape.step(n * dt, dt)
    seeds = [Seed(x=q.x.copy(), v=q.v.copy(), F=q.F.copy()) for _, q, *_ in problem.bodies]
    return state_of(problem.bodies) | {"gradient": tape.gradient({steps: seeds})}
