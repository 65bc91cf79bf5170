"""All that the cases need of mpm_ref's reduced models; see `library`."""

from dataclasses import replace
from functools import cache, partial
from itertools import islice

import numba
import numpy as np

from mpm_ref.cases import snapshots
from mpm_ref.reduced.case import case
from mpm_ref.reduced.inferring import Plan, drawn, infer, of_cells, weighed
from mpm_ref.reduced.maps import computed
from mpm_ref.reduced.march import Way, march, model, start, stepped
from mpm_ref.reduced.nsf.fields import BLOCK
from mpm_ref.reduced.study import load as load_study
from mpm_ref.reduced.whole import history, whole
from mpm_ref.rom import fields_file, weights
from mpm_ref.rom.curved import curved
from mpm_ref.rom.deformed import deformed
from mpm_ref.rom.histories import joined
from mpm_ref.rom.inferred import Position
from mpm_ref.rom.joint import Joint, joint
from mpm_ref.rom.learned import learned
from mpm_ref.rom.modes import basis
from mpm_ref.rom.neighbours import neighbours
from mpm_ref.rom.node_centric import node_centric, nodes_of
from mpm_ref.rom.spanned import Sizes, spanned
from mpm_ref.scene import build

from .library import ROOT, scene, scene_names

LDM_WEIGHTS = ROOT / "validation" / "ldm" / "weights"
NSF_WEIGHTS = ROOT / "validation" / "nsf" / "weights"


def of_threads(function):
    """Cache a function without arguments for each number of threads."""
    cached = cache(lambda count: function())
    return lambda: cached(numba.get_num_threads())


def study(name):
    """Return a shipped study."""
    shipped = {one: ROOT / "scenes" / f"{one}.toml" for one in scene_names()}
    return load_study(ROOT / "studies" / f"{name}.toml", shipped)


# LDM: runs on maps of positions alone.


def network(name):
    """Return the stored map of a name and latent coordinates near the body at rest."""
    stored = weights.load(LDM_WEIGHTS / f"{name}.npz")
    return stored.decoder, stored.rest


@of_threads
def small_snapshots():
    """Return the snapshots of the training runs of the study `gravity_small`."""
    of = study("gravity_small")
    return snapshots((build(of.scene(of.mu[k])) for k in of.train), of.mu[list(of.train)])


@of_threads
def small_case():
    """Return the held-out run of the study `gravity_small`."""
    of = study("gravity_small")
    return case(of.scene(of.mu[of.test[0]]))


def pod():
    """Return POD modes of the study `gravity_small`, and latent coordinates at rest."""
    made = computed(study("gravity_small"), small_snapshots(), {})
    return made.decoder, made.rest


def polynomial(r, R, degree):
    """Return a polynomial manifold over POD modes of the same data, and coordinates at rest."""
    known = small_snapshots()
    return curved(basis(known.X, *known.flat(), R), r, degree), np.zeros(r)


def data_of_pod():
    """Return the training snapshots and the modes made of them."""
    made = computed(study("gravity_small"), small_snapshots(), {})
    known = small_snapshots()
    X = known.X
    return {"x": known.x, "F": known.F, "v": known.v, "latent": made.xhat,
            "derivatives": made.decoder.derivatives(X, made.xhat[0, -1])}


def case_of(name, **values):
    """Return what a reduced run knows of a shipped scene with other values."""
    return case(scene(name, **values))


def ldm(of, map, rest, way, steps):
    """Return latent coordinates, reports and last positions of a reduced run; way: its options."""
    return told(of, map, march(of, map, Way(**way), rest), steps)


