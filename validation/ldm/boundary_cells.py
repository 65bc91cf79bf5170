"""Table 3 with Eulerian sub-cells that the body's surface cuts: an option of ours.

As printed, a sub-cell counts as a whole or not at all. With `boundary_cells = "cut"` it counts by
the part of it within the body. Errors of Table 3's test runs, and of the body's mass on the grid;
which option to take was decided on training runs. What is left over Lagrangian quadrature may be
due to the full model, whose random points the latter shares: errors are therefore also measured
against full runs of regular points, which integrate better, as tracers bring them to the same
points.
"""

import numpy as np

from mpm_ref.rom.quadrature.eulerian import CUT, WHOLE
from mpm_ref.rom.study.errors import PositionErrors, Squares
from mpm_ref.rom.study.run import PROJECTIONS, RunOptions, ldm_model

from ..common.position_errors import mean_errors
from ..common.registry import experiment
from .networks import SEEDS, trained
from .references import record_errors, references
from .studies import TORSION, refined
from .superres import advected
from .tables import POINTS

NAME = "ldm.boundary-cells"
NETS = tuple(f"torsion-{seed}" for seed in range(SEEDS))
EULERIAN = RunOptions("eulerian")
DENSE = 3           # quadrature points of a cell per axis, beside the printed two
REGULAR = 4         # points of a cell per axis in full runs of regular points
COLUMNS = ("scheme", "points", "per_cell", "cells", "net", "origin", "centroid", "displacement")


@experiment(NAME, title="LDM: Eulerian sub-cells at the body's surface",
            profiles=("quick", "standard"), budget={"quick": 25, "standard": 400})
def boundary_cells(run):
    """Record errors of torsion with cut sub-cells, by projection and number of samples, and with
    more quadrature points to a cell; and errors of mass.
    """
    tests, rows = references(TORSION, run.choose(quick=1, standard=None)), []
    nets = run.choose(quick=NETS[:1], standard=NETS)
    plans = run.choose(quick=[plan(PROJECTIONS[1])], standard=[
        plan(projection, points, per_cell) for projection in PROJECTIONS
        for points, per_cell in ((POINTS, EULERIAN.per_cell), (None, EULERIAN.per_cell),
                                 (None, DENSE))])
    for options in run.progress(plans, "options"):
        rows += recorded(run, options, nets, tests)
    for cells in (WHOLE, CUT):
        record_mass(run, cells, nets, tests)
    if run.profile == "standard":
        regular = regular_references(tests)
        for options in (RunOptions(), plan(PROJECTIONS[1])):
            rows += recorded(run, options, nets, regular, "regular.")
        record_errors(run, f"{NAME}.regular.full", difference(tests, regular), tests.scale,
                      "of the full runs of random points themselves", comparator="info")
    run.table("errors", COLUMNS, rows)


def plan(projection, points=None, per_cell=EULERIAN.per_cell):
    """Return the `RunOptions` of cut sub-cells with a projection."""
    return EULERIAN._replace(projection=projection, points=points, per_cell=per_cell,
                             boundary_cells=CUT)


def recorded(run, options, nets, tests, against=""):
    """Record the mean errors of some maps over `References`; return a row of each."""
    name = against + plan_name(options)
    errors = [PositionErrors(*run.cached(f"{name}.{net}",
                                         lambda net=net: tests.network_errors(net, options)))
              for net in nets]
    mean, note = mean_errors(errors, "trainings, one draw of samples each")
    record_errors(run, f"{NAME}.{name}", mean, tests.scale, note, comparator="info")
    return [(against + options.name, options.points or len(tests.X), options.per_cell,
             options.boundary_cells, net, *one) for net, one in zip(nets, errors, strict=True)]


def record_mass(run, cells, nets, tests):
    """Record the largest error of the body's mass on the grid at the ends of training runs."""
    off = [error for net in nets for error in mass_errors(tests.cases[0], trained(net), cells)]
    size = 100.0 * np.sqrt(np.mean(np.square(off)))
    scale = f"{len(tests.X)} particles, {len(off) // len(nets)} training runs, {len(nets)} maps"
    run.record(f"{NAME}.mass.{cells}", 100.0 * np.abs(off).max(), unit="%", scale=scale,
               comparator="info", note="largest error of the body's mass on the grid, at the ends "
               f"of the runs; root mean square {size:.3g} %")


def regular_references(tests):
    """Return the `References` of the same test runs with full runs of regular points."""
    dx = tests.cases[0].problem.dx
    x = [advected(refined(TORSION.scene(*TORSION.mu[k]), dx, REGULAR), tests.X)
         for k in TORSION.test]
    return tests._replace(x=tuple(x))


def difference(one, other):
    """Return the `PositionErrors` of `References` relative to others of the same runs."""
    sums = Squares(one.X)
    for x, y in zip(one.x, other.x, strict=True):
        for state, reference in zip(x, y, strict=True):
            sums.add(state, reference)
    return sums.errors


def plan_name(options):
    """Return the name of `RunOptions` in records."""
    dense = "" if options.per_cell == EULERIAN.per_cell else f".{options.per_cell}"
    cells = "" if options.quadrature == "lagrangian" else f"{options.boundary_cells}."
    return f"{cells}{options.name}.{options.points or 'all'}{dense}"


def mass_errors(full, model, cells):
    """Return the relative errors of a body's mass on the grid in the last states of all training
    runs of a map.
    """
    quadrature = ldm_model(full, model.field, EULERIAN._replace(boundary_cells=cells)).quadrature
    every, total = np.arange(len(full.X)), full.m.sum()
    return [quadrature.cloud(model.field, xhat, every).m.sum() / total - 1.0
            for xhat in model.xhat[:, -1]]
