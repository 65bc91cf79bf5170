"""What laws learned from the film of the dough do: on the run that was filmed, and on a star."""

from functools import partial
from typing import NamedTuple

import numpy as np

from mpm_ref.materials import make_flow
from mpm_ref.nclaw.bodies import body_maker, body_with_laws, copy_body
from mpm_ref.nclaw.camera import project

from ..common.registry import experiment
from ..common.weights_needed import load_available
from ..ldm.published_bodies import keep
from .diverged import diverged
from .dough import (
    DROP,
    EVERY,
    FRAMES_PER_SECOND,
    GUESS,
    NOISE,
    block,
    camera,
    doughs,
    film,
    identity,
    material,
    scene,
    star,
    trained,
)
from .initial_laws import untrained
from .states import shots

BODIES = {"block": block, "star": star}
COLUMNS = ("laws", "pixels", "block", "star", "broken")
INFO = {"comparator": "info"}


class Row(NamedTuple):
    """How far laws are off; NaN where a run broke down."""

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
    runs = {name: {body: shots(scene(shape()), law) for body, shape in BODIES.items()}
            for name, law in run.progress(laws.items(), "laws")}
    truth = runs["true"]
    marks = film(truth["block"])
    rows = [row(name, found, truth, marks) for name, found in runs.items()]
    keep(run, **{f"{body}_{name}": x[::(len(x) - 1) // 2] for name, found in runs.items()
                 for body, x in found.items()})
    record_settings(run, marks, truth["block"])
    for one in rows:
        record(run, one, len(truth["star"][0]))
    run.table("errors", COLUMNS, rows)


def contestants(run):
    """{name: what makes a body of other laws}; records which weights are not there yet."""
    laws = load_available(run, doughs(), trained)
    for name, net in doughs().items():
        about = diverged(name, identity(net))
        if about is not None:
            run.record(f"nclaw.dough.{name}.epochs", len(about["errors"]), unit="epochs",
                       comparator="info", scale=f"of {net.epochs} epochs",
                       note=f"the training diverged: {about['stopped']}")
    return {"true": copy_body, "guess": guessed, "init": body_maker(untrained()),
            **{name: body_maker(one) for name, one in laws.items()}}


def guessed(body):
    """A body of the wrong guess."""
    of = material(**GUESS)
    law = of.elastic()
    return body_with_laws(body, law, make_flow(of.flow.type, law, 3, tau_y=of.flow.tau_y,
                                      s_min=of.flow.s_min))


def row(name, found, truth, marks):
    """`Row` of laws whose frames of both bodies were found."""
    seen = project(camera(), found["block"][:, marks.points])
    off = {body: apart(x, truth[body]) for body, x in found.items()}
    broken = " and ".join(body for body, x in found.items() if np.isnan(x).any())
    return Row(name, apart(seen, marks.places), *off.values(), broken)


def apart(a, b):
    """Root mean square distance of points (.., d)."""
    return float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=-1))))


def record_settings(run, marks, x):
    """Record the printed settings, and how fast the true body moves in depth, which the prior of
    training wants small.
    """
    scale = "synthetic"
    run.record("nclaw.appD3.drop_height", 100.0 * DROP, scale=scale)
    run.record("nclaw.appD3.fps", FRAMES_PER_SECOND, scale=scale)
    run.record("nclaw.appD3.dots", len(marks.points), scale=scale, comparator="~", factor=1.1,
               note='the text says "around 50"')
    speed = np.diff(x[..., 2], axis=0) * FRAMES_PER_SECOND
    run.record("nclaw.dough.depth_speed", float(np.sqrt(np.mean(speed**2))), unit="m/s", **INFO,
               scale=f"{x.shape[1]} particles", note="root mean square of the true run in depth")


def record(run, one, points):
    """Record a `Row`."""
    target = partial("nclaw.dough.{}.{}".format, one.laws)
    note = f"runs that broke down: {one.broken}" if one.broken else ""
    run.record(target("pixels"), one.pixels, unit="px", **INFO, scale=f"{EVERY} steps a frame",
               note="; ".join(filter(None, (f"marks seen with noise of {NOISE} px along each axis",
                                            note))))
    run.record(target("block"), one.block, unit="m", **INFO, scale="the run that was filmed",
               note=note)
    run.record(target("star"), one.star, unit="m", **INFO,
               scale=f"another body, {points} particles", note=note)