def ldm_by_neighbours(of, map, rest, count, steps):
    """Return the same with samples chosen once and the points found near them."""
    samples = np.arange(0, len(of.X), len(of.X) // count)
    stepper = model(of, map, Way("lagrangian", "linear"))
    near = neighbours(stepper.quadrature, map, rest[None], samples)
    stepper = replace(stepper, quadrature=near)
    return told(of, map, from_start(of, map, rest, stepper, lambda t, latent: samples), steps)


def ldm_by_nodes(of, map, rest, count, steps):
    """Return the same with the node-centric quadrature, around the nodes of some points."""
    chosen = np.argsort(np.linalg.norm(of.X - of.X.mean(axis=0), axis=1))[:count]
    stepper = model(of, map, Way("eulerian", "linear"))
    quadrature = stepper.quadrature
    body = node_centric(quadrature, nodes_of(of.X[chosen], quadrature.dx, quadrature.degree))
    stepper = replace(stepper, quadrature=body)
    return told(of, map, from_start(of, map, rest, stepper,
                                    lambda t, latent: body.samples(map, latent)), steps)


def from_start(of, map, rest, stepper, choose):
    """Yield the latent state and report of each step of a stepper, the start first."""
    first = start(of, map, rest)
    yield first, None
    yield from stepped(stepper, of.problem.clock, first, choose)


def told(of, map, states, steps):
    """Return what (latent, report) of some steps say, by position."""
    latents, reports = zip(*islice(states, steps + 1), strict=True)
    return {"latent": np.array([latent[0] for latent in latents]),
            "rate": np.array([latent[1] for latent in latents]),
            "reports": reports, "x": map.place(of.X, latents[-1][0])}


# NSF: runs on fields of position, stress and affine velocity.


@of_threads
def small_histories():
    """Return the full-order training runs of the study `jelly_small`."""
    of = study("jelly_small")
    runs = (history(of.scene(of.mu[k]), of.mu[k], every=of.base.every) for k in of.train)
    return joined(runs, len(of.train))


@of_threads
def small_fields():
    """Return the fields of modes of `jelly_small`, latent coordinates, and its held-out run."""
    of = study("jelly_small")
    made = computed(of, small_histories(), {})
    return made.decoder, made.rest, whole(of.scene(of.mu[of.test[0]]))


def data_of_modes():
    """Return the training runs, and what the fields made of them give at the start."""
    known = small_histories()
    fields, rest, _ = small_fields()
    return {"x": known.x, "tau": known.tau, "C": known.C, "latent": rest,
            "fields": values_of(fields, rest)}


def values_of(fields, xhat):
    """Return positions, derivatives, stress and affine field of all points."""
    everything = np.arange(len(fields.X))
    return {"x": fields.place(everything, xhat), "G": fields.derivatives(everything, xhat)[2],
            "tau": fields.stress(everything, xhat), "C": fields.affine(everything, xhat)}


def samples_of(kind, fields, of, count):
    """Return samples of a kind: drawn, weighted point by point, or weighted cell by cell."""
    make = {"drawn": drawn, "weighted": partial(weighed, fields),
            "cells": partial(of_cells, fields, of.problem)}
    return make[kind](len(of.X), count, 0)


def nsf_modes(samples, count, steps, map_alone=False, **options):
    """Return a reduced run of `jelly_small` on fields of modes; options: of `nsf`."""
    fields, rest, of = small_fields()
    chosen = samples_of(samples, fields, of, count)
    if map_alone:
        fields = deformed(fields, of.problem.bodies)
    return {"samples": tuple(chosen)} | nsf(of, fields, rest, (chosen, steps), **options)


def nsf_networks(name, scene_name, values, mu, count, steps):
    """Return a reduced run of a shipped scene with other values on stored networks."""
    stored, of = fields_file.load(NSF_WEIGHTS / f"{name}.npz"), whole(scene(scene_name, **values))
    g, h, l, _, rest, _ = stored
    fields = learned(of.X, (g, h, l), mu, BLOCK * of.problem.dx)
    return nsf(of, fields, rest, (drawn(len(of.X), count, 0), steps))


def nsf(of, fields, rest, plan, factor=1.0, inversion="nonlinear"):
    """Return latent coordinates, reports and last fields of a run; plan: samples and steps."""
    chosen, steps = plan
    run = infer(of, fields, Plan((chosen,), factor, inversion), rest)
    times, states, reports = zip(*islice(run, steps + 1), strict=True)
    return {"t": times, "latent": np.array([state[0] for state in states]), "reports": reports,
            "fields": values_of(fields, states[-1][0])}


def nsf_joint(name, key, train, values, sizes, plan):
    """Return a run on latent coordinates of position and stress together, and one on those of
    positions alone, of fields made of runs of a scene with several values of a key; plan: number
    of samples and of steps.
    """
    scenes = [scene(name, **values, **{key: value}) for value in train]
    runs = joined((history(one, [value], every=values["every"])
                   for one, value in zip(scenes, train, strict=True)), len(train))
    of = whole(scenes[len(train) // 2])
    size, chosen = BLOCK * of.problem.dx, (drawn(len(of.X), plan[0], 0), plan[1])
    fields, xhat, scale = joint(runs, Sizes(*sizes), size)
    alone, coordinates = spanned(runs, Sizes(*sizes), size, False)
    return {"scale": tuple(scale),
            **stepped_joint(of, fields, xhat[:, 0].mean(axis=0), scale, chosen),
            "positions alone": nsf(of, alone, coordinates[:, 0].mean(axis=0), chosen)}


def stepped_joint(of, fields, rest, scale, plan):
    """Return latent coordinates, reports and last fields of steps of position and stress."""
    problem, (chosen, steps) = of.problem, plan
    _, _, law, flow, _ = problem.bodies[0]
    stepper = Joint(fields, of.matter, problem.dx, problem.scheme.degree, problem.gravity,
                    problem.conditions, law=law, flow=flow, scale=scale)
    states, reports, dt = [Position(rest)], [], problem.clock.dt
    for k in range(steps):
        state, report = stepper.step(states[-1], chosen.points, k * dt, dt)
        states.append(state)
        reports.append(report)
    return {"latent": np.array([state[0] for state in states]), "reports": reports,
            "fields": values_of(fields, states[-1][0])}
