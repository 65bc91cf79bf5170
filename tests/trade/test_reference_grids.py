"""The grids of the reference of a search, and how long it is known."""

from dataclasses import replace

import numpy as np
import pytest
from model_runs import EXACT, TIMES, ModelRuns, search_of
from sweep_scenes import FLIGHT, scene_of

from mpm_ref.scene import SceneError, loads
from mpm_ref.sweep.observation import FINISHED, RunCost, RunObservation
from mpm_ref.sweep.setting import setting
from mpm_ref.trade.search import (
    FINEST,
    PERTURBED,
    REFERENCE_PART,
    TradeSearch,
)


def test_no_grid_is_finer_than_the_finest():
    runs = ModelRuns()
    search = TradeSearch(scene_of(FLIGHT), runs, ("positions",), TIMES, 1e-5, finest=0.25)
    search.run()
    assert search.levels[-1] == 0.25


def test_refinement_ends_where_it_no_longer_helps():
    runs = ModelRuns()
    runs.chaos = 0.02               # no grid is known past it
    search = search_of(runs)
    search.run()
    assert search.horizon() == 0.5
    assert search.levels[-1] == 1 / 64      # two grids past that which knows the first half


def test_a_grid_that_is_stored_is_always_taken():
    runs = ModelRuns()
    runs.chaos, runs.has = 0.02, lambda request: request.scene.dx >= 0.1 / 256.0
    search = search_of(runs)
    search.finest = 0.0
    search.run()
    assert search.levels[-1] == FINEST      # update_references looks no farther
    runs = ModelRuns(left=0.0)
    runs.has = lambda request: request.scene.dx > 0.02
    search = search_of(runs)
    search.run()
    assert search.levels[-1] == 0.25


def test_a_stored_grid_is_taken_also_where_the_error_needs_none():
    runs = ModelRuns()
    search = search_of(runs, error=0.5)
    search.run()
    assert search.levels[-1] > 1 / 16
    runs = ModelRuns()
    runs.has = lambda request: request.scene.dx > 0.1 / 17.0
    finer = search_of(runs, error=0.5)
    finer.run()
    assert finer.levels[-1] == 1 / 16
    assert finer.reference_error() < search.reference_error()


def test_a_grid_past_one_that_failed_is_no_reference():
    runs = ModelRuns()
    runs.fails = lambda text: text == "dx x 0.25"
    search = search_of(runs, error=1e-3)
    search.run()
    search.observe([setting(dx=0.125)], most_cpu=np.inf)
    search.update_references()
    assert search.levels == (4.0, 2.0, 1.0, 0.5)


def test_four_grids_are_the_least_where_the_budget_allows():
    search = search_of(ModelRuns(), error=1.0)
    search.run()
    assert search.levels == (4.0, 2.0, 1.0, 0.5)
    runs = ModelRuns(left=10.0)
    search = search_of(runs, error=1.0)
    search.run()
    assert search.levels == (4.0, 2.0, 1.0)
    assert all(label.get("dx", 1.0) > 0.5 for label in runs.labels if label != PERTURBED)


def test_the_horizon_ends_where_the_finest_grid_misses_the_error():
    search = search_of(ModelRuns(), error=0.1)
    search.run()
    assert search.horizon() == 1.0
    reference = search.references["positions"]
    off = reference.values + 0.2 * (TIMES > 0.6)[:, None]
    search.references["positions"] = replace(reference, values=off)
    assert reference.error[-1] < REFERENCE_PART * search.error
    finest = search.observations[setting(dx=search.levels[-1])]
    assert search.errors_of_run(finest)[-1] > search.error
    assert search.horizon() == 0.5
    assert search.best() is not None


def test_what_is_asked_at_the_end_holds_there_or_not_at_all():
    runs = ModelRuns()
    run = runs.run

    def named(label):
        done = run(label)
        return replace(done, values={"positions@end": done.values["positions"]})
    runs.run = named
    search = TradeSearch(scene_of(FLIGHT), runs, ("positions@end",), TIMES, 0.01)
    search.run()
    assert search.horizon() == 1.0
    runs.chaos = 0.02
    search = TradeSearch(scene_of(FLIGHT), runs, ("positions@end",), TIMES, 0.01)
    search.run()
    assert search.chaos == 0.625
    assert search.horizon() == 0.0
    assert search.best() is None


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


@pytest.mark.parametrize(("head", "other"), [
    ("", "apic"), ('integrator = "hot"\n', "mls"),
    ('integrator = "hot"\nscheme = { transfer = "flip" }\n', "apic")])
def test_the_other_transfer_is_one_that_the_integrator_has(head, other):
    search = TradeSearch(loads(head + FLIGHT), ModelRuns(), ("positions",), TIMES, 0.01)
    search.start()
    search.refine()
    assert search.compared_with is None
    search.compare_families()
    assert search.compared_with == other
    chosen = setting(dx=search.levels[-2], transfer=other)
    assert chosen in search.settings()
    assert not isinstance(search._scene_at(chosen), SceneError)


def test_without_another_transfer_nothing_is_compared():
    runs = ModelRuns()
    runs.fails = lambda text: "apic" in text
    search = search_of(runs)
    search.run()
    assert search.compared_with is None
