"""Search the settings of a scene for the cheapest one that keeps an error, within a budget.

1. The scene's own setting runs on at least four halved grids, until their reference is known to
   half the error asked for the whole run, stops improving, or the next grid does not fit into the
   budget. Grids that are stored from a search before are always used.
2. The scene's own setting, and each single knob, walk over the grids from the coarsest on, whose
   runs cost least, until they keep the error or can no longer be cheaper than the best so far.
3. Pairs of the single knobs that keep the error cheapest walk likewise.

A setting that fails has its outcome recorded.
"""

from dataclasses import dataclass, field

import msgspec
import numpy as np

from ..scene import SceneError
from ..sweep.difference import difference_so_far, largest_change
from ..sweep.observation import FINISHED
from ..sweep.quantity import OutputQuantity
from ..sweep.runs import RunRequest
from ..sweep.setting import Setting, scene_at, setting
from .candidates import GRIDS, pairs, single_knobs
from .reference import reference_of, reliable_times

COARSEST, FINEST = 4.0, 1.0 / 64.0      # factors of dx on halved grids; the latter may be set
AT_START = (4.0, 2.0, 1.0)
GRIDS_OF_REFERENCE = 4      # at least, where the budget allows them
PATIENCE = 1                # grids past one that did not make the reference better known
REFERENCE_SHARE = 0.7       # of the time left that the next grid of the reference may take
REFERENCE_PART = 0.5        # of the error asked, which the reference's own may be
DIVERGED = 0.5      # of the error asked, by which a perturbed run shows chaos: that it has another
                    # number of steps makes a small difference
CHEAPER = 0.5               # a setting is tried if it is expected to cost less than best / this
HOPELESS = 3.0              # times the best cost, after which a candidate's run is stopped
BEST_SINGLES = 4            # whose pairs are tried
PERTURBED = "perturbed"     # label of the perturbed run
ALTERNATIVE = {"mls": "apic", "apic": "mls", "flip": "apic", "pic": "apic"}


