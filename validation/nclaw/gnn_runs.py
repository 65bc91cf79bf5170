"""How well graph networks run away from what they learned, of 1, 10 and 100 runs (Table 6)."""

from ..common.registry import experiment
from ..common.weights_needed import load_available
from .errors import COLUMNS, errors, record_mean
from .simulators import COUNTS, named
from .trained_laws import nets, trained

WATER, TASK = "water", "velocity"
METHODS = {named(WATER, count): f"gnn.{count}" for count in COUNTS} | {WATER: "ours.1"}


@experiment("nclaw.table6", title="NCLaw: graph networks of more and more runs",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 600})
def table6(run):
    """Water thrown otherwise, by graph networks and by ours."""
    found = load_available(run, METHODS, trained)
    rows = errors(run, {METHODS[name]: {WATER: laws} for name, laws in found.items()}, (TASK,))
    for name in found:
        method = METHODS[name]
        mine = [row for row in rows if row.method == method]
        record_mean(run, f"nclaw.table6.{method}.loss", mine, nets()[name])
        run.record(f"nclaw.table6.{method}.trajectories", int(method.split(".")[1]), unit="1",
                   scale=f"weights {name}.npz")
    run.table("errors", COLUMNS, rows)
