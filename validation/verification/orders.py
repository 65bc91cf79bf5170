"""Why some transfers miss the second order that their splines promise, on the solution of `mms`.

Three causes are tried for each family of `mms` that misses it: the filter of the transfer in each
step (by relaxation, and by dt in proportion to dx^2, which takes more steps), the error of the time
step (the same), and the integrals, which are sums over few particles (by more of them). RPIC
damping, which `mms` has not, is a filter of second order in dx in each step: its error is to be of
first order with dt in proportion to dx, and not to converge with dx^2.
"""

from ..common.registry import experiment
from .convergence import order
from .mms import CFL, MmsRun, error, name

FAMILIES = (("apic", 2, 3), ("flip", 2, 3), ("apic", 3, 2))     # (transfer, degree, per direction)
DAMPED, RPIC = ("mls", 3, 2), 0.1
MANY = 6                    # particles per cell and direction
COARSEST = 16               # cells per side


@experiment("verification.orders", title="Why some transfers miss second order",
            profiles=("quick", "standard"), budget={"quick": 45, "standard": 300})
def orders(run):
    """Record the orders of the families under each cause, and those of RPIC damping."""
    cells = run.choose(quick=(16, 32), standard=(16, 32, 64))
    families = run.choose(quick=(FAMILIES[0],), standard=FAMILIES)
    rows = []
    for family in run.progress(families, "families"):
        trials = {"as-is": {}, "short-steps": {"shorter": True}, "many-particles": {"per": MANY}}
        if family[0] != "flip":
            trials["relaxed"] = {"crossings": 1.0}
        for trial, options in trials.items():
            p, errors = measured_order(family, cells, **options)
            rows += table_rows(name(family), trial, cells, errors)
            record_trial(run, family, trial, p, cells)
    for trial, shorter in (("rpic", False), ("rpic-short-steps", True)):
        p, errors = measured_order(DAMPED, cells, rpic=RPIC, shorter=shorter)
        rows += table_rows(name(DAMPED), trial, cells, errors)
        record_rpic(run, trial, p, cells, shorter)
    run.table("errors", ("family", "trial", "cells", "error"), rows)


def measured_order(family, cells, shorter=False, per=None, **options):
    """Return the order of a family over numbers of cells, and the errors.

    shorter: dt in proportion to dx^2, not to dx; per: particles per direction instead of the
    family's; options: others of `MmsRun`.
    """
    transfer, degree, usual = family
    errors = [error(MmsRun(transfer, degree, per or usual, n,
                           cfl=CFL * (COARSEST / n if shorter else 1.0), **options)) for n in cells]
    return order([1.0 / n for n in cells], errors), errors


def table_rows(family, trial, cells, errors):
    """Return a row of the table for each number of cells."""
    return [(family, trial, n, e) for n, e in zip(cells, errors, strict=True)]


def record_trial(run, family, trial, p, cells):
    """Record the order of a family in one trial; many particles are to restore the second."""
    id, scale = f"verification.orders.{name(family)}.{trial}", f"{cells} cells per side"
    if trial == "many-particles":
        run.record(id, p, paper=2.0, comparator="band", bound=(1.8, 2.3),
                   scale=f"{scale}, {MANY} particles per cell and direction",
                   note="the sums over few particles are what misses the order")
    else:
        run.record(id, p, paper=2.0, comparator="info", scale=scale,
                   note="neither the filter per step nor the time step is what misses the order")


def record_rpic(run, trial, p, cells, shorter):
    """Record the order with RPIC damping against that of its filter."""
    run.record(f"verification.orders.{name(DAMPED)}.{trial}", p, paper=0.0 if shorter else 1.0,
               comparator="band", bound=(-0.3, 0.5) if shorter else (0.8, 1.3),
               scale=f"{cells} cells per side, rpic = {RPIC}",
               note="a loss in proportion to dx^2 in each step: first order at constant dt/dx, "
                    "none at constant dt/dx^2")
