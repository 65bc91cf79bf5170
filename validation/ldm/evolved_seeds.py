"""Pokes with evolved F over several trainings of the map; `ldm.evolved` has one training."""

from mpm_ref.rom.study.run import RunOptions

from ..common.registry import experiment
from .evolved_gradients import EVOLVED, MapCase, errors_of
from .networks import POKE_NETS, trained
from .references import record_seeds, references
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
