from dataclasses import replace

import numpy as np
import pytest
from model_runs import EXACT, TIMES, ModelRuns, search_of
from sweep_scenes import FLIGHT, observed_run, scene_of

from mpm_ref.executor import open_executor
from mpm_ref.scene import SceneError, loads
from mpm_ref.sweep.observation import FINISHED, REFUSED, STOPPED, RunCost, RunObservation
from mpm_ref.sweep.runs import SceneRuns
from mpm_ref.sweep.setting import scene_at, setting
from mpm_ref.sweep.store import RunStore
from mpm_ref.trade.candidates import GRIDS, pairs, single_knobs
from mpm_ref.trade.search import (
    CHEAPER,
    HOPELESS,
    PERTURBED,
    REFERENCE_PART,
    TradeSearch,
    guessed_ratio,
    without_grid,
)


def test_the_cheapest_setting_that_keeps_the_error_is_recommended():
    search = search_of(ModelRuns())
    search.run()
    best = search.best()
    assert search.horizon() == 1.0
    assert search.error_of(best) + search.reference_error() <= 0.01
    singles = single_knobs(search.scene)
    every = [family | setting(dx=factor) for family in [setting(), *singles, *pairs(singles)]
             for factor in GRIDS]
    search.observe(every, most_cpu=np.inf)
    assert search.observations[search.best()].cost.cpu == search.observations[best].cost.cpu


def test_walks_begin_on_the_coarsest_grid_and_end_where_the_error_is_kept():
    search = search_of(ModelRuns())
    search.start()
    search.refine()
    search.walk([setting(transfer="apic"), setting(cfl=0.25)])
    def grids(**knobs):
        return [s.get("dx") for s in search.settings() if without_grid(s) == setting(**knobs)]
    kept = grids(transfer="apic")
    assert kept == list(GRIDS[:len(kept)])
    keeps = [search.keeps(setting(transfer="apic", dx=factor)) for factor in kept]
    assert keeps == [False] * (len(kept) - 1) + [True]
    dear = grids(cfl=0.25)
    assert dear == list(GRIDS[:len(dear)])
    assert not any(search.keeps(setting(cfl=0.25, dx=factor)) for factor in dear)
    following = setting(cfl=0.25, dx=GRIDS[len(dear)])
    assert search.expected_cpu(following) > search.expected_cpu(search.best()) / CHEAPER


def test_a_family_that_fails_on_coarse_grids_goes_on():
    runs = ModelRuns()
    runs.fails = lambda text: "apic" in text and text.startswith(("dx x 4", "dx x 3"))
    search = search_of(runs)
    search.run()
    assert "apic" in search.best().text


def test_runs_past_the_best_cost_are_stopped():
    search = search_of(ModelRuns())
    search.start()
    search.refine()
    most, observe = [], search.runs.observe

    def note(requests):
        most.extend(request.most_cpu for request in requests.values())
        return observe(requests)
    search.runs.observe = note
    cost = search.observations[search.best()].cost.cpu
    search.walk([setting(transfer="apic")])
    assert most[0] == HOPELESS * cost
    assert len(most) > 1
    assert (np.array(most) <= HOPELESS * cost).all()


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
    assert search.levels[-1] == 1 / 32      # one grid past that which knows the first half


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


def test_grids_that_the_scene_cannot_have_are_skipped():
    text = "walls = { low = [2, 2], high = [12, 12] }\n" + FLIGHT
    search = TradeSearch(loads(text), ModelRuns(), ("positions",), TIMES, 0.01)
    possible = [factor for factor in GRIDS
                if not isinstance(search._scene_at(setting(dx=factor)), SceneError)]
    assert 0 < len(possible) < len(GRIDS)
    search.run()
    tried = {s.get("dx", 1.0) for s in search.settings() if without_grid(s) != setting()}
    assert tried & set(GRIDS)
    assert tried & set(GRIDS) <= set(possible)


def test_at_the_end_only_the_last_state_counts():
    runs = ModelRuns()
    run = runs.run

    def off_in_the_middle(label):
        done = run(label)
        if label != setting(cfl=0.9, dx=1.0):
            return replace(done, values={"positions@end": done.values["positions"]})
        middle = (TIMES == 0.5)[:, None] * 10.0
        return replace(done, values={"positions@end": done.values["positions"] + middle})
    runs.run = off_in_the_middle
    search = TradeSearch(scene_of(FLIGHT), runs, ("positions@end",), TIMES, 0.01)
    search.start()
    search.refine()
    chosen = [setting(dx=1.0), setting(cfl=0.9, dx=1.0)]
    search.observe(chosen, most_cpu=np.inf)
    assert search.error_of(chosen[1]) == search.error_of(chosen[0]) < 0.1


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


def test_a_setting_that_does_not_fit_the_scene_is_refused():
    observe = ModelRuns.observe
    runs = ModelRuns()

    def refuse(requests):
        return {label: RunObservation({}, RunCost(), REFUSED, str(request.scene))
                if isinstance(request.scene, SceneError) else observe(runs, {label: request})[label]
                for label, request in requests.items()}
    runs.observe = refuse
    search = search_of(runs)
    search.observe([setting(eps=1e-3)])
    done = search.observations[setting(eps=1e-3)]
    assert (done.outcome, "solves nothing" in done.message) == (REFUSED, True)


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


@pytest.mark.parametrize(("head", "other"), [
    ("", "apic"), ('integrator = "hot"\n', "flip"),
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


def test_knobs_that_give_the_same_scene_are_tried_once():
    singles = search_of(ModelRuns()).singles()
    assert setting(particles=0.5) in singles
    assert setting(particles=2 / 3) not in singles      # both have one point per cell and axis


def test_settings_of_another_scene_are_tried():
    runs, scenes = ModelRuns(), {}
    observe, other = runs.observe, loads(FLIGHT.replace("E = 1e4", "E = 2e4"))

    def note(requests):
        scenes.update({label: request.scene for label, request in requests.items()})
        return observe(requests)
    runs.observe = note
    search = search_of(runs)
    search.others = {"stiff": other}
    search.run()
    tried = [label for label in search.settings() if label.get("scene") == "stiff"]
    assert tried
    assert other.body != search.scene.body
    assert all(scenes[label].body == scene_at(other, without_scene(label)).body for label in tried)
    assert "scene" not in search.best().text


def without_scene(chosen):
    return setting(**{name: value for name, value in chosen.items if name != "scene"})


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
    assert [text for text in texts if "sampling" in text] == ["sampling poisson"]
    assert "degree 1, transfer flip 0.95" in texts
    assert len(set(texts)) == len(texts)
    implicit = [one.text for one in single_knobs(loads('integrator = "hot"' + FLIGHT))]
    assert "integrator explicit, cfl 0.5" in implicit
    assert "eps 0.001" in implicit
    assert "eps 1e-07" not in implicit
    assert "transfer mls" not in implicit           # it has no implicit step
    assert "transfer pic" in implicit


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
        runs = SceneRuns(run, executor, RunStore(tmp_path), budget=0.0)     # all are stored
        again = TradeSearch(scene, runs, ("positions",), np.array(run.times), 0.02)
        again.run()
        assert again.levels == search.levels
        assert again.best() == search.best()


def test_a_stopped_setting_is_not_an_error():
    search = search_of(ModelRuns())
    search.start()
    stopped = RunObservation({"positions": EXACT[:, :0]}, RunCost(cpu=0.0), STOPPED)
    search.observations[setting(cfl=0.1)] = stopped
    assert search.error_of(setting(cfl=0.1)) == np.inf
    assert not search.keeps(setting(cfl=0.1))
