"""Trade at equal error on HOT's scenes: one step each, from the middle of things.

Every method solves the same step to a ladder of tolerances. At the paper's tolerance the methods
leave different errors in the particles; so times are compared at that tolerance, for the error that
HOT leaves at it, and for one error of the displacement in all scenes.
"""

from functools import partial
from math import inf
from typing import NamedTuple

from ..common import targets
from ..common.registry import experiment
from ..hot.one_step import ParticleErrors, particle_errors, solve_step
from ..hot.stiffness import METHODS
from ..hot.warm_states import PRINTED, START_TIMES, following_steps, warm_state
from .hot import PAPER, POINT, Point, bounded_below, record_equal_eps, times_for
from .hot_methods import ALL, OPTIONS, SLOW, SOME, descended, tolerance_ladders

EXACT, CHECK = "pn-mgpcg", "pn-pcg"     # methods of the reference and of its check
MANY = {"max_iterations": 1000, "max_cg_iterations": 20000}     # at most, of their solves
BELOW = 10.0                        # of the smallest tolerance, the reference's
TRUST = 3.0                         # errors below so many times the reference's own say nothing
TIE = 1.1                           # ratio of CPU times below which nobody is faster
LEFT = 0.5                          # share of the increment up to which an error is compared: a
                                    # solve that leaves more has hardly begun
CELLS = 1e-3                        # error of displacement that is the same for all scenes [dx]
OVER = {
    "equal-eps": f"CPU time over HOT's at eps = {PAPER:.0e}",
    "equal-error": "CPU time over HOT's for the error that HOT leaves there",
    "cells": f"CPU time over HOT's until no particle is off by more than {CELLS:g} cells",
}


class Trial(NamedTuple):
    """A scene, the size it is run at, the tolerances its step is solved to, and by whom."""

    scene: str
    size: str           # of `sizes.SIZES`: quick, standard
    ladder: tuple
    methods: tuple

    @property
    def name(self):
        """Leading part of its records."""
        return f"trade.hot.scenes.{self.scene}" + (".fine" if self.size == "standard" else "")

    @property
    def eps(self):
        """Tolerance of the reference."""
        return self.ladder[-1] / BELOW


def plan(profile):
    """The `Trial`s of a profile: the small ones cheaply; all at the small size, and some finer."""
    few, many = (tuple(10.0**-k for k in range(*ends)) for ends in ((5, 9), (3, 11)))
    if profile == "quick":
        return [Trial(name, "quick", few, METHODS) for name in ("faceless", "sauce")]
    return ([Trial(name, "quick", many, ALL) for name in START_TIMES]
            + [Trial(name, "standard", few, SOME)
               for name in ("twist", "boxes", "wheel", "faceless")])


class Reference(NamedTuple):
    """How sure the reference of a trial is, and what it was."""

    least: ParticleErrors       # what its two methods differ by
    converged: bool     # both
    scale: str


@experiment("trade.hot.scenes", title="HOT at equal error: one step of each of its scenes",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 1200})
def equal_error(run):
    """Ladders of all scenes; times at equal tolerance and at equal error; who is the fastest."""
    rows, times = [], {}
    trials = plan(run.profile)
    compiled(trials)
    for trial in run.progress(trials, "scenes"):
        found, exact = unpacked(run.cached(trial.name, partial(ladder, trial)))
        own = bounded_below(found, exact.least)
        times[trial] = seconds(own)
        record_trial(run, trial, own, exact)
        rows += [(trial.scene, trial.size, *p, exact.least.velocity, exact.least.cells_max)
                 for p in found]
    record_ranking(run, times)
    record_ranges(run, {trial.scene: over_hot(own) for trial, own in times.items()
                        if trial.size == "quick" and trial.scene in PRINTED})
    run.table("points", ("scene", "size", *POINT, "least", "least_cells"), rows)


def compiled(trials):
    """Compile what the first of the trials needs, on the last one made small."""
    ladder(trials[-1]._replace(size="quick", ladder=(PAPER,), methods=trials[0].methods))


def ladder(trial):
    """(`Point`s, `Reference`) of a trial."""
    problem, state = warm_state(trial.scene, trial.size)
    step = next(following_steps(problem, state, 1))
    exact, check = (solve_step(step, method, eps=trial.eps, **MANY, **OPTIONS.get(method, {}))
                    for method in (EXACT, CHECK))
    found = descended(step, exact, tolerance_ladders(trial.methods, trial.ladder))
    scale = (f"{step.particles} particles, {len(exact.dv)} nodes, one step from "
             f"{START_TIMES[trial.scene]:g} s on")
    return found, Reference(particle_errors(step, check.dv, exact.dv),
                            exact.report.converged and check.report.converged, scale)


def unpacked(ladder):
    """A `ladder` from plain lists, as it comes back from disk."""
    found, (least, converged, scale) = ladder
    return [Point(*p) for p in found], Reference(ParticleErrors(*least), converged, scale)


def trust(points):
    """The error that is compared: HOT's at the paper's tolerance."""
    return next(p.error for p in points if (p.method, p.eps) == ("hot", PAPER))


def seconds(points):
    """{comparison of `OVER`: {method: CPU seconds}}, without methods whose ladder does not hold it;
    none at HOT's error where that is larger than `LEFT`. Solves that did not converge do not count,
    but for HOT's at the paper's tolerance.
    """
    sound = [p for p in points if p.converged or (p.method, p.eps) == ("hot", PAPER)]
    methods = dict.fromkeys(p.method for p in sound)
    at_eps = {p.method: p.cpu for p in sound if p.eps == PAPER}
    at_error = {}
    if trust(points) <= LEFT:
        at_error = {**times_for(sound, methods, trust(points)), "hot": at_eps["hot"]}
    found = at_eps, at_error, times_for(sound, methods, CELLS, "cells")
    return {what: {method: t for method, t in times.items() if t is not None}
            for what, times in zip(OVER, found, strict=True)}


