from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from model_runs import EXACT, TIMES, ModelRuns, search_of
from sweep_scenes import FLIGHT, observed_run, scene_of

from mpm_ref.executor import open_executor
from mpm_ref.scene import SceneError, loads
from mpm_ref.sweep.observation import REFUSED, STOPPED, RunCost, RunObservation
from mpm_ref.sweep.runs import SceneRuns
from mpm_ref.sweep.setting import scene_at, setting
from mpm_ref.sweep.store import RunStore
from mpm_ref.trade.candidates import GRIDS, pairs, single_knobs
from mpm_ref.trade.search import (
    CHEAPER,
    HOPELESS,
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
    keeps = [bool(search.keeping([setting(transfer="apic", dx=factor)])) for factor in kept]
    assert keeps == [False] * (len(kept) - 1) + [True]
    dear = grids(cfl=0.25)
    assert dear == list(GRIDS[:len(dear)])
    assert not search.keeping([setting(cfl=0.25, dx=factor) for factor in dear])
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


def test_without_convergence_nothing_is_recommended():
    search = search_of(ModelRuns(order=0.2))
    search.run()
    assert search.horizon() == 0.0
    assert search.best() is None


def test_a_setting_that_fails_is_recorded_and_not_recommended():
    runs = ModelRuns()
    runs.fails = lambda text: "apic" in text
    search = search_of(runs)
    search.run()
    assert any(search.observations[s].outcome == REFUSED for s in search.settings())
    assert "apic" not in search.best().text


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
    crossing = 0.1 / sqrt(1e4 * 0.7 / (1.3 * 0.4) / 1000.0)
    assert f"transfer mls relaxation {crossing:.3g}" in texts
    assert len(set(texts)) == len(texts)
    implicit = [one.text for one in single_knobs(loads('integrator = "hot"' + FLIGHT))]
    assert "integrator explicit, cfl 0.5" in implicit
    assert "eps 0.001" in implicit
    assert "eps 1e-07" not in implicit
    assert "transfer mls" in implicit
    assert "transfer pic" in implicit
    assert not any("relaxation" in text for text in implicit)


def test_averaged_volumes_are_tried_near_incompressibility():
    """With nu >= 0.45 in explicit scenes alone; where a scene has them, it is tried without."""
    stiff = FLIGHT.replace("nu = 0.3", "nu = 0.49")
    assert stiff != FLIGHT
    averaged, implicit = 'scheme = { f_bar = true }' + FLIGHT, 'integrator = "hot"' + stiff
    for text, expected in ((FLIGHT, []), (stiff, ["f_bar true"]), (implicit, []),
                           (averaged, ["f_bar false"])):
        texts = [one.text for one in single_knobs(loads(text))]
        assert [text for text in texts if "f_bar" in text] == expected


def test_gimp_is_tried_with_the_points_per_cell():
    """In explicit scenes with several points per cell; affine transfers become FLIP, and splines of
    another degree quadratic ones. Where a scene has GIMP, it is tried without.
    """
    three = FLIGHT.replace("velocity", 'sampling = { type = "regular", per_cell = 3 }\nvelocity')
    one = three.replace("per_cell = 3", "per_cell = 1")
    assert len({FLIGHT, three, one}) == 3
    linear = 'scheme = { transfer = "pic", degree = 1 }\n' + three
    for text, expected in (
            (FLIGHT, ["degree 2, transfer flip 0.95, gimp 2.0"]),
            (linear, ["degree 2, gimp 3.0"]), (one, []), ('integrator = "hot"' + FLIGHT, []),
            ('scheme = { transfer = "pic", gimp = 2 }\n' + FLIGHT, ["gimp 0.0"])):
        scene = loads(text)
        settings = [one for one in single_knobs(scene) if one.get("gimp") is not None]
        assert [one.text for one in settings] == expected
        for chosen in settings:
            assert scene_at(scene, chosen).scheme.gimp == chosen.get("gimp")


def test_the_other_precision_is_tried_in_explicit_scenes():
    single, implicit = 'scheme = { precision = "single" }' + FLIGHT, 'integrator = "hot"' + FLIGHT
    for text, expected in ((FLIGHT, ["precision single"]), (single, ["precision double"]),
                           (implicit, [])):
        texts = [one.text for one in single_knobs(loads(text))]
        assert [text for text in texts if "precision" in text] == expected


@pytest.mark.parametrize(("scheme", "given", "other"), [
    ('transfer = "mls", relaxation = 0.005', "transfer mls relaxation 0.005", "transfer mls"),
    ('transfer = "apic", rpic = 0.1', "transfer apic rpic 0.1", "transfer apic"),
    ('transfer = "flip", flip = 0.95', "transfer flip 0.95", "transfer flip"),
    ('transfer = "apic"', "transfer apic", "transfer mls")])
def test_the_transfer_of_the_scene_is_no_candidate_and_its_plain_form_is(scheme, given, other):
    texts = [one.text for one in single_knobs(loads(f"scheme = {{ {scheme} }}" + FLIGHT))]
    assert given not in texts
    assert other in texts


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
    assert not search.keeping([setting(cfl=0.1)])
