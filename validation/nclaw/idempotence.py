"""Laws whose training counts what a second return map changes, a variant of NCLaw's recipe.

The true return maps are projections: a second one changes nothing. Nothing in the printed training
asks that of the learned one, which returns a part of a strain in each step, and the stress is
learned for the F that it leaves: so both belong to the time step of training. The variants have
`Recipe.idempotence` times the mean squared change of F in a second return in their loss: one is the
printed training with the term from its first epoch on; the other goes on from the printed training,
beside one that goes on alike without the term. Each is a file of weights, remade by
`python -m validation.training.nclaw NAME`.
"""

from functools import cache, partial
from typing import NamedTuple

import numpy as np

from mpm_ref.materials import Fluid, FluidProjection
from mpm_ref.materials.learned import learned_flow, learned_law
from mpm_ref.nclaw.bodies import body_with_laws, deformation_gradients
from mpm_ref.nclaw.dissipation import returned
from mpm_ref.nclaw.study.compare import RunBroken, positions
from mpm_ref.scene import build

from ..common import targets
from ..common.registry import experiment
from ..common.scenes import threads_for
from ..common.weights_needed import load_available
from ..extremes.nclaw_extrapolation import with_time_step
from .dissipation import TRUE, MaterialLaws
from .diverged_trainings import diverged_trainings, record_epochs
from .environments import environment
from .errors import COLUMNS, OURS, errors, grouped, quick_note, scale
from .evaluate import ComparedError, body_maker, compare
from .longer_horizons import continued_laws
from .printed_ids import error_id
from .trained_laws import nets, trained

TERM = 0.3              # weight of the term [m^2]
VARIANTS = "again", "idempotent", "idempotent-start"
NAMES = ("water",)      # environments of which the variants are trained
SCHEDULE = {"epochs": 24, "first": 50, "last": 200, "elastic_rate": 0.3, "plastic_rate": 0.03}
FACTORS = 0.5, 2.0      # times the step of training
SHEAR = 1e-3            # size of what is added to F, over that of F
EVERY = 50              # steps between the states that are probed
STEPS = ("method", "environment", "factor", "error", "step", "why")


class Returns(NamedTuple):
    """The effect of the return map of a run on small strains."""

    shares: list        # 5, 50 and 95 % of the share of an added shear that it passes on
    second: float       # change of F in a second return, over that of a step before the first
    frames: int         # that were probed
    why: str            # sentence with which the run broke down; "" if it ran to its end


def idempotent_nets():
    """Return {name: `LawNet`} of the trainings of `VARIANTS`."""
    return {f"{name}-{word}": nets()[name]._replace(**changes) for name in NAMES
            for word, changes in zip(VARIANTS, changes_of(name), strict=True)}


def changes_of(name):
    """Return what each of `VARIANTS` changes in the printed training of an environment."""
    on = {"start": name, **SCHEDULE}
    return on, {**on, "idempotence": TERM}, {"idempotence": TERM}


@cache
def idempotent_laws(name):
    """Return the `LearnedLaws` of a name; raises as `longer_horizons.continued_laws`."""
    return continued_laws(name, idempotent_nets()[name])


@experiment("nclaw.idempotence", title="NCLaw: a return map that a second one does not change",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 600})
def idempotence(run):
    """Record errors of all trainings in the same runs, and what their return maps do."""
    laws = available_laws(run)
    tasks = run.choose(quick=("reconstruction",),
                       standard=("reconstruction", "time", "velocity"))
    rows = errors(run, laws, tasks) if laws else []
    for (name, task), group in grouped(rows).items():
        record_errors(run, (name, task), group)
    run.table("errors", COLUMNS, rows)
    run.table("steps", STEPS, [row for method, by_name in laws.items()
                               for name, pair in by_name.items()
                               for row in other_steps(run, (method, name), pair)])
    for (method, name), pair in material_laws(laws).items():
        length = run.choose(quick=100, standard=environment(name).steps)
        record_returns(run, (method, name), Returns(*run.cached(
            f"returns.{method}.{name}", partial(returns_of, name, pair, length, run.rng))))


def available_laws(run):
    """Return {method: {environment: laws}} of those that are trained; record others."""
    printed = load_available(run, NAMES, trained)
    all_nets = idempotent_nets()
    lost = diverged_trainings(all_nets)
    for name, about in lost.items():
        record_epochs(run, f"nclaw.idempotence.{name}", about, all_nets[name].epochs)
    later = load_available(run, [name for name in all_nets if name not in lost], idempotent_laws)
    by_method = {OURS: printed, **{word: {name: later[f"{name}-{word}"] for name in NAMES
                                          if f"{name}-{word}" in later} for word in VARIANTS}}
    return {method: laws for method, laws in by_method.items() if laws}


