"""Errors of laws learned from images of the dough: on the run that was filmed, and on a star."""

from functools import partial
from typing import NamedTuple

import numpy as np

from mpm_ref.materials import make_flow
from mpm_ref.nclaw.bodies import body_maker, body_with_laws, copy_body
from mpm_ref.nclaw.camera import project

from ..common.registry import experiment
from ..common.weights_needed import load_available
from ..ldm.published_bodies import keep
from .diverged_trainings import diverged_trainings, record_epochs
from .dough import (
    EVERY,
    FRAMES_PER_SECOND,
    GUESS,
    NOISE,
    block,
    camera,
    doughs,
    identity,
    material,
    observe,
    scene,
    star,
    trained,
)
from .initial_laws import untrained
from .states import shots

BODIES = {"block": block, "star": star}
COLUMNS = ("laws", "pixels", "block", "star", "broken")
INFO = {"comparator": "info"}


class DoughRow(NamedTuple):
    """Errors of laws; NaN where a run broke down."""

    laws: str
    pixels: float       # root mean square distance of marks in the image [px]
    block: float        # ... of points in space, in the run that was filmed [m]
    star: float         # ... in that of the star [m]
    broken: str         # runs that broke down


@experiment("nclaw.dough", title="NCLaw: dough, filmed synthetically",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 15})
def dough(run):
    """Trained laws beside a wrong guess, laws before training, and the true ones, which see the
    noise of the camera alone. Keeps the points at the start, half-way and at the end.
    """
    laws = contestants(run)
    runs = {name: {body: shots(scene(shape()), law).x for body, shape in BODIES.items()}
            for name, law in run.progress(laws.items(), "laws")}
    truth = runs["true"]
    marks = observe(truth["block"])
    rows = [row(name, frames, truth, marks) for name, frames in runs.items()]
    keep(run, **{f"{body}_{name}": x[::(len(x) - 1) // 2] for name, frames in runs.items()
                 for body, x in frames.items()})
    record_depth_speed(run, truth["block"])
    for one in rows:
        record(run, one, len(truth["star"][0]))
    run.table("errors", COLUMNS, rows)


def contestants(run):
    """Return {name: function that gives a body other laws}; record which weights are missing."""
    laws = load_available(run, doughs(), trained)
    for name, about in diverged_trainings(doughs(), identity).items():
        record_epochs(run, f"nclaw.dough.{name}", about, doughs()[name].epochs)
    return {"true": copy_body, "guess": guessed, "init": body_maker(untrained()),
            **{name: body_maker(one) for name, one in laws.items()}}


def guessed(body):
    """Return a body with the laws of the wrong guess."""
    guess = material(**GUESS)
    law, flow = guess.elastic(), guess.flow
    return body_with_laws(body, law, make_flow(flow.name, law, 3, tau_y=flow.tau_y,
                                               s_min=flow.s_min))


def row(name, frames, truth, marks):
    """Return the `DoughRow` of laws from the frames of both bodies."""
    image = project(camera(), frames["block"][:, marks.points])
    errors = {body: rms_distance(x, truth[body]) for body, x in frames.items()}
    broken = " and ".join(body for body, x in frames.items() if np.isnan(x).any())
    return DoughRow(name, rms_distance(image, marks.places), *errors.values(), broken)


def rms_distance(a, b):
    """Return the root mean square distance of points (.., d)."""
    return float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=-1))))


def record_depth_speed(run, x):
    """Record the speed of the true body in depth, which the prior of training takes to be small."""
    speed = np.diff(x[..., 2], axis=0) * FRAMES_PER_SECOND
    run.record("nclaw.dough.depth_speed", float(np.sqrt(np.mean(speed**2))), unit="m/s", **INFO,
               scale=f"{x.shape[1]} particles", note="root mean square of the true run in depth")


def record(run, one, points):
    """Record a `DoughRow`."""
    target = partial("nclaw.dough.{}.{}".format, one.laws)
    note = f"runs that broke down: {one.broken}" if one.broken else ""
    run.record(target("pixels"), one.pixels, unit="px", **INFO, scale=f"{EVERY} steps a frame",
               note="; ".join(filter(None,
                                     (f"marks observed with noise of {NOISE} px along each axis",
                                      note))))
    run.record(target("block"), one.block, unit="m", **INFO, scale="the run that was filmed",
               note=note)
    run.record(target("star"), one.star, unit="m", **INFO,
               scale=f"another body, {points} particles", note=note)
