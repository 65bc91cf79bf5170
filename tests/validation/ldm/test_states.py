"""What LDM's state experiments record and keep: reduced runs beside full ones, and their plane."""

from types import SimpleNamespace

import numpy as np
import pytest
from record_verdicts import expected, verdict

from figures.common import state_panels
from figures.frame import draw_all
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.study.errors import PositionErrors
from mpm_ref.rom.study.full_model import ldm_full_model
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.scenes import with_
from validation.ldm import paired_runs, published_bodies, states
from validation.ldm.studies import POKES, TORSION, TOWER, fallen, leaning, twisted
from validation.ldm.superres import fine

# Experiments, and how many printed numbers each records; those that made-up runs miss.
MADE = {"gravities": 3, "torsion": 0, "superresolution": 7, "poke": 0, "tower": 16}
MISSED = {"superresolution": {"ldm.fig12.reduced_high", "ldm.fig12.low_points",
                              "ldm.fig12.baseline", "ldm.fig12.reduced_high.displacement",
                              "ldm.fig12.baseline.displacement"},
          "tower": {f"ldm.fig15.row{k}.r" for k in range(1, 5)}}      # the print: a tenth (LDM-X9)
# Other scenes than the printed ones: what an experiment misses with them, beside that
OTHERS = {
    "gravities": ("fallen", lambda g: fallen(g + 0.1),
                  {f"ldm.fig6.gravity.{g}" for g in states.GRAVITIES}),
    "superresolution": ("fine", lambda v, w: with_(fine(v, w), dx=0.03, body=twisted(v, w).body),
                        {"ldm.fig12.high_points", "ldm.fig12.refine"}),
    "tower": ("leaning", lambda r, theta, phi: leaning(r, theta + 0.1, phi - 0.1),
              {f"ldm.fig15.row{k}.{angle}" for k in range(1, 5) for angle in ("theta", "phi")})}
SOME = np.stack(np.meshgrid(*3 * (np.arange(2.0),), indexing="ij"), axis=-1).reshape(-1, 3)


@pytest.fixture
def short(monkeypatch):
    """A short run, and a map that is exact for affine motions."""
    affine = SimpleNamespace(field=Affine(3), rest=Affine(3).rest)
    monkeypatch.setattr(paired_runs, "trained", lambda name: affine)
    return with_(fallen(5.0), steps=3)


def test_a_pair_is_one_run_in_two_models(short):
    one = paired_runs.pair(short, "any", {0, 3})
    x = list(paired_runs.positions(short))
    np.testing.assert_array_equal(one.full, [x[0], x[3]])
    np.testing.assert_allclose(one.reduced[0], one.X, atol=1e-12)
    assert one.xhat.shape == (4, 12)
    assert 0.0 < one.errors.origin < 0.01
    assert np.linalg.norm(one.reduced[1] - x[3]) / np.linalg.norm(x[3]) < 0.01
    assert one.scale == "1368 particles, 3 steps, 50 samples, errors of 1368 points"


def test_scales_say_of_how_many_points_errors_are(short, monkeypatch):
    monkeypatch.setattr(paired_runs, "ERROR_POINTS", 500)
    one = paired_runs.pair(short, "any", options=paired_runs.ALL)
    own = paired_runs.position_errors(one.X[::3], one.reduced[:, ::3], one.full[:, ::3])
    assert one.errors == pytest.approx(own)
    assert one.scale == "1368 particles, 3 steps, all points, errors of 456 points"
    with pytest.raises(ValueError, match="longer"):
        paired_runs.position_errors(one.X, one.reduced[:2], one.full)


def test_errors_are_of_all_points_whatever_is_shown(short):
    every = paired_runs.pair(short, "any")
    some = paired_runs.pair(short, "any", {1}, np.array([4, 9]))
    assert every.full.shape == (4, 1368, 3)
    np.testing.assert_array_equal(some.full[0], every.full[1][[4, 9]])
    np.testing.assert_allclose(some.reduced[0], every.reduced[1][[4, 9]], atol=1e-12)
    assert some.errors == every.errors


