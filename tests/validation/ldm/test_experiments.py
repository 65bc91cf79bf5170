"""What LDM's experiments make of errors, which weights they accept, and settings of the tower."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from record_verdicts import verdict

from mpm_ref.rom.model_file import Model, load, save
from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.run import SCHEMES, RunOptions
from validation.common import targets
from validation.common.position_errors import mean_errors
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import with_
from validation.ldm import networks, settings, superres
from validation.ldm.gravity import SAME, sufficient_points
from validation.ldm.references import references
from validation.ldm.studies import TORSION, TOWER
from validation.ldm.tower import GRIDS, scene_of


def rows(**means):
    """Rows (scheme, points, draw, error) of two draws around the means {scheme: {points: mean}}."""
    return [(scheme, points, draw, mean + 0.01 * (2 * draw - 1), 0.0, 0.0)
            for scheme, own in means.items() for points, mean in own.items() for draw in (0, 1)]


def test_enough_points_are_those_from_which_all_schemes_are_as_good_as_with_all():
    fine = {10: 3.0, 50: 1.05, 100: 1.0, 999: 1.0}
    assert sufficient_points(rows(a=fine), 999) == 50
    assert sufficient_points(rows(a=fine, b={**fine, 50: SAME + 0.02}), 999) == 100
    assert sufficient_points(rows(a={**fine, 100: 2.0}), 999) == 999


def test_the_mean_says_of_how_many_it_is():
    mean, words = mean_errors([PositionErrors(0.01, 0.02, 0.1), PositionErrors(0.03, 0.04, 0.3)],
                              "draws")
    assert mean == pytest.approx((0.02, 0.03, 0.2))
    assert words == "mean of 2 draws, the largest 3 %"


def test_few_references_are_spread_over_the_tests(monkeypatch):
    short = TORSION._replace(scene=lambda v, w: with_(TORSION.scene(v, w), steps=2))
    found = references(short, 2)
    assert len(found.x) == 2
    assert found.total == len(TORSION.test)
    assert found.x[0].shape == (3, 1757, 3)
    assert found.scale == "1757 particles, 2 steps, 2 of 7 test runs"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where weights are looked for; nothing is remembered."""
    monkeypatch.setattr(networks, "FOLDER", tmp_path)
    networks.trained.cache_clear()
    yield tmp_path
    networks.trained.cache_clear()


def test_missing_weights_say_how_to_make_them(folder):
    with pytest.raises(ValueError, match=r"gravity-r2.npz: python -m validation.training.ldm grav"):
        networks.trained("gravity-r2")


@pytest.mark.parametrize("key", ["scenes", "epochs", "seed"])
def test_weights_of_another_training_are_refused(folder, key):
    model = load(next((networks.Path(networks.__file__).parent / "weights").glob("gravity-r2.npz")))
    assert save(folder / "gravity-r2.npz", model) is None
    assert networks.trained("gravity-r2").field.r == 2
    networks.trained.cache_clear()
    save(folder / "gravity-r2.npz", Model(*model[:3], {**model.about, key: "other"}))
    with pytest.raises(
            ValueError, match=r"of .*'other'.*: python -m validation\.training\.ldm gravity-r2"):
        networks.trained("gravity-r2")


@pytest.mark.parametrize("name", networks.nets())
def test_all_weights_are_here_and_of_what_is_said(name):
    model, net = networks.trained(name), networks.nets()[name]
    steps = net.study.scene(*net.study.mu[0]).steps
    assert model.field.r == net.r
    assert model.xhat.shape[:2] == (len(net.study.train), steps + 1)
    assert "+changes" not in model.about["commit"]


def test_tracers_go_with_the_full_models_own_points():
    """Points where the full model has its own move as they do."""
    scene = with_(TORSION.scene(0.36, 1.2), steps=3)
    x = TORSION._replace(scene=lambda v, w: with_(TORSION.scene(v, w), steps=3)).run([0])
    found = superres.advected(scene, x.X)
    own = TORSION._replace(mu=np.array([[0.36, 1.2]]), scene=lambda v, w: scene).run([0]).x[0]
    assert abs(found - own).max() < 1e-12


