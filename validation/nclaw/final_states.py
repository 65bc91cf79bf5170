"""The final states of the four training environments.

They are recorded for later comparison, of our runs with each other and with other codes; NCLaw's
own are in single precision and not published.
"""

import hashlib

import numpy as np

from mpm_ref.energy import kinetic
from mpm_ref.monitor import volume_ratio
from mpm_ref.nclaw.study.compare import positions
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import mean, threads_for, with_
from .environments import ENVIRONMENTS, environment

CARRIED = ("x", "v", "C", "F", "y")         # what a particle carries from step to step
AXES = "xyz"


@experiment("nclaw.environments", title="Final states of NCLaw's four environments",
            profiles=("quick", "standard"), budget={"quick": 40, "standard": 40})
def environments(run):
    """1000 particles, 1000 steps each."""
    rows = []
    for name in run.progress(ENVIRONMENTS, "environments"):
        body = final(name)
        rows.append(state_row(name, body))
        record_state(run, name, body)
    run.table("states", ("environment", *(f"{what}_{a}" for what in ("center", "low", "high")
                                          for a in AXES), "J", "kinetic", "sha256"), rows)


def final(name):
    """Return the body of an environment after its last step.

    Neither its energy nor the bound of its time step is computed, which changes no bit.
    """
    scene = environment(name)
    problem = build(with_(scene, every=scene.steps))
    with threads_for(problem.bodies):
        for _ in positions(problem, problem.bodies):
            pass
    return problem.bodies[0]


def state_row(name, body):
    """Return the name, centre of mass, bounding box, mean J, kinetic energy, hash of a body's
    state.
    """
    q = body.particles
    return (name, *mean(body, "x"), *q.x.min(axis=0), *q.x.max(axis=0),
            float(volume_ratio(q).mean()), float(kinetic(q).sum()), digest(body))


def record_state(run, name, body):
    """Record the numbers of one final state."""
    q, target = body.particles, f"nclaw.environments.{name}"
    rule = {"comparator": "info", "scale": f"{len(q.x)} particles, 1000 steps, as printed"}
    for axis, x in zip(AXES, mean(body, "x"), strict=True):
        run.record(f"{target}.center.{axis}", float(x), unit="m", **rule)
    run.record(f"{target}.J", float(volume_ratio(q).mean()), note="mean volume ratio", **rule)
    run.record(f"{target}.kinetic", float(kinetic(q).sum()), unit="J",
               note=f"sha256 of the state {digest(body)}", **rule)


def digest(body):
    """sha256 of what the particles carry, in the order in which they were sampled."""
    order, text = np.argsort(body.id), hashlib.sha256()
    for name in CARRIED:
        a = getattr(body.particles, name)
        text.update(np.ascontiguousarray(a[order] if len(a) == len(order) else a).tobytes())
    return text.hexdigest()
