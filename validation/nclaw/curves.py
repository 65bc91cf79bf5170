"""Errors of NCLaw's laws in training, as stored with their weights (the inset of section 4.7 among
them), and errors of graph networks in free runs.
"""

from mpm_ref.materials.learned.weights import errors_include_velocities
from mpm_ref.nclaw.gnn.simulator import Simulator

from ..common.registry import experiment
from .diverged_trainings import diverged_trainings, record_epochs
from .simulators import GraphNet
from .strain_bounds import LABELED
from .tables import available_laws, method_of
from .trained_laws import nets

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
    for method, by_environment in available_laws(run).items():
        for name, laws in by_environment.items():
            if isinstance(laws, Simulator):
                record_picked(run, f"nclaw.loss.{method}.{name}", laws.about)
                continue
            errors, kind = laws.about["errors"], error_kind(method, laws.about)
            record(run, f"nclaw.loss.{method}.{name}", errors, kind)
            rows += table_rows(method, name, errors, kind)
    run.table("errors", COLUMNS, rows + diverged_rows(run))


def diverged_rows(run):
    """Record the epochs of the trainings that diverged, and return their rows."""
    rows = []
    laws = {name: net for name, net in nets().items() if not isinstance(net, GraphNet)}
    for name, about in diverged_trainings(laws).items():
        net = laws[name]
        method = method_of(name, net)
        record_epochs(run, f"nclaw.loss.{method}.{net.environment}", about, net.epochs)
        rows += table_rows(method, net.environment, about["errors"], error_kind(method, about))
    return rows


def table_rows(method, name, errors, kind):
    """Return rows of the table, if the errors are those of a step."""
    return [(method, name, epoch, error) for epoch, error in enumerate(errors, 1) if kind is STEP]


def error_kind(method, about):
    """Return the unit of a training's errors, and a note on them."""
    if method == LABELED:
        return ANSWER
    return MIXED if errors_include_velocities(about) else STEP


def record(run, target, errors, kind):
    """Record the first and the last error of a training; kind: unit and note."""
    for word, error in (("first", errors[0]), ("last", errors[-1])):
        run.record(f"{target}.{word}", error, comparator="info", scale=f"{len(errors)} epochs",
                   **kind)


def record_picked(run, target, about):
    """Record the error for which a graph network was picked."""
    errors, checks = about["errors"], len(about["errors"])
    run.record(f"{target}.picked", errors[about["picked"]], unit="m^2", comparator="info",
               scale=f"{about['steps']} steps, {checks} checks",
               note=f"the free run along the first run that it learned from, at check "
                    f"{about['picked'] + 1}; at the last one {errors[-1]} m^2")
