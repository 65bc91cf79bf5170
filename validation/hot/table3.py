"""Table 3: projected Newton with CG, preconditioned by symmetric Gauss-Seidel and by Jacobi.

A scene runs by HOT until its contact or pull has begun; from there on every step is solved by both,
from the same state, and HOT's step is taken. Where planes may let go of a node, the first solve is
the one that counts. The paper's numbers are of whole runs at ten and more times the particles, so
ratios are compared. Its times are per playback frame (HOT-X14): ours are those of the steps, over
the time they advance.
"""

from typing import NamedTuple

from ..common import targets
from ..common.registry import experiment
from ..common.scenes import particle_count
from .one_step import solve_step
from .warm_states import PRINTED, QUICK, START_TIMES, following_steps, warm_state

METHODS = {"sgs": "sgs-pcg", "jacobi": "pn-pcg"}
FRAME = 1.0 / 24.0      # of playback [s]
SAME = 2.0              # factor within which ratios of both preconditioners agree


class RowCost(NamedTuple):
    """The work of the steps of a scene by one method."""

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
    """Return ({preconditioner: reports}, time advanced [s]) of a state's next `count` steps."""
    by_method, advanced = {short: [] for short in METHODS}, 0.0
    for step in following_steps(problem, state, count):
        advanced += step.dt
        for short, method in METHODS.items():
            by_method[short].append(solve_step(step, method).report)
    return by_method, advanced


def costs(name, profile, count):
    """Return {preconditioner: `RowCost`} of a row."""
    problem, state = warm_state(name, profile)
    by_method, advanced = reports(problem, state, count)
    return {short: cost((name, short, particle_count(state.bodies)), solves, advanced)
            for short, solves in by_method.items()}


def cost(about, solves, advanced):
    """Return the `RowCost` of reports; about: its first fields; advanced: time advanced [s]."""
    n = len(solves)
    return RowCost(*about, n, sum(r.iterations for r in solves) / n,
                sum(r.cg_iterations for r in solves) / n,
                sum(sum(r.seconds.values()) for r in solves) / n, advanced / n,
                all(r.converged for r in solves))


@experiment("hot.table3", title="Gauss-Seidel against Jacobi as preconditioner of Newton's CG",
            profiles=("quick", "standard", "paper"),
            budget={"quick": 10, "standard": 200, "paper": 14400})
def table3(run):
    """Record CG iterations and time of both on every scene, and the printed ones."""
    names, count = run.choose(quick=(QUICK, 2), standard=(PRINTED, 5), paper=(PRINTED, 5))
    reports(*warm_state(names[0], "quick"), 1)                     # compiles
    rows = {}
    for name in run.progress(names, "scenes"):
        rows[name] = costs(name, run.profile, count)
        record_row(run, name, rows[name])
    run.record("hot.table3.fewer", min(gain(row) for row in rows.values()), comparator=">=",
               bound=1.0, scale=f"{len(rows)} of {len(PRINTED)} rows", note="smallest ratio of CG "
               "iterations, Jacobi over Gauss-Seidel; the paper's is above 1 in every row")
    run.table("costs", RowCost._fields, [c for row in rows.values() for c in row.values()])


def gain(row):
    """Return CG iterations by Jacobi over those by Gauss-Seidel."""
    return row["jacobi"].cg / row["sgs"].cg


def record_row(run, name, row):
    """Record iterations and times as printed, and the ratios of both."""
    printed, c = targets.load(), row["sgs"]
    scale = f"{c.particles} particles, {c.steps} steps from {START_TIMES[name]:g} s on"
    for short, cost_ in row.items():
        run.record(f"hot.table3.{name}.{short}.cg_iters", cost_.cg, scale=scale,
                   note=f"{cost_.newton:.1f} Newton steps, {cost_.cpu:.3f} CPU seconds per step"
                   + ("" if cost_.converged else "; not every step converged"))
        run.record(f"hot.table3.{name}.{short}.time", cost_.cpu * FRAME / cost_.dt,
                   scale=scale, note=f"CPU seconds, {FRAME / cost_.dt:.2f} "
                   "steps a frame; another machine and another size than the paper's")

    def paper(quantity):
        return (printed[f"hot.table3.{name}.jacobi.{quantity}"].value
                / printed[f"hot.table3.{name}.sgs.{quantity}"].value)
    run.record(f"hot.table3.{name}.gain", gain(row), paper=paper("cg_iters"), comparator="~",
               factor=SAME, scale=scale, note="CG iterations, Jacobi over Gauss-Seidel: of the "
               "same matrices, so that most of the dependence on size divides out")
    run.record(f"hot.table3.{name}.time", row["jacobi"].cpu / c.cpu, paper=paper("time"),
               comparator="~", factor=SAME, scale=scale, note="CPU time, Jacobi over Gauss-Seidel, "
               "whose sweeps and whose products are block kernels; a sweep in parallel, as the "
               "paper's, costs up to twice as much as one in order")
