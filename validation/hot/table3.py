"""Table 3: projected Newton with CG, preconditioned by symmetric Gauss-Seidel and by Jacobi.

A scene runs by HOT until what it is about has begun, a contact or a pull; from there on every step
is solved by both, from the same state, and HOT's step is taken. Where planes may let go of a node,
the first solve is the one that counts. The paper's numbers are of whole runs at ten and more times
the particles, so ratios are compared. Its times are per playback frame (HOT-X14): ours are those of
the steps, over the time they advance.
"""

from typing import NamedTuple

from ..common import targets
from ..common.registry import experiment
from .one_step import solved
from .warm_states import BEGUN, PRINTED, QUICK, begun, particles, steps

METHODS = {"sgs": "sgs-pcg", "jacobi": "pn-pcg"}
FRAME = 1.0 / 24.0      # of playback [s]


class Cost(NamedTuple):
    """What the steps of a scene took by one method."""

    scene: str
    preconditioner: str
    particles: int
    steps: int
    newton: float           # per step
    cg: float               # per step
    cpu: float              # seconds per step
    dt: float               # of a step, in the mean [s]
    converged: bool         # every step


def reports(problem, state, count):
    """({preconditioner: reports}, time that they advance [s]) of a state's next so many steps."""
    found, advanced = {short: [] for short in METHODS}, 0.0
    for step in steps(problem, state, count):
        advanced += step.dt
        for short, method in METHODS.items():
            found[short].append(solved(step, method).report)
    return found, advanced


def costs(name, profile, count):
    """{preconditioner: `Cost`} of a row."""
    problem, state = begun(name, profile)
    found, advanced = reports(problem, state, count)
    return {short: cost((name, short, particles(problem)), done, advanced)
            for short, done in found.items()}


def cost(about, done, advanced):
    """`Cost` of some reports; about: its first fields; advanced: the time they advance [s]."""
    n = len(done)
    return Cost(*about, n, sum(r.iterations for r in done) / n,
                sum(r.cg_iterations for r in done) / n,
                sum(sum(r.seconds.values()) for r in done) / n, advanced / n,
                all(r.converged for r in done))


@experiment("hot.table3", title="Gauss-Seidel against Jacobi as preconditioner of Newton's CG",
            profiles=("quick", "standard", "paper"),
            budget={"quick": 10, "standard": 200, "paper": 14400})
def table3(run):
    """CG iterations and time of both on every scene, beside the printed ones."""
    names, count = run.choose(quick=(QUICK, 2), standard=(PRINTED, 5), paper=(PRINTED, 5))
    reports(*begun(names[0], "quick"), 1)                     # compiles
    rows = {}
    for name in run.progress(names, "scenes"):
        rows[name] = costs(name, run.profile, count)
        record_row(run, name, rows[name])
    run.record("hot.table3.fewer", min(gain(row) for row in rows.values()), comparator=">=",
               bound=1.0, scale=f"{len(rows)} of {len(PRINTED)} rows", note="smallest ratio of CG "
               "iterations, Jacobi over Gauss-Seidel; the paper's is above 1 in every row")
    run.table("costs", Cost._fields, [c for row in rows.values() for c in row.values()])


def gain(row):
    """CG iterations by Jacobi over those by Gauss-Seidel."""
    return row["jacobi"].cg / row["sgs"].cg


def record_row(run, name, row):
    """Iterations and times as printed, and the ratios of both."""
    printed, c = targets.load(), row["sgs"]
    scale = f"{c.particles} particles, {c.steps} steps from {BEGUN[name]:g} s on"
    for short, cost_ in row.items():
        run.record(f"hot.table3.{name}.{short}.cg_iters", cost_.cg, comparator="info", scale=scale,
                   note=f"{cost_.newton:.1f} Newton steps, {cost_.cpu:.3f} CPU seconds per step"
                   + ("" if cost_.converged else "; not every step converged"))
        run.record(f"hot.table3.{name}.{short}.time", cost_.cpu * FRAME / cost_.dt,
                   comparator="info", scale=scale, note=f"CPU seconds, {FRAME / cost_.dt:.2f} "
                   "steps a frame; another machine and another size than the paper's")

    def paper(what):
        return (printed[f"hot.table3.{name}.jacobi.{what}"].value
                / printed[f"hot.table3.{name}.sgs.{what}"].value)
    run.record(f"hot.table3.{name}.gain", gain(row), paper=paper("cg_iters"), comparator="~",
               scale=scale, note="CG iterations, Jacobi over Gauss-Seidel")
    run.record(f"hot.table3.{name}.time", row["jacobi"].cpu / c.cpu, paper=paper("time"),
               comparator="info", scale=scale, note="CPU time, Jacobi over Gauss-Seidel, whose "
               "sweeps and whose products are block kernels")
