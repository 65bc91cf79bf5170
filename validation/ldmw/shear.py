"""One step of a sheared cylinder: which terms of the loss are needed (Table 1), and the two
hyper-reductions (Table 2), LDMW-unit.

A step from rest is linear in the speed, so that one POD mode is exact: its errors are recorded too.
Forces are zero in the step, but for those of a learned F that is not the identity at rest: errors
without any force are recorded as well, and those of the map made the identity at rest.
"""

from dataclasses import replace

import numpy as np

from ..common.registry import experiment
from ..ldm.networks import NEITHER, NO_F, WORKSHOP, trained
from ..ldm.workshop_studies import SHEAR3, SHEAR17
from .anchored import Anchored
from .runs import by_nodes, by_points, pod, record, spread, study_runs

R, HYPER = 1, 6             # latent coordinates; sample points of the hyper-reduction
LOSSES = {"none": NEITHER, "temporal": NO_F, "both": WORKSHOP}


@experiment("ldmw.table1", title="LDM workshop: which terms of the loss are needed",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 5})
def losses(run):
    """Errors by the terms of the loss; with the printed weights read as SI units; of POD."""
    tests = study_runs(SHEAR3, SHEAR3.test)
    every = by_points(np.arange(len(tests.X)))
    for row, terms in LOSSES.items():
        net, name = f"shear3-{terms}", f"ldmw.table1.{row}"
        record(run, name, tests.network_errors(net, every), tests.scale)
        record(run, f"{name}.forceless", tests.network_errors(net, forceless(every)), tests.scale,
               comparator="info")
        model = trained(net)
        record(run, f"{name}.anchored",
               tests.errors(Anchored(model.field, model.rest), model.rest, every), tests.scale,
               "g(X; xhat) + X - g(X; rest), the identity at rest", comparator="info")
    record(run, "ldmw.table1.printed", tests.network_errors("shear3-printed", every), tests.scale,
           "lambda_1 = 1e4 and lambda_2 = 0.01 in SI units", comparator="info")
    record(run, "ldmw.table1.pod", tests.errors(*pod(SHEAR3, R), every), tests.scale,
           comparator="info")


@experiment("ldmw.table2", title="LDM workshop: sample points and sample nodes",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 5})
def approaches(run):
    """Errors of both approaches, with all points and with a few; of POD."""
    tests = study_runs(SHEAR17, SHEAR17.test)
    every, few = np.arange(len(tests.X)), spread(tests.X, HYPER)
    rows = {"point": by_points(every), "node": by_nodes(every),
            f"point_hyper{HYPER}": by_points(few), f"node_hyper{HYPER}": by_nodes(few, HYPER)}
    for row, approach in rows.items():
        record(run, f"ldmw.table2.{row}", tests.network_errors("shear17", approach), tests.scale)
        record(run, f"ldmw.table2.{row}.pod", tests.errors(*pod(SHEAR17, R), approach),
               tests.scale, comparator="info")


def forceless(approach):
    """Return an approach whose material has no stress."""
    def softened(one, g):
        stepper, choose = approach(one, g)
        field = stepper.field
        law = type(field.law)(*np.zeros(len(field.law)).tolist())
        return replace(stepper, field=field._replace(law=law)), choose

    return softened
