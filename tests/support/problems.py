"""A small problem with everything in it, and what to do with it in another process."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from mpm_ref.body import Body, particles_at, with_separate_gradient
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.solids import half_space
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import FixedCorotated, Hencky, NoFlow, make_flow
from mpm_ref.problem import Clock, Problem

HERE = Path(__file__).resolve().parent
DX, DT = 0.05, 1e-3
JELLY, METAL = FixedCorotated(4e4, 6e4), Hencky(4e4, 6e4)


def ball(name, center, law, flow, *, transfer="mls", radius=2.4):
    """A disk or ball of `radius` cells on a lattice."""
    d, h = len(center), DX / 2
    k = np.arange(-10, 11) * h
    x = np.stack(np.meshgrid(*d * [k], indexing="ij"), axis=-1).reshape(-1, d)
    x = x[(x**2).sum(axis=1) < (radius * DX) ** 2] + center
    n, V = len(x), h**d
    q = particles_at(x, np.zeros((n, d)), np.full(n, 1e3 * V), np.full(n, V), transfer)
    return Body(name, q, law, flow, np.arange(n))


def moving(body, v, spin=0.0):
    """The body with velocity v and, in its first two axes, a spin [1/s]."""
    q = body.particles
    r = q.x - q.x.mean(axis=0)
    q.v[:] = v
    q.v[:, 0] -= spin * r[:, 1]
    q.v[:, 1] += spin * r[:, 0]
    return body


def two_disks(scheme=None, conditions=None, gravity=(0.0, -9.8)):
    """A spinning elastic disk and a hardening one that hits it, 2D, on a floor unless told."""
    scheme = scheme or Scheme()
    flow = make_flow("von_mises_hardening", METAL, 2, tau_y=50.0, xi=0.2)
    jelly = ball("jelly", (0.31, 0.13), JELLY, NoFlow(), transfer=scheme.transfer)
    metal = ball("metal", (0.33, 0.36), METAL, flow, transfer=scheme.transfer)
    metal = metal._replace(particles=metal.particles._replace(y=np.full(len(metal.id), 50.0)))
    if scheme.relaxation:
        jelly, metal = (body._replace(particles=with_separate_gradient(body.particles))
                        for body in (jelly, metal))
    bodies = moving(jelly, (0.0, -1.0), 3.0), moving(metal, (0.2, -3.0))
    if conditions is None:
        floor = Collider(half_space((0.0, 0.04), (0.0, 1.0)), "separate", 0.3)
        wall = Collider(half_space((0.21, 0.0), (1.0, 0.2)), "slip")
        conditions = Conditions(colliders=(floor, wall))
    return Problem(bodies, DX, Clock(dt=DT, steps=100), np.array(gravity), scheme, conditions)


FREE = Conditions()


def stepped(problem, steps, sort_every=None):
    """The bodies after some steps."""
    stepper = Stepper(problem.scheme, problem.dx, problem.dim, problem.gravity, problem.conditions)
    stepper.start(problem.bodies)
    for k in range(steps):
        if sort_every and k % sort_every == 0:
            stepper.sort(problem.bodies)
        stepper.step(problem.bodies, k * DT, DT)
    return problem.bodies


def digest(bodies):
    """sha256 of all arrays."""
    sha = hashlib.sha256()
    for body in bodies:
        for a in (*body.particles, body.id):
            sha.update(np.ascontiguousarray(a).tobytes())
    return sha.hexdigest()


def run_python(code, **environment):
    """The JSON that `code` prints in a new Python process, with some environment variables."""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE), str(HERE.parents[1])]),
           **environment}
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], env=env, check=False,
                          capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
