"""Warnings about runs in which learned laws are evaluated beyond the strains of their training.

No step fails where a law extrapolates: its values are smooth, and often wrong. The `excess` of
`learned.strain_range` detects it, in the elastic deformation gradients of a state. A state is out
of range where the excess of a point is above MAX_EXCESS, or the point is inverted where none was in
training, or its F is not finite; and where the mean excess of all points is above MEAN_EXCESS, as
in a body that is strained as a whole. This does not measure the error: `python -m validation run
extremes.nclaw` records how often the watch warns about accurate runs, and misses wrong ones.
"""

from typing import NamedTuple

import numpy as np

from ..body import Body
from ..materials.learned.guard import StrainBox, count_cut, is_guarded
from ..materials.learned.strain_range import (
    describe_bounds,
    describe_strains,
    excess,
    stored_bounds,
    strain_measures,
)
from ..monitor import CHECK
from .bodies import body_maker, deformation_gradients

MAX_EXCESS = 0.3        # runs of task (b) reach 0.2, those thrown twice as fast 0.8
MEAN_EXCESS = 0.1       # from small laws in strained bodies (`extremes.nclaw.bound`):
                        # stretched ones without a point above MAX_EXCESS have up to 0.075 where
                        # good, from 0.176 on where wrong, but for one of each
POOR = 0.16             # error on the training run over its motion; from unfinished trainings of
                        # small laws (`extremes.nclaw.epochs`): good ones have up to 0.137, bad ones
                        # from 0.17 on


class StrainReport(NamedTuple):
    """The strains of a body in a state, compared with the bounds of training."""

    body: str
    particle: int       # the one that is farthest out of bounds, of those that are
    measures: tuple     # its stretches and J
    excess: float       # of that particle
    count: int          # points of an excess above MAX_EXCESS
    n: int              # points
    mean: float = 0.0   # excess of all points

    @property
    def J(self):
        """det F of that particle."""
        return self.measures[-1]

    @property
    def out_of_range(self):
        """True if a point is beyond the strains of the law's training."""
        return self.count > 0 or not self.mean <= MEAN_EXCESS


def strain_report(body: Body, bounds):
    """Return the `StrainReport` of a body by bounds of `strain_range`."""
    with np.errstate(invalid="ignore", over="ignore"):
        measures = strain_measures(deformation_gradients(body))
    out = excess(measures, bounds)
    p = int(np.argmax(out))
    return StrainReport(body.name, int(body.id[p]), tuple(measures[p].tolist()), float(out[p]),
                        int(np.sum(out > MAX_EXCESS)), len(out), float(np.mean(out)))


class StrainWatch:
    """The watch of a run whose bodies have learned laws; it reports each body once, and counts the
    particle-steps in which the guard of a law cut its strains, `cut` {body: count}.

    bounds: {name of a body: bounds as of `stored_bounds`}.
    """

    def __init__(self, bounds):
        self.bounds, self.silent = bounds, set(bounds)
        self.steps, self.cut = 0, {}

    def count(self, state):
        """Count the points whose strains are cut in a `simulate.State` after a step."""
        self.steps += 1
        for body in state.bodies:
            if body.name in self.bounds and is_guarded(body.law):
                box = StrainBox(body.law.low, body.law.high)
                n = count_cut(deformation_gradients(body), box)
                self.cut[body.name] = self.cut.get(body.name, 0) + n

    def summary(self):
        """Return a sentence for each body whose strains were cut."""
        return [cut_message(name, count, self.steps) for name, count in self.cut.items() if count]

    def news(self, state):
        """Return a sentence for each body that is out of range for the first time in a
        `simulate.State`; states are looked at every CHECK steps.
        """
        if state.step % CHECK or not self.silent:
            return []
        reports = [self.report(body) for body in state.bodies if body.name in self.silent]
        out = [report for report in reports if report.out_of_range]
        self.silent -= {report.body for report in out}
        guards = {body.name: is_guarded(body.law) for body in state.bodies}
        return [message(report, state.step, state.t, self.bounds[report.body], guards[report.body])
                for report in out]

    def report(self, body):
        """Return the `StrainReport` of a body."""
        return strain_report(body, self.bounds[body.name])


class ComparisonWatch:
    """The watch of a run by `LearnedLaws` that is compared with the run of a `Problem` by its own
    laws; it reports each body once, and none where the laws hold no bounds.
    """

    def __init__(self, laws, problem):
        self.law, self.clock = body_maker(laws), problem.clock
        self.bounds, self.silent = stored_bounds(laws.about, problem.dim), []

    def body(self, body):
        """Return a body of the learned laws, and watch it from now on."""
        copy = self.law(body)
        if self.bounds is not None:
            self.silent.append(copy)
        return copy

    def news(self, frame):
        """Return a sentence for each body that is out of range for the first time, at a frame."""
        step = frame * self.clock.every
        reports = [(body, strain_report(body, self.bounds)) for body in self.silent]
        self.silent = [body for body, report in reports if not report.out_of_range]
        return [message(report, step, step * self.clock.dt, self.bounds)
                for _, report in reports if report.out_of_range]


def strain_watch(problem):
    """Return the `StrainWatch` of a run of a `Problem`; None where no law has bounds."""
    return StrainWatch(problem.strain_bounds) if problem.strain_bounds else None


def is_poor(run_error):
    """Return whether laws with an error on their own training run, over its motion, are poor; None
    is that of a run that broke down.
    """
    return run_error is None or not run_error <= POOR


def poor_law_warnings(problem):
    """Yield a warning for each body whose laws had a large error on their own training run."""
    for name, bounds in problem.strain_bounds.items():
        error = bounds.get("run_error", 0.0)
        if is_poor(error):
            share = "broke down on" if error is None else f"missed {error:.0%} of the motion of"
            yield (f"body {name!r}: its laws {share} the run that they were trained on: most runs "
                   f"of laws that missed more than {POOR:.0%} went wrong; train longer")


def time_step_warnings(problem):
    """Yield a warning for each body whose laws were trained in steps of another length."""
    for name, bounds in problem.strain_bounds.items():
        if bounds["dt"] not in (None, problem.clock.dt):
            yield (f"body {name!r}: its laws were trained in steps of {bounds['dt']:g} s, this run "
                   f"has {describe_dt(problem.clock.dt)}: a learned return map acts once a step, "
                   "so that it may answer otherwise")


def describe_dt(dt):
    """Return a time step [s] in words; None is an adaptive one."""
    return "an adaptive one" if dt is None else f"dt = {dt:g} s"


def message(report, step, t, bounds, has_guard=False):
    """Return the sentence on a `StrainReport`: where, when, how far, and what may help."""
    answer = ("the guard cuts what its law is asked about there" if has_guard else
              "its answer there is a guess")
    others = f", and {report.count - 1} others" if report.count > 1 else ""
    if not report.count:
        others = (f" and most others, on average by {report.mean:.2g} of the range's width, more "
                  f"than {MEAN_EXCESS:g}")
    return (f"step {step}, t = {t:.6g} s: body {report.body!r}: particle "
            f"{report.particle}{others}: {describe_strains(report.measures)}, are outside what its "
            f"learned law has seen in training: {describe_bounds(bounds)}; {answer}: train "
            "on a run that strains as much, or load this one less")


def cut_message(name, count, steps):
    """Return the sentence on how often the guard cut the strains of a body."""
    return (f"body {name!r}: {count} particle-steps were cut to the strains of its law's training "
            f"and a margin, in {steps} steps")
