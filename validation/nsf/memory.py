"""Latent coordinates of position and stress together (`rom.fields.joint_latent`), compared with
those of positions alone: a block that is sheared to and fro, whose positions do not determine its
stress, and the sand column, which flows one way.
"""

from functools import partial

import numpy as np

from mpm_ref.rom.fields.joint_latent import Stacked, joint, joint_stepper
from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields
from mpm_ref.rom.latent import Latent
from mpm_ref.rom.projection import project_position
from mpm_ref.rom.snapshots import join_histories
from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.study.evaluate import (
    history_reference,
    level_of,
    nearest_states,
    path_errors,
    stress_share,
)
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.reduce import BLOCK
from mpm_ref.rom.study.run import nsf_model
from mpm_ref.rom.study.samples import drawn_samples
from mpm_ref.rom.symmetric import tensor

from ..common.registry import experiment
from .studies import NsfStudy, sand

INFO = {"comparator": "info"}
COLUMNS = ("scene", "latent", "value", "samples", "displacement", "stress")
NEAREST = 0         # samples of the nearest states, which are no run


def shear(steps=None):
    """Return the study of the block with several amplitudes; 500 steps are half a period."""
    return NsfStudy("nsf_shear", "fixed.top.motion.translation.amplitude[0]", (0.02, 0.03, 0.04),
                    (0.025, 0.035), Sizes(r=4, modes=20, tau=40, C=20, smoothing=1e-2), 40,
                    follows=False, steps=steps, every=15)


@experiment("nsf.memory", title="NSF: latent coordinates of position and stress together",
            profiles=("quick", "standard"), budget={"quick": 40, "standard": 300})
def memory(run):
    """Errors of the displacement and of the stress, with few samples and with all particles."""
    rows = []
    for name, study in run.progress(studies(run).items(), "scenes"):
        runs = join_histories((simulated(study, value) for value in study.train), len(study.train))
        tests = {value: simulated(study, value)
                 for value in study.test[:run.choose(quick=1, standard=2)]}
        for word, rows_of_test in (("position", position_rows), ("joint", joint_rows)):
            new = [(name, word, *row) for value, test in tests.items()
                   for row in rows_of_test(study, value, runs, test)]
            record(run, f"nsf.memory.{name}.{word}", new, study, next(iter(tests.values())))
            rows += new
    run.table("errors", COLUMNS, rows)


def studies(run):
    """{name: study} at a run's profile."""
    column = run.choose(quick=partial(sand, 4, 4), standard=partial(sand, 2, 8))()
    sizes = column.sizes._replace(smoothing=1e-2)
    return {"shear": shear(run.choose(quick=750, standard=None)),
            "sand": column._replace(follows=False, test=column.test[1:3], sizes=sizes)}


def simulated(study, value):
    """Return the `Histories` of a run."""
    return simulate_history(study.run(value), [value], every=study.spacing)


def position_rows(study, value, runs, test):
    """Yield the rows (value, samples, errors) of a test, with latent coordinates of positions."""
    one = nsf_full_model(study.run(value))
    fields, xhat = fit_pod_fields(runs, study.sizes, BLOCK * one.problem.dx, follows=False)
    rest = xhat[:, 0].mean(axis=0)
    yield value, NEAREST, *errors(fields, test, nearest_states(fields, test.x[0], rest))
    for samples in (study.samples, len(one.X)):
        path = states(one, nsf_model(one, fields), rest, samples, test.dt)
        yield value, samples, *errors(fields, test, path)


def joint_rows(study, value, runs, test):
    """Yield the rows (value, samples, errors) of a test, with joint latent coordinates."""
    one = nsf_full_model(study.run(value))
    fields, xhat, scale = joint(runs, study.sizes, BLOCK * one.problem.dx)
    rest = xhat[:, 0].mean(axis=0)
    stepper = joint_stepper(fields, one.material, one.problem, scale)
    both = Stacked(fields, scale, 1.0)
    yield value, NEAREST, *errors(fields, test, nearest(both, test, rest))
    for samples in (study.samples, len(one.X)):
        path = states(one, stepper, rest, samples, test.dt)
        yield value, samples, *errors(fields, test, path)


def nearest(both, test, xhat):
    """Yield (level, latent coordinates) of the states nearest in position and stress."""
    everything, d = np.arange(len(test.X)), test.X.shape[1]
    for level, (x, tau) in enumerate(zip(test.x[0], test.tau[0], strict=True)):
        target = both.vectors(x, tensor(tau, d))
        xhat = project_position(both, everything, target, xhat).y
        yield level, xhat


def states(one, stepper, rest, samples, spacing):
    """Yield (level or None, latent coordinates) of a reduced run of a stepper, from those at rest;
    `spacing` is the time between levels [s].
    """
    clock, points = one.problem.clock, drawn_samples(len(one.X), samples, 0).points
    latent = Latent(rest)
    for k in range(clock.steps + 1):
        yield level_of(k * clock.dt / spacing), latent.xhat
        if k < clock.steps:
            latent, _ = stepper.step(latent, points, k * clock.dt, clock.dt)


def errors(fields, test, path):
    """Return the errors of the displacement and of the stress of a path, over their norms."""
    path = path_errors(fields, history_reference(test), path)
    return path.errors.displacement, stress_share(path.stress)


def record(run, target, rows, study, test):
    """Record the errors of a scene and kind of latent coordinates, means over tests."""
    n, levels = len(test.X), test.x.shape[1] - 1
    scale = (f"{n} particles, {levels} states kept, {len(study.train)} runs and "
             f"{len(rows) // 3} tests; r = {study.sizes.r}")
    for word, count, note in (("nearest", NEAREST, "nearest states that the fields know"),
                              ("few", study.samples, f"{study.samples} samples, one draw"),
                              ("all", n, "all particles are samples")):
        means = np.mean([row[4:] for row in rows if row[3] == count], axis=0)
        for kind, value in zip(("displacement", "stress"), means, strict=True):
            run.record(f"{target}.{word}.{kind}", 100.0 * value, unit="%", scale=scale, note=note,
                       **INFO)
