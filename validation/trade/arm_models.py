"""Methods for the positions of a run of the arm: full-order runs on grids of their own, what is
looked up in the training runs, reduced models, and a coarse run with a learned correction.
"""

from collections.abc import Callable
from functools import partial
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.rom.correction import carrier, fit_correction
from mpm_ref.rom.fields.pod import basis
from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields
from mpm_ref.rom.fields.polynomial_manifold import curved
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.baselines import interpolation_weights
from mpm_ref.rom.study.full_model import ldm_full_model, nsf_full_model
from mpm_ref.rom.study.reduce import BLOCK
from mpm_ref.rom.study.run import FieldRunOptions, RunOptions, ldm_run, nsf_run
from mpm_ref.rom.study.samples import drawn_samples, weighted_samples

from .arm import ENDS, LEVELS, arm, histories, simulated

CORRECTIONS = 30        # modes of a correction
FEW = 50                # samples of a hyper-reduced step
MODES = 30              # of LDM
CURVED = 4              # free coordinates of a curved map
NSF = Sizes(r=8, smoothing=1e-4)


class TimedPositions(NamedTuple):
    """Positions of a run, and the CPU time that they took."""

    x: np.ndarray | None    # (LEVELS + 1, n, 3) [m]; None: it broke down, or there is none
    cpu: float              # [s]


class ArmMethod(NamedTuple):
    """A method for the positions of a run of parameters mu (6,)."""

    name: str
    positions: Callable     # mu -> `TimedPositions`
    fit: float = 0.0        # CPU seconds of what it computes from the training runs
    pairs: int = 0          # it needs training runs on a grid so many times as coarse too
    settings: str = ""      # in words


class Training(NamedTuple):
    """Training runs at one size."""

    dx: float               # [m]
    mu: np.ndarray          # (runs, 6)
    runs: list              # of `ArmRun`

    @property
    def X(self):
        """Points (n, 3) at rest [m]."""
        return ldm_full_model(arm(self.mu[0], self.dx)).X

    @property
    def x(self):
        """Positions (runs, LEVELS + 1, n, 3) [m]."""
        return np.stack([run.x for run in self.runs])


# Full-order runs.

def full_method(dx, transfer="apic"):
    """Return the `ArmMethod` of a full-order run with a transfer."""
    def positions(mu):
        run = simulated(arm(mu, dx, transfer))
        return TimedPositions(run.x, run.cpu)
    return ArmMethod(f"full.{transfer}", positions)


def coarse_method(times, training, transfer):
    """Return the `ArmMethod` of a full-order run on a grid `times` as coarse, with a transfer and
    steps as much longer, whose particles carry the fine points at the end.
    """
    coarse = partial(arm, dx=times * training.dx, transfer=transfer)
    return ArmMethod(f"coarse.{times}.{transfer}",
                     partial(carried, coarse, carrier_of(times, training).place))


def carrier_of(times, training):
    """Return the `Carrier` of the training's points by the particles of a coarse run."""
    return carrier(training.X, ldm_full_model(arm(training.mu[0], times * training.dx)).X)


def carried(coarse, place, mu):
    """Return the `TimedPositions` of a coarse run; coarse: parameters -> its scene; place:
    positions of its particles -> of fine points.
    """
    run = simulated(coarse(mu))
    start = process_time()
    x = np.array([place(state.astype(float)) for state in run.x])
    return TimedPositions(x, run.cpu + process_time() - start)


def coarse_scene(times, dx):
    """Return the function of parameters that gives the scene of a run that is to be corrected, on a
    grid `times` as coarse as dx [m]: by MLS-MPM, the fastest transfer, since what differs is
    learned.
    """
    return partial(arm, dx=times * dx, transfer="mls")