def material_laws(laws):
    """Return {(method, environment): `MaterialLaws`} of the true laws and of learned ones."""
    return {**{(TRUE, name): true_laws(name) for name in NAMES},
            **{(method, name): MaterialLaws(learned_law(pair.elastic), learned_flow(pair.plastic))
               for method, by_name in laws.items() for name, pair in by_name.items()}}


def true_laws(name):
    """Return the `MaterialLaws` of an environment; a fluid's with its projection, without which the
    scene carries J alone.
    """
    body = build(environment(name)).bodies[0]
    return MaterialLaws(body.law, FluidProjection() if isinstance(body.law, Fluid) else body.flow)


def record_errors(run, task, rows):
    """Record the mean errors of a task, (environment, task), by method."""
    name, what = task
    table = "nclaw.table1" if what == "reconstruction" else "nclaw.table2"
    printed = targets.load().get(error_id(table, OURS, name, what))
    word = f"; printed {printed.value:g} m^2" if printed else ""
    for method in dict.fromkeys(row.method for row in rows):
        mine = [row.error for row in rows if row.method == method]
        run.record(f"nclaw.idempotence.{method}.{name}.{what}", np.mean(mine), unit="m^2",
                   comparator="info", scale=scale(run, name, what), note=f"one training{word}")


def other_steps(run, whose, laws):
    """Record the errors of laws in steps of other lengths, against true laws with the same steps;
    yield rows of STEPS. whose: (method, environment).
    """
    method, name = whose
    for factor in FACTORS:
        scene = with_time_step(environment(name, steps=run.choose(
            quick=100, standard=environment(name).steps)), factor)
        [one] = run.cached(f"steps.{method}.{name}.{factor:g}",
                           partial(compare, scene, [body_maker(laws)]))
        found = ComparedError(*one)
        run.record(f"nclaw.idempotence.{method}.{name}.dt.{factor:g}", found.error, unit="m^2",
                   comparator="info", scale=f"1000 particles, {scene.steps} steps of {factor:g} dt"
                   + quick_note(run), note=found.why)
        yield method, name, factor, *found


def returns_of(name, pair, steps, rng):
    """Return the `Returns` of a training run with `MaterialLaws`, in its own states, as plain
    values.
    """
    problem = build(environment(name, steps=steps, every=EVERY))
    body, dt = body_with_laws(problem.bodies[0], *pair), problem.clock.dt
    shares, squares, why = [], [], ""
    with threads_for(problem.bodies):
        frames = positions(problem, (body,))
        next(frames)
        try:
            for _ in frames:
                F = deformation_gradients(body)
                shares.append(passed_on(pair, F, shears(len(F), rng)))
                squares.append([np.mean(a**2) for a in (returned(*pair, F) - F,
                                                        dt * body.particles.L @ F)])
        except RunBroken as end:
            why = str(end)
    second, added = np.mean(squares, axis=0)
    return (np.percentile(shares, (5.0, 50.0, 95.0)).tolist(), float(np.sqrt(second / added)),
            len(shares), why)


def shears(n, rng):
    """Return random symmetric tensors (n, 3, 3) without a trace, of norm 1."""
    A = rng.normal(size=(n, 3, 3))
    A = A + A.swapaxes(1, 2)
    A -= np.trace(A, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    return A / np.linalg.norm(A, axis=(1, 2), keepdims=True)


def passed_on(pair, F, A):
    """Return the share (n,) of a small shear A F of F (n, 3, 3) that a return leaves, by the change
    of F F^T, which no rotation has a part in.
    """
    sheared = F + SHEAR * A @ F
    left = squared(returned(*pair, sheared)) - squared(returned(*pair, F))
    return (np.linalg.norm(left, axis=(1, 2))
            / np.linalg.norm(squared(sheared) - squared(F), axis=(1, 2)))


def squared(F):
    """Return F F^T (n, 3, 3)."""
    return F @ F.swapaxes(1, 2)


def record_returns(run, whose, returns):
    """Record the `Returns` of a method on an environment, `whose`."""
    method, name = whose
    id, where = f"nclaw.idempotence.{method}.{name}", f"1000 particles, {returns.frames} states"
    low, middle, high = returns.shares
    run.record(f"{id}.passed", middle, unit="1", comparator="info", scale=where,
               note=f"median share of an added shear that the return map passes on; 5 and 95 % "
                    f"{low:.2g} and {high:.2g}" + (f"; {returns.why}" if returns.why else ""))
    run.record(f"{id}.second", returns.second, unit="1", comparator="info", scale=where,
               note="root mean square of the change of F in a second return, over that of a step")
