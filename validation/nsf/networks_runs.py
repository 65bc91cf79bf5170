"""Errors of reduced runs on trained networks (NSF-sec4.5), beside those of `errors`, whose fields
are sums of modes; and what networks of these widths, and of the printed ones, cost at a point.
"""

from itertools import pairwise

import numpy as np

from mpm_ref.rom.fields import perceptron
from mpm_ref.rom.fields.architecture import DEPTH
from mpm_ref.rom.study.errors import PositionErrors

from ..common import targets
from ..common.registry import experiment
from ..common.weights_needed import load_available
from .errors import COLUMNS, mean, rows_of, said, share, weights
from .networks import fields_of, nets, trained
from .reduced_runs import tested

DIM, DRAWS = 3, 3
OUTPUTS = {"g": 3, "h": 6, "l": 9}
WEIGHED = "samples with weights"
TRAINED = {"fields": "trained networks", "comparator": "info"}


@experiment("nsf.networks", title="NSF: reduced runs on trained networks",
            profiles=("standard",), budget={"standard": 4500})
def networks(run):
    """Errors with few samples, drawn or with weights, and all particles, of the scenes whose
    networks are trained; weights and operations of these and of the printed widths.
    """
    known = nets()
    for name, net in known.items():
        cost(run, name, net)
    rows = []
    for name, model in load_available(run, list(known), trained).items():
        one = tested_on(model, known[name].study)
        rows += of_scene(run, name, one, scale_of(known[name], one))
    run.table("errors", ("scene", *COLUMNS[1:]), rows)


def cost(run, name, net):
    """Record the weights of a scene's `Net` and operations at a point, and those of the printed
    widths.
    """
    id, of_ours = f"nsf.networks.{name}", {own: getattr(net, own).width for own in OUTPUTS}
    for word, widths, octaves in (("", of_ours, net.octaves),
                                  (".printed", printed(name.split("-")[0]), 0)):
        count = sum(weights_of(net.study, own, width, octaves if own != "g" else 0)
                    for own, width in widths.items())
        note = (f"hidden layers {DEPTH} x " + ", ".join(f"{w} ({own})" for own, w in widths.items())
                + said_of(octaves))
        run.record(f"{id}.weights{word}", count, unit="1", comparator="info", note=note)
        run.record(f"{id}.operations{word}", 2 * count, unit="1", comparator="info",
                   note=f"{note}; products and sums of all three networks at a point, without "
                        "derivatives")


def printed(scene):
    """{network: printed width} of a scene."""
    known = targets.load()
    return {own: int(known[f"nsf.table1.{scene}.mlp.{own}.width"].value) for own in OUTPUTS}


def said_of(octaves):
    """What fields read beside places, in words."""
    return f", {octaves} octaves of sines and cosines of places (h, l)" if octaves else ""


def weights_of(study, own, width, octaves=0):
    """Number of weights, without biases, of one network with hidden layers so wide."""
    inputs = perceptron.feature_count(DIM, octaves) + study.sizes.r + (own == "h" and study.follows)
    return sum(n * m for n, m in pairwise((inputs, *(width,) * DEPTH, OUTPUTS[own])))


def tested_on(model, study):
    """`Tested` of a study on trained networks; modes are of the same training runs."""
    one = tested(study)
    return one._replace(fields=fields_of(model, study), xhat=model.xhat, modes=one.fields)


def scale_of(net, one):
    """In words."""
    widths = f"widths {net.g.width}, {net.h.width} and {net.l.width}"
    return f"{one.size}, {widths}{said_of(net.octaves)}, seed {net.seed}"


def of_scene(run, name, one, scale):
    """Record the errors of a scene's reduced runs; their rows."""
    id, few = f"nsf.networks.{name}", one.study.samples
    drawn, weighed, every = (
        [row for draw in run.progress(range(draws), f"{name}, {words}")
         for row in rows_of(one, name, count, (draw,), weighed=words == WEIGHED)]
        for words, count, draws in (("samples", few, DRAWS), (WEIGHED, few, DRAWS),
                                    ("all particles", len(one.fields.X), 1)))
    for own, rows, note in (
            ("", drawn, f"{few} samples"),
            (".cubature", weighed, f"at most {few} samples with weights by cubature of modes of "
             f"the same runs; {weights(weighed)}"),
            (".all", every, "all particles are samples")):
        share(run, f"{id}{own}", rows, scale, note, **TRAINED)
        run.record(f"{id}{own}.stress", 100.0 * mean(rows, "stress"), unit="%", comparator="info",
                   scale=scale, note=f"{note}; of the Kirchhoff stress, all particles and times")
    nearest = [one.nearest(value) for value in run.progress(one.study.test, f"{name}, nearest")]
    said(run, f"{id}.nearest", PositionErrors(*np.mean(nearest, axis=0)), scale,
         "nearest states that the networks know", **TRAINED)
    return drawn + weighed + every
