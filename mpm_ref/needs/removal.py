"""Run a scene with one ingredient less, for each, and then without all that are not required.

The change of a removal is the largest difference of a quantity from the scene as given, relative to
the largest change of the quantity during that run. A removal is required where the change is larger
than the error asked. First all removals that change nothing are made at once; then, again and
again, the one that saves most CPU time and leaves the change since the scene as given within the
error, each of the others being measured anew on the scene that is left. Where something stands in
place of an ingredient, it must save time: slip instead of separation, for instance, is no simpler.
"""

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from ..scene import SceneError
from ..sweep.observation import CRASHED, FINISHED, REFUSED, STOPPED, TORN, UNSTABLE
from ..sweep.runs import RunRequest
from ..sweep.setting import scene_at, setting
from .variant import changes

AS_GIVEN = "as given"
REQUIRED, NOT_REQUIRED, COSTLY = "required", "not required", "costly"
IMPOSSIBLE, UNMEASURED = "impossible", "not measured"
NOTHING = 1e-9          # a change that is round-off
NOISE = 0.05            # of CPU times, at least: less is no saving
MOST_CPU = 2.0          # of the base run, after which a run is stopped
LEAST_CPU = 1.0         # [s] that a run may take in any case
FINE, COARSE = 0.5, 2.0         # factors of dx, one of which shows the grid's error
FINE_SHARE = 0.25        # of the time left that the run on the fine grid may take
GRID_POWER = 1          # of the time step: cost grows as dx^-(dim + 1)
SHORT = 5.0             # [s] of CPU time: runs so short are made three times
SEEDS = 1, 2, 3         # of perturbations: of the scene as given, and of repeated runs


@dataclass(frozen=True)
class RemovalRun:
    """The run of a variant: its changes by quantity, its CPU time, and what follows."""

    label: str
    verdict: str
    changes: dict           # {quantity: largest relative change}
    cpu: float              # [s]
    outcome: str
    message: str = ""

    @property
    def change(self):
        """Return the largest change of all quantities."""
        return max(self.changes.values(), default=inf)


@dataclass(frozen=True)
class SceneErrors:
    """The change of each quantity by another grid spacing, and by a perturbation of positions."""

    grid: dict              # {quantity: change}, empty where not measured
    grid_factor: float      # of dx: `FINE` or `COARSE`
    perturbation: dict
    message: str = ""       # why the grid was not refined


@dataclass(frozen=True)
class NeedsResult:
    """Measurements of a scene: its errors, each removal alone, and the best order."""

    first: object           # `SceneVariant` as given
    base: object            # `RunObservation`
    cpu: float              # [s] of the scene as given: the least of its runs
    noise: float            # of CPU times: how far those runs differ, relative
    errors: SceneErrors
    singles: tuple          # of `RemovalRun`: each removal alone
    order: tuple            # of `RemovalRun`: removals one after the other, the last is the lean
    lean: object            # `SceneVariant`
    complete: bool          # whether the budget sufficed
    missing_cpu: float      # [s] of the runs that were not made, estimated


