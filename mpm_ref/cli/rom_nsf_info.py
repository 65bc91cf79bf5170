"""`mpm-ref info` of a study and of fields with model = "nsf": what differs from LDM's."""

import numpy as np

from ..reduced.nsf.networks import Networks
from ..reduced.tables import NETWORK, NSF
from ..rom.fields.pod_fields import Spanned

OF = {"modes": "the displacement", "tau": "the stress", "C": "the affine field"}


def of_study(study):
    """Further facts of a study; none of another model."""
    if study.tables.model != NSF:
        return {}
    return {"model": NSF, "every": study.base.every}


def of_fields(fields, levels):
    """Further facts of fields from the states of each run, whose steps they do not know; none of a
    map of another model.
    """
    inferred = isinstance(fields, Networks | Spanned)
    return {"model": NSF, "states": levels, "steps": None} if inferred else {}


def kept(facts):
    """Which states of a run a study keeps, in words."""
    every = facts["every"]
    return f", one in {every} kept" if every > 1 else ""


def learned(facts):
    """Fields and reduced runs of a study in words."""
    map, run = facts["map"], facts["run"]
    longer = f", steps {run['faster']:g} times as long" if run["faster"] != 1.0 else ""
    return (f"stress fields: {map['kind']}, r = {map['r']}, {sizes(map)}; reduced runs: "
            f"{run['inversion']} inversion, {samples(run)}{longer}")


def samples(run):
    """Which points are samples, in words."""
    if run.get("cells"):
        return f"points of {run['cells']} cells at most, with weights"
    return (f"{run['points'] or 'all'} points"
            f"{' at most, with weights' if run['weighed'] else ''}")


def making(about):
    """What fields say of their making, a line each; trainings of experiments have no study, and
    keep the losses of several epochs.
    """
    if "map" in about:
        yield sizes(about["map"])
    if "losses" in about:
        losses = zip(OF.values(), about["losses"].values(), strict=False)
        yield "last losses: " + ", ".join(f"{np.ravel(loss)[-1]:.3g} of {what}"
                                          for what, loss in losses)


def sizes(map):
    """Numbers of modes or widths of networks, and what the stress is told, in words."""
    told = f"the stress is{'' if map['told'] else ' not'} told the parameters"
    if map["kind"] == NETWORK:
        waves = f", octaves of sines and cosines: {map['octaves']}" if map["octaves"] else ""
        return f"factors of width {', '.join(str(one) for one in map['beta'])}{waves}; {told}"
    modes = ", ".join(f"{map[name]} of {what}" for name, what in OF.items() if map[name])
    return f"modes: {modes}; {told}"
