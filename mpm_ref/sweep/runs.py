"""Observe scenes side by side within a budget of time, each at most once."""

import time
from dataclasses import dataclass

import msgspec
import numpy as np

from ..scene import SceneError
from ..scene.toml import digest
from .observation import CRASHED, REFUSED, STOPPED, ObservedRun, RunCost, RunObservation, observe
from .store import key_of

LATE = "not begun within the budget"


@dataclass(frozen=True)
class RunRequest:
    """A scene to be observed, or the SceneError that says why it is none."""

    scene: object
    most_cpu: float = np.inf        # [s]
    seed: int | None = None         # of a perturbation of the particles' positions
    probes: tuple | None = None     # other than those of the `SceneRuns`
    quantities: tuple | None = None     # likewise


class SceneRuns:
    """Runs of variants of a scene, with the same quantities at the same times unless a request has
    others.
    """

    def __init__(self, observed, executor, store, budget=np.inf, on_run=None):
        """Prepare runs.

        observed: an `ObservedRun` whose quantities, times and probes are those of all runs;
        executor: see `executor.open_executor`; store: a `RunStore`; budget: wall time [s] after
        which no run begins; on_run(label, observation) is called after each.
        """
        self._observed, self._executor, self._store = observed, executor, store
        self._deadline, self.on_run = time.monotonic() + budget, on_run
        self.count = self.reused = 0

    @property
    def left(self):
        """Return the wall time left [s]."""
        return self._deadline - time.monotonic()

    @property
    def probes(self):
        """Return the probes of all runs, (body, positions)."""
        return self._observed.probes

    @property
    def quantities(self):
        """Return the texts of the quantities of all runs."""
        return self._observed.quantities

    @property
    def workers(self):
        """Return the number of runs at a time."""
        return self._executor.workers

    def observe(self, requests):
        """Return {label: `RunObservation`} of {label: `RunRequest`}, in that order.

        Stored runs are not made again, nor equal ones twice. One whose turn comes after the budget
        is stopped.
        """
        observations, runs, keys = {}, {}, {}
        for label, request in requests.items():
            run = self._run_of(request)
            stored = run if isinstance(run, RunObservation) else self._store.get(run)
            if stored is None:
                keys[label] = key_of(run)
                runs.setdefault(keys[label], (label, run))
            else:
                observations[label] = stored
                self.reused += not isinstance(run, RunObservation)
        new = self._make(dict(runs.values()))
        observations |= {label: new[runs[key][0]] for label, key in keys.items()}
        return {label: observations[label] for label in requests}

    def has(self, request):
        """Return whether a `RunRequest` needs no run: it is stored, or refused."""
        run = self._run_of(request)
        return isinstance(run, RunObservation) or self._store.get(run) is not None

    def _run_of(self, request):
        """Return the `ObservedRun` of a request, or the observation of one that is refused."""
        try:
            if isinstance(request.scene, SceneError):
                raise request.scene
            text = msgspec.json.encode(request.scene).decode()
            name = digest(request.scene)
        except SceneError as fault:
            return RunObservation(blank_values(self._observed), RunCost(), REFUSED, str(fault))
        probes = self._observed.probes if request.probes is None else request.probes
        texts = self._observed.quantities if request.quantities is None else request.quantities
        most = max(min(request.most_cpu, self.left), 0.0)
        return self._observed._replace(scene=text, digest=name, most_cpu=most, seed=request.seed,
                                       probes=probes, quantities=texts)

    def _make(self, runs):
        labels, observations = list(runs), {}
        tasks = [RunWithDeadline(runs[label], time.time() + self.left) for label in labels]
        for outcome in self._executor.run(observe_in_time, tasks):
            label = labels[outcome.index]
            observation = outcome.value
            if outcome.error is not None:
                observation = RunObservation(blank_values(runs[label]), RunCost(), CRASHED,
                                             outcome.error)
            elif is_lasting(observation):
                self._store.put(runs[label], observation)
            self.count += 1
            observations[label] = observation
            if self.on_run is not None:
                self.on_run(label, observation)
        return observations


def is_lasting(observation):
    """Return whether the same run would end in the same way another time."""
    if observation.outcome == STOPPED:
        return observation.cost.steps > 0
    return observation.outcome != CRASHED


@dataclass(frozen=True)
class RunWithDeadline:
    """A run with the time [s since 1970] after which it does not begin."""

    run: ObservedRun
    deadline: float


def observe_in_time(task):
    """Return the observation of a `RunWithDeadline`, which is not begun after the deadline."""
    left = task.deadline - time.time()
    if left <= 0.0:
        return RunObservation(blank_values(task.run), RunCost(cpu=0.0), STOPPED,
                              LATE)
    return observe(task.run._replace(most_cpu=min(task.run.most_cpu, left)))


def blank_values(run):
    """Return the values of a run that did not begin."""
    return {text: np.full((len(run.times), 0), np.nan) for text in run.quantities}
