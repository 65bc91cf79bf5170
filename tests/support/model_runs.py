"""Runs whose error and cost are formulas of the setting: a twin of `SceneRuns` for searches."""

import numpy as np
from sweep_scenes import FLIGHT, scene_of

from mpm_ref.sweep.observation import FINISHED, REFUSED, RunCost, RunObservation
from mpm_ref.sweep.setting import setting
from mpm_ref.trade.search import PERTURBED, TradeSearch

TIMES = np.linspace(0.0, 1.0, 9)
EXACT = np.stack((np.cos(TIMES), TIMES), axis=1)
PATTERN = np.stack((TIMES, TIMES**2), axis=1)


class ModelRuns:
    """Runs whose error and cost are formulas of the setting; a twin of `SceneRuns`."""

    workers = 1

    def __init__(self, order=1.0, left=1e9):
        self.order, self.left, self.labels = order, left, []
        self.probes = (("disk", np.array([[0.25, 0.45], [0.75, 0.95]])),)
        self.fails, self.chaos = lambda text: False, 0.0
        self.tears, self.answers = lambda chosen: False, lambda run: run

    def has(self, request):
        return False

    def observe(self, requests):
        return {label: self.answers(self.run(label)) for label in requests}

    def run(self, label):
        self.labels.append(label)
        chosen = setting(dx=1.0) if label == PERTURBED else label
        dx, text = chosen.get("dx", 1.0), chosen.text
        error = 0.05 * dx**self.order * (0.3 if chosen.get("transfer") == "apic" else 1.0)
        error /= chosen.get("particles", 1.0) ** 3
        values = EXACT + error * PATTERN
        later = values.copy()
        if label == PERTURBED:
            values = values + self.chaos * (TIMES > 0.6)[:, None]
            later = later + self.chaos * (TIMES > 0.8)[:, None]
        cpu = dx**-3.0 * (chosen.get("particles", 1.0) ** 2) * (
            0.5 if chosen.get("cfl") == 0.9 else 1.0)
        if self.fails(text):
            return RunObservation({"positions": values[:, :0]}, RunCost(), REFUSED, "refused")
        both = {"positions": values, "kinetic": later}
        warnings = ("gap: torn",) if self.tears(chosen) else ()
        return RunObservation(both, RunCost(cpu, cpu, 10, 100, 1), FINISHED, warnings=warnings)


def search_of(runs, error=0.01):
    return TradeSearch(scene_of(FLIGHT), runs, ("positions",), TIMES, error)
