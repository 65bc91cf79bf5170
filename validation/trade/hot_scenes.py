"""Trade at equal error on HOT's scenes: one step of each, by many methods.

Every method solves the same step down a ladder of tolerances, until a solve is cut short or slow.
Methods take turns, so that other load on the computer affects all alike. At the paper's tolerance
the methods leave different errors in the particles; so times are compared at that tolerance, for
the error that HOT leaves at it, and for one error of the displacement in all scenes.
"""

from functools import partial
from itertools import zip_longest
from math import inf
from statistics import geometric_mean
from typing import NamedTuple

from ..common import targets
from ..common.registry import experiment
from ..hot.one_step import ParticleErrors, particle_errors, solve_step
from ..hot.stiffness import METHODS
from ..hot.warm_states import PRINTED, START_TIMES, following_steps, warm_state
from .hot import (
    PAPER,
    POINT_FIELDS,
    SolvePoint,
    bounded_below,
    measured_point,
    record_equal_eps,
    times_for,
)

FEW_METHODS = (*METHODS, "hot-plus")
ALL_METHODS = (*FEW_METHODS, "hot-quadratic", "lbfgs-gmg", "sgs-pcg", "pn-gmg-pcg", "admm",
               "gast15")
FLEXIBLE = {"flexible": True}       # CG for a preconditioner that varies, as a V-cycle with an
                                    # inexact coarsest solve does; plain CG takes thousands of
                                    # iterations near the solution
OPTIONS = {"pn-mgpcg": FLEXIBLE, "pn-gmg-pcg": FLEXIBLE}
OWN_LADDERS = {"gast15": tuple(10.0**-k for k in range(-1, 6))}     # an L2 norm [kg m/s]
CAPS = {"max_iterations": 300, "max_cg_iterations": 3000}   # of iterations
SLOW = 10.0                         # CPU time from which on a solve is its ladder's last [s]


class ToleranceLadder(NamedTuple):
    """A method and its tolerances, largest first."""

    method: str
    ladder: tuple

    @property
    def options(self):
        """Options of its solves, without the tolerance."""
        return {**CAPS, **OPTIONS.get(self.method, {})}


def tolerance_ladders(methods, ladder):
    """Return the ladders of methods: one for all but where a tolerance means something else."""
    return [ToleranceLadder(method, OWN_LADDERS.get(method, ladder)) for method in methods]


def descend_ladders(step, exact, ladders):
    """Return the `SolvePoint`s of all `ToleranceLadder`s, against the exact `Solution`."""
    points, ended = [], set()
    for rung in zip_longest(*(ladder.ladder for ladder in ladders)):
        for ladder, eps in zip(ladders, rung, strict=True):
            if eps is None or ladder.method in ended:
                continue
            points.append(measured_point(step, exact, (ladder.method, eps), 1, **ladder.options))
            if is_last(points[-1]):
                ended.add(ladder.method)
    return points


def is_last(p):
    """Return whether a `SolvePoint` is its ladder's last. HOT goes on to the paper's tolerance, at
    which all are compared to it.
    """
    return (not p.converged or p.cpu > SLOW) and (p.method != "hot" or p.eps <= PAPER)


EXACT, CHECK = "pn-mgpcg", "pn-pcg"     # methods of the reference and of its check
REFERENCE_CAPS = {"max_iterations": 1000, "max_cg_iterations": 20000}     # at most, of their solves
BELOW = 10.0                        # the smallest tolerance over that of the reference
TRUST = 3.0                         # smallest compared error over that of the reference
AHEAD = 0.7                         # aim for hot-plus: CPU time over HOT's at equal error
TIE = 1.1                           # ratio of CPU times below which methods tie
COMPARABLE = 0.5                    # share of the increment up to which an error is compared:
                                    # a solve that leaves more has hardly started
CELLS = 1e-3                        # error of displacement that is the same for all scenes [dx]
COMPARISONS = {
    "equal-eps": f"CPU time over HOT's at eps = {PAPER:.0e}",
    "equal-error": "CPU time over HOT's for the error that HOT leaves there",
    "cells": f"CPU time over HOT's until no particle is off by more than {CELLS:g} cells",
}


class SceneTrial(NamedTuple):
    """A scene, its size, the ladder of tolerances of its step, and the methods."""

    scene: str
    size: str           # of `sizes.SIZES`: quick, standard
    ladder: tuple
    methods: tuple

    @property
    def name(self):
        """Leading part of the ids of its records."""
        return f"trade.hot.scenes.{self.scene}" + (".fine" if self.size == "standard" else "")

    @property
    def eps(self):
        """Tolerance of the reference."""
        return self.ladder[-1] / BELOW


