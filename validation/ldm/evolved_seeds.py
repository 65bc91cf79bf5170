"""Pokes with evolved F over several trainings of the map; `ldm.evolved` has one training."""

import numpy as np

from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.run import RunOptions

from ..common.registry import experiment
from .evolved_gradients import EVOLVED, MapCase, errors_of
from .networks import POKE_NETS, trained
from .references import record_errors, references
from .studies import POKES
from .tables import POINTS

NAME = "ldm.evolved-seeds"


@experiment(NAME, title="LDM: pokes with evolved F, over three trainings",
            profiles=("standard",), budget={"standard": 1200})
def seeds(run):
    """Record the errors of each training over all test runs, their median and their spread."""
    tests, rows = references(POKES), []
    for points in (None, POINTS):
        options, name = RunOptions(points=points, deformation_gradient=EVOLVED), points or "all"
        errors = {}
        for net in run.progress(POKE_NETS, "trainings"):
            case = MapCase(net, tests, trained(net).field, trained(net).rest)
            errors[net] = errors_of(run, "", case, options)
        record_seeds(run, f"{NAME}.{options.name}.{name}", errors, tests.scale)
        rows += [(net, name, *one) for net, one in errors.items()]
    run.table("errors", ("net", "points", "origin", "centroid", "displacement"), rows)


def record_seeds(run, name, errors, scale):
    """Record the `PositionErrors` {net: ..} of trainings, their median and their spread."""
    for net, one in errors.items():
        record_errors(run, f"{name}.{net}", one, scale, comparator="info")
    origins = [one.origin for one in errors.values()]
    record_errors(run, f"{name}.median",
                  PositionErrors(*np.median(list(errors.values()), axis=0).tolist()), scale,
                  f"of {len(errors)} trainings, one draw of samples", comparator="info")
    run.record(f"{name}.spread", max(origins) / min(origins), unit="1", scale=scale,
               comparator="info", note="the largest error of a training over the smallest")
