"""CPU times of steps of the arm at several sizes, a step of each method and size in turn, and of
what is read from a state.

Modes are those of a few runs of a small arm, carried to the points of a larger one as runs on
coarser grids are: times are the same as those of modes of large runs, which are not needed.
"""

from functools import partial
from time import process_time
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import KDTree

from mpm_ref.core.blas import one_thread
from mpm_ref.rom.correction import CoarseCorrection, carrier
from mpm_ref.rom.fields.numbered import numbered
from mpm_ref.rom.fields.pod import PodModes, modes
from mpm_ref.rom.fields.pod_fields import PodFields, cells, fit_pod_fields
from mpm_ref.rom.study.full_model import ldm_full_model, nsf_full_model
from mpm_ref.rom.study.reduce import BLOCK
from mpm_ref.rom.study.run import FieldRunOptions, RunOptions, ldm_run, nsf_run
from mpm_ref.rom.study.samples import drawn_samples, weighted_samples

from ..ldm.timing import SteppedFullRun
from .arm import LEVELS, arm, histories, simulated
from .arm_models import CORRECTIONS, FEW, MODES, NSF, Training, carrier_of
from .ldm_cost import TimedCalls

FIELDS = ("x", "F", "tau", "C")
TRAINED_STATES = 16 * LEVELS    # of the training of a correction, as in `trade.reduced`


class SmallModels(NamedTuple):
    """Modes of a small arm."""

    mu: np.ndarray          # (runs, 6) parameters
    pod: PodModes           # of LDM
    fields: PodFields       # of NSF
    rest: np.ndarray        # (r,) latent coordinates at the start


class Step(NamedTuple):
    """A step, or the median of some."""

    cpu: float              # [s]
    points: float           # that carry mass
    candidates: float       # that were tried
    samples: float


def small_models(mu, dx):
    """Return the `SmallModels` of runs with parameters mu (runs, 6) on a grid of spacing dx [m]."""
    scene = arm(mu[0], dx)
    runs = [simulated(arm(one, dx), FIELDS) for one in mu]
    x, F = (np.concatenate([run.fields[name] for run in runs]).astype(float) for name in ("x", "F"))
    fields, xhat = fit_pod_fields(histories(runs, scene, mu), NSF, BLOCK * dx)
    X = ldm_full_model(scene).X
    return SmallModels(mu, modes(X, x, F, MODES), fields, xhat[:, 0].mean(axis=0))


def carried_models(small, dx):
    """Return the `SmallModels` for the points of an arm on a grid of spacing dx [m]."""
    X = ldm_full_model(arm(small.mu[0], dx)).X
    one = carrier(X, small.pod.X)
    rows = np.arange(0, one.near.size + 1, one.near.shape[1])
    weights = csr_array((one.w.ravel(), one.near.ravel(), rows), (len(X), len(small.pod.X)))

    def fine(values):
        return (weights @ values.reshape(len(values), -1)).reshape(len(X), *values.shape[1:])

    fields, U = small.fields, fine(small.fields.U)
    tau, C = (field._replace(modes=fine(field.modes)) for field in (fields.tau, fields.C))
    return small._replace(
        pod=PodModes(X, fine(small.pod.U), fine(small.pod.slope), KDTree(X)),
        fields=fields._replace(X=X, U=U, tau=tau, C=C, cells=cells(X, U, BLOCK * dx)))


# Steps.

def steppers(models, mu, dx):
    """Return {name of a method: function that makes its next step and returns the `Step`} of an arm
    with parameters mu (6,) on a grid of spacing dx [m]; models: `carried_models` for its points.
    """
    found = {f"full.{transfer}": full_stepper(arm(mu, dx, transfer))
             for transfer in ("apic", "mls")}
    full, own = ldm_full_model(arm(mu, dx)), models.fields.with_parameters(mu)
    for name, points in (("few", FEW), ("all", None)):
        plan = ldm_run(full, models.pod, RunOptions(points=points), np.zeros(MODES))
        found[f"pod.{name}"] = reduced_stepper(plan)
    n = len(full.X)
    for name, samples in (("few", weighted_samples(own, n, FEW, 0)),
                          ("all", drawn_samples(n, n, 0))):
        plan = nsf_run(nsf_full_model(arm(mu, dx)), own, FieldRunOptions((samples,)), models.rest)
        found[f"nsf.{name}"] = reduced_stepper(plan)
    return found


def full_stepper(scene):
    """Return the function that makes the next step of a full-order run and returns the `Step`."""
    run = SteppedFullRun(scene)
    n = sum(len(body.id) for body in run.state.bodies)

    def step():
        run.step()
        return Step(run.spent[-1].cpu, n, 0, n)
    return step


def reduced_stepper(plan):
    """Return the function that makes the next step of a `ReducedRun` and returns the `Step`."""
    tried = []

    def counted(_, near):
        def call(*args):
            numbers = near(*args)
            tried.append(len(numbers))
            return numbers
        return call

    stepper, states = plan.stepper, None
    counting = partial(TimedCalls, names=("near",), through=counted)
    if hasattr(stepper.field, "near"):
        stepper.field = counting(stepper.field)
    else:
        stepper.quadrature = stepper.quadrature._replace(
            blocks=counting(stepper.quadrature.blocks))
    states = plan.states()
    next(states)

    def step():
        tried.clear()
        start = process_time()
        report = next(states).report
        return Step(process_time() - start, report.points, sum(tried), report.samples)
    return step


def in_turn(functions, rounds, progress):
    """Return {key: list of results} of functions that are called in turn, after one call of each
    that compiles.
    """
    with one_thread():
        for function in functions.values():
            function()
        found = {key: [] for key in functions}
        for _ in progress(range(rounds), "rounds"):
            for key, function in functions.items():
                found[key].append(function())
    return found


def median_step(steps):
    """Return the `Step` of medians of `Step`s."""
    return Step(*map(float, np.median(steps, axis=0)))


# Readings.

def readings(models, mu, dx, coarser):
    """Return {name: function that returns the CPU seconds of a point} of what is read from a state:
    modes of LDM and NSF, and points that go with coarse particles, with a correction and without.
    """
    n, rng = len(models.pod.X), np.random.default_rng(0)
    own, numbers, g = models.fields.with_parameters(mu), np.arange(n), numbered(models.pod)
    found = {"pod": lambda: g.place(numbers, np.ones(MODES)),
             "nsf": lambda: own.place(numbers, models.rest)}
    for times in coarser:
        one = carrier_of(times, Training(dx, models.mu, []))
        fit = CoarseCorrection(one, rng.standard_normal((n, 3, CORRECTIONS)),
                               rng.standard_normal((TRAINED_STATES, one.X_coarse.size)),
                               rng.standard_normal((TRAINED_STATES, CORRECTIONS)), 0.0)
        found |= {f"carry.{times}": partial(one.place, 1.1 * one.X_coarse),
                  f"corrected.{times}": partial(fit.place, 1.1 * one.X_coarse)}
    return {name: partial(seconds_per_point, call, n) for name, call in found.items()}


def seconds_per_point(call, n):
    """Return the CPU seconds of a call, per point of n."""
    start = process_time()
    call()
    return (process_time() - start) / n
