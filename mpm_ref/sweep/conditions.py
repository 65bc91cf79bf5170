"""Boundary conditions that also sum the impulses of their parts over a run."""

from dataclasses import replace

import numpy as np

from ..scene.quantity_records import part_names

EVEN = 1e-12        # of a step: a step that begins before another ended replaces it


class ImpulseRecorder:
    """Conditions of a problem, with the impulse that each part gave to the matter so far."""

    def __init__(self, conditions, names, dim):
        self._conditions, self._names = conditions, names
        self._total, self._steps = np.zeros((len(names), dim)), []

    def __getattr__(self, name):
        return getattr(self._conditions, name)

    def apply(self, grid, t, dt):
        """Apply the conditions in the step of length dt [s] that ends at t [s]."""
        return self._noted(self._conditions.apply(grid, t, dt), t, dt)

    def apply_all(self, grids, t, dt):
        """Apply the conditions to the grids of several velocity fields."""
        return self._noted(self._conditions.apply_all(grids, t, dt), t, dt)

    def _noted(self, J, t, dt):
        if J is not None:
            while self._steps and self._steps[-1][0] > t - dt + EVEN * dt:
                self._steps.pop()           # of a step that was rejected
            self._steps.append((t, J))
        return J

    def impulses(self):
        """Return {part: impulse (d,) [N s]} since the start of the run."""
        for _, J in self._steps:
            self._total = self._total + J
        self._steps = []
        return dict(zip(self._names, self._total, strict=True))


def record_impulses(problem, scene):
    """Return (problem with an `ImpulseRecorder`, the recorder); (problem, None) without
    conditions, or for an implicit step, which does not state impulses.
    """
    if problem.conditions is None or problem.integrator != "explicit":
        return problem, None
    recorder = ImpulseRecorder(problem.conditions, part_names(scene), problem.dim)
    return replace(problem, conditions=recorder), recorder
