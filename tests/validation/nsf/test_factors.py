"""NSF: where a speed-up comes from, on a small study and a clock that the test winds."""

import numpy as np
import pytest
from small_toys import Records

from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.samples import cell_samples
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.nsf import factors, reduced_runs
from validation.nsf.factors import RunPlan
from validation.nsf.studies import jelly

STUDY = jelly(4)._replace(train=(0.3, 0.5), test=(0.35, 0.4), samples=40,
                          sizes=Sizes(r=3, modes=8, tau=12, C=12, smoothing=1e-4))
DRAWN, WEIGHTED, LONGER, CELLS = (RunPlan(30, factors.DRAWN, 1.0), RunPlan(12, factors.WEIGHTED,
                                                                           1.0),
                                  RunPlan(30, factors.DRAWN, 2.0), RunPlan(4, factors.CELLS, 1.0))


@pytest.fixture(scope="module")
def one():
    """The small study."""
    return reduced_runs.fit_study(STUDY)


@pytest.fixture
def clock(monkeypatch):
    """Every state takes a second; states of full-order runs, of which the last one is kept alone,
    take 50.
    """
    now = [0.0]

    def passing(work, spent):
        def run(*given):
            for state in work(*given):
                now[0] += spent
                yield state
        return run

    reduced_run = factors.reduced_run
    monkeypatch.setattr(factors, "reduced_run", passing(reduced_run, 1.0))
    monkeypatch.setattr(factors, "simulate", passing(factors.simulate, 50.0))
    monkeypatch.setattr(factors, "perf_counter", lambda: now[0])


@pytest.mark.usefixtures("clock")
def test_whole_runs_are_clocked_each_from_its_start(one):
    steps = STUDY.run(0.35).steps
    full, reduced = factors.median_seconds(one, (DRAWN, LONGER), 3)
    assert full == 100.0                        # the first state and the last
    assert reduced == [steps + 1, steps // 2 + 1]


def test_samples_of_a_way_are_drawn_or_weighed(one):
    (drawn,), (weighed,), (cells,) = (factors.run_options(one, plan).samples
                                      for plan in (DRAWN, WEIGHTED, CELLS))
    assert (len(drawn.points), drawn.weights) == (30, None)
    assert len(weighed.points) <= 12
    assert (weighed.weights > 0.0).all()
    scene = nsf_full_model(STUDY.run(0.35))
    expected = cell_samples(one.fields, scene.problem, len(scene.X), 4, 0)
    assert np.array_equal(cells.points, expected.points)
    assert not np.array_equal(weighed.points, cells.points)
    assert factors.run_options(one, LONGER).dt_factor == 2.0


def test_samples_with_weights_are_anywhere(one):
    """Those that are drawn are of the study's column, and others later."""
    study = one.study._replace(column=2.0, later=10)
    for plan in (DRAWN, WEIGHTED, CELLS):
        own = plan.apply(one._replace(study=study)).study
        assert (own.column, own.later) == ((2.0, 10) if plan is DRAWN else (None, None))
        assert own.by_cell is (plan is CELLS)


def test_the_printed_ways_are_among_those_of_the_standard_profile():
    for name, plan in factors.PRINTED.items():
        assert plan in factors.PLANS["standard", name]


def test_ways_have_names_that_differ():
    for plans in factors.PLANS.values():
        assert len({plan.label for plan in plans}) == len(plans)
    assert WEIGHTED.label == "weighed.12.x1"


@pytest.mark.usefixtures("clock")
def test_errors_and_times_are_recorded(one, tmp_path, monkeypatch):
    monkeypatch.setattr(factors, "studies", lambda run: {"metal": STUDY, "cake": STUDY})
    monkeypatch.setattr(factors, "fit_study", lambda study: one._replace(
        study=study, tests={value: one.tests[value] for value in study.test}))
    monkeypatch.setattr(factors, "PRINTED", {"metal": WEIGHTED, "cake": DRAWN})
    monkeypatch.setattr(factors, "PLANS", {("quick", "metal"): (DRAWN, WEIGHTED),
                                           ("quick", "cake"): (CELLS,)})
    assert not run_all([factors.factors.experiment], RunSetting("quick", tmp_path,
                                                                  targets=targets.load()))
    found = ProfileResults(tmp_path)
    table = found.table("nsf.factors", "ways")
    assert table["scene"].tolist() == ["metal", "metal", "cake"]
    for k, plan in enumerate((DRAWN, WEIGHTED, CELLS)):
        expected = plan.apply(one).errors(0.4, plan.samples, 0, 1.0, plan is not DRAWN)
        assert table["error"][k] == table["largest"][k] == pytest.approx(expected.errors.origin)
        assert table["displacement"][k] == pytest.approx(expected.errors.displacement)
        assert table["stress"][k] == pytest.approx(expected.stress)
        assert table["kept"][k] == expected.samples
    assert table["speedup"] == pytest.approx(100.0 / table["reduced"])
    records = {r.target: r for r in found.records("nsf.factors")}
    start = "nsf.factors.metal.drawn.30.x1"
    assert records[f"{start}.error"].value == pytest.approx(100.0 * table["error"][0])
    assert records[f"{start}.speedup"].value == table["speedup"][0]
    assert np.isfinite(table["points"]).all()
    assert records["nsf.metal.time_full"].value == 100.0
    assert records["nsf.metal.time_reduced.modes"].value == table["reduced"][1]
    assert "nsf.cake.time_full" not in records
    note = records["nsf.factors.cake.cells.4.x1.speedup"].note
    assert note.startswith("4 cells of samples with weights at most, "
                           f"{table['kept'][2]:g} samples on average, steps 1 times")


def test_the_cake_is_smoother_and_has_more_modes():
    found = factors.studies(Records())
    assert [found[name].sizes.smoothing for name in ("metal", "cake")] == [1e-2, 1.0]
    assert [found[name].sizes.modes for name in ("metal", "cake")] == [20, 80]
    assert {(Records.profile, name) for name in found} <= {*factors.PLANS}
