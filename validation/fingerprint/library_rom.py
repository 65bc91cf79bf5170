"""Calls of mpm_ref's reduced models, for `ldm` and `nsf`; see `library`."""

from dataclasses import replace
from functools import cache, partial
from itertools import islice

import numba
import numpy as np

from mpm_ref.rom import model_file
from mpm_ref.rom.fields.elastic import elastic_modes
from mpm_ref.rom.fields.joint_latent import joint, joint_stepper
from mpm_ref.rom.fields.network import learned_fields
from mpm_ref.rom.fields.pod import basis
from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields
from mpm_ref.rom.fields.polynomial_manifold import curved
from mpm_ref.rom.latent import Latent
from mpm_ref.rom.quadrature.lagrangian import neighbours
from mpm_ref.rom.quadrature.node_centric import node_centric, nodes_of
from mpm_ref.rom.snapshots import join_histories
from mpm_ref.rom.study.dataset import simulate_history, simulate_snapshots
from mpm_ref.rom.study.full_model import ldm_full_model, nsf_full_model
from mpm_ref.rom.study.reduce import BLOCK, compute_model
from mpm_ref.rom.study.run import (
    FieldRunOptions,
    ReducedRun,
    RunOptions,
    ldm_run,
    ldm_start,
    nsf_run,
)
from mpm_ref.rom.study.run import ldm_model as reduced_step
from mpm_ref.rom.study.samples import SampleSet, cell_samples, drawn_samples, weighted_samples
from mpm_ref.rom.study.study import load as load_study
from mpm_ref.scene import build

from .library import ROOT, scene, scene_names

LDM_WEIGHTS = ROOT / "validation" / "ldm" / "weights"
NSF_WEIGHTS = ROOT / "validation" / "nsf" / "weights"


def cached_by_threads(function):
    """Cache a function without arguments for each number of threads."""
    cached = cache(lambda count: function())
    return lambda: cached(numba.get_num_threads())


def study(name):
    """Return a study of the repository's folder `studies`."""
    scenes = {one: ROOT / "scenes" / f"{one}.toml" for one in scene_names()}
    return load_study(ROOT / "studies" / f"{name}.toml", scenes)


# LDM: runs on maps of positions alone.


def network(name):
    """Return the stored map of a name and latent coordinates near the body at rest."""
    stored = model_file.load(LDM_WEIGHTS / f"{name}.npz")
    return stored.field, stored.rest


@cached_by_threads
def small_snapshots():
    """Return the snapshots of the training runs of the study `gravity_small`."""
    small = study("gravity_small")
    return simulate_snapshots((build(small.scene(small.mu[k])) for k in small.train),
                     small.mu[list(small.train)])


@cached_by_threads
def small_setup():
    """Return the held-out run of the study `gravity_small`."""
    small = study("gravity_small")
    return ldm_full_model(small.scene(small.mu[small.test[0]]))


def pod():
    """Return POD modes of the study `gravity_small`, and latent coordinates at rest."""
    model = compute_model(study("gravity_small"), small_snapshots(), {})
    return model.field, model.rest


def polynomial(r, R, degree):
    """Return a polynomial manifold over POD modes of these snapshots, and coordinates at rest."""
    data = small_snapshots()
    return curved(basis(data.X, *data.flat(), R), r, degree), np.zeros(r)


def data_of_pod():
    """Return the training snapshots and the modes computed from them."""
    model = compute_model(study("gravity_small"), small_snapshots(), {})
    data = small_snapshots()
    return {"x": data.x, "F": data.F, "v": data.v, "latent": model.xhat,
            "derivatives": model.field.derivatives(data.X, model.xhat[0, -1])}


def setup_of(name, **values):
    """Return the body, problem and points of a reduced run of a scene with other values."""
    return ldm_full_model(scene(name, **values))


def ldm(setup, decoder, rest, options, steps):
    """Return latent coordinates, reports and last positions of a reduced run with options."""
    run = ldm_run(setup, decoder, RunOptions(**options), rest)
    return summary(setup, decoder, run, steps)


