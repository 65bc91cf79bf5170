"""Energy that laws take away or create, in closed strain cycles of one element and in the returns
of whole runs (see `mpm_ref.nclaw.dissipation`).
"""

from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from mpm_ref.body import restore_order
from mpm_ref.energy import kinetic
from mpm_ref.materials.learned import learned_flow, learned_law
from mpm_ref.nclaw.bodies import body_with_laws, deformation_gradients
from mpm_ref.nclaw.dissipation import balance, loops, work
from mpm_ref.nclaw.study.compare import RunBroken, positions
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import threads_for
from ..common.weights_needed import load_available
from .environments import ENVIRONMENTS, environment
from .trained_laws import trained, weights_of

METHODS = ("ours", "admissible")
TRUE = "true"
BOUND = TRUE, "admissible"          # laws that must not create energy
SIZES = (0.02, 0.1)                 # of cycles
CREATED = 1e-4      # a cycle creates energy that gives back this share of what went in and out more
ROUND_OFF = 1e-12   # of the energy that a body is thrown with
CYCLES = ("method", "environment", "size", "cycles", "least_share", "least_work", "creating",
          "mean_share")
RUNS = ("method", "environment", "steps", "taken", "created", "thrown", "why")


class MaterialLaws(NamedTuple):
    """The elastic and the plastic law of a body."""

    law: tuple
    flow: tuple


@experiment("nclaw.dissipation", title="NCLaw: energy that laws take away or create",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 1200})
def dissipation(run):
    """True laws, the paper's network, and laws that thermodynamics admits, which are what its
    conclusion leaves for later: cycles from rest, and the training runs.
    """
    laws = tested_laws(run)
    n, steps = run.choose(quick=(20, 100), standard=(1000, 200))
    length = run.choose(quick=50, standard=environment(ENVIRONMENTS[0]).steps)
    closed = {size: loops(n, size, steps, run.rng) for size in SIZES}
    cycles, runs = [], []
    for (method, name), pair in run.progress(laws.items(), "laws"):
        cycles += [(method, name, size, n, *cycled(pair, G)) for size, G in closed.items()]
        energies = run.cached(f"{method}.{name}", partial(returns, name, pair, length))
        runs.append((method, name, length, *energies))
    run.table("cycles", CYCLES, cycles)
    run.table("runs", RUNS, runs)
    for row in cycles:
        record_cycles(run, row, steps)
    for row in runs:
        record_run(run, row)


def tested_laws(run):
    """Return {(method, environment): `MaterialLaws`}; record which weights are missing."""
    names = {(method, name): weights_of(method, name)
             for name, method in product(ENVIRONMENTS, METHODS)}
    laws = load_available(run, names.values(), trained)
    true = {(TRUE, name): build(environment(name)).bodies[0] for name in ENVIRONMENTS}
    return {**{key: MaterialLaws(body.law, body.flow) for key, body in true.items()},
            **{key: MaterialLaws(learned_law(laws[name].elastic), learned_flow(laws[name].plastic))
               for key, name in names.items() if name in laws}}


def cycled(pair, G):
    """Return the least share and work [J/m^3] of a cycle, the share of cycles that create energy,
    and the mean share.
    """
    cycles = balance(*pair, G)
    creating = np.mean(cycles.share < -CREATED)
    return tuple(map(float, (cycles.share.min(), cycles.work.min(), creating,
                             cycles.share.mean())))


def returns(name, pair, steps):
    """Return the energy that the returns of a training run take away and create [J], that of its
    motion at the start [J], and why it ended before so many steps, if it did.
    """
    problem = build(environment(name, steps=steps, every=1))
    body, energies, why = body_with_laws(problem.bodies[0], *pair), [], ""
    thrown = float(kinetic(body.particles).sum())
    with threads_for(problem.bodies):
        try:
            energies += taken(body, pair.law, positions(problem, (body,)), problem.clock.dt)
        except RunBroken as end:
            why = str(end)
    a = np.array(energies)
    return float(a[a > 0.0].sum()), float(-a[a < 0.0].sum()), thrown, why


def taken(body, law, frames, dt):
    """Yield what the return of each point took away in each step [J], (n,), of a body of which the
    frames are all steps of dt [s].
    """
    F = np.tile(np.eye(3), (len(body.id), 1, 1))
    V0 = restore_order(body.particles.V0, body.id)
    next(frames)
    for _ in frames:
        L, F_new = (restore_order(a, body.id)
                    for a in (body.particles.L, deformation_gradients(body)))
        yield V0 * work(law, F_new, F + dt * L @ F)
        F = F_new


def record_cycles(run, row, steps):
    """Record the work of a law's cycles."""
    method, name, size, n, least, work, creating, _ = row
    target = f"nclaw.dissipation.{method}.{name}.cycles.{size}"
    scale = f"{n} cycles, {steps} steps each"
    rule = {"comparator": "<=", "bound": 0.0} if method in BOUND else {"comparator": "info"}
    run.record(f"{target}.least", least, scale=scale, comparator="info",
               note=f"work of the cycle that gives back most, over what went in and out; the least "
                    f"work is {work:.3g} J/m^3")
    run.record(f"{target}.creating", creating, scale=scale, **rule,
               note=f"share of cycles that give back {CREATED:g} of what went in and out more than "
                    "was put in")


def record_run(run, row):
    """Record the energy that the returns of a run took away, and that which they created."""
    method, name, steps, taken, created, thrown, why = row
    target, scale = f"nclaw.dissipation.{method}.{name}.run", f"{steps} steps"
    rule = {"comparator": "<=", "bound": ROUND_OFF} if method in BOUND else {"comparator": "info"}
    run.record(f"{target}.taken", taken, unit="J", scale=scale, comparator="info", note=why)
    run.record(f"{target}.created", created / thrown, scale=scale, **rule,
               note="energy that returns added, over that of the motion at the start")
