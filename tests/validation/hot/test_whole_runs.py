"""Whole runs: the content of a history, that it is read again, and pictures of its states."""

from types import SimpleNamespace

import numpy as np
import pytest

from figures.common.splats import DARK, Balls, Camera, image, outward
from figures.common.state_panels import (
    SceneView,
    is_shown,
    load_history,
    scene_cloud,
    states,
    surface,
)
from mpm_ref.scene import build
from validation.common.registry import discover
from validation.common.results import ProfileResults
from validation.common.scenes import catalogue_scene, with_
from validation.hot import real_counts, whole_runs
from validation.hot import run_history as histories
from validation.hot.run_history import COLUMNS, FIELDS, read, run, run_history
from validation.hot.sizes import SIZES
from validation.trade.hot_energy import DT, BarRunEnd, StopRule, distance_in_cells, twisted_bar


def small(steps=3, **changes):
    """The first steps of a bust of few particles, held at its foot and turned at its head."""
    scene = catalogue_scene("hot_faceless", unstable="allow", dx=0.06, **changes)
    scene = with_(scene, end=steps * scene.longest)
    body = scene.body[0]
    return with_(scene, body=(with_(body, sampling=with_(body.sampling, count=500)),))


@pytest.fixture(scope="module")
def history():
    return run(small(), 1e3)


def test_history_has_every_step_and_some_states(history):
    assert history.facts["why"] == "end"
    assert history.steps.shape == (3, len(COLUMNS))
    np.testing.assert_allclose(history.column("t"), np.cumsum(history.column("dt")), rtol=1e-14)
    np.testing.assert_allclose(history.times, np.arange(4) / 24.0, rtol=1e-14)
    assert history.column("converged").all()
    for name in FIELDS:
        assert getattr(history, name).shape[:2] == (4, 500)
        assert getattr(history, name).dtype == np.float32
    assert np.all(history.column("solve") <= history.column("cpu"))


def test_particles_have_the_same_places_throughout_a_history(history):
    body = build(small()).bodies[0]
    np.testing.assert_array_equal(history.x[0], body.particles.x[np.argsort(body.id)]
                                  .astype(np.float32))
    assert np.linalg.norm(history.x[1] - history.x[0], axis=1).max() < 0.06


@pytest.fixture(scope="module")
def poured():
    scene = catalogue_scene("hot_sauce", unstable="allow", dx=0.09, end=0.5)
    body = scene.body[0]
    return run(with_(scene, body=(with_(body, sampling=with_(body.sampling, count=60)),)), 1e3)


def test_particles_that_enter_are_in_a_history_from_then_on(poured):
    there = np.isfinite(poured.x).all(axis=2)
    assert there.shape == (13, 300)
    assert len(poured.body) == 300
    assert there[0].sum() == 60
    assert there[-1].all()
    assert np.all(there[1:] >= there[:-1])
    np.testing.assert_array_equal(np.isfinite(poured.speed), there)
    assert poured.facts["mass"][1] == pytest.approx(5.0 * poured.facts["mass"][0])
    assert poured.column("gap").max() < 1e-13       # what enters is no part of the step's balance


def test_poured_particles_are_kept_by_their_last_places(poured, monkeypatch):
    monkeypatch.setattr(whole_runs, "MOST", 50)
    shown = whole_runs.shown_particles(poured.x)
    assert len(set(shown)) == 50
    assert shown.max() >= 240
    early = poured.x[:5]
    assert np.isfinite(early[-1, whole_runs.shown_particles(early)]).all()


def test_momentum_balances_only_with_the_impulse_of_the_conditions(history, monkeypatch):
    assert history.column("gap").max() < 1e-13
    monkeypatch.setattr(histories.ImpulseStepper, "solve", histories.ImplicitStepper.solve)
    assert run(small(1), 1e3).column("gap").max() > 1e-3


def test_history_is_read_where_it_was_run(tmp_path, monkeypatch):
    file = tmp_path / "states" / "bust.npz"
    stored = run_history(small(1), file, 1e3)
    assert stored.facts["memory"] > 1e7
    assert (file.parent / ".gitignore").read_text() == "*\n"
    monkeypatch.setattr(histories, "run", lambda *_: pytest.fail("it is there"))
    again = run_history(small(1), file, 1e3)
    assert again.facts == stored.facts
    for a, b in zip(again[:-1], stored[:-1], strict=True):
        np.testing.assert_array_equal(a, b)


