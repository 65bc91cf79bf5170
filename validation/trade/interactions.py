"""Whether the knobs act by themselves: random pairs of changes, made alone and together."""

from itertools import combinations

import numpy as np

from ..common.registry import experiment
from .knobs import DEFAULT
from .measure import measure
from .mms import prepare

# One change of each knob, none of which breaks the run.
CHANGES = {
    "dt": {"cfl": 0.1}, "dx": {"cells": 32}, "particles": {"per": 3},
    "sampling": {"sampling": "jittered"}, "degree": {"degree": 3}, "transfer": {"transfer": "apic"},
    "storage": {"storage": "f32"},
}
PAIRS = 10


@experiment("trade.explicit.interactions", title="Explicit MPM: do the knobs act by themselves?",
            profiles=("standard",), budget={"standard": 300})
def interactions(run):
    """Factor by which the error of two changes departs from the product of their factors."""
    pairs = list(combinations(CHANGES, 2))
    chosen = [pairs[k] for k in sorted(run.rng.permutation(len(pairs))[:PAIRS])]
    alone = {knob: error(run, CHANGES[knob]) for knob in CHANGES}
    default, rows = error(run, {}), []
    for a, b in run.progress(chosen, "pairs"):
        both = error(run, {**CHANGES[a], **CHANGES[b]})
        expected = alone[a] * alone[b] / default
        rows.append((a, b, alone[a] / default, alone[b] / default, both / default, both / expected))
    run.table("pairs", ("first", "second", "factor_first", "factor_second", "factor_both",
                        "interaction"), rows)
    strongest = max(rows, key=lambda row: abs(np.log(row[-1])))
    run.record("trade.explicit.interactions.strongest", strongest[-1], comparator="info",
               scale=f"{PAIRS} of {len(pairs)} pairs, drawn with the seed of the run",
               note=f"error of {strongest[0]} and {strongest[1]} together over what their factors "
                    "promise: where this is far from 1, a front of single knobs does not tell all")


def error(run, change):
    """Error of the manufactured solution with some knobs changed."""
    return measure("pair", DEFAULT._replace(**change), lambda s: prepare(s, run.seed), 1).error
