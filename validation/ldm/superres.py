"""A map trained on few points runs many on a finer grid (LDM-sec5.2.1, Table 4, Figure 12)."""

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.rom.study.errors import Squares
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import SCHEMES, RunOptions, ldm_run
from mpm_ref.scene import build
from mpm_ref.trajectories import history

from ..common.registry import experiment
from ..common.scenes import threads_for, with_
from .networks import trained
from .references import record_errors
from .studies import TORSION

FINE = 13900        # points
REFINE = 2          # cells per cell, axis and step
NET = "torsion-0"
BASELINE = "baseline"


def fine(v, w):
    """The block pulled at v [m/s] and twisted at w [rad/s], on the finer grid, in shorter steps."""
    scene = TORSION.scene(v, w)
    body = scene.body[0]
    body = with_(body, sampling=with_(body.sampling, count=FINE))
    return with_(scene, dx=scene.dx / REFINE, dt=scene.dt / REFINE, steps=scene.steps * REFINE,
                 body=(body,))


def advected(scene, X):
    """Return x (k + 1, n, d) of points X (n, d) that go with the velocity field of a full-order
    run, the paper's baseline. A node without mass stands still.
    """
    problem = build(scene)
    n, d = X.shape
    tracers = Body("tracers", particles_at(X, np.zeros((n, d)), np.zeros(n), np.zeros(n), "pic"),
                   problem.bodies[0].law, problem.bodies[0].flow, np.arange(n))
    stepper, dt, levels = problem.stepper(), problem.clock.dt, [X.copy()]
    stepper.start(problem.bodies)
    for k in range(problem.clock.steps):
        stepper.step((*problem.bodies, tracers), k * dt, dt)
        levels.append(tracers.particles.x.copy())
    return np.array(levels)


@experiment("ldm.table4", title="LDM: more points than it was trained on",
            profiles=("quick", "standard"), budget={"quick": 25, "standard": 900})
def superresolution(run):
    """Errors of reduced runs and of advected tracers beside fine full-order runs, at the time
    levels that both have; and how many times larger the tracers' are.
    """
    schemes = run.choose(quick=SCHEMES[1:2], standard=SCHEMES)
    tests = TORSION.test[:run.choose(quick=1, standard=None)]
    model, sums, rows = trained(NET), {}, []
    for k in run.progress(tests, "runs"):
        mu = TORSION.mu[k]
        one = ldm_full_model(fine(*mu))
        with threads_for(one.problem.bodies):
            x = history(build(fine(*mu))).x[::REFINE]
        runs = {RunOptions(*scheme).name: reduced(one, model, RunOptions(*scheme))[::REFINE]
                for scheme in schemes}
        runs[BASELINE] = advected(TORSION.scene(*mu), one.X)
        for name, states in runs.items():
            squares = Squares(one.X)
            for state, reference in zip(states, x, strict=True):
                squares.add(state, reference)
            sums.setdefault(name, Squares(one.X)).sums += squares.sums
            rows.append((*mu, name, *squares.errors))
    record_schemes(run, {name: total.errors for name, total in sums.items()},
                   f"{FINE} particles, {one.problem.clock.steps} steps, "
                   f"{len(tests)} of {len(TORSION.test)} test runs, "
                   f"errors of {len(one.X)} points at {len(x)} times each")
    run.table("errors", ("v", "w", "scheme", "origin", "centroid", "displacement"), rows)


def record_schemes(run, errors, scale):
    """Record the errors {scheme or BASELINE: `PositionErrors`}; of the whole study also the ratio
    of the tracers' error to the largest of the others.
    """
    tracers = errors[BASELINE]
    schemes = {name: one for name, one in errors.items() if name != BASELINE}
    for name, one in schemes.items():
        record_errors(run, f"ldm.table4.{name}", one, scale)
    record_errors(run, f"ldm.table4.{BASELINE}", tracers, scale,
                  "the reduced runs have to beat it, see ldm.table4.gain")
    if run.profile == "standard":
        worst = max(schemes, key=lambda name: schemes[name].origin)
        run.record("ldm.table4.gain", tracers.origin / schemes[worst].origin, unit="x", scale=scale,
                   comparator=">=", bound=1.0, note="the tracers' error over the largest of the "
                   f"reduced runs, {worst}")


def reduced(one, model, options):
    """Return x (k + 1, n, d) of a reduced run."""
    run = ldm_run(one, model.field, options, model.rest)
    return np.array([model.field.place(one.X, state.latent.xhat) for state in run.states()])