def test_history_of_another_scene_is_run_anew(tmp_path):
    file = tmp_path / "bust.npz"
    run_history(small(1), file, 1e3)
    assert len(run_history(small(2), file, 1e3).steps) == 2
    assert len(read(file).steps) == 2


def test_run_out_of_patience_says_so():
    history = run(small(), 0.0)
    assert history.facts["why"] == "more than 0.0 CPU seconds"
    assert len(history.steps) == 0


def test_broken_run_is_stored_with_its_reason():
    scene = small()
    history = run(with_(scene, limits=with_(scene.limits, J=(0.9999, 1.0001))), 1e3)
    assert "J is outside" in history.facts["why"]
    assert history.times[-1] > 0.0


def test_peak_memory_is_recorded_of_runs_that_noted_it(history):
    rows = {}
    run = SimpleNamespace(record=lambda id, value, **notes: rows.update({id: value}))
    whole_runs.record_cost(run, "faceless", history)
    assert "hot.scenes.faceless.memory" not in rows
    noted = history._replace(facts={**history.facts, "memory": 2_500_000_000})
    whole_runs.record_cost(run, "faceless", noted)
    assert rows["hot.scenes.faceless.memory"] == pytest.approx(2.5)


@pytest.mark.parametrize("share", [None, 0.25])
def test_a_run_of_the_beginning_says_so(history, share):
    rows = {}
    run = SimpleNamespace(record=lambda id, value, **notes: rows.update({id: value}))
    whole = catalogue_scene("hot_faceless").end
    whole_runs.record_beginning(run, "faceless", history._replace(
        facts={**history.facts, "end": whole * (share or 1.0)}))
    assert rows == ({"hot.scenes.faceless.asked": share} if share else {})


def test_every_scene_has_a_whole_run():
    experiments = {id for id in discover().experiments if id.startswith("hot.scenes.")}
    names = {*(name.removeprefix("hot_") for name in SIZES), "armacat_soft"}
    assert experiments - {real_counts.ID} == {f"hot.scenes.{name}" for name in names}


def test_the_soft_cat_alone_is_softer_in_its_run(monkeypatch):
    seen = {}
    monkeypatch.setattr(whole_runs, "record_run",
                        lambda run, name, scene, patience: seen.update({name: scene}))
    run = SimpleNamespace(profile="standard", choose=lambda **values: values["standard"])
    for name in ("armacat", "armacat_soft"):
        discover().experiments[f"hot.scenes.{name}"].function(run)
    stiff, soft = ({body.name: body for body in scene.body} for scene in seen.values())
    assert (stiff["cat"].material.E, soft["cat"].material.E) == (1e9, 1e6)
    soft["cat"] = with_(soft["cat"], material=stiff["cat"].material)
    assert soft == stiff


# Pictures

CAMERA = Camera(0.0, 0.0, np.array([-2.0, -1.0]), np.array([2.0, 1.0]), 80)


def balls(*places):
    """Balls of radius 0.5 m, red, green, blue, .."""
    return Balls(np.array(places, dtype=float), np.zeros((len(places), 3)),
                 np.full(len(places), 0.5), np.eye(3)[:len(places)])


def test_axes_of_the_camera_are_orthonormal():
    axes = CAMERA._replace(turn=33.0, lift=21.0).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    np.testing.assert_array_equal(CAMERA.axes, np.eye(3))


def test_ball_is_where_it_should_be():
    picture = image(balls((1.0, 0.5, 0.0)), CAMERA)
    assert picture.shape == (40, 80, 4)
    rows, columns = np.nonzero(picture[..., 3] > 0.5)
    assert (rows.mean() + 0.5, columns.mean() + 0.5) == pytest.approx((10.0, 60.0), abs=0.3)
    assert picture[..., 3].sum() == pytest.approx(np.pi * 10.0**2, rel=0.02)
    assert picture[10, 60, 0] > DARK > picture[10, 60, 1]


