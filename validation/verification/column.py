"""Collapse of columns of sand against published scalings of the run-out with the aspect ratio.

Exponents as the abstracts of their papers state them: in plane channels 0.65 +- 0.05 (narrow) and
0.9 +- 0.1 (wide) [BalmforthKerswell2005]; 0.52 for tall cylinders [Larrieu2006]. The laws of
[Lube2005] and [Lube2004] are quoted so in later work; the papers are not at hand: `unconfirmed`.
"""


from ..registry import experiment
from .collapse import collapse
from .convergence import order

KINDS = {2: "plane", 3: "axisymmetric"}
TALL = {2: 2.8, 3: 1.7}         # aspect ratios above which a column is tall [Lube2005] [Lube2004]
EXPONENT = {                    # of tall columns: band, and why
    2: ((0.6, 1.0), "from the narrow channels' 0.65 - 0.05 to the wide ones' 0.9 + 0.1; the plane "
                    "column has no side walls"),
    3: ((0.47, 0.57), "0.52 with the +- 0.05 that the plane channels' exponents have"),
}
CAUSE = {
    2: "",
    3: ". The exponent of the simulated cylinders does not fall with dx, and rises as friction "
       "falls: rate-independent flow damps fast grains no more than slow ones",
}
FRICTION = "friction angle 30 degrees, rough floor"


def lube(dim, a):
    """Run-out by the unconfirmed laws; None in the gap between them."""
    if dim == 2:
        return 1.2 * a if a < 1.8 else (1.9 * a ** (2.0 / 3.0) if a > TALL[2] else None)
    return 1.24 * a if a < TALL[3] else 1.6 * a**0.5


@experiment("verification.column", title="Column collapse of sand: run-out against aspect ratio",
            profiles=("quick", "standard"), budget={"quick": 25, "standard": 1500})
def column(run):
    """Plane and axisymmetric columns of several aspect ratios, and the exponent of tall ones."""
    plans = run.choose(
        quick=((2, 6, (1.0, 4.0, 8.0)), (3, 4, (1.0, 2.0, 4.0))),
        standard=((2, 16, (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)), (2, 32, (0.5, 1.0, 2.0, 4.0, 8.0)),
                  (3, 6, (2.0, 4.0, 8.0)), (3, 8, (0.5, 1.0, 2.0, 4.0, 8.0))))
    cases = [(dim, cells, a) for dim, cells, ratios in plans for a in ratios]
    done = {(dim, cells, a): collapse(dim, a, cells)
            for dim, cells, a in run.progress(cases, "columns")}
    for (dim, cells, a), c in done.items():
        record_runout(run, f"{KINDS[dim]}.a{a:g}.n{cells}", c, lube(dim, a))
    for dim, cells, _ in plans:
        tall = {a: c for (d, n, a), c in done.items() if (d, n) == (dim, cells) and a > TALL[dim]}
        record_exponent(run, f"{KINDS[dim]}.n{cells}", dim, tall)
    if run.choose(quick=False, standard=True):
        weak_friction(run)
    write_tables(run, done)


def record_runout(run, name, c, law):
    """Record the run-out of one column beside the unconfirmed law."""
    run.record(f"verification.column.{name}.runout", c.runout, paper=law, comparator="info",
               scale=f"{c.particles} particles, {c.steps} steps; {FRICTION}",
               note=f"unconfirmed law of Lube et al.; foremost particle {c.foremost - 1.0:.2f}, "
               f"moved in the last tenth of the time {c.creep:.1e}, mean J {c.J:.3f}")


def record_exponent(run, name, dim, tall):
    """Record the exponent of the run-out of tall columns."""
    if len(tall) < 2:
        return
    bound, why = EXPONENT[dim]
    value = order(list(tall), [c.runout for c in tall.values()])
    ratios = ", ".join(f"{a:g}" for a in tall)
    run.record(f"verification.column.{name}.exponent", value, comparator="band", bound=bound,
               scale=f"aspect ratios {ratios}; {FRICTION}", note=why + CAUSE[dim])


def weak_friction(run, angle=20.0, cells=6, ratios=(2.0, 4.0, 8.0)):
    """How the exponent of cylinders depends on the friction angle, which the published does not."""
    runouts = [collapse(3, a, cells, angle).runout for a in ratios]
    run.record("verification.column.axisymmetric.weak.exponent", order(ratios, runouts),
               comparator="info", scale=f"aspect ratios {ratios}, L = {cells} dx",
               note=f"friction angle {angle:g} degrees instead of 30")


def write_tables(run, done):
    """Run-outs, fronts over time, deposits."""
    def head(dim, cells, a):
        return KINDS[dim], cells, a

    keys = ("kind", "cells", "a")
    run.table("runout", (*keys, "runout", "foremost", "lube"),
              [(*head(*key), c.runout, c.foremost - 1.0, lube(key[0], key[2]) or float("nan"))
               for key, c in done.items()])
    run.table("front", (*keys, "t", "front"),
              [(*head(*key), t, x) for key, c in done.items()
               for t, x in zip(c.t, c.front, strict=True)])
    run.table("deposit", (*keys, "r", "height"),
              [(*head(*key), r, h) for key, c in done.items() for r, h in c.deposit])