def test_what_is_kept_is_read_again(tmp_path):
    run = SimpleNamespace(folder=tmp_path, experiment=SimpleNamespace(id="ldm.toy"))
    x = np.random.default_rng(0).normal(size=(50, 3))
    published_bodies.keep(run, x=x, count=[3, 1])
    found = published_bodies.read(tmp_path, "ldm.toy")
    assert found["x"].dtype == np.float32
    assert found["count"].tolist() == [3, 1]
    rounding = 2.0 ** -published_bodies.BITS * np.abs(x).max() / 2.0
    assert 0.0 < np.abs(found["x"] - x).max() <= rounding
    with pytest.raises(FileNotFoundError, match=r"run ldm\.other again"):
        published_bodies.read(tmp_path, "ldm.other")


def test_rounding_takes_less_room_and_keeps_zeros(tmp_path):
    x = np.random.default_rng(0).normal(size=(5000, 3))
    np.savez_compressed(tmp_path / "plain.npz", x=x.astype(np.float32))
    np.savez_compressed(tmp_path / "rounded.npz", x=published_bodies.rounded(x))
    plain, rounded = ((tmp_path / f"{name}.npz").stat().st_size for name in ("plain", "rounded"))
    assert rounded < 0.75 * plain
    assert published_bodies.rounded(np.array([0.0, 1.0])).tolist() == [0.0, 1.0]
    assert published_bodies.rounded(np.zeros(3)).tolist() == [0.0, 0.0, 0.0]
    gone = published_bodies.rounded(np.array([np.nan, 1.0, np.inf]))
    assert np.array_equal(gone, [np.nan, 1.0, np.inf], equal_nan=True)
    assert published_bodies.rounded(np.zeros((2, 0))).shape == (2, 0)


def test_skin_is_what_is_seen():
    X = 0.5 * np.stack(np.meshgrid(*3 * (np.arange(9.0),), indexing="ij"), axis=-1).reshape(-1, 3)
    depth = np.minimum(X, 4.0 - X).min(axis=1)
    shown = states.skin(X)
    assert depth[shown].max() == pytest.approx(0.5)
    assert len(shown) == pytest.approx(0.5 * np.sum(depth < 0.9), rel=0.05)
    near = np.linalg.norm(X[shown][:, None] - X[shown], axis=2)[np.triu_indices(len(shown), 1)]
    assert near.min() == pytest.approx(0.5 * np.sqrt(2.0))


def test_components_are_the_plane_of_a_plane():
    a = np.linspace(0.0, 5.0, 80)
    flat = np.column_stack([3.0 * np.cos(a), np.sin(a)])
    Q, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 6)))
    plane, share = states.components(flat @ Q[:2] + 7.0)
    assert share == pytest.approx(1.0)
    gaps = [np.linalg.norm(x[:, None] - x, axis=2) for x in (flat, plane)]
    np.testing.assert_allclose(*gaps, atol=1e-12)
    assert np.ptp(plane, axis=0)[0] > np.ptp(plane, axis=0)[1]
    assert (plane.max(axis=0) >= -plane.min(axis=0)).all()
    assert states.components(np.eye(4))[1] == pytest.approx(2.0 / 3.0)


def test_what_has_come_back_has_returned():
    path = np.array([0.0, 1.0, 4.0, -2.0])[:, None] * np.array([3.0, 4.0])
    assert states.return_distance(path) == pytest.approx(0.5)
    assert states.return_distance(np.vstack([path, path[:1]])) == 0.0
    assert states.return_distance(path[:, None] + np.ones((1, 5, 1))) == pytest.approx(0.5)


def stood_in(scene, net, shots=None, shown=None, options=paired_runs.SHOWN):
    """A `PairedRun` of a few points without any run."""
    k = scene.steps + 1 if shots is None else len(shots)
    x = np.arange(k)[:, None, None] * 0.01 + SOME
    xhat = np.random.default_rng(0).normal(size=(scene.steps + 1, 4))
    return paired_runs.PairedRun(ldm_full_model(scene), SOME, 1.01 * x, x, xhat,
                                 PositionErrors(0.1, 0.2, 0.3), len(SOME),
                                 options.points or len(SOME))


