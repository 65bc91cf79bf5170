"""The weight of prescribed samples is chosen on training runs, and judged on test runs."""

from types import SimpleNamespace

import numpy as np

from mpm_ref.rom.study.errors import PositionErrors
from validation.ldm import driven_weights as experiment
from validation.ldm.studies import POKES

TRAINING = dict(zip(experiment.WEIGHTS, (5.0, 3.0, 2.0, 4.0, 4.5, 4.7), strict=True))
BEST = 16.0
TEST = {1.0: 8.0, BEST: 6.0}


def test_the_best_weight_of_training_runs_is_tested(monkeypatch):
    found, nothing = {}, SimpleNamespace(X=np.zeros((7, 3)), scale="runs", total=9)
    one = experiment.Weighted("network", POKES, None, np.zeros(6), 4)
    monkeypatch.setattr(experiment, "maps", lambda: (one,))
    monkeypatch.setattr(experiment, "training_references", lambda study, count: nothing)
    monkeypatch.setattr(experiment, "references", lambda study, count: nothing)
    monkeypatch.setattr(experiment, "errors_of", lambda run, about, runs, options: PositionErrors(
        *3 * [{"training": TRAINING, "test": TEST}[about[1]][options.driven_weight]]))
    tables = {}
    run = SimpleNamespace(progress=lambda names, noun: names,
                          record=lambda name, value, **rest: found.update({name: value}),
                          table=lambda name, columns, rows: tables.update({name: rows}))
    experiment.driven_weights(run)
    assert found["ldm.driven-weight.network.all.gain"] == 0.75
    assert found["ldm.driven-weight.network.50"] == 600.0
    assert [row[1:4] for row in tables["errors"]] == [
        *((w, 7, "training") for w in experiment.WEIGHTS),
        *((w, n, "test") for n in (50, 7) for w in (1.0, BEST))]


def test_training_runs_are_those_of_the_study():
    found = experiment.training_references(POKES, 2)
    runs = POKES.train[0], POKES.train[len(POKES.train) // 2]
    assert [one.problem.title for one in found.cases] == 2 * ["LDM: poke and recover"]
    np.testing.assert_array_equal(found.x, POKES.run(runs).x)