def plan(profile):
    """Return the `SceneTrial`s of a profile: few at quick, else all scenes and some finer ones."""
    few, many = (tuple(10.0**-k for k in range(*ends)) for ends in ((5, 9), (3, 11)))
    if profile == "quick":
        return [SceneTrial(name, "quick", few, METHODS) for name in ("faceless", "sauce")]
    return ([SceneTrial(name, "quick", many, ALL_METHODS) for name in START_TIMES]
            + [SceneTrial(name, "standard", few, FEW_METHODS)
               for name in ("twist", "boxes", "wheel", "faceless")])


class ReferenceQuality(NamedTuple):
    """The accuracy of a trial's reference, and the scale of the trial."""

    least: ParticleErrors       # what its two methods differ by
    converged: bool     # both
    scale: str


@experiment("trade.hot.scenes", title="HOT at equal error: one step of each of its scenes",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 1200})
def equal_error(run):
    """Compare times at equal tolerance and at equal error in all scenes."""
    rows, times = [], {}
    trials = plan(run.profile)
    compile_all(trials)
    for trial in run.progress(trials, "scenes"):
        found, exact = unpack(run.cached(trial.name, partial(ladder, trial)))
        own = bounded_below(found, exact.least)
        times[trial] = seconds(own)
        record_trial(run, trial, own, exact)
        rows += [(trial.scene, trial.size, *p, exact.least.velocity, exact.least.cells_max)
                 for p in found]
    record_ranking(run, times)
    record_ranges(run, {trial.scene: ratios_to_hot(own) for trial, own in times.items()
                        if trial.size == "quick" and trial.scene in PRINTED})
    run.table("points", ("scene", "size", *POINT_FIELDS, "least", "least_cells"), rows)


def compile_all(trials):
    """Compile what the first of the trials needs, on the last one made small."""
    ladder(trials[-1]._replace(size="quick", ladder=(PAPER,), methods=trials[0].methods))


def ladder(trial):
    """Run a trial. Returns its `SolvePoint`s and `ReferenceQuality`."""
    problem, state = warm_state(trial.scene, trial.size)
    step = next(following_steps(problem, state, 1))
    exact, check = (solve_step(step, method, eps=trial.eps, **REFERENCE_CAPS,
                               **OPTIONS.get(method, {})) for method in (EXACT, CHECK))
    found = descend_ladders(step, exact, tolerance_ladders(trial.methods, trial.ladder))
    scale = (f"{step.particles} particles, {len(exact.dv)} nodes, one step from "
             f"{START_TIMES[trial.scene]:g} s on")
    return found, ReferenceQuality(particle_errors(step, check.dv, exact.dv),
                            exact.report.converged and check.report.converged, scale)


def unpack(ladder):
    """Return the result of `ladder` from the plain lists of its file."""
    points, (least, converged, scale) = ladder
    return ([SolvePoint(*p) for p in points],
            ReferenceQuality(ParticleErrors(*least), converged, scale))


def compared_error(points):
    """Return the error that is compared: HOT's at the paper's tolerance."""
    return next(p.error for p in points if (p.method, p.eps) == ("hot", PAPER))


def seconds(points):
    """{comparison of `COMPARISONS`: {method: CPU seconds}}, without methods whose ladder does not
    hold it; none at HOT's error where that is larger than `COMPARABLE`. Solves that did not
    converge do not count, but for HOT's at the paper's tolerance.
    """
    sound = [p for p in points if p.converged or (p.method, p.eps) == ("hot", PAPER)]
    methods = dict.fromkeys(p.method for p in sound)
    at_eps = {p.method: p.cpu for p in sound if p.eps == PAPER}
    at_error = {}
    if compared_error(points) <= COMPARABLE:
        at_error = {**times_for(sound, methods, compared_error(points)), "hot": at_eps["hot"]}
    found = at_eps, at_error, times_for(sound, methods, CELLS, "cells")
    return {what: {method: t for method, t in times.items() if t is not None}
            for what, times in zip(COMPARISONS, found, strict=True)}


def ratios_to_hot(times):
    """Return {comparison: {other method: its CPU time over HOT's}} from `seconds`."""
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


def record_trial(run, trial, points, exact):
    """Record the reference, errors and times of one trial."""
    run.record(f"{trial.name}.reference", exact.least.velocity, comparator="<=",
               bound=compared_error(points) / TRUST, scale=exact.scale,
               note=f"difference of {EXACT} and {CHECK} at eps = {trial.eps:.0e}, relative to the "
               "increment; at most a third of "
               f"the error that is compared; {exact.least.cells_max:.1e} cells at most"
               + ("" if exact.converged else "; not both converged"))
    record_equal_eps(run, trial.name, points, exact.scale)
    for what, ratios in ratios_to_hot(seconds(points)).items():
        for method, ratio in ratios.items():
            run.record(f"{trial.name}.{method}.{what}", ratio, comparator="info",
                       scale=exact.scale, note=COMPARISONS[what])
    cut, slow = ([f"{p.method} at {p.eps:.0e}" for p in points if which(p)] for which in (
        lambda p: not p.converged, lambda p: p.converged and p.cpu > SLOW))
    run.record(f"{trial.name}.cut", len(cut), comparator="info", scale=exact.scale,
               note="solves that did not converge within the caps: " + (", ".join(cut) or "none")
               + f"; that took more than {SLOW:g} CPU seconds: " + (", ".join(slow) or "none")
               + "; their methods went no further")