@pytest.fixture
def made_up(monkeypatch):
    """Table 4 without its runs, two tests: x of all points grows from 1 by 1 in each coarse step;
    the reduced run of the k-th scheme is off by (k + 1) % of x, by much more at the fine run's
    other levels, the tracers by 5 %.
    """
    x = np.ones((61, 8, 3)) + 0.5 * np.arange(61)[:, None, None]
    problem = SimpleNamespace(bodies=(), clock=SimpleNamespace(steps=60))
    off = np.where(np.arange(61) % superres.REFINE, 7.0, 0.01)[:, None, None]
    ways = [RunOptions(*scheme) for scheme in SCHEMES]
    for name, value in {
            "TORSION": TORSION._replace(test=TORSION.test[:2]), "trained": lambda name: None,
            "ldm_full_model": lambda scene: SimpleNamespace(X=x[0], problem=problem),
            "build": lambda scene: None, "threads_for": lambda bodies: nullcontext(),
            "history": lambda problem: SimpleNamespace(x=x),
            "reduced": lambda one, model, way: x * (1.0 + off * (1 + ways.index(way))),
            "advected": lambda scene, X: 1.05 * x[::superres.REFINE]}.items():
        monkeypatch.setattr(superres, name, value)


def test_tracers_of_table_4_are_measured_at_the_same_times_and_to_be_beaten(tmp_path, made_up):
    setting = RunSetting("standard", tmp_path, targets=targets.load())
    assert run_all([superres.superresolution.experiment], setting) == []
    found = {r.target.rpartition(".")[2]: r for r in ProfileResults(tmp_path).records("ldm.table4")}
    for k, scheme in enumerate(SCHEMES):
        assert found[RunOptions(*scheme).name].value == pytest.approx(1.0 + k)
    baseline, gain = found["baseline"], found["gain"]
    assert (baseline.value, verdict(baseline)) == (pytest.approx(5.0), "miss")
    assert (gain.value, verdict(gain)) == (pytest.approx(5.0 / 4.0), "pass")
    assert "eulerian_linear" in gain.note
    assert "errors of 8 points at 31 times" in gain.scale


def test_tracers_that_are_as_good_are_not_beaten(tmp_path, made_up, monkeypatch):
    monkeypatch.setattr(superres, "advected", lambda scene, X: 1.039 * superres.history(0).x[::2])
    for profile, expected in (("standard", "miss"), ("quick", None)):
        setting = RunSetting(profile, tmp_path / profile, targets=targets.load())
        assert run_all([superres.superresolution.experiment], setting) == []
        records = ProfileResults(tmp_path / profile).records("ldm.table4")
        assert {r.target: verdict(r) for r in records}.get("ldm.table4.gain") == expected


def missed(folder):
    """Printed settings that ours are not, but for remarks that contradict their own table."""
    setting = RunSetting("quick", folder, targets=targets.load())
    assert run_all([settings.settings.experiment], setting) == []
    remarks = {f"ldm.sec5_4.remark_{word}" for word in ("total", "reduction")}
    return {r.target for r in ProfileResults(folder).records("ldm.settings")
            if verdict(r) == "miss"} - remarks


@pytest.fixture
def coarse(monkeypatch):
    """The tower on its coarsest grid where its finest is asked for; what that misses."""
    monkeypatch.setattr(settings, "scene_of", {max(GRIDS): scene_of(min(GRIDS))}.get)
    return {*(f"ldm.table2.tower.{name}" for name in ("particles", "dx", "ppc_per_dim")),
            "ldm.sec5_4.reduction_resolved"}


def test_settings_are_the_printed_ones(tmp_path, coarse):
    """LDM-tab2-sampling, LDM-X1, LDM-X3; but for the tower's grid."""
    assert missed(tmp_path) == coarse


def test_settings_of_the_tower_are_those_of_its_runs(tmp_path, coarse, monkeypatch):
    other = TOWER._replace(mu=TOWER.mu + 0.3, test=TOWER.test[1:])
    monkeypatch.setattr(settings, "TOWER", other)
    monkeypatch.setattr(settings, "nets", lambda: {
        name: net._replace(r=net.r + (name == "tower")) for name, net in networks.nets().items()})
    counts = {f"ldm.{place}.n_{of}" for place in ("table2.tower", "sec5_4")
              for of in ("train", "test")}
    drawn = {f"ldm.sec5_4.{name}_max" for name in ("r", "theta", "phi")}
    assert missed(tmp_path) == coarse | counts | drawn | {"ldm.sec5_4.r"}
