"""A golden file of two disks under stress, and another code that is our own, stage by stage."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from problems import DX, FREE, JELLY, ball, moving, two_disks

from mpm_ref import oracle
from mpm_ref.materials import NoFlow
from mpm_ref.oracle import kernel_stages, recording
from mpm_ref.oracle.schema import ARRAYS
from mpm_ref.problem import Clock, Problem

ROOT = Path(__file__).resolve().parents[2]
STEPS = 2
ON_NODES = [a.name for a in ARRAYS if a.location == "nodes"]


def stretched():
    """Two disks under stress from the first step on."""
    problem = two_disks()
    for body in problem.bodies:
        body.particles.F[:] *= 0.99
        body.particles.C[:] = np.random.default_rng(0).normal(size=body.particles.C.shape)
    return problem


def kernel_arrays(problem, steps=STEPS, order=1):
    """What the kernels compute, as another code would hand it in."""
    problem = recording.copy_problem(problem, order)
    stepper, dt = recording.start_stepper(problem), problem.clock.dt
    steps = [kernel_stages.step(problem, problem.bodies, stepper, k * dt, dt)[0]
             for k in range(steps)]
    return [seen | {f"{b.name}/id": b.id for b in problem.bodies} for seen in steps]


def recorded(folder):
    """Path of a golden file of the disks."""
    oracle.record(stretched(), folder / "golden.h5", STEPS)
    return folder / "golden.h5"


def checker(golden, path):
    """A function that checks arrays against a golden file, by way of a file at `path`."""
    def check(steps, **how):
        oracle.write(path, steps)
        return oracle.check(golden, path, **how)
    return check


def run_example(name, folder):
    """Output of an example, from a copy of all examples in a folder; it leaves no files."""
    shutil.copytree(ROOT / "examples", folder / "examples",
                    ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "empty").mkdir()
    files = sorted(folder.rglob("*"))
    done = subprocess.run([sys.executable, "-B", folder / "examples" / name], cwd=folder / "empty",
                          text=True, check=False, capture_output=True,
                          env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert done.returncode == 0, done.stderr
    assert sorted(folder.rglob("*")) == files
    return done.stdout


def alone(scheme, law=JELLY, **fields):
    """One spinning disk without conditions."""
    body = moving(ball("jelly", (0.31, 0.13), law, NoFlow(), transfer=scheme.transfer), 1.0, 5.0)
    body = body._replace(particles=body.particles._replace(**fields))
    return Problem((body,), DX, Clock(dt=1e-3, steps=9), np.array([0.0, -9.8]), scheme, FREE)
