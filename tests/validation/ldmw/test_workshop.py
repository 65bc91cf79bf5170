"""The workshop paper: its studies, its two hyper-reductions on scenes, what is recorded of them."""

from math import cos, radians, sin
from types import SimpleNamespace

import numpy as np
import pytest
from record_verdicts import verdict

from figures.common import state_panels
from figures.frame import draw_all
from mpm_ref.rom.latent import start_state
from mpm_ref.rom.model_file import load, save
from mpm_ref.rom.study.full_model import ldm_full_model
from validation.common import targets
from validation.common.record import read_records
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.ldm import networks, published_bodies
from validation.ldm.workshop_studies import PUSHES, SHEAR3, SHEAR17, TOP, WORKSHOP, pushed, sheared
from validation.ldmw import poke, settings, shear, states
from validation.ldmw.runs import by_nodes, by_points, pod, spread, study_runs, training_neighbours

SHEARS = (SHEAR3, SHEAR17)


# studies

@pytest.mark.parametrize("study", WORKSHOP.values(), ids=WORKSHOP)
def test_no_run_is_trained_on_and_tested(study):
    assert sorted((*study.train, *study.test)) == list(range(len(study.mu)))


@pytest.mark.parametrize("study", SHEARS, ids=lambda study: study.name)
def test_a_shear_moves_the_top_along_x_and_holds_the_base(study):
    """Nodes below the base and beyond the plane move as told, those between not in this step."""
    full = study.run([7])
    v, z = full.v[0, 1], full.X[:, 2]
    dx = sheared(len(z), 0.48).dx
    assert full.x.shape[1] == 2
    assert not v[:, 1:].any()
    assert not v[z < TOP - 2.0 * dx].any()
    assert (v[z > TOP - 0.4 * dx, 0] > 0.0).all()
    assert 0.0 < v[:, 0].max() <= 0.48
    assert np.array_equal(full.x[0, 1], full.X + full.dt * v)


def test_three_points_stand_in_the_thirds_of_the_height():
    z = np.sort(SHEAR3.run([0]).X[:, 2])
    assert (np.floor(z / (0.4 / 3.0)) == [0, 1, 2]).all()


def test_all_speeds_drive_the_same_nodes():
    """The plane lies between layers of nodes."""
    off = TOP / sheared(3, 0.1).dx
    assert 0.1 < off % 1.0 < 0.9


def test_a_push_goes_inwards_and_down_as_far_as_its_magnitude():
    base, push = pushed(1.1, 4.0, 12.0).fixed
    path = np.array(push.motion.translation.rate) * 0.25
    theta, phi = radians(4.0), radians(12.0)
    assert np.linalg.norm(path) == pytest.approx(1.1 * 0.1)
    assert path / np.linalg.norm(path) == pytest.approx(
        [cos(phi) * cos(theta), cos(phi) * sin(theta), -sin(phi)])
    assert push.region.center == (-0.1, 0.0, 0.4)
    assert base.motion.translation is None


def test_pushes_are_all_triples_of_three_values():
    assert len({tuple(mu) for mu in PUSHES.mu.tolist()}) == 27
    assert [len(set(column)) for column in PUSHES.mu.T] == [3, 3, 3]


# reduced runs

@pytest.fixture(scope="module")
def sheared_runs():
    """Test runs of the 17 points."""
    return study_runs(SHEAR17, SHEAR17.test)


@pytest.mark.parametrize("make", [
    lambda every, some: by_points(every), lambda every, some: by_nodes(every),
    lambda every, some: by_points(some), lambda every, some: by_nodes(some, 6),
], ids=["points", "nodes", "some points", "some nodes"])
def test_both_approaches_are_exact_where_the_map_is(sheared_runs, make):
    """One mode holds a step from rest at any speed: seen 1e-15."""
    approach = make(np.arange(17), spread(sheared_runs.X, 6))
    assert max(sheared_runs.errors(*pod(SHEAR17, 1), approach)) < 1e-12


def test_errors_are_those_of_each_field(sheared_runs):
    """Of a run that goes 1 % too far: errors are known from the full-order fields."""
    class Farther:
        def __init__(self, stepper):
            self.stepper = stepper

        def step(self, latent, *how):
            after, report = self.stepper.step(latent, *how)
            return after._replace(xhat=1.01 * after.xhat, vhat=1.02 * after.vhat), report

    def approach(one, map):
        stepper, choose = by_points(np.arange(17))(one, map)
        return Farther(stepper), choose

    found = sheared_runs.errors(*pod(SHEAR17, 1), approach)
    full = sheared_runs.full
    assert found.position == pytest.approx(
        0.01 * np.linalg.norm(full.x - full.X) / np.linalg.norm(full.x), rel=1e-9)
    assert found.velocity == pytest.approx(0.02, rel=1e-9)
    assert found.defgrad == pytest.approx(
        0.01 * np.linalg.norm(full.F - np.eye(3)) / np.linalg.norm(full.F), rel=1e-9)


def test_few_nodes_have_few_samples_and_few_of_these_are_used(sheared_runs):
    one, some = sheared_runs.cases[0], spread(sheared_runs.X, 6)
    map, rest = pod(SHEAR17, 1)
    _, every = by_nodes(some)(one, map)
    assert set(some) <= set(every(0.0, start_state(rest))) < set(range(17))
    _, few = by_nodes(some, 6)(one, map)
    assert len(few(0.0, start_state(rest))) == 6


