"""Collapse of columns of sand against published scalings of the run-out with the aspect ratio.

Exponents as the abstracts of their papers state them: in plane channels 0.65 +- 0.05 (narrow) and
0.9 +- 0.1 (wide) [BalmforthKerswell2005]; 0.52 for tall cylinders [Larrieu2006]. The laws of
[Lube2005] and [Lube2004] are quoted so in later work; the papers are not at hand: `unconfirmed`.
"""

from ..common.registry import experiment
from .collapse import Case, collapse
from .convergence import order

TALL = {2: 2.8, 3: 1.7}         # aspect ratios above which a column is tall [Lube2005] [Lube2004]
EXPONENT = {                    # of tall columns: band, and why
    2: ((0.6, 1.0), "from the narrow channels' 0.65 - 0.05 to the wide ones' 0.9 + 0.1; the plane "
                    "column has no side walls"),
    3: ((0.47, 0.57), "0.52 with the +- 0.05 that the plane channels' exponents have"),
}
STEADY = 0.05                   # of the run-out: change that a third of the time step may make
FRICTION = "friction angle 30 degrees, rough floor"


def lube(dim, a):
    """Run-out by the unconfirmed laws; None in the gap between them."""
    if dim == 2:
        return 1.2 * a if a < 1.8 else (1.9 * a ** (2.0 / 3.0) if a > TALL[2] else None)
    return 1.24 * a if a < TALL[3] else 1.6 * a**0.5


@experiment("verification.column", title="Column collapse of sand: run-out against aspect ratio",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 2400})
def column(run):
    """Plane and axisymmetric columns of several aspect ratios, and the exponent of tall ones."""
    plans = run.choose(
        quick=((2, 6, (4.0, 8.0)), (3, 4, (2.0,))),
        standard=((2, 8, (0.5, 1.0, 2.0, 4.0, 8.0)), (2, 16, (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)),
                  (2, 32, (0.5, 1.0, 2.0, 4.0)), (3, 6, (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)),
                  (3, 10, (0.5, 1.0, 2.0, 4.0, 8.0))))
    cases = [Case(dim, a, cells) for dim, cells, ratios in plans for a in ratios]
    done = {case: collapse(case) for case in run.progress(cases, "columns")}
    for case, c in done.items():
        record_runout(run, case, c)
    for dim, cells, _ in plans:
        record_exponent(run, {case.a: (case, c) for case, c in done.items()
                              if (case.dim, case.cells) == (dim, cells) and case.a > TALL[dim]})
    time_steps(run, *run.choose(quick=(4, ("flip", "mls")), standard=(8, ("flip", "apic", "mls"))))
    write_tables(run, done)


def record_runout(run, case, c):
    """Record the run-out of one column beside the unconfirmed law."""
    run.record(f"verification.column.{case.kind}.a{case.a:g}.n{case.cells}.runout", c.runout,
               paper=lube(case.dim, case.a), comparator="info",
               scale=f"{c.particles} particles, {c.steps} steps; {FRICTION}",
               note=f"unconfirmed law of Lube et al.; foremost particle {c.foremost - 1.0:.2f}, "
               f"moved in the last tenth of the time {c.creep:.1e}, mean J {c.J:.3f}")


def record_exponent(run, tall):
    """Record the exponent of the run-out of tall columns {a: (case, collapse)} of one kind."""
    if len(tall) < 2:
        return
    case = next(iter(tall.values()))[0]
    bound, why = EXPONENT[case.dim]
    ratios, runouts = list(tall), [c.runout for _, c in tall.values()]
    local = [order(ratios[k:k + 2], runouts[k:k + 2]) for k in range(len(tall) - 1)]
    run.record(f"verification.column.{case.kind}.n{case.cells}.exponent", order(ratios, runouts),
               comparator="band", bound=bound,
               scale=f"aspect ratios {', '.join(f'{a:g}' for a in ratios)}; {FRICTION}",
               note=f"{why}; from ratio to ratio {', '.join(f'{p:.2f}' for p in local)}, so that a "
               "power law is reached at best by the tallest")


def time_steps(run, cells, transfers):
    """What a third of the time step changes, with each transfer."""
    rows = []
    for transfer in run.progress(transfers, "time steps"):
        cases = [Case(2, 1.0, cells, transfer, cfl) for cfl in (0.9, 0.3)]
        long, short = (collapse(case) for case in cases)
        rule = {"comparator": "<=", "bound": STEADY} if transfer == "flip" else {
            "comparator": "info"}
        run.record(f"verification.column.dt.{transfer}", abs(short.runout / long.runout - 1.0),
                   scale=f"plane, a = 1, L = {cells} dx; {long.steps} and {short.steps} steps",
                   note="relative change of the run-out", **rule)
        rows += [(transfer, c.steps, c.runout) for c in (long, short)]
    run.table("dt", ("transfer", "steps", "runout"), rows)


def write_tables(run, done):
    """Run-outs, fronts over time, deposits."""
    keys = ("kind", "cells", "a")

    def head(case):
        return case.kind, case.cells, case.a

    run.table("runout", (*keys, "runout", "foremost", "lube"),
              [(*head(case), c.runout, c.foremost - 1.0, lube(case.dim, case.a) or float("nan"))
               for case, c in done.items()])
    run.table("front", (*keys, "t", "front"),
              [(*head(case), t, x) for case, c in done.items()
               for t, x in zip(c.t, c.front, strict=True)])
    run.table("deposit", (*keys, "r", "height"),
              [(*head(case), r, h) for case, c in done.items() for r, h in c.deposit])
