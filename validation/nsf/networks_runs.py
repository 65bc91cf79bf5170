"""Errors of reduced runs on trained networks (NSF-sec4.5), beside those of `errors`, whose fields
are sums of modes; and what networks of these widths, and of the printed ones, cost at a point.
"""

from itertools import pairwise

import numpy as np

from mpm_ref.reduced.errors import Errors
from mpm_ref.reduced.whole import history
from mpm_ref.rom import features
from mpm_ref.rom.architecture import DEPTH

from .. import targets
from ..registry import experiment
from ..waiting import there
from .errors import COLUMNS, DRAWS, mean, rows_of, said, share
from .networks import WAVES, Part, fields_of, nets, trained
from .tested import Tested

DIM = 3
OUTPUTS = {"g": 3, "h": 6, "l": 9}
TRAINED = {"fields": "trained networks", "comparator": "info"}


@experiment("nsf.networks", title="NSF: reduced runs on trained networks",
            profiles=("standard",), budget={"standard": 1500})
def networks(run):
    """Errors with few samples and all particles, of the scenes whose networks are trained; weights
    and operations of these and of the printed widths.
    """
    known = nets()
    for name, net in known.items():
        cost(run, name, net)
    rows = []
    for name, model in there(run, list(known), trained).items():
        one = tested_on(model, known[name].study)
        rows += of_scene(run, name, one, scale_of(known[name], one))
    run.table("errors", ("scene", *COLUMNS[1:]), rows)


def cost(run, name, net):
    """Record the weights of a scene's `Net` and operations at a point, and those of the printed
    widths.
    """
    id, of_ours = f"nsf.networks.{name}", {own: getattr(net, own) for own in OUTPUTS}
    for word, parts in (("", of_ours), (".printed", printed(name.removesuffix(WAVES)))):
        count = sum(weights(net.study, own, part) for own, part in parts.items())
        note = f"hidden layers {DEPTH} x " + ", ".join(f"{part.width} ({own})"
                                                       for own, part in parts.items())
        run.record(f"{id}.weights{word}", count, unit="1", comparator="info", note=note)
        run.record(f"{id}.operations{word}", 2 * count, unit="1", comparator="info",
                   note=f"{note}; products and sums of all three networks at a point, without "
                        "derivatives")


def printed(scene):
    """{network: `Part`} with the printed widths of a scene."""
    known = targets.load()
    return {own: Part(int(known[f"nsf.table1.{scene}.mlp.{own}.width"].value), 0, 0.0)
            for own in OUTPUTS}


def weights(study, own, part):
    """Number of weights, without biases, of one network as a `Part` says."""
    inputs = features.count(DIM, part.octaves) + study.sizes.r + (own == "h" and study.follows)
    return sum(n * m for n, m in pairwise((inputs, *part.hidden, OUTPUTS[own])))


def tested_on(model, study):
    """`Tested` of a study's held-out runs on trained networks; its training runs are not made."""
    tests = {value: history(study.run(value), [value], every=study.spacing)
             for value in study.test}
    return Tested(study, fields_of(model, study), model.xhat, None, tests)


def scale_of(net, one):
    """In words."""
    return f"{one.size}, widths {net.g.width}, {net.h.width} and {net.l.width}"


def of_scene(run, name, one, scale):
    """Record the errors of a scene's reduced runs; their rows."""
    id, few = f"nsf.networks.{name}", one.study.samples
    drawn, every = (
        [row for draw in run.progress(range(draws), f"{name}, {count} samples")
         for row in rows_of(one, name, count, (draw,))]
        for count, draws in ((few, DRAWS), (len(one.fields.X), 1)))
    share(run, id, drawn, scale, f"{few} samples", **TRAINED)
    share(run, f"{id}.all", every, scale, "all particles are samples", **TRAINED)
    nearest = [one.nearest(value) for value in run.progress(one.study.test, f"{name}, nearest")]
    said(run, f"{id}.nearest", Errors(*np.mean(nearest, axis=0)), scale,
         "nearest states that the networks know", **TRAINED)
    run.record(f"{id}.stress", 100.0 * mean(drawn, "stress"), unit="%", comparator="info",
               scale=scale, note=f"{few} samples; of the Kirchhoff stress, all particles and times")
    return drawn + every
