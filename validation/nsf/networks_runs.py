"""Errors of reduced runs on trained networks (NSF-sec4.5), beside those of `errors`, whose fields
are sums of modes; and what networks of these widths, and of the printed ones, cost at a point.
"""

from itertools import pairwise

import numpy as np

from mpm_ref.reduced.errors import Errors
from mpm_ref.reduced.whole import history
from mpm_ref.rom.architecture import DEPTH

from .. import targets
from ..nclaw.waiting import there
from ..registry import experiment
from .errors import ORIGIN
from .networks import fields_of, nets, trained
from .tested import Tested

DRAWS = 10              # of samples
DIM = 3
OUTPUTS = {"g": 3, "h": 6, "l": 9}
COLUMNS = ("scene", "value", "samples", "draw", "origin", "centroid", "displacement", "stress",
           "points")


@experiment("nsf.networks", title="NSF: reduced runs on trained networks",
            profiles=("standard",), budget={"standard": 1500})
def networks(run):
    """Errors with few samples and all particles, of the scenes whose networks are trained; weights
    and operations of these and of the printed widths.
    """
    known = nets()
    for name, net in known.items():
        cost(run, f"nsf.networks.{name}", net)
    rows = []
    for name, model in there(run, list(known), trained).items():
        one = tested_on(model, known[name].study)
        rows += of_scene(run, name, one, scale_of(known[name], one))
    run.table("errors", COLUMNS, rows)


def cost(run, id, net):
    """Record the weights of a `Net` and operations at a point, and those of the printed widths."""
    name, printed = id.rpartition(".")[2], targets.load()
    for word, widths in (("", {own: getattr(net, own).width for own in OUTPUTS}),
                         (".printed", {own: int(printed[f"nsf.table1.{name}.mlp.{own}.width"].value)
                                       for own in OUTPUTS})):
        count = sum(weights(net.study, own, width) for own, width in widths.items())
        note = f"hidden layers {DEPTH} x " + ", ".join(f"{w} ({own})" for own, w in widths.items())
        run.record(f"{id}.weights{word}", count, unit="1", comparator="info", note=note)
        run.record(f"{id}.operations{word}", 2 * count, unit="1", comparator="info",
                   note=f"{note}; products and sums of all three networks at a point, without "
                        "derivatives")


def weights(study, own, width):
    """Number of weights, without biases, of one network with hidden layers so wide."""
    inputs = DIM + study.sizes.r + (own == "h" and study.follows)
    return sum(n * m for n, m in pairwise((inputs, *(width,) * DEPTH, OUTPUTS[own])))


def tested_on(model, study):
    """`Tested` of a study's held-out runs on trained networks; its training runs are not made."""
    tests = {value: history(study.run(value), [value], every=study.spacing)
             for value in study.test}
    return Tested(study, fields_of(model, study), model.xhat, None, tests)


def scale_of(net, one):
    """In words."""
    study, test = one.study, next(iter(one.tests.values()))
    coarse = "" if study.coarser == 1 else f", dx and dt {study.coarser} times as long"
    return (f"{len(test.X)} particles, {test.x.shape[1] - 1} steps, {len(study.train)} runs and "
            f"{len(study.test)} tests{coarse}; r = {study.sizes.r}, widths {net.g.width}, "
            f"{net.h.width} and {net.l.width}")


def of_scene(run, name, one, scale):
    """Record the errors of a scene's reduced runs; their rows."""
    few, every = one.study.samples, len(one.fields.X)
    drawn = rows_of(run, name, one, few, DRAWS)
    all_points = rows_of(run, name, one, every, 1)
    id = f"nsf.networks.{name}"
    said(run, id, mean_of(drawn), scale, f"{few} samples; mean of {len(drawn)}, the largest "
         f"{100.0 * max(row[COLUMNS.index('origin')] for row in drawn):.3g} %")
    said(run, f"{id}.all", mean_of(all_points), scale, "all particles are samples")
    nearest = [one.nearest(value) for value in run.progress(one.study.test, f"{name}, nearest")]
    said(run, f"{id}.nearest", Errors(*np.mean(nearest, axis=0)), scale,
         "nearest states that the networks know")
    run.record(f"{id}.stress", 100.0 * float(np.mean(column(drawn, "stress"))), unit="%",
               comparator="info", scale=scale, note=f"{few} samples; of the Kirchhoff stress, all "
               "particles and times")
    return drawn + all_points


def rows_of(run, name, one, count, draws):
    """A row for each test and draw."""
    cases = [(value, draw) for value in one.study.test for draw in range(draws)]
    found = [(value, draw, one.errors(value, count, draw))
             for value, draw in run.progress(cases, f"{name}, {count} samples")]
    return [(name, value, count, draw, *got.errors, got.stress, got.points)
            for value, draw, got in found]


def column(rows, name):
    """Of rows."""
    return [row[COLUMNS.index(name)] for row in rows]


def mean_of(rows):
    """Mean `Errors` of rows."""
    return Errors(*(float(np.mean(column(rows, name))) for name in Errors._fields))


def said(run, id, errors, scale, note):
    """Record `Errors` in per cent: the paper's, which depends on the origin, and others beside."""
    origin, centroid, displacement = (100.0 * error for error in errors)
    run.record(id, origin, unit="%", comparator="info", scale=scale, note=f"{note}; trained "
               f"networks; {ORIGIN}; from the centroid {centroid:.3g} %, of the displacement "
               f"{displacement:.3g} %")
