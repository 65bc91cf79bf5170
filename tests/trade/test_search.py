import numpy as np
import pytest
from model_runs import EXACT, ModelRuns, search_of
from sweep_scenes import FLIGHT, observed_run, scene_of

from mpm_ref.executor import open_executor
from mpm_ref.scene import loads
from mpm_ref.sweep.observation import FINISHED, REFUSED, STOPPED, RunCost, RunObservation
from mpm_ref.sweep.runs import SceneRuns
from mpm_ref.sweep.setting import setting
from mpm_ref.sweep.store import RunStore
from mpm_ref.trade.candidates import GRIDS, neighbouring_grid, pairs, single_knobs
from mpm_ref.trade.search import PERTURBED, TradeSearch, guessed_ratio


def test_the_cheapest_setting_that_keeps_the_error_is_recommended():
    search = search_of(ModelRuns())
    search.run()
    best, runs = search.best(), search.observations
    assert search.horizon() == 1.0
    assert best.get("transfer") == "apic"
    assert best.get("cfl") == 0.9
    assert search.error_of(best) + search.reference_error() <= 0.01
    cheaper = [s for s in search.settings() if runs[s].cost.cpu < runs[best].cost.cpu]
    assert cheaper
    assert not any(search.keeps(s) for s in cheaper)


def test_references_are_refined_until_half_the_error():
    search = search_of(ModelRuns())
    search.run()
    assert search.reference_error() <= 0.005
    assert min(search.levels) > 1 / 64


def test_other_workers_run_candidates_beside_the_reference():
    runs = ModelRuns()
    search = search_of(runs)
    search.start()
    assert search.side_runs(1e9) == []
    runs.workers = 2
    cpu = search.expected_cpu(setting(dx=0.25))
    beside = search.side_runs(cpu)
    assert beside
    assert sum(search.expected_cpu(chosen) for chosen in beside) <= cpu


def test_without_convergence_nothing_is_recommended():
    search = search_of(ModelRuns(order=0.2))
    search.run()
    assert search.horizon() == 0.0
    assert search.best() is None


def test_a_grid_that_does_not_fit_into_the_budget_is_not_run():
    runs = ModelRuns(left=20.0)
    search = search_of(runs, error=1e-3)
    search.run()
    assert min(label.get("dx", 1.0) for label in runs.labels if label != PERTURBED) == 0.5
    assert search.best() is None


def test_chaos_ends_the_horizon():
    runs = ModelRuns()
    runs.chaos = 0.02
    search = search_of(runs)
    search.run()
    assert search.chaos == 0.625
    assert search.horizon() == 0.5
    assert search.best() is not None


def test_chaos_begins_with_the_first_quantity_that_diverges():
    runs = ModelRuns()
    runs.chaos = 0.02
    search = search_of(runs)
    search.start()
    for quantities in (("kinetic", "positions"), ("positions", "kinetic")):
        search.quantities = quantities
        assert search.time_of_divergence() == 0.625
    search.quantities = ("kinetic",)
    assert search.time_of_divergence() == 0.875


def test_a_setting_that_fails_is_recorded_and_not_recommended():
    runs = ModelRuns()
    runs.fails = lambda text: "apic" in text
    search = search_of(runs)
    search.run()
    assert any(search.observations[s].outcome == REFUSED for s in search.settings())
    assert "apic" not in search.best().text


def test_a_grid_that_fails_ends_the_reference():
    runs = ModelRuns()
    runs.fails = lambda text: text == "dx x 0.25"
    search = search_of(runs, error=1e-3)
    search.run()
    assert search.levels == (4.0, 2.0, 1.0, 0.5)


def test_another_family_raises_the_error_of_the_reference():
    runs = ModelRuns()
    search = search_of(runs)
    search.start()
    search.refine()
    own, run = search.reference_error(), runs.run
    values = dict.fromkeys(("positions", "kinetic"), EXACT + 0.2)
    shifted = RunObservation(values, RunCost(1.0, 1.0, 1, 1, 1), FINISHED)
    runs.run = lambda label: shifted if "apic" in label.text else run(label)
    search.compare_families()
    assert search.references["positions"].error[-1] > 5.0 * own


def test_expected_cost_follows_the_grid_and_the_knob():
    search = search_of(ModelRuns())
    search.start()
    assert search.expected_cpu(setting(dx=0.25)) == pytest.approx(64.0)
    assert search.expected_cpu(setting(dx=1.0, particles=2.0)) == pytest.approx(4.0)
    assert guessed_ratio(scene_of(FLIGHT), setting(cfl=0.25)) == 2.0


def test_single_knobs_are_not_those_of_the_scene():
    texts = [one.text for one in single_knobs(scene_of(FLIGHT))]
    assert "cfl 0.5" not in texts
    assert "transfer mls" not in texts
    assert "degree 1, transfer flip 0.95" in texts
    assert len(set(texts)) == len(texts)
    implicit = [one.text for one in single_knobs(loads('integrator = "hot"' + FLIGHT))]
    assert "integrator explicit, cfl 0.5" in implicit
    assert "eps 0.001" in implicit
    assert "eps 1e-07" not in implicit


def test_neighbouring_grids_end_with_the_list():
    assert neighbouring_grid(1.0) == 1.5
    assert neighbouring_grid(1.0, -1) == 0.75
    assert neighbouring_grid(GRIDS[0]) is None
    assert neighbouring_grid(GRIDS[-1], -1) is None


def test_pairs_change_different_knobs():
    a, b, c = setting(cfl=0.9), setting(cfl=0.25), setting(transfer="apic")
    assert pairs([a, b, c]) == [a | c, b | c]


def test_a_real_scene_keeps_the_error_against_the_exact_motion(tmp_path):
    scene = scene_of(FLIGHT)
    run = observed_run(scene)
    with open_executor(workers=1) as executor:
        runs = SceneRuns(run, executor, RunStore(tmp_path), budget=60.0)
        search = TradeSearch(scene, runs, ("positions",), np.array(run.times), 0.02)
        search.run()
        t = np.array(run.times)[:, None, None]
        X = np.concatenate([X for _, X in run.probes])[None]
        exact = X + t * [1.0, 0.5] - 0.5 * t**2 * [0.0, 9.8]
        best = search.observations[search.best()].values["positions"]
        error = np.sqrt(np.mean((best - exact.reshape(len(t), -1)) ** 2, axis=1))
        assert error.max() / search.references["positions"].scale[-1] <= 0.02
        assert search.horizon() == scene.end
        count = runs.count
        again = TradeSearch(scene, runs, ("positions",), np.array(run.times), 0.02)
        again.run()
        assert runs.count == count
        assert again.best() == search.best()


def test_a_stopped_setting_is_not_an_error():
    search = search_of(ModelRuns())
    search.start()
    stopped = RunObservation({"positions": EXACT[:, :0]}, RunCost(cpu=0.0), STOPPED)
    search.observations[setting(cfl=0.1)] = stopped
    assert search.error_of(setting(cfl=0.1)) == np.inf
    assert not search.keeps(setting(cfl=0.1))
