"""Errors of reduced runs on trained networks (NSF-sec4.5); `errors` has those of fields of modes.
Also the operations of networks of these widths, and of the printed ones, at a point.
"""

from itertools import pairwise

import numpy as np

from mpm_ref.rom.fields import perceptron
from mpm_ref.rom.fields.architecture import DEPTH
from mpm_ref.rom.study.errors import PositionErrors

from ..common import targets
from ..common.registry import experiment
from ..common.weights_needed import load_available
from .errors import COLUMNS, error_rows, mean, record_errors, record_mean, weights_note
from .networks import fields_of, nets, trained
from .reduced_runs import fit_study

DIM, DRAWS = 3, 3
OUTPUTS = {"g": 3, "h": 6, "l": 9}
WEIGHTED = "samples with weights"
PRINTED = {"metal": "error.50", "toothpaste": "error.50"}       # of the others: "error"
TRAINED = {"fields": "trained networks", "comparator": "info"}


@experiment("nsf.networks", title="NSF: reduced runs on trained networks",
            profiles=("standard",), budget={"standard": 4500})
def networks(run):
    """Errors with few samples, drawn or with weights, and all particles, of the scenes whose
    networks are trained; weights and operations of these and of the printed widths.
    """
    all_nets = nets()
    for name, net in all_nets.items():
        record_cost(run, name, net)
    rows = []
    for name, model in load_available(run, list(all_nets), trained).items():
        one = fit_to_networks(model, all_nets[name].study)
        rows += record_scene(run, name, one, scale_of(all_nets[name], one))
    run.table("errors", ("scene", *COLUMNS[1:]), rows)


def record_cost(run, name, net):
    """Record the weights of a scene's `FieldsNet` and operations at a point, and those of the
    printed widths.
    """
    target = f"nsf.networks.{name}"
    our_widths = {network: getattr(net, network).width for network in OUTPUTS}
    for word, widths, octaves in (("", our_widths, net.octaves),
                                  (".printed", printed(name.split("-")[0]), 0)):
        count = sum(weight_count(net.study, network, width, octaves if network != "g" else 0)
                    for network, width in widths.items())
        note = (f"hidden layers {DEPTH} x " + ", ".join(f"{w} ({network})" for network,
                                                        w in widths.items())
                + features_note(octaves))
        run.record(f"{target}.weights{word}", count, unit="1", comparator="info", note=note)
        run.record(f"{target}.operations{word}", 2 * count, unit="1", comparator="info",
                   note=f"{note}; products and sums of all three networks at a point, without "
                        "derivatives")


def printed(scene):
    """Return {network: printed width} of a scene."""
    numbers = targets.load()
    return {network: int(numbers[f"nsf.table1.{scene}.mlp.{network}.width"].value)
            for network in OUTPUTS}


def features_note(octaves):
    """Describe the Fourier features that fields read."""
    return f", {octaves} octaves of sines and cosines of places (h, l)" if octaves else ""


def weight_count(study, network, width, octaves=0):
    """Return the number of weights, without biases, of a network with hidden layers of a width."""
    inputs = (perceptron.feature_count(DIM, octaves) + study.sizes.r
              + (network == "h" and study.follows))
    return sum(n * m for n, m in pairwise((inputs, *(width,) * DEPTH, OUTPUTS[network])))


def fit_to_networks(model, study):
    """Return the `FittedStudy` of a study on trained networks; its modes are of the same runs."""
    one = fit_study(study)
    return one._replace(fields=fields_of(model, study), xhat=model.xhat, modes=one.fields)


def scale_of(net, one):
    """Describe the runs, and the widths and seed of the networks, in words."""
    widths = f"widths {net.g.width}, {net.h.width} and {net.l.width}"
    return f"{one.size}, {widths}{features_note(net.octaves)}, seed {net.seed}"


def printed_error(name, target):
    """Return the id of the printed error of networks as printed; of narrower ones, with a word
    behind it; of other seeds and widths, an id of our own.
    """
    scene, _, kind = name.partition("-")
    printed = f"nsf.{scene}.{PRINTED.get(scene, 'error')}"
    words = {"printed": "", "waves": ".waves", "": ".plain"}
    return printed + words[kind] if kind in words else target


def own_rule(name):
    """Return the rule of the error of networks that no printed number stands for."""
    return {} if name.partition("-")[2] in ("printed", "waves", "") else {"comparator": "info"}


def record_scene(run, name, one, scale):
    """Record the errors of a scene's reduced runs; return their rows."""
    target, few = f"nsf.networks.{name}", one.study.samples
    drawn, weighted, every = (
        [row for draw in run.progress(range(draws), f"{name}, {words}")
         for row in error_rows(one, name, count, (draw,), weighted=words == WEIGHTED)]
        for words, count, draws in (("samples", few, DRAWS), (WEIGHTED, few, DRAWS),
                                    ("all particles", len(one.fields.X), 1)))
    record_mean(run, printed_error(name, target), drawn, scale, f"{few} samples",
                fields=TRAINED["fields"], **own_rule(name))
    for word, rows, note in (
            (".cubature", weighted, f"at most {few} samples with weights by cubature of modes of "
             f"the same runs; {weights_note(weighted)}"),
            (".all", every, "all particles are samples")):
        record_mean(run, f"{target}{word}", rows, scale, note, **TRAINED)
    for word, rows in (("", drawn), (".cubature", weighted), (".all", every)):
        run.record(f"{target}{word}.stress", 100.0 * mean(rows, "stress"), unit="%",
                   comparator="info", scale=scale,
                   note="of the Kirchhoff stress, all particles and times")
    nearest = [one.nearest_state_errors(value) for value in run.progress(one.study.test,
                                                                         f"{name}, nearest")]
    record_errors(run, f"{target}.nearest", PositionErrors(*np.mean(nearest, axis=0)), scale,
                  "nearest states that the networks know", **TRAINED)
    return drawn + weighted + every