def corrected_method(times, training, coarse):
    """Return the `ArmMethod` of a run of `coarse_scene` with a correction learned from the training
    runs and such runs of the same parameters, `ArmRun`s.
    """
    start, one = process_time(), carrier_of(times, training)
    x, x_coarse = (np.concatenate([run.x[1:] for run in runs]).astype(float)
                   for runs in (training.runs, coarse))
    fit = fit_correction(one, x, x_coarse, CORRECTIONS, np.arange(len(x)) // LEVELS)
    return ArmMethod(f"corrected.{times}",
                     partial(carried, coarse_scene(times, training.dx), fit.place),
                     process_time() - start, times, f"smoothing {fit.smoothing:g}, chosen by "
                     "leaving out each training run")


# Training runs, looked up.

def looked_up_methods(training):
    """Yield the `ArmMethod`s that weigh training runs: the nearest, interpolation between them, and
    the linear function of the parameters that fits them best.
    """
    low, high = np.transpose(ENDS)
    unit = (training.mu - low) / (high - low)

    def nearest(target):
        return {int(np.argmin(np.linalg.norm(unit - target, axis=1))): 1.0}

    def linear(target):
        rows = np.column_stack([np.ones(len(unit)), unit])
        return dict(enumerate(np.append(1.0, target) @ np.linalg.pinv(rows)))

    weighing = {"nearest": nearest, "linear": linear,
                "interpolated": partial(interpolation_weights, unit)}
    for name, weights in weighing.items():
        yield ArmMethod(name, partial(weighted, training, weights, (low, high)))


def weighted(training, weights, ends, mu):
    """Return the `TimedPositions` of training runs with the weights of a target in units of its
    range.
    """
    low, high = ends
    start = process_time()
    chosen = weights((mu - low) / (high - low))
    x = sum(w * training.runs[k].x.astype(float) for k, w in chosen.items()) if chosen else None
    return TimedPositions(x, process_time() - start)


# Reduced models.

def stepped(plan, place):
    """Return the `TimedPositions` of a `ReducedRun`; place: latent coordinates -> x (n, 3)."""
    start, x = process_time(), []
    every = plan.steps // LEVELS
    try:
        with one_thread():
            for k, state in enumerate(plan.states()):
                if k % every == 0:
                    x.append(place(state.latent.xhat))
    except BREAKDOWNS:
        return TimedPositions(None, process_time() - start)
    return TimedPositions(np.array(x), process_time() - start)


def map_method(name, training, g, options, fit):
    """Return the `ArmMethod` of LDM's reduced run on a map g; fit: CPU seconds that it took."""
    X = training.X

    def positions(mu):
        full = ldm_full_model(arm(mu, training.dx))
        return stepped(ldm_run(full, g, options, np.zeros(g.r)), partial(g.place, X))
    points = options.points or "all"
    return ArmMethod(name, positions, fit, settings=f"r = {g.r}, {points} samples")


def pod_methods(training, with_all):
    """Yield the `ArmMethod`s of LDM on POD modes with a few samples; and `with_all` samples, then
    on a curved map of as many modes too.
    """
    start = process_time()
    x, F = (np.concatenate([run.fields[name] for run in training.runs]).astype(float)
            for name in ("x", "F"))
    found = basis(training.X, x, F, MODES)
    fit = process_time() - start
    yield map_method("pod.few", training, found.modes, RunOptions(points=FEW), fit)
    if with_all:
        yield map_method("pod.all", training, found.modes, RunOptions(), fit)
        start = process_time()
        g = curved(found, CURVED, 2)
        yield map_method("curved", training, g, RunOptions(projection="nonlinear"),
                         fit + process_time() - start)


def nsf_methods(training, with_all):
    """Yield the `ArmMethod`s of NSF's reduced run on fields of modes, with a few samples that have
    weights, and `with_all`.
    """
    start = process_time()
    scene = arm(training.mu[0], training.dx)
    fields, xhat = fit_pod_fields(histories(training.runs, scene, training.mu), NSF,
                                  BLOCK * training.dx)
    n, rest, fit = len(training.X), xhat[:, 0].mean(axis=0), process_time() - start
    kinds = {"few": partial(weighted_samples, fields, n, FEW, 0)}
    if with_all:
        kinds["all"] = partial(drawn_samples, n, n, 0)
    for name, samples in kinds.items():
        start = process_time()
        sets = (samples(),)
        yield ArmMethod(f"nsf.{name}", partial(field_positions, training.dx, fields, sets, rest),
                  fit + process_time() - start,
                  settings=f"r = {NSF.r}, {len(sets[0].points)} samples")


def field_positions(dx, fields, sets, rest, mu):
    """Return the `TimedPositions` of a reduced run of NSF on fields with sample sets."""
    own, points = fields.with_parameters(mu), np.arange(len(fields.X))
    plan = nsf_run(nsf_full_model(arm(mu, dx)), own, FieldRunOptions(sets), rest)
    return stepped(plan, partial(own.place, points))