def record_ranking(run, times):
    """Record the fastest methods, and where another one is fastest at equal error."""
    best = {trial.name.removeprefix("trade.hot.scenes."): fastest(own)
            for trial, own in times.items()}
    compared = [name for name, own in best.items() if own["equal-error"] is not None]
    reordered = [f"{name} ({best[name]['equal-eps']} -> {best[name]['equal-error']})"
                 for name in compared if best[name]["equal-eps"] != best[name]["equal-error"]]
    run.record("trade.hot.scenes.reordered", len(reordered), comparator="info",
               scale=f"{len(compared)} of {len(best)} trials", note="trials whose fastest method "
               "at equal error is another one than at equal tolerance: "
               + (", ".join(reordered) or "none"))
    hardly = [name for name in best if name not in compared]
    run.record("trade.hot.scenes.hardly-begun", len(hardly), comparator="info",
               scale=f"{len(best)} trials", note=f"trials where HOT at eps = {PAPER:.0e} leaves "
               f"more than {COMPARABLE:g} of the increment, an error at which nothing is compared: "
               + (", ".join(hardly) or "none"))
    for what in COMPARISONS:
        for method in dict.fromkeys(m for own in times.values() for m in own[what]):
            first = [name for name, own in best.items() if own[what] == method]
            run.record(f"trade.hot.scenes.first.{method}.{what}", len(first), comparator="info",
                       scale=f"{len(best)} trials", note="trials where it is the fastest: "
                       + (", ".join(first) or "none"))


def record_ranges(run, over):
    """Record the smallest and largest ratios of each method over scenes {scene: `ratios_to_hot`},
    their geometric mean, and the scenes where it and HOT change places.
    """
    for method in dict.fromkeys(m for own in over.values() for of in own.values() for m in of):
        of = {what: {scene: own[what][method] for scene, own in over.items()
                     if method in own.get(what, ())} for what in COMPARISONS}
        for what, ratios in of.items():
            for word, pick in (("min", min), ("max", max)) if ratios else ():
                scene = pick(ratios, key=ratios.get)
                run.record(f"trade.hot.scenes.range.{method}.{what}.{word}", ratios[scene],
                           comparator="info", scale=f"{len(ratios)} of {len(over)} scenes",
                           note=f"{scene}; {COMPARISONS[what]}" + printed_range(method, word))
            if ratios:
                record_mean(run, (method, what), list(ratios.values()), len(over))
        record_reversed(run, method, of["equal-eps"], of["equal-error"])


def record_mean(run, compared, ratios, count):
    """Record the geometric mean of ratios to HOT of a (method, comparison), of `count` scenes; that
    of hot-plus at equal error is judged.
    """
    method, what = compared
    judged = compared == ("hot-plus", "equal-error") and run.profile == "standard"
    run.record(f"trade.hot.scenes.range.{method}.{what}.mean",
               geometric_mean(ratios), scale=f"{len(ratios)} of {count} scenes",
               note=f"geometric mean; {COMPARISONS[what]}"
               + (f"; our aim: {AHEAD:g}, see decision 127" if judged else ""),
               **({"comparator": "<=", "bound": AHEAD} if judged else {"comparator": "info"}))


def printed_range(method, word):
    """Return the printed value for an end of a method's range as text, "" if there is none."""
    found = targets.load().get(f"hot.sec7_2.speedup.{method.replace('-', '_')}.{word}")
    return f"; the paper, at equal tolerance: {found.value:g}" if found else ""


def record_reversed(run, method, at_eps, at_error):
    """Record the scenes where a method is faster than HOT in one comparison {scene: ratio} and
    slower in the other.
    """
    both = [scene for scene in at_eps if scene in at_error]
    reversed_in = [scene for scene in both if (at_eps[scene] - 1.0) * (at_error[scene] - 1.0) < 0.0]
    run.record(f"trade.hot.scenes.range.{method}.turned", len(reversed_in), comparator="info",
               scale=f"{len(both)} scenes", note="where it is faster than HOT at equal tolerance "
               "and slower at equal error, or the other way round: " + (", ".join(
                   f"{scene} ({at_eps[scene]:.2g} -> {at_error[scene]:.2g})"
                   for scene in reversed_in) or "none"))