class RemovalStudy:
    """Measures removals of one scene by its runs."""

    def __init__(self, runs, first, error):
        self.runs, self.first, self.error = runs, first, error
        self.base, self.missing_cpu, self.times = None, 0.0, {AS_GIVEN: []}

    @property
    def cpu(self):
        """Return the CPU time of the scene as given [s]: the least of its runs."""
        return min(self.times[AS_GIVEN])

    @property
    def noise(self):
        """Return the relative difference of CPU times of the scene as given, at least `NOISE`."""
        return max(max(self.times[AS_GIVEN]) / self.cpu - 1.0, NOISE)

    def result(self):
        """Return the `NeedsResult`; None, with the observation in `base`, if the scene as given
        does not reach its end.
        """
        given = self.observe({AS_GIVEN: self.first})
        self.base = given[AS_GIVEN]
        if self.base.outcome != FINISHED:
            return None
        perturbed = self.observe({AS_GIVEN: self.first}, seed=SEEDS[0])
        self.note_times(given, self.times)
        self.note_times(perturbed, self.times)
        errors = self.scene_errors(self.change_of(perturbed[AS_GIVEN]))
        singles = self.measured(attempts(self.first, self.first.offers))
        order, lean, complete = self.reduced(singles)
        complete &= all(run.verdict != UNMEASURED for run in singles)
        return NeedsResult(self.first, self.base, self.cpu, self.noise, errors, tuple(singles),
                           tuple(order), lean, complete, self.missing_cpu)

    def observe(self, variants, most_cpu=inf, seed=None):
        """Return {label: observation} of {label: `SceneVariant` or SceneError}."""
        requests = {}
        for label, variant in variants.items():
            requests[label] = (RunRequest(variant) if isinstance(variant, SceneError)
                               else self.request(variant, most_cpu, seed))
        return self.runs.observe(requests)

    def request(self, variant, most_cpu, seed):
        """Return the `RunRequest` of a variant; it is refused where it has no such quantity."""
        try:
            texts = tuple(variant.quantity(text) for text in self.runs.quantities)
        except SceneError as fault:
            return RunRequest(fault)
        return RunRequest(variant.scene, most_cpu, seed, variant.probes, texts)

    def measured(self, variants, cpu=None):
        """Return a `RemovalRun` for each of {label: `SceneVariant` or SceneError}.

        cpu: CPU time before the removals [s]; that of the scene as given if None. Short runs are
        made again and again, all in turn, since what else a machine does changes their times.
        """
        if not variants:
            return []
        most = max(MOST_CPU * self.cpu, LEAST_CPU)
        observations = self.observe(variants, most)
        runs = [self.judged(label, variants[label], observation)
                for label, observation in observations.items()]
        times = {run.label: [run.cpu] for run in runs}
        if self.base.cost.cpu < SHORT:
            again = {run.label: variants[run.label] for run in runs if run.verdict == NOT_REQUIRED}
            for seed in SEEDS[1:]:
                self.note_times(self.observe({AS_GIVEN: self.first}, seed=seed), self.times)
                self.note_times(self.observe(again, most, seed), times)
        before = self.cpu if cpu is None else cpu
        return [self.costed(run, min(times[run.label]), before) for run in runs]

    def note_times(self, observations, times):
        """Add the CPU times of finished runs to lists in a dictionary."""
        for label, observation in observations.items():
            if observation.outcome == FINISHED:
                times[label].append(observation.cost.cpu)

    def judged(self, label, variant, observation):
        """Return the `RemovalRun` of an observation, whatever its CPU time."""
        cpu, (outcome, message) = observation.cost.cpu, observation.ending
        if outcome == TORN and self.base.tear:
            outcome, message = FINISHED, ""
        if outcome != FINISHED:
            verdict = self.verdict_of_failure(observation)
            return RemovalRun(label, verdict, {}, cpu, outcome, message)
        change = {text: float(error[-1]) for text, error
                  in changes(self.base, observation, variant, self.first).items()}
        verdict = NOT_REQUIRED if max(change.values()) <= self.error else REQUIRED
        return RemovalRun(label, verdict, change, cpu, outcome)

    def costed(self, run, cpu, before):
        """Return a `RemovalRun` with its CPU time [s], and the verdict that follows: without a part
        that changes nothing a run cannot take longer.
        """
        run = replace(run, cpu=cpu)
        is_costly = run.verdict == NOT_REQUIRED and takes_longer(run, before, self.noise)
        return replace(run, verdict=COSTLY) if is_costly else run

    def verdict_of_failure(self, observation):
        """Return the verdict of a run that did not reach its end, or tore a body."""
        if observation.outcome == UNSTABLE or (observation.finished and observation.tear):
            return REQUIRED
        if observation.outcome in (REFUSED, CRASHED):
            return IMPOSSIBLE
        if observation.outcome == STOPPED and observation.cost.cpu > MOST_CPU * self.cpu:
            return COSTLY
        self.missing_cpu += self.cpu
        return UNMEASURED

    # the errors of the scene itself

    def scene_errors(self, perturbation):
        """Return the `SceneErrors` of the scene as given; perturbation: {quantity: change}."""
        fine_cpu = self.cpu * 2.0 ** (self.first.scene.dim + GRID_POWER)
        affordable = fine_cpu < FINE_SHARE * self.runs.left
        message = "" if affordable else f"half of dx would take about {fine_cpu:.3g} s of CPU time"
        factor = FINE if affordable else COARSE
        grid = self.on_grid(factor)
        if not grid and factor == FINE:
            factor, message = COARSE, "the scene with half of dx did not reach its end"
            grid = self.on_grid(factor)
        return SceneErrors(grid, factor, perturbation, message)

    def on_grid(self, factor):
        """Return {quantity: change} of the scene as given by a factor of dx; {} if it fails."""
        try:
            scene = scene_at(self.first.scene, setting(dx=factor))
        except SceneError:
            return {}
        label = f"dx x {factor:g}"
        return self.change_of(self.runs.observe({label: RunRequest(scene)})[label])

    def change_of(self, observation):
        """Return {quantity: change} of another run of the scene as given; {} if it failed."""
        if observation.outcome != FINISHED:
            return {}
        return {text: float(error[-1]) for text, error
                in changes(self.base, observation, self.first, self.first).items()}

    # the order of removals

    def reduced(self, singles):
        """Return (removals as `RemovalRun`, the `SceneVariant` that they lead to, whether the
        budget sufficed).
        """
        hopeless = {run.label for run in singles if run.verdict not in (NOT_REQUIRED, UNMEASURED)}
        cpu = {run.label: run.cpu for run in singles if run.verdict == NOT_REQUIRED}
        order, variant, current = self.without_effect(singles)
        while True:
            candidates = {label: removal for label, removal in variant.offers.items()
                          if label not in hopeless and not removal.is_output}
            runs = {run.label: run
                    for run in self.measured(attempts(variant, candidates), current)}
            hopeless |= {run.label for run in runs.values() if run.verdict != NOT_REQUIRED}
            if any(run.verdict == UNMEASURED for run in runs.values()):
                return order, variant, False
            worthwhile = [run for run in runs.values()
                          if not candidates[run.label].replacement
                          or run.cpu < (1.0 - self.noise) * current]
            best = best_of(worthwhile, cpu)
            if best is None:
                return order, variant, True
            order.append(best)
            variant, current = variant.without(candidates[best.label]), best.cpu

    def without_effect(self, singles):
        """Return (removals, variant, its CPU time) after all removals that change nothing; none
        where they change something together.
        """
        idle = [run for run in singles if run.verdict == NOT_REQUIRED and run.change <= NOTHING]
        variant, labels = self.first, []
        for run in idle:
            removal = variant.offers.get(run.label)
            stays = removal is None or removal.is_output or removal.replacement
            after = None if stays else attempt(variant, removal)
            if after is not None and not isinstance(after, SceneError):
                variant, labels = after, [*labels, run.label]
        if not labels:
            return [], self.first, self.cpu
        together = " and ".join(labels)
        run, = self.measured({together: variant}, inf)
        if run.verdict != NOT_REQUIRED or run.change > NOTHING:
            return [], self.first, self.cpu
        return [run], variant, run.cpu


def attempts(variant, offers):
    """Return {label: `SceneVariant` or SceneError} after each of {label: `Removal`}."""
    return {label: attempt(variant, removal) for label, removal in offers.items()}


def attempt(variant, removal):
    """Return a variant after a removal, or the SceneError that says why there is none: it may not
    change the scene, as fewer points than one.
    """
    try:
        after = variant.without(removal)
    except SceneError as fault:
        return fault
    return SceneError("the scene stays as it is") if after.scene == variant.scene else after


def best_of(runs, cpu_alone):
    """Return the removal that is not required and costs least CPU time, or None; of equal ones,
    the one that saves most alone.
    """
    allowed = [run for run in runs if run.verdict == NOT_REQUIRED]
    return min(allowed, key=lambda run: (run.cpu, cpu_alone.get(run.label, inf), run.change),
               default=None) if allowed else None


def takes_longer(run, before, noise):
    """Return whether a run that changes something takes longer than before [s] and the noise."""
    return run.change > NOTHING and run.cpu > (1.0 + noise) * before


def saving(run, base_cpu):
    """Return the share of the CPU time that a run saves; NaN where it is not known."""
    return 1.0 - run.cpu / base_cpu if np.isfinite(run.cpu) else np.nan
