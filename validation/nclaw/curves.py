"""How the errors of NCLaw's laws fall in training, as their weights tell (the inset of section
4.7 among them); of graph networks, how far off they run freely.
"""

from mpm_ref.materials.learned.weights import errors_include_velocities
from mpm_ref.nclaw.gnn.simulator import Simulator

from ..common.registry import experiment
from .diverged import diverged
from .simulators import GraphNet
from .strain_bounds import LABELED
from .tables import known, method_of
from .trained_laws import identity, nets

STEP = {"unit": "m^2", "note": "mean over steps from restarts of the horizon of that epoch"}
MIXED = {"unit": "m^2", "note": f"{STEP['note']}; the loss's term of velocities is in it, which "
                                "the training did not tell apart"}
ANSWER = {"unit": "1", "note": "mean squared error of F after the return map, over pairs"}
COLUMNS = ("method", "environment", "epoch", "error")


@experiment("nclaw.loss", title="NCLaw: errors in training",
            profiles=("quick", "standard"), budget={"quick": 1, "standard": 1})
def loss(run):
    """Mean squared errors of positions after a step, from restarts, epoch by epoch; of "labeled"
    laws, which follow no motion, and where velocities are mixed in, first and last error alone.
    """
    rows = []
    for method, own in known(run).items():
        for name, laws in own.items():
            if isinstance(laws, Simulator):
                record_picked(run, f"nclaw.loss.{method}.{name}", laws.about)
                continue
            errors, of = laws.about["errors"], kind_of(method, laws.about)
            record(run, f"nclaw.loss.{method}.{name}", errors, of)
            rows += rows_of(method, name, errors, of)
    run.table("errors", COLUMNS, rows + of_diverged(run))


def of_diverged(run):
    """Rows of the trainings that diverged; records how far they came."""
    rows = []
    for name, net in nets().items():
        about = None if isinstance(net, GraphNet) else diverged(name, identity(net))
        if about is None:
            continue
        method, errors = method_of(name, net), about["errors"]
        run.record(f"nclaw.loss.{method}.{net.environment}.epochs", len(errors), unit="epochs",
                   comparator="info", scale=f"of {net.epochs} epochs",
                   note=f"the training diverged: {about['stopped']}")
        rows += rows_of(method, net.environment, errors, kind_of(method, about))
    return rows


def rows_of(method, name, errors, of):
    """Rows of the table, if the errors are those of a step."""
    return [(method, name, epoch, error) for epoch, error in enumerate(errors, 1) if of is STEP]


def kind_of(method, about):
    """What the errors of a training are: unit and note."""
    if method == LABELED:
        return ANSWER
    return MIXED if errors_include_velocities(about) else STEP


def record(run, target, errors, of):
    """Record where a training began and ended; of: unit and note."""
    for word, error in (("first", errors[0]), ("last", errors[-1])):
        run.record(f"{target}.{word}", error, comparator="info", scale=f"{len(errors)} epochs",
                   **of)


def record_picked(run, target, about):
    """Record what a graph network was picked for."""
    errors, checks = about["errors"], len(about["errors"])
    run.record(f"{target}.picked", errors[about["picked"]], unit="m^2", comparator="info",
               scale=f"{about['steps']} steps, {checks} checks",
               note=f"the free run along the first run that it learned from, at check "
                    f"{about['picked'] + 1}; at the last one {errors[-1]} m^2")