def judged(name, folder, monkeypatch):
    """{printed number: verdict} of an experiment without its runs."""
    monkeypatch.setattr(states, "pair", stood_in)
    monkeypatch.setattr(states, "advected", lambda scene, X: np.stack((scene.steps + 1) * [SOME]))
    monkeypatch.setattr(states, "positions", lambda scene: [SOME])
    declared = getattr(states, name).experiment
    assert run_all([declared], RunSetting("standard", folder, targets=targets.load())) == []
    records = ProfileResults(folder).records(declared.id)
    return {r.target: verdict(r) for r in records if expected(r) is not None}


@pytest.mark.parametrize("name", MADE)
def test_figures_are_drawn_from_what_experiments_leave(name, tmp_path, monkeypatch):
    monkeypatch.setattr(state_panels, "PIXELS", 40)
    found = judged(name, tmp_path, monkeypatch)
    missed = {target for target, one in found.items() if one == "miss"}
    assert missed == MISSED.get(name, set())
    assert len(found) == MADE[name]
    drawn = draw_all(ProfileResults(tmp_path), names=[getattr(states, name).experiment.id])
    assert (drawn.left, drawn.failed) == ([], [])
    assert len(drawn.done) == 1 + (name == "poke")


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_recorded_is_of_the_scenes_that_ran(name, tmp_path, monkeypatch):
    scene, other, missed = OTHERS[name]
    monkeypatch.setattr(states, scene, other)
    found = judged(name, tmp_path, monkeypatch)
    assert {target for target, one in found.items() if one == "miss"} == (
        missed | MISSED.get(name, set()))


def test_tracers_are_measured_as_the_reduced_run_is(tmp_path, monkeypatch):
    """Figure 12: the same points and times, and the reduced run must be the better."""
    judged("superresolution", tmp_path, monkeypatch)
    found = {r.target: r for r in ProfileResults(tmp_path).records("ldm.fig12")}
    reduced, baseline, gain = (found[f"ldm.fig12.{name}"]
                               for name in ("reduced_high", "baseline", "gain"))
    x = np.arange(31)[:, None, None] * 0.01 + SOME
    assert reduced.value == pytest.approx(1.0)
    assert baseline.value == pytest.approx(100.0 * np.linalg.norm(x - SOME) / np.linalg.norm(x))
    assert "errors of 8 points at 31 times" in reduced.scale == baseline.scale
    assert gain.value == pytest.approx(baseline.value / reduced.value)
    assert (verdict(baseline), verdict(gain)) == ("miss", "pass")


def test_samples_are_near_what_is_held(tmp_path):
    """LDM-sec3.3-hyper."""
    setting = RunSetting("quick", tmp_path, targets=targets.load())
    assert run_all([states.sampled.experiment], setting) == []
    found = published_bodies.read(tmp_path, "ldm.fig4")
    z = found["X"][found["samples"], 2]
    bottom, top = (z[held] for held in found["held"])
    assert len(z) == paired_runs.SHOWN.points
    assert min(len(bottom), len(top)) >= 5
    assert bottom.max() < 3.0
    assert top.min() > 36.0


def test_shown_runs_are_no_training_runs():
    pulled, poked = (
        [study.mu[k] for k in study.train] for study in (TORSION, POKES))
    assert not any(np.array_equal(mu, states.PULLED) for mu in pulled)
    assert not any(np.array_equal(mu, states.POKED) for mu in poked)
    low, high = TOWER.mu.min(axis=0), TOWER.mu.max(axis=0)
    assert not (np.array(states.LEANINGS)[:, None] == TOWER.mu).all(axis=2).any()
    assert (np.ptp(states.LEANINGS, axis=0) <= 1.1 * (high - low)).all()
