"""Table 4 over several trainings: whose errors are whose, and what is said of all."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.ldm import superres_seeds as experiment
from validation.ldm.studies import TORSION

OFF = {"torsion-0": 4.0, "torsion-1": 1.0, "torsion-2": 2.0}        # [%]


@pytest.fixture
def made_up(monkeypatch):
    """Two tests without their runs: x of all points grows with time; a reduced run on a map is off
    by OFF of x, twice as much with the linear projection, and by much more between the levels.
    """
    x = np.ones((61, 8, 3)) + 0.5 * np.arange(61)[:, None, None]
    problem = SimpleNamespace(bodies=())
    between = np.where(np.arange(61) % experiment.REFINE, 7.0, 0.01)[:, None, None]
    for name, value in {
            "TORSION": TORSION._replace(test=TORSION.test[:2]), "trained": lambda name: OFF[name],
            "ldm_full_model": lambda scene: SimpleNamespace(X=x[0], problem=problem),
            "build": lambda scene: None, "threads_for": lambda bodies: nullcontext(),
            "history": lambda problem: SimpleNamespace(x=x),
            "reduced": lambda one, off, way: x * (1.0 + off * between * (
                1 + (way.projection == "linear")))}.items():
        monkeypatch.setattr(experiment, name, value)


def test_errors_of_trainings_their_median_and_their_spread(tmp_path, made_up):
    setting = RunSetting("standard", tmp_path, targets=targets.load())
    assert run_all([experiment.seeds.experiment], setting) == []
    found = {record.target.removeprefix("ldm.table4-seeds."): record.value
             for record in ProfileResults(tmp_path).records("ldm.table4-seeds")}
    for factor, name in ((1.0, "lagrangian_nonlinear"), (2.0, "lagrangian_linear")):
        for net, off in OFF.items():
            assert found[f"{name}.{net}"] == pytest.approx(factor * off)
        assert found[f"{name}.median"] == pytest.approx(2.0 * factor)
        assert found[f"{name}.spread"] == pytest.approx(4.0)
    assert len(found) == 1 + 10