def over_hot(times):
    """{comparison: {another method: its CPU time over HOT's}}, of `seconds`."""
    return {what: {method: t / own["hot"] for method, t in own.items() if method != "hot"}
            for what, own in times.items() if "hot" in own}


def fastest(times):
    """{comparison: fastest method, or None where there is none}, of `seconds`. At equal error it is
    that of equal tolerance unless it is beaten by more than a `TIE`.
    """
    first = min(times["equal-eps"], key=times["equal-eps"].get)
    best = {what: min(own, key=own.get, default=None) for what, own in times.items()}
    return {what: first if own and own.get(first, inf) <= TIE * own[best[what]] else best[what]
            for what, own in times.items()}


def record_trial(run, trial, own, exact):
    """What the points of one trial say."""
    run.record(f"{trial.name}.reference", exact.least.velocity, comparator="<=",
               bound=trust(own) / TRUST, scale=exact.scale, note=f"difference of {EXACT} and "
               f"{CHECK} at eps = {trial.eps:.0e}, relative to the increment; at most a third of "
               f"the error that is compared; {exact.least.cells_max:.1e} cells at most"
               + ("" if exact.converged else "; not both converged"))
    record_equal_eps(run, trial.name, own, exact.scale)
    for what, ratios in over_hot(seconds(own)).items():
        for method, ratio in ratios.items():
            run.record(f"{trial.name}.{method}.{what}", ratio, comparator="info",
                       scale=exact.scale, note=OVER[what])
    cut, slow = ([f"{p.method} at {p.eps:.0e}" for p in own if which(p)] for which in (
        lambda p: not p.converged, lambda p: p.converged and p.cpu > SLOW))
    run.record(f"{trial.name}.cut", len(cut), comparator="info", scale=exact.scale,
               note="solves that did not converge within the caps: " + (", ".join(cut) or "none")
               + f"; that took more than {SLOW:g} CPU seconds: " + (", ".join(slow) or "none")
               + "; their methods went no further")


def record_ranking(run, times):
    """Who is the fastest, and where another method is once errors are equal."""
    best = {trial.name.removeprefix("trade.hot.scenes."): fastest(own)
            for trial, own in times.items()}
    compared = [name for name, own in best.items() if own["equal-error"] is not None]
    moved = [f"{name} ({best[name]['equal-eps']} -> {best[name]['equal-error']})"
             for name in compared if best[name]["equal-eps"] != best[name]["equal-error"]]
    run.record("trade.hot.scenes.reordered", len(moved), comparator="info",
               scale=f"{len(compared)} of {len(best)} trials", note="trials whose fastest method "
               "at equal error is another one than at equal tolerance: "
               + (", ".join(moved) or "none"))
    hardly = [name for name in best if name not in compared]
    run.record("trade.hot.scenes.hardly-begun", len(hardly), comparator="info",
               scale=f"{len(best)} trials", note=f"trials where HOT at eps = {PAPER:.0e} leaves "
               f"more than {LEFT:g} of the increment, an error at which nothing is compared: "
               + (", ".join(hardly) or "none"))
    for what in OVER:
        for method in dict.fromkeys(m for own in times.values() for m in own[what]):
            first = [name for name, own in best.items() if own[what] == method]
            run.record(f"trade.hot.scenes.first.{method}.{what}", len(first), comparator="info",
                       scale=f"{len(best)} trials", note="trials where it is the fastest: "
                       + (", ".join(first) or "none"))


def record_ranges(run, over):
    """Smallest and largest ratios of each method over scenes, {scene: `over_hot`}; and the scenes
    where it and HOT change places.
    """
    for method in dict.fromkeys(m for own in over.values() for of in own.values() for m in of):
        of = {what: {scene: own[what][method] for scene, own in over.items()
                     if method in own.get(what, ())} for what in OVER}
        for what, ratios in of.items():
            for word, pick in (("min", min), ("max", max)) if ratios else ():
                scene = pick(ratios, key=ratios.get)
                run.record(f"trade.hot.scenes.range.{method}.{what}.{word}", ratios[scene],
                           comparator="info", scale=f"{len(ratios)} of {len(over)} scenes",
                           note=f"{scene}; {OVER[what]}" + printed(method, word))
        record_turned(run, method, of["equal-eps"], of["equal-error"])


def printed(method, word):
    """What the paper prints for an end of a method's range, if it does."""
    found = targets.load().get(f"hot.sec7_2.speedup.{method.replace('-', '_')}.{word}")
    return f"; the paper, at equal tolerance: {found.value:g}" if found else ""


def record_turned(run, method, at_eps, at_error):
    """Scenes where a method is faster than HOT in one comparison, {scene: ratio}, and slower in the
    other.
    """
    both = [scene for scene in at_eps if scene in at_error]
    turned = [scene for scene in both if (at_eps[scene] - 1.0) * (at_error[scene] - 1.0) < 0.0]
    run.record(f"trade.hot.scenes.range.{method}.turned", len(turned), comparator="info",
               scale=f"{len(both)} scenes", note="where it is faster than HOT at equal tolerance "
               "and slower at equal error, or the other way round: " + (", ".join(
                   f"{scene} ({at_eps[scene]:.2g} -> {at_error[scene]:.2g})"
                   for scene in turned) or "none"))