@pytest.mark.parametrize("order", [1, -1])
def test_nearer_ball_hides_the_other(order):
    two = balls((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    picture = image(Balls(*(a[::order] for a in two)), CAMERA)
    assert picture[20, 40, 1] > picture[20, 40, 0]


def test_normals_of_a_cloud_point_outwards():
    x = np.stack(np.meshgrid(*3 * [np.linspace(-1.0, 1.0, 9)]), axis=-1).reshape(-1, 3)
    n = outward(x)
    face = (x[:, 0] == 1.0) & (abs(x[:, 1:]).max(axis=1) < 0.5)
    assert n[face, 0].min() > 0.9       # the nearest of a lattice are not the same to all sides
    assert np.all(n[abs(x).max(axis=1) < 0.5] == 0.0)


def test_kept_states_are_those_of_the_run_and_few(history, tmp_path, monkeypatch):
    run = SimpleNamespace(folder=tmp_path, experiment=SimpleNamespace(id="hot.scenes.faceless"))
    whole_runs.keep_states(run, history, stress=True)
    kept = load_history(ProfileResults(tmp_path), "faceless")
    np.testing.assert_allclose(kept.x, history.x, atol=2e-4)
    np.testing.assert_array_equal(kept.body, history.body)
    monkeypatch.setattr(whole_runs, "MOST", 60)
    whole_runs.keep_states(run, history, stress=True)
    assert load_history(ProfileResults(tmp_path), "faceless").x.shape == (4, 60, 3)
    whole_runs.keep_states(run, history, stress=False)
    assert load_history(ProfileResults(tmp_path), "faceless").stress is None


def test_states_are_drawn_and_missing_ones_named(history, tmp_path):
    results = ProfileResults(tmp_path)
    with pytest.raises(FileNotFoundError, match=r"hot\.scenes\.faceless"):
        states(results, "faceless", SceneView((0,), ("#e8a33d",)))
    run = SimpleNamespace(folder=tmp_path, experiment=SimpleNamespace(id="hot.scenes.faceless"))
    whole_runs.keep_states(run, history, stress=True)
    figure = states(results, "faceless", SceneView((0, 7), ("viridis",),
                                              scalar=("stress", 1e-6, "stress [MPa]")))
    assert [ax.get_title() for ax in figure.axes[:2]] == ["t = 0.00 s", "t = 0.12 s"]
    assert len(figure.axes) == 3        # with the colour bar; of a short run, the last picture


def test_a_prescribed_region_is_shown_while_it_holds_nodes():
    source, = build(catalogue_scene("hot_sauce")).conditions.prescribed
    assert 5.9 < source.until < 6.3
    assert [is_shown(source, t) for t in (0.0, 5.9, 7.7)] == [True, True, False]


@pytest.mark.parametrize("t", [0.0, 0.3, 5.9])
def test_a_region_that_sways_is_drawn_where_it_is(t):
    """The shape of the sauce's source, where the block is that entered last."""
    source, = build(catalogue_scene("hot_sauce")).conditions.prescribed
    due = 0.12 * np.floor(t / 0.12)
    where = [3.0 - 0.4 * np.sin(np.radians(55.0) * due), 4.18,
             2.857 + 0.5 * np.sin(np.radians(120.0) * due)]
    box = np.array([[2.4, 4.1, 2.1], [3.6, 4.3, 3.6]])
    balls = surface(source, (t, box, 0.015), "#000000")
    middle = 0.5 * (balls.x.min(axis=0) + balls.x.max(axis=0))
    assert middle == pytest.approx(where, abs=0.01)


def test_states_of_a_pour_are_drawn_with_what_is_there(poured, tmp_path):
    results = ProfileResults(tmp_path)
    run = SimpleNamespace(folder=tmp_path, experiment=SimpleNamespace(id="hot.scenes.sauce"))
    whole_runs.keep_states(run, poured, stress=True)
    kept = load_history(results, "sauce")
    assert len(scene_cloud(kept, 0, np.ones((300, 3))).x) == 60
    figure = states(results, "sauce", SceneView((0, 12), ("viridis",),
                                            scalar=("stress", 1e-6, "stress [MPa]")))
    assert len(figure.axes) == 3


# The trade

def test_bar_of_the_trade_has_fixed_steps_and_the_count_of_the_authors():
    scene = twisted_bar(0.015, 40, StopRule("hot", 1e-9))
    assert sum(body.sampling.count for body in scene.body) == 30720
    clock = build(with_(twisted_bar(0.06, 2, StopRule("hot", 1e-9)))).clock
    assert (clock.dt, clock.steps, clock.interval) == (DT, 2, None)


def test_distance_from_the_answer_is_in_cells():
    x = np.zeros((4, 3))
    y = x.copy()
    y[0, 2] = 0.3
    ends = [BarRunEnd(1.0, 1.0, places, 0.0, 1.0, True) for places in (y, x)]
    assert distance_in_cells(*ends, 0.1) \
        == pytest.approx((1.5, 3.0))