@dataclass
class TradeSearch:
    """All runs of a search, and the references of each quantity."""

    scene: object
    runs: object                        # `sweep.runs.SceneRuns`
    quantities: tuple                   # of texts, for which the error is asked
    times: np.ndarray                   # (T,) [s]
    error: float
    finest: float = FINEST              # factor of dx of the finest grid of the reference
    others: dict = field(default_factory=dict)          # name: another scene of the same problem
    observations: dict = field(default_factory=dict)    # Setting: RunObservation
    references: dict = field(default_factory=dict)      # text: QuantityReference
    levels: tuple = ()                  # factors of dx of the reference
    chaos: float = np.inf               # [s] from which a perturbed run diverges
    compared_with: str | None = None    # another transfer, which the references' errors include
    idle: int = 0                       # grids since the last that made the reference better known

    def run(self):
        """Make all runs."""
        self.start()
        self.refine()
        self.compare_families()
        self.walk([Setting(), *self.singles()])
        self.walk(self.promising_pairs())

    def singles(self):
        """Return the settings that change one knob, each scene once: 0.5 and 2/3 of two points per
        cell are one.
        """
        scenes = {}
        for chosen in single_knobs(self.scene):
            scene = self._scene_at(chosen)
            key = chosen if isinstance(scene, SceneError) else msgspec.json.encode(scene)
            scenes.setdefault(key, chosen)
        return [*scenes.values(), *(setting(scene=name) for name in self.others)]

    # the reference

    def start(self):
        """Run the first grids, and the scene with perturbed positions."""
        perturbed = {PERTURBED: RunRequest(self.scene, seed=1)}
        self.observe([setting(dx=factor) for factor in AT_START], perturbed)
        self.update_references()

    def refine(self):
        """Halve the grid until the reference is known, stops improving, or the budget says so."""
        self.idle = 0
        while self.levels and (len(self.levels) < GRIDS_OF_REFERENCE
                               or self.horizon() < self.times[-1]
                               or self.is_stored(setting(dx=self.levels[-1] / 2.0))):
            chosen, n, before = setting(dx=self.levels[-1] / 2.0), len(self.levels), self.horizon()
            if not self.is_next_grid(chosen):
                break
            free = 0.0 if self.is_stored(chosen) else self.expected_cpu(chosen)
            side_runs = self.side_runs(free)
            self.observe([chosen, *side_runs], most_cpu=np.inf)
            self.update_references()
            self.idle = self.idle + 1 if 0.0 < self.horizon() <= before else 0
            if len(self.levels) == n:
                break

    def is_next_grid(self, chosen):
        """Return whether a finer grid is run for the reference; one that is stored always is."""
        if chosen.get("dx") < self.finest:
            return False
        if self.is_stored(chosen):
            return True
        helps = self.idle <= PATIENCE or len(self.levels) < GRIDS_OF_REFERENCE
        return helps and self.expected_cpu(chosen) <= REFERENCE_SHARE * self.runs.left

    def is_stored(self, chosen):
        """Return whether a setting needs no run: its observation is stored, or it is refused."""
        return self.runs.has(RunRequest(self._scene_at(chosen)))

    def side_runs(self, cpu):
        """Return candidates that the other workers can run during a reference run of so much CPU
        time [s].
        """
        grid = setting(dx=(self.best() or setting(dx=1.0)).get("dx"))
        candidates = [family | grid for family in self.singles()
                      if family | grid not in self.observations]
        total = np.cumsum([self.expected_cpu(chosen) for chosen in candidates])
        return [c for c, t in zip(candidates, total, strict=True)
                if t <= (self.runs.workers - 1) * cpu]

    def update_references(self):
        """Compute the references from the first unbroken sequence of halved grids, the coarsest
        first, on which the run is sound.
        """
        factors, factor = [], COARSEST
        while factor >= FINEST:
            run = self.observations.get(setting(dx=factor))
            if run is not None and run.is_sound:
                factors.append(factor)
            elif factors and run is not None:
                break
            factor /= 2.0
        self.levels = tuple(factors)
        if len(factors) >= 2:
            texts = self.observations[setting(dx=factors[-1])].values
            self.references = {text: reference_of(
                [self.observations[setting(dx=f)].values[text] for f in factors])
                for text in texts}
        self.chaos = self.time_of_divergence()

    def time_of_divergence(self):
        """Return the time [s] at which the perturbed run leaves the scene's; infinite if never."""
        diverged = np.any([self.divergence(text) > DIVERGED * self.error
                           for text in self.quantities], axis=0)
        return float(self.times[np.argmax(diverged)]) if diverged.any() else np.inf

    def divergence(self, text):
        """Return the relative difference so far (T,) of the perturbed run from the scene's; zero
        where one of them did not finish.
        """
        a = self.observations.get(setting(dx=1.0))
        b = self.observations.get(PERTURBED)
        if not (a and b and a.finished and b.finished):
            return np.zeros(len(self.times))
        return difference_so_far(b.values[text], a.values[text]) / largest_change(a.values[text])

    def compare_families(self):
        """Raise the references' errors where another transfer approaches another solution.

        It runs on the second finest grid; the error that it would have on the finest one, at the
        observed order, is a second estimate of how far the reference is from the solution.
        """
        other = ALTERNATIVE[self.scene.step_scheme.transfer]
        if len(self.levels) < 3 or self.scene.scheme.degree == 1:
            return
        chosen = setting(dx=self.levels[-2], transfer=other)
        self.observe([chosen], most_cpu=np.inf)
        run = self.observations[chosen]
        if run.is_sound:
            self.compared_with = other
            for text, reference in self.references.items():
                shrunk = reference.error_of(run.values[text]) / 2.0**np.clip(reference.order, 0, 2)
                self.references[text] = reference.raised(shrunk)

    @property
    def last(self):
        """Return the index of the last time until which all quantities asked for are known to half
        the error, the finest grid keeps it, and no chaos has begun; 0 where there is none.

        What is asked for at the end has no other time than that.
        """
        if not self.references:
            return 0
        references = [self.references[text] for text in self.quantities]
        reliable = reliable_times(references, REFERENCE_PART * self.error)
        finest = self.errors_of_run(self.observations[setting(dx=self.levels[-1])])
        kept = finest + np.max([one.error for one in references], axis=0) <= self.error
        known = reliable & kept & (self.times < self.chaos)
        if any(OutputQuantity(text).at_end for text in self.quantities):
            known[:-1] = False
        return int(np.max(np.flatnonzero(known), initial=0))

    def horizon(self):
        """Return the time [s] until which all quantities asked for are known to half the error."""
        return float(self.times[self.last])

    # errors and costs of settings

    def error_of(self, chosen, texts=None):
        """Return the largest error of a setting until the horizon, of the quantities asked for (or
        those given); infinite where it did not finish.
        """
        run = self.observations.get(chosen)
        return np.inf if run is None else self.error_of_run(run, texts)

    def error_of_run(self, run, texts=None, k=None):
        """Return the error of a `RunObservation`, as `error_of` does of a setting's; until another
        time than the horizon where its index k is given.
        """
        if not run.finished or not self.references:
            return np.inf
        return float(self.errors_of_run(run, texts)[self.last if k is None else k])

    def errors_of_run(self, run, texts=None):
        """Return the largest error (T,) until each time of a run that finished."""
        return np.max([self.references[text].error_of(run.values[text], OutputQuantity(text).at_end)
                       for text in texts or self.quantities], axis=0)

    def reference_error(self):
        """Return the largest error of the references until the horizon."""
        return max(float(self.references[text].error[self.last]) for text in self.quantities)

    def least_error(self, text):
        """Return the least error for which a quantity is known for the whole run by the grids that
        finished.
        """
        own = self.references[text].error[-1]
        finest = self.error_of_run(self.observations[setting(dx=self.levels[-1])], (text,), -1)
        return float(max(own / REFERENCE_PART, own + finest, self.divergence(text)[-1] / DIVERGED))

    def keeping(self, settings):
        """Return those of some settings that keep the error asked, that of the reference included,
        with their bodies whole.
        """
        if not self.references:
            return []
        k, own = self.last, self.reference_error()
        runs = {chosen: self.observations.get(chosen) for chosen in settings}
        return [chosen for chosen, run in runs.items() if run is not None and run.is_sound
                and self.error_of_run(run, k=k) + own <= self.error]

    def best(self):
        """Return the cheapest setting that keeps the error, or None."""
        if not self.references or self.horizon() <= 0.0:
            return None
        return min(self.keeping(self.settings()), key=lambda s: self.observations[s].cost.cpu,
                   default=None)

    def settings(self):
        """Return all settings with an observation."""
        return [label for label in self.observations if isinstance(label, Setting)]

    def expected_cpu(self, chosen):
        """Return the CPU time [s] expected of a setting: that of the same knobs on the nearest
        grid, or of the scene's own, times (dx ratio)^-(d + 1).
        """
        knobs = without_grid(chosen)
        family = [s for s in self.settings() if without_grid(s) == knobs and self._cost(s)]
        base = [s for s in self.settings() if not without_grid(s).items and self._cost(s)]
        ratio, pool = (1.0, family) if family else (guessed_ratio(self.scene, knobs), base)
        if not pool:
            return 0.0
        dx = chosen.get("dx", 1.0)
        nearest = min(pool, key=lambda s: abs(np.log(s.get("dx", 1.0) / dx)))
        power = self.scene.dim + 1
        return ratio * self._cost(nearest) * (nearest.get("dx", 1.0) / dx) ** power

    def _cost(self, chosen):
        run = self.observations[chosen]
        return run.cost.cpu if run.outcome == FINISHED else 0.0

    # walks over the grids

    def walk(self, families):
        """Run settings without a grid from the coarsest grid to the first on which they keep the
        error, or on which they are not worth trying.
        """
        walking = list(families)
        for factor in self.grids():
            best = self.best()
            batch = {family: chosen for family in walking
                     if self.is_worth_trying(chosen := family | setting(dx=factor), best)}
            self.observe(sorted(batch.values(), key=self.expected_cpu))
            kept = set(self.keeping(batch.values()))
            walking = [family for family, chosen in batch.items() if chosen not in kept]

    def grids(self):
        """Return the factors of dx of the grids that the scene can have, the coarsest first."""
        return [factor for factor in GRIDS
                if not isinstance(self._scene_at(setting(dx=factor)), SceneError)]

    def is_worth_trying(self, chosen, best):
        """Return whether a setting may still be cheaper than the best one; none without one."""
        if best is None:
            return False
        return (chosen in self.observations
                or CHEAPER * self.expected_cpu(chosen) < self._cost(best))

    def promising_pairs(self):
        """Return the pairs of the single knobs that keep the error cheapest."""
        if self.best() is None:
            return []
        best = {}
        for chosen in self.keeping(self.settings()):
            knobs = without_grid(chosen)
            if len(knobs.items) == 1:
                best[knobs] = min(best.get(knobs, np.inf), self._cost(chosen))
        return pairs(sorted(best, key=best.get)[:BEST_SINGLES])

    def observe(self, settings, others=None, most_cpu=None):
        """Observe settings that were not observed yet, and other requests by their labels.

        most_cpu: CPU time [s] that each may take; usually `HOPELESS` times that of the best one.
        """
        if most_cpu is None:
            best = self.best()
            most_cpu = np.inf if best is None else HOPELESS * self._cost(best)
        requests = {s: RunRequest(self._scene_at(s), most_cpu=most_cpu) for s in settings
                    if s not in self.observations}
        self.observations |= self.runs.observe((others or {}) | requests)

    def _scene_at(self, chosen):
        try:
            return scene_at(self.scene, chosen, self.others)
        except SceneError as fault:
            return fault


def without_grid(chosen):
    """Return a setting without its grid."""
    return Setting(tuple(item for item in chosen.items if item[0] != "dx"))


def guessed_ratio(scene, knobs):
    """Return the expected ratio of a setting's cost to that of the scene on the same grid."""
    ratio = knobs.get("particles", 1.0) ** scene.dim
    if knobs.get("cfl") and scene.dt is None and knobs.get("integrator") in (None, "explicit"):
        ratio *= (scene.cfl or 0.5) / knobs.get("cfl")
    return ratio
