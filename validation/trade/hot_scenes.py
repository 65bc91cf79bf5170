"""Trade at equal error on HOT's scenes: one step each, from the middle of things.

Every method solves the same step to a ladder of tolerances. At the paper's tolerance the methods
leave different errors in the particles; so times are compared once at that tolerance, and once for
the error that HOT leaves at it.
"""

from math import inf
from typing import NamedTuple

from ..hot.begun import BEGUN, begun, particles, steps
from ..hot.one_step import difference, solved
from ..hot.stiffness import METHODS
from ..registry import experiment
from .hot import POINT, point, record_equal_eps, times_for

PAPER = 1e-7                        # tolerance of the paper
EXACT, CHECK = "pn-pcg-mf", "lbfgs-h"   # methods of the reference and of its check
BELOW = 10.0                        # of the smallest tolerance, the reference's
TRUST = 3.0                         # errors below so many times the reference's own say nothing
TIE = 1.1                           # ratio of CPU times below which nobody is faster
CAPS = {"iterations": 300, "cg_iterations": 3000}   # of a solve; one that is cut short says so
COLUMNS = ("scene", "size", *POINT)


class Trial(NamedTuple):
    """A scene, the size it is run at, and the tolerances its step is solved to."""

    scene: str
    size: str           # of `sizes.SIZES`: quick, standard
    ladder: tuple

    @property
    def name(self):
        """Leading part of its records."""
        return f"trade.hot.scenes.{self.scene}" + (".fine" if self.size == "standard" else "")


def plan(profile):
    """The `Trial`s of a profile: the small ones cheaply; all at the small size, and some finer."""
    few, many = (tuple(10.0**-k for k in ks) for ks in ((5, 6, 7, 8), (4, 5, 6, 7, 8)))
    if profile == "quick":
        return [Trial(name, "quick", few) for name in ("faceless", "sauce")]
    return ([Trial(name, "quick", many) for name in BEGUN]
            + [Trial(name, "standard", few) for name in ("twist", "boxes", "wheel", "faceless")])


@experiment("trade.hot.scenes", title="HOT at equal error: one step of each of its scenes",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 1200})
def equal_error(run):
    """Ladders of all scenes; times at equal tolerance and at equal error; who is the fastest."""
    rows, best = [], {}
    trials = plan(run.profile)
    ladder(trials[-1]._replace(ladder=(PAPER,), size="quick"))                 # compiles
    for trial in run.progress(trials, "scenes"):
        found, exact = ladder(trial)
        own = known(found, exact.error)
        record_trial(run, trial, own, exact)
        best[trial.name] = fastest(own)
        rows += [(*row, exact.error) for row in found]
    record_ranking(run, best)
    run.table("points", (*COLUMNS, "least"), rows)         # least: of the reference


class Reference(NamedTuple):
    """How sure the reference of a trial is, and what it was."""

    error: float        # difference of its two methods, relative to the increment, rms
    converged: bool     # both
    scale: str


def ladder(trial):
    """(rows of `COLUMNS`, `Reference`) of a trial."""
    problem, state = begun(trial.scene, trial.size)
    step = next(steps(problem, state, 1))
    eps = trial.ladder[-1] / BELOW
    exact, check = (solved(step, method, eps=eps, **CAPS) for method in (EXACT, CHECK))
    rows = [(trial.scene, trial.size, *point(step, exact, (method, eps), 1, **CAPS))
            for eps in trial.ladder for method in METHODS]
    scale = (f"{particles(problem)} particles, {len(exact.dv)} nodes, one step from "
             f"{BEGUN[trial.scene]:g} s on")
    return rows, Reference(difference(step, check.dv, exact.dv)[0],
                           exact.report.converged and check.report.converged, scale)


def known(rows, least):
    """Rows (name, *`POINT`) as `trade.hot` has them, of rows of `COLUMNS`; no error is below the
    reference's own, since a method that made the reference would agree with it to the bit.
    """
    return [(*row[1:5], max(row[5], least), *row[6:]) for row in rows]


def record_trial(run, trial, own, exact):
    """What the rows of one trial say."""
    run.record(f"{trial.name}.reference", exact.error, comparator="<=", bound=trust(own) / TRUST,
               scale=exact.scale, note=f"difference of {EXACT} and {CHECK} at eps = "
               f"{trial.ladder[-1] / BELOW:.0e}, relative to the increment; at most a third of the "
               "error that is compared" + ("" if exact.converged else "; not both converged"))
    record_equal_eps(run, trial.name, own, exact.scale)
    at_eps, at_error = seconds(own)
    for method in METHODS[1:]:
        record_ratios(run, f"{trial.name}.{method}", (at_eps, at_error, method), exact.scale)
    cut = [f"{row[1]} at {row[2]:.0e}" for row in own if not row[8]]
    run.record(f"{trial.name}.cut", len(cut), comparator="info", scale=exact.scale,
               note="solves that did not converge within the caps: " + (", ".join(cut) or "none"))


def record_ratios(run, name, times, scale):
    """Time of a method over HOT's at equal tolerance and, where its ladder holds it, at equal
    error.
    """
    at_eps, at_error, method = times
    if method in at_eps:
        run.record(f"{name}.equal-eps", at_eps[method] / at_eps["hot"], comparator="info",
                   scale=scale, note=f"CPU time over HOT's at eps = {PAPER:.0e}")
    if at_error[method] is not None:
        run.record(f"{name}.equal-error", at_error[method] / at_eps["hot"], comparator="info",
                   scale=scale, note="CPU time over HOT's for the error that HOT leaves there")


def trust(rows):
    """The error that is compared: HOT's at the paper's tolerance."""
    return next(error for _, method, eps, _, error, *_ in rows if (method, eps) == ("hot", PAPER))


def seconds(rows):
    """({method: CPU seconds at the paper's tolerance}, {method: for the error of HOT there, or
    None where the ladder does not hold it}). Of other methods, solves that did not converge do not
    count.
    """
    sound = [row for row in rows if row[8] or row[1] == "hot"]
    at_eps = {method: cpu for _, method, eps, cpu, *_ in sound if eps == PAPER}
    return at_eps, {**times_for(sound, trust(rows)), "hot": at_eps["hot"]}


def fastest(rows):
    """The fastest method at equal tolerance, and at equal error: the same unless it is beaten by
    more than a `TIE`.
    """
    at_eps, at_error = seconds(rows)
    reached = {method: t for method, t in at_error.items() if t is not None}
    first, best = min(at_eps, key=at_eps.get), min(reached, key=reached.get)
    tied = reached.get(first, inf) <= TIE * reached[best]
    return first, first if tied else best


def record_ranking(run, best):
    """Where another method is the fastest once errors are equal."""
    short = {name.removeprefix("trade.hot.scenes."): pair for name, pair in best.items()}
    moved = {name: f"{a} -> {b}" for name, (a, b) in short.items() if a != b}
    run.record("trade.hot.scenes.reordered", len(moved), comparator="info",
               scale=f"{len(best)} trials", note="trials whose fastest method at equal error is "
               "another one than at equal tolerance: "
               + (", ".join(f"{name} ({words})" for name, words in moved.items()) or "none"))
    for k, what in enumerate(("equal-eps", "equal-error")):
        first = [name for name, pair in short.items() if pair[k] == "hot"]
        run.record(f"trade.hot.scenes.{what}.first", len(first), comparator="info",
                   scale=f"{len(best)} trials", note="trials where HOT is the fastest: "
                   + (", ".join(first) or "none"))
