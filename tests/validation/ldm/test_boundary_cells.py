"""Which runs the experiment on cut sub-cells makes, and what it compares them with."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.full_model import ldm_full_model
from validation.common.scenes import with_
from validation.ldm import boundary_cells as experiment
from validation.ldm.networks import trained
from validation.ldm.references import References
from validation.ldm.studies import TORSION


@pytest.fixture
def tests():
    """A torsion run of one step, which the body swells in."""
    one = ldm_full_model(with_(TORSION.scene(0.0, 0.8), steps=1))
    return References("torsion", (one,), (np.array([one.X, 1.01 * one.X]),), 1)


def test_the_standard_profile_has_both_projections_and_another_reference(monkeypatch, tests):
    found, tables = {}, {}
    monkeypatch.setattr(experiment, "references", lambda study, count: tests)
    monkeypatch.setattr(experiment, "regular_references", lambda tests: tests)
    monkeypatch.setattr(experiment, "mass_errors", lambda full, model, cells:
                        [0.03, -0.05] if cells == "whole" else [0.001])
    monkeypatch.setattr(References, "network_errors", lambda self, net, options, seed=0:
                        PositionErrors(*3 * [0.01 * options.per_cell + 0.001 * int(net[-1])]))
    run = SimpleNamespace(profile="standard", choose=lambda quick, standard: standard,
                          progress=lambda what, noun: what, cached=lambda name, make: make(),
                          record=lambda name, value, **rest: found.update({name: value}),
                          table=lambda name, columns, rows: tables.update({name: rows}))
    experiment.boundary_cells(run)
    names = {name.removeprefix("ldm.boundary-cells.") for name in found}
    runs = {f"cut.eulerian_{projection}.{points}" for projection in ("nonlinear", "linear")
            for points in ("50", "all", "all.3")}
    assert names == runs | {"mass.whole", "mass.cut", "regular.lagrangian_linear.all",
                            "regular.cut.eulerian_linear.all", "regular.full"}
    assert found["ldm.boundary-cells.cut.eulerian_linear.all.3"] == pytest.approx(3.1)
    assert found["ldm.boundary-cells.mass.whole"] == pytest.approx(5.0)
    assert found["ldm.boundary-cells.regular.full"] == 0.0
    assert len(tables["errors"]) == 3 * (6 + 2)


def test_cut_cells_have_the_body_s_mass(tests):
    """At the end of a training run, where whole cells miss it by several per cent."""
    model = trained("torsion-0")
    few = model._replace(xhat=model.xhat[-2:])
    whole, cut = (np.abs(experiment.mass_errors(tests.cases[0], few, cells)).max()
                  for cells in ("whole", "cut"))
    assert cut < 0.003 < 0.01 < whole


def test_full_runs_of_regular_points_are_near_those_of_random_ones(monkeypatch):
    few = TORSION._replace(scene=lambda v, w: with_(TORSION.scene(v, w), steps=3),
                           test=TORSION.test[-1:])
    monkeypatch.setattr(experiment, "TORSION", few)
    one = ldm_full_model(few.scene(*few.mu[few.test[0]]))
    tests = References("torsion", (one,), tuple(few.run(few.test).x), 1)
    off = experiment.difference(tests, experiment.regular_references(tests))
    assert 0.0 < off.displacement < 0.3
