"""NSF: where Gauss-Newton ends, on a small study."""

from types import SimpleNamespace

import pytest
from record_verdicts import verdict

from mpm_ref.rom.fields.pod_fields import Sizes
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.nsf import reduced_runs, stop
from validation.nsf.stop import StoppedRun, largest_change, stopped_run
from validation.nsf.studies import jelly

STUDY = jelly(4)._replace(train=(0.3, 0.5), test=(0.4,), samples=40,
                          sizes=Sizes(r=3, modes=8, tau=12, C=12, smoothing=1e-4))
FOUND = StoppedRun(0.1, 0.2, 2.9, 3.0, 4.0)


@pytest.fixture(scope="module")
def one():
    """The small study."""
    return reduced_runs.fit_study(STUDY)


def test_without_a_tolerance_it_is_the_usual_run(one):
    found, usual = stopped_run(one, (0.4, 1), None), one.errors(0.4, 40, 1)
    assert (found.origin, found.stress) == (usual.errors.origin, usual.stress)
    assert found.mean == pytest.approx(sum(usual.iterations) / len(usual.iterations))
    assert found.most == max(usual.iterations)


def test_a_tolerance_saves_iterations(one):
    none, some, large = (stopped_run(one, (0.4, 0), tolerance) for tolerance in (None, 1e-6, 1e3))
    assert none.mean > some.mean > large.median == 1.0
    assert 0.0 < largest_change({0: some}, {0: none}) < 1e-3
    assert largest_change({0: large}, {0: none}) > largest_change({0: some}, {0: none})


def test_the_largest_change_is_of_any_run_and_of_either_error():
    before = {0: FOUND, 1: FOUND}
    assert largest_change({0: FOUND._replace(origin=0.09), 1: FOUND}, before) == pytest.approx(0.1)
    assert largest_change({0: FOUND, 1: FOUND._replace(stress=0.25)}, before) == pytest.approx(0.25)


@pytest.mark.parametrize(("change", "misses"), [
    ({}, set()), ({"origin": 0.1002}, {"1e-6.change"}), ({"median": 3.5}, {"1e-6.iterations"})])
def test_one_tolerance_is_judged(tmp_path, monkeypatch, change, misses):
    one = SimpleNamespace(study=STUDY._replace(test=(0.4, 0.45, 0.5)), scale="a size")
    monkeypatch.setattr(stop, "fit_study", lambda study: one)
    monkeypatch.setattr(stop, "step_seconds", lambda one, case, tolerance: 1.0 + bool(tolerance))
    monkeypatch.setattr(stop, "stopped_run", lambda one, case, tolerance: (
        FOUND._replace(**change) if tolerance else FOUND))
    setting = RunSetting("quick", tmp_path, targets=targets.load())
    assert run_all([stop.stop.experiment], setting) == []
    results = ProfileResults(tmp_path)
    found = {r.target.removeprefix("nsf.stop."): r for r in results.records("nsf.stop")}
    assert {id for id, r in found.items() if verdict(r) == "miss"} == {
        f"{name}.{miss}" for name in ("jelly", "metal") for miss in misses}
    assert found["jelly.1e-4.cost"].value == 2.0
    assert verdict(found["jelly.1e-4.change"]) == verdict(found["jelly.none.iterations"]) == "info"
    assert list(results.table("nsf.stop", "runs")["value"]) == 2 * [*3 * [0.4], *3 * [0.45]]
