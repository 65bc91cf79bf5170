"""Deformation gradients that reduced runs evolve on the grid, beside those of the map: ours.

With `deformation_gradient = "evolved"` quadrature points keep F as the full model's particles do
(`rom.evolution`). The option has no number that could be chosen on tests. Pokes, one (Table 5) and
ten in a row (Table 6), are judged by the printed errors of Lagrangian quadrature; elsewhere errors
are set beside those with the map's F.
"""

from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from mpm_ref.rom.evolution import EVOLVED, GRADIENTS, MAP
from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.run import PROJECTIONS, RunOptions

from ..common.registry import experiment
from ..common.seeding import generator
from .networks import SEEDS, trained
from .references import References, pod, record_errors, references
from .studies import GRAVITY, POKES, TORSION
from .tables import POINTS, TESTED, poked_in_a_row

NAME, TABLE6 = "ldm.evolved", "ldm.table6"     # whose pokes in a row these are
MODES = {"poke": (6, 12, 24), "gravity": (4, 7), "torsion": (7,)}    # of POD, by study
NOTE = "one training, one draw of samples"
COLUMNS = ("table", "map", "F", "scheme", "points", "origin", "centroid", "displacement")


class MapCase(NamedTuple):
    """A map, and the runs on it."""

    name: str               # in records
    tests: References
    g: object
    rest: np.ndarray        # (r,) latent coordinates at rest


@experiment(NAME, title="LDM: deformation gradients evolved on the grid",
            profiles=("standard",), budget={"standard": 2400})
def evolved_gradients(run):
    """Record errors of pokes by networks, beside the printed ones, and of all studies with
    both deformation gradients.
    """
    rows = []
    for case in compared_cases():
        rows += compared_rows(run, case)
    rows += judged_rows(run, TABLE6, poked_in_a_row(generator(run.seed, TABLE6)))
    rows += judged_rows(run, "ldm.table5", references(POKES))
    run.table("errors", COLUMNS, rows)


def judged_rows(run, table, tests):
    """Record the errors of evolved F on the poke's network by the ids of a printed table, and
    beside them those of the map's F by linear projection. Return rows of all.
    """
    rows, model = [], trained(POKES.name)
    case = MapCase(POKES.name, tests, model.field, model.rest)
    plans = [(EVOLVED, one) for one in PROJECTIONS] + [(MAP, PROJECTIONS[1])]
    for (gradient, projection), points in run.progress([*product(plans, (None, POINTS))], table):
        options = RunOptions("lagrangian", projection, points, deformation_gradient=gradient)
        errors = errors_of(run, table, case, options)
        name = f"{options.name}.{points or 'all'}"
        if gradient == EVOLVED:
            record_errors(run, f"{table}.{name}.{EVOLVED}", errors, tests.scale, NOTE)
        else:
            record_errors(run, f"{NAME}.{table}.{name}.{MAP}", errors, tests.scale, NOTE,
                          comparator="info")
        rows.append(row(table, case, options, errors))
    return rows


def compared_cases():
    """Yield the `MapCase` of each map on which the two deformation gradients are compared."""
    for study, nets in ((POKES, ()), (GRAVITY, ("gravity-r7",)),
                        (TORSION, [f"torsion-{seed}" for seed in range(SEEDS)])):
        tests = references(study, TESTED if study is POKES else None)
        for net in nets:
            yield MapCase(net, tests, trained(net).field, trained(net).rest)
        for r in MODES[study.name]:
            yield MapCase(f"{study.name}.pod-{r}", tests, pod(study.name, r), np.zeros(r))


def compared_rows(run, case):
    """Record the errors of a `MapCase` with all points, and with a few, with both deformation
    gradients; and the ratio of the errors with all points. Return rows of them.
    """
    rows = []
    for points in (None, POINTS):
        errors = {}
        for gradient in GRADIENTS:
            options = RunOptions(points=points, deformation_gradient=gradient)
            errors[gradient] = errors_of(run, "", case, options)
            record_errors(run, f"{NAME}.{case.name}.{points or 'all'}.{gradient}", errors[gradient],
                          case.tests.scale, comparator="info")
            rows.append(row("", case, options, errors[gradient]))
        if points is None:
            run.record(f"{NAME}.{case.name}.ratio", errors[EVOLVED].origin / errors[MAP].origin,
                       unit="1", scale=case.tests.scale, comparator="<=", bound=1.0,
                       note="error with evolved F over that with the map's, all points")
    return rows


def errors_of(run, table, case, options):
    """Return the `PositionErrors` of the runs of a case, which an interrupted run has cached."""
    key = f"{table}{case.name}.{options.name}.{options.points}.{options.deformation_gradient}"
    return PositionErrors(*run.cached(key, partial(case.tests.run_errors, case.g, case.rest,
                                                   options)))


def row(table, case, options, errors):
    """Return a row of the table of all errors."""
    return (table, case.name, options.deformation_gradient, options.name,
            options.points or len(case.tests.X), *errors)
