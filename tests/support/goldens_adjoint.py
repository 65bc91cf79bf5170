"""Golden files with adjoints, and other codes that hand in gradients: kernels and plain twin."""

from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
from adjoint_runs import dive, splash
from problems import DX, JELLY, ball, moving

from mpm_ref import oracle
from mpm_ref.adjoint import StepAdjoint, initial_stress_adjoint, zero_sums
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.solids import half_space
from mpm_ref.explicit import Scheme
from mpm_ref.materials import Hencky, HerschelBulkley, NeoHookean, NoFlow, make_flow
from mpm_ref.oracle import adjoint_recording, kernel_stages, recording
from mpm_ref.oracle.plain_adjoint import gradients
from mpm_ref.oracle.plain_twin import Twin
from mpm_ref.oracle.recording import copy_body
from mpm_ref.problem import Clock, Problem

STEPS, STEP = 2, 1e-3
SAND = Hencky(4e4, 6e4)


def problem_of(run):
    """A run of `adjoint_runs` as a problem."""
    return Problem(run.bodies, DX, Clock(dt=STEP, steps=100), run.gravity, run.scheme,
                   run.conditions)


def strained(d, law=JELLY, flow=None, y=None, scheme=None):
    """A small ball under random strain that spins on a floor that rubs."""
    scheme, rng = scheme or Scheme(), np.random.default_rng(1)
    ground = half_space((0.1, 0.08, 0.0)[:d], (0.1, 1.0, 0.0)[:d])
    body = ball("body", (0.31, 0.13, 0.32)[:d], law, flow or NoFlow(), transfer=scheme.transfer,
                radius=1.3)
    q = moving(body, (0.3, -1.0, 0.2)[:d], 3.0).particles
    q.F[:] = 0.99 * q.F + 0.02 * rng.normal(size=q.F.shape)
    if scheme.affine:
        q.C[:] = rng.normal(size=q.C.shape)
    body = body if y is None else body._replace(particles=q._replace(y=np.full(len(q.m), y)))
    return Problem((body,), DX, Clock(dt=STEP, steps=9), np.array((0.0, -9.8, 0.0)[:d]), scheme,
                   Conditions((Collider(ground, "separate", 0.3),)))


def sand():
    """A ball of sand under random strain, 2D."""
    return strained(2, SAND, make_flow("drucker_prager", SAND, 2, friction_angle=30.0))


STATES = {
    "fluid and metal 3d": lambda: problem_of(splash()),
    "flip 3": lambda: problem_of(dive()),
    "pic 1": lambda: problem_of(dive("pic", 1)),
    "sand 2d": sand,
    "paste 2d": lambda: strained(2, NeoHookean(4e4, 6e4), HerschelBulkley(500.0, 3.0)),
    "jelly 3d apic": lambda: strained(3, scheme=Scheme(transfer="apic", rpic=0.1)),
}


def agreement(state):
    """How the kernels in reverse order agree with a golden file of a state, as JSON takes it."""
    problem = STATES[state]()
    with TemporaryDirectory() as folder:
        golden, other = Path(folder) / "golden.h5", Path(folder) / "other.h5"
        oracle.record_adjoint(problem, golden, 1)
        oracle.write(other, kernel_arrays(problem, 1, order=-1))
        report = oracle.check(golden, other)
        with h5py.File(golden) as f:
            units = max(a.attrs["error_in_units"] for a in arrays_in(f["steps/0"]).values())
    return {"agrees": report.agrees, "text": str(report), "missing": report.missing,
            "units": float(units)}


def refusal_on_a_kink():
    """Why sand at rest is not recorded, and the files that this leaves."""
    problem = sand()
    q = problem.bodies[0].particles
    q.F[:], q.C[:], q.v[:] = np.eye(2), 0.0, (0.0, 1.0)
    with TemporaryDirectory() as folder:
        try:
            oracle.record_adjoint(problem, Path(folder) / "golden.h5", 1)
        except ValueError as error:
            return str(error), [file.name for file in Path(folder).iterdir()]
    return "", []


def arrays_in(group):
    """The arrays of a golden step that come with an error, by their keys."""
    arrays = {}
    group.visititems(lambda n, a: arrays.update({n: a}) if "error_in_units" in a.attrs else None)
    return arrays


def differences_from_step_adjoint(run):
    """Names of the arrays in which the stages do not end in the adjoint of the step to the bit."""
    problem = recording.copy_problem(problem_of(run), 1)
    stepper = recording.start_stepper(problem)
    before = tuple(copy_body(body, 1) for body in problem.bodies)
    seeds = [adjoint_recording.draw_seeds(problem, body, STEP, 0) for body in before]
    forward, _ = kernel_stages.step(problem, problem.bodies, stepper, 0.0, STEP)
    stages = adjoint_recording.adjoint_stages(problem, before, forward, seeds, (0.0, STEP))
    bars = [adjoint_recording.seed_bars(*pair) for pair in zip(before, seeds)]
    sums = [zero_sums(body) for body in before]
    expected = {"gravity": StepAdjoint(problem.stepper()).pull_back(before, bars, sums, 0.0, STEP)}
    for body, bar, parts in zip(before, bars, sums):
        initial_stress_adjoint(body, bar, parts)
        expected |= {f"{body.name}/{name}": getattr(bar, name)
                     for name in ("x", "v", "C", "F", "tau", "m", "V0", "b", "y")
                     if len(getattr(body.particles, name))}
        law, flow = np.split(parts.sum(axis=0), [len(body.law)])
        expected |= {f"{body.name}/law": law, f"{body.name}/flow": flow}
    return [name for name, a in expected.items()
            if not np.array_equal(a, stages.get(f"{name}_grad", []))]


def recorded(problem, path, steps=STEPS):
    """The path of a golden file with adjoints."""
    oracle.record_adjoint(problem, path, steps)
    return path


def kernel_arrays(problem, steps=STEPS, order=1):
    """What the kernels compute, as another code would hand it in, forwards and backwards."""
    problem = recording.copy_problem(problem, order)
    stepper, dt, out = recording.start_stepper(problem), problem.clock.dt, []
    for k in range(steps):
        before = tuple(copy_body(body, 1) for body in problem.bodies)
        seeds = [adjoint_recording.draw_seeds(problem, body, dt, k) for body in before]
        seeds = seeds if order == 1 else [seed.reversed() for seed in seeds]
        seen, _ = kernel_stages.step(problem, problem.bodies, stepper, k * dt, dt)
        back = adjoint_recording.adjoint_stages(problem, before, seen, seeds, (k * dt, dt))
        out.append(seen | back | {f"{b.name}/id": b.id for b in problem.bodies})
    return out


def twin_steps(problem, real, steps=STEPS):
    """What the plain twin computes backwards in a floating type, from its own states."""
    ours, twin, dt, out = recording.copy_problem(problem, 1), Twin(problem, real), STEP, []
    stepper = recording.start_stepper(ours)
    for k in range(steps):
        seeds = [adjoint_recording.draw_seeds(problem, body, dt, k) for body in ours.bodies]
        seen, contacts = kernel_stages.step(ours, ours.bodies, stepper, k * dt, dt)
        done = twin.step(dt, seen["nodes"], contacts)
        on_empty = problem.scheme.gravity_on_empty
        out.append({"nodes": seen["nodes"],
                    **gradients(twin, done, seeds, on_empty, seen["nodes"])})
    return out
