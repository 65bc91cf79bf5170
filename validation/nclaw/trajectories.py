"""How well graph networks run away from what they learned, of 1, 10 and 100 runs (Table 6)."""

import numpy as np

from ..registry import experiment
from .nets import Untrained, nets, trained
from .simulators import COUNTS, named
from .tables import COLUMNS, INFO, errors, noted, other, scale, tell

WATER, TASK = "water", "velocity"
METHODS = {f"gnn.{count}": named(WATER, count) for count in COUNTS} | {"ours.1": WATER}


@experiment("nclaw.table6", title="NCLaw: graph networks of more and more runs",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 600})
def table6(run):
    """Water thrown otherwise, by graph networks and by ours."""
    found, waiting = {}, []
    for method, name in METHODS.items():
        try:
            found[method] = {WATER: trained(name)}
        except Untrained as fault:
            waiting.append(str(fault))
    rows = errors(run, found, (TASK,))
    for method in found:
        mine, net = [row for row in rows if row.method == method], nets()[METHODS[method]]
        run.record(f"nclaw.table6.{method}.loss", np.mean([row.error for row in mine]),
                   unit="m^2", scale=scale(run, WATER, TASK), note=noted(mine, net),
                   **(INFO if other(run, WATER, TASK) else {}))
        run.record(f"nclaw.table6.{method}.trajectories", int(method.split(".")[1]), unit="1",
                   scale=f"weights {METHODS[method]}.npz")
    run.table("errors", COLUMNS, rows)
    tell(run, waiting)