def ldm_by_neighbours(setup, decoder, rest, count, steps):
    """Return the summary of a run with samples chosen once and the points found near them."""
    samples = np.arange(0, len(setup.X), len(setup.X) // count)
    stepper = reduced_step(setup, decoder, RunOptions("lagrangian", "linear"))
    near = neighbours(stepper.quadrature, decoder, rest[None], samples)
    stepper = replace(stepper, quadrature=near)
    run = from_start(setup, decoder, rest, stepper, lambda t, latent: samples)
    return summary(setup, decoder, run, steps)


def ldm_by_nodes(setup, decoder, rest, count, steps):
    """Return the summary of a run with the node-centric quadrature around some points' nodes."""
    chosen = np.argsort(np.linalg.norm(setup.X - setup.X.mean(axis=0), axis=1))[:count]
    stepper = reduced_step(setup, decoder, RunOptions("eulerian", "linear"))
    grid = stepper.quadrature
    quadrature = node_centric(grid, nodes_of(setup.X[chosen], grid.dx, grid.degree))
    run = from_start(setup, decoder, rest, replace(stepper, quadrature=quadrature),
                     lambda t, latent: quadrature.samples(decoder, latent.xhat))
    return summary(setup, decoder, run, steps)


def from_start(setup, decoder, rest, stepper, choose):
    """Return the run of a stepper with samples choose(t, latent), from the body at rest."""
    clock = setup.problem.clock
    return ReducedRun(stepper, lambda: ldm_start(setup, decoder, rest),
                      lambda xhat: lambda t, latent: SampleSet(t, choose(t, latent)),
                      clock.dt, clock.steps)


def summary(setup, decoder, run, steps):
    """Return latent coordinates, rates, reports and last positions of a run's first steps."""
    _, latents, reports, _ = zip(*islice(run.states(), steps + 1), strict=True)
    return {"latent": np.array([latent[0] for latent in latents]),
            "rate": np.array([latent[1] for latent in latents]),
            "reports": reports, "x": decoder.place(setup.X, latents[-1][0])}


# NSF: runs on fields of position, stress and affine velocity.


@cached_by_threads
def small_histories():
    """Return the full-order training runs of the study `jelly_small`."""
    small = study("jelly_small")
    runs = (simulate_history(small.scene(small.mu[k]), small.mu[k], every=small.base.every)
            for k in small.train)
    return join_histories(runs, len(small.train))


@cached_by_threads
def small_fields():
    """Return the fields of modes of `jelly_small`, latent coordinates, and its held-out run."""
    small = study("jelly_small")
    model = compute_model(small, small_histories(), {})
    return model.field, model.rest, nsf_full_model(small.scene(small.mu[small.test[0]]))


def data_of_modes():
    """Return the training runs, and the start of the fields that are computed from them."""
    data = small_histories()
    fields, rest, _ = small_fields()
    return {"x": data.x, "tau": data.tau, "C": data.C, "latent": rest,
            "fields": values_of(fields, rest)}


def values_of(fields, xhat):
    """Return positions, derivatives, stress and affine field of all points."""
    points = np.arange(len(fields.X))
    return {"x": fields.place(points, xhat), "G": fields.derivatives(points, xhat)[2],
            "tau": fields.stress(points, xhat), "C": fields.affine(points, xhat)}


def samples_of(kind, fields, setup, count):
    """Return samples of a kind: drawn, weighted point by point, or weighted cell by cell."""
    choose = {"drawn": drawn_samples, "weighted": partial(weighted_samples, fields),
              "cells": partial(cell_samples, fields, setup.problem)}
    return choose[kind](len(setup.X), count, 0)


def nsf_modes(samples, count, steps, map_alone=False, **options):
    """Return a reduced run of `jelly_small` on fields of modes; options: of `nsf`."""
    fields, rest, setup = small_fields()
    chosen = samples_of(samples, fields, setup, count)
    if map_alone:
        fields = elastic_modes(fields, setup.problem.bodies)
    return {"samples": tuple(chosen)} | nsf(setup, fields, rest, (chosen, steps), **options)


def nsf_networks(name, scene_name, values, mu, count, steps):
    """Return a reduced run of a scene with other values on stored networks."""
    stored = model_file.load(NSF_WEIGHTS / f"{name}.npz")
    setup = nsf_full_model(scene(scene_name, **values))
    rest = stored.rest
    fields = learned_fields(setup.X, stored.field, mu, BLOCK * setup.problem.dx)
    return nsf(setup, fields, rest, (drawn_samples(len(setup.X), count, 0), steps))


def nsf(setup, fields, rest, plan, factor=1.0, inversion="nonlinear"):
    """Return latent coordinates, reports and last fields of a run; plan: samples and steps."""
    chosen, steps = plan
    run = nsf_run(setup, fields, FieldRunOptions((chosen,), factor, inversion), rest)
    times, states, reports, _ = zip(*islice(run.states(), steps + 1), strict=True)
    reports = [report and report[:6] for report in reports]
    return {"t": times, "latent": np.array([state[0] for state in states]), "reports": reports,
            "fields": values_of(fields, states[-1][0])}


def nsf_joint(name, key, train, values, sizes, plan):
    """Return runs on joint latent coordinates of position and stress, and on those of positions.

    The fields are computed from runs of a scene with several values of a key. plan: number of
    samples and of steps.
    """
    scenes = [scene(name, **values, **{key: value}) for value in train]
    runs = join_histories((simulate_history(one, [value], every=values["every"])
                   for one, value in zip(scenes, train, strict=True)), len(train))
    setup = nsf_full_model(scenes[len(train) // 2])
    size, chosen = BLOCK * setup.problem.dx, (drawn_samples(len(setup.X), plan[0], 0), plan[1])
    fields, xhat, scale = joint(runs, Sizes(*sizes), size)
    alone, coordinates = fit_pod_fields(runs, Sizes(*sizes), size, False)
    return {"scale": tuple(scale),
            **joint_run(setup, fields, xhat[:, 0].mean(axis=0), scale, chosen),
            "positions alone": nsf(setup, alone, coordinates[:, 0].mean(axis=0), chosen)}


def joint_run(setup, fields, rest, scale, plan):
    """Return latent coordinates, reports and last fields of steps of position and stress."""
    problem, (chosen, steps) = setup.problem, plan
    stepper = joint_stepper(fields, setup.material, problem, scale)
    states, reports, dt = [Latent(rest)], [], problem.clock.dt
    for k in range(steps):
        state, report = stepper.step(states[-1], chosen.points, k * dt, dt)
        states.append(state)
        reports.append(report[:6])
    return {"latent": np.array([state[0] for state in states]), "reports": reports,
            "fields": values_of(fields, states[-1][0])}