def test_samples_are_spread_from_the_bottom_to_the_top():
    X = np.zeros((9, 3))
    X[:, 2] = [8, 3, 0, 5, 1, 7, 2, 6, 4]
    assert X[spread(X, 3), 2].tolist() == [8, 0, 4]
    assert spread(X, 9).tolist() == list(range(9))


def test_with_neighbours_found_once_a_run_is_the_same(sheared_runs):
    """The same bits, with those of all training states."""
    some = spread(sheared_runs.X, 6)
    near = training_neighbours("shear17", sheared_runs.cases[0], some)
    assert not set(some) & set(near.around)
    found, expected = (sheared_runs.network_errors("shear17", by_points(some, *given))
                       for given in ((near,), ()))
    assert found == expected


def test_samples_of_a_push_are_held_pushed_and_free():
    one = ldm_full_model(PUSHES.scene(*PUSHES.mu[0]))
    samples = poke.samples(one, 0)
    assert len(samples) == poke.HYPER
    groups = one.constrained_points(0.0)
    assert [len(np.intersect1d(samples, group)) >= 5 for group in groups] == [True, True]
    assert set(samples) != set(poke.samples(one, 1))


# nets and records

@pytest.mark.parametrize(("key", "value"), [("latent", "encoder"), ("terms", "both")])
def test_weights_of_another_training_are_refused(tmp_path, monkeypatch, key, value):
    model = load(networks.FOLDER / "shear17.npz")
    assert model.about["latent"] == "free"
    save(tmp_path / "shear17.npz", model._replace(about={**model.about, key: value}))
    monkeypatch.setattr(networks, "FOLDER", tmp_path)
    with pytest.raises(ValueError, match=r"shear17\.npz are of .*training\.ldm shear17"):
        networks.trained.__wrapped__("shear17")


def recorded(function, folder):
    """{target: `Record`} of an experiment at the quick profile."""
    one = function.experiment
    assert run_all([one], RunSetting("quick", folder, targets=targets.load())) == []
    return {record.target: record for record in read_records(folder / f"{one.id}.json")}


@pytest.mark.parametrize("function", [shear.losses, shear.approaches, settings.settings],
                         ids=["table1", "table2", "settings"])
def test_all_printed_numbers_are_recorded(function, tmp_path):
    found = recorded(function, tmp_path)
    kind, start = "error", function.experiment.id
    if function is settings.settings:
        kind, start = "setting", "ldmw."
    wanted = {one.id for one in targets.load().values()
              if one.kind == kind and one.id.startswith(start)}
    assert wanted <= set(found)
    assert all(np.isfinite(found[name].value) for name in wanted)


def test_settings_are_the_printed_ones(tmp_path):
    """But for the number of snapshots, of which the print has one level too few (LDMW-X1)."""
    found = recorded(settings.settings, tmp_path)
    assert {target for target, r in found.items() if verdict(r) == "miss"} == {
        "ldmw.poke.snapshots"}


SOME = np.stack(np.meshgrid(*3 * (np.arange(1.0, 3.0),), indexing="ij"), axis=-1).reshape(-1, 3)


def stood_in(study, numbers):
    """`StudyRuns` of a few points that go 1, 2, .. % too far in one of three time levels."""
    def levels(map, rest, approach):
        for k in range(len(numbers)):
            yield [(3 * [(1.0 + 0.01 * (k + 1) * (level == 2)) * SOME], 3 * [SOME])
                   for level in range(3)]

    cases = (ldm_full_model(study.scene(*study.mu[0])),)
    return SimpleNamespace(X=SOME, cases=cases, levels=levels,
                           full=SimpleNamespace(mu=study.mu[list(numbers)]))


def test_fig1_is_of_the_ends_of_test_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(states, "study_runs", stood_in)
    monkeypatch.setattr(states, "training_neighbours", lambda *of: None)
    monkeypatch.setattr(state_panels, "PIXELS", 40)
    found = recorded(states.pokes, tmp_path)
    for k in (1, 2, 3):
        one = found[f"ldmw.fig1.error.{k}.position"]
        assert one.value == pytest.approx(k / np.sqrt(3.0))
        assert (verdict(one), one.scale) == (
            "info", "8 particles, 2 steps, r = 5, 15 sample points, one run each")
    ends = published_bodies.read(tmp_path, "ldmw.fig1")
    assert ends["full"] == pytest.approx(np.stack(3 * [SOME]))
    assert ends["reduced"] == pytest.approx(np.stack([k * SOME for k in (1.01, 1.02, 1.03)]), 1e-4)
    assert ends["mu"] == pytest.approx(PUSHES.mu[list(states.SHOWN)], 1e-3)
    drawn = draw_all(ProfileResults(tmp_path), names=["ldmw.fig1"])
    assert (drawn.done, drawn.left, drawn.failed) == (["ldmw_fig01"], [], [])


def test_shown_pokes_are_tested_and_as_different_as_tests_are():
    assert set(states.SHOWN) <= set(PUSHES.test)
    rho = PUSHES.mu[list(states.SHOWN), 0]
    every = PUSHES.mu[list(PUSHES.test), 0]
    assert (np.diff(rho) > 0.0).all()
    assert (rho[0], rho[-1]) == (every.min(), every.max())
