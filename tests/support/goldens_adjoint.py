"""Golden files with adjoints, and other codes that hand in gradients: kernels and plain twin."""

import numpy as np
from problems import DX, JELLY, ball, moving

from mpm_ref import oracle
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.solids import half_space
from mpm_ref.explicit import Scheme
from mpm_ref.materials import NoFlow
from mpm_ref.oracle import adjoint_recording, adjoint_stages, kernel_stages, recording
from mpm_ref.oracle.plain_adjoint import gradients
from mpm_ref.oracle.plain_twin import Twin
from mpm_ref.oracle.recording import copied
from mpm_ref.problem import Clock, Problem

STEPS, STEP = 2, 1e-3


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


def recorded(problem, path, steps=STEPS):
    """The path of a golden file with adjoints."""
    oracle.record_adjoint(problem, path, steps)
    return path


def seen_by(problem, steps=STEPS, order=1):
    """What the kernels compute, as another code would hand it in, forwards and backwards."""
    problem = recording.problem_of(problem, order)
    stepper, dt, out = recording.started(problem), problem.clock.dt, []
    for k in range(steps):
        before = tuple(copied(body, 1) for body in problem.bodies)
        seeds = [adjoint_recording.seeds_of(problem, body, dt, k) for body in before]
        seeds = seeds if order == 1 else [seed.reversed() for seed in seeds]
        seen, _ = kernel_stages.step(problem, problem.bodies, stepper, k * dt, dt)
        back = adjoint_stages.step(problem, before, seen, seeds, (k * dt, dt))
        out.append(seen | back | {f"{b.name}/id": b.id for b in problem.bodies})
    return out


def twin_steps(problem, real, steps=STEPS):
    """What the plain twin computes backwards in a floating type, from its own states."""
    ours, twin, dt, out = recording.problem_of(problem, 1), Twin(problem, real), STEP, []
    stepper = recording.started(ours)
    for k in range(steps):
        seeds = [adjoint_recording.seeds_of(problem, body, dt, k) for body in ours.bodies]
        seen, contacts = kernel_stages.step(ours, ours.bodies, stepper, k * dt, dt)
        done = twin.step(dt, seen["nodes"], contacts)
        on_empty = problem.scheme.gravity_on_empty
        out.append({"nodes": seen["nodes"],
                    **gradients(twin, done, seeds, on_empty, seen["nodes"])})
    return out
