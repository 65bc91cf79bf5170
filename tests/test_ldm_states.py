"""What LDM's state experiments keep: reduced runs beside full ones, rounded, and their plane."""

from types import SimpleNamespace

import numpy as np
import pytest

from figures import _states
from figures.frame import draw_all
from mpm_ref.reduced.errors import Errors
from mpm_ref.rom.affine import Affine
from validation import targets
from validation.ldm import states
from validation.ldm.studies import POKES, TORSION, TOWER, fallen
from validation.results import Results
from validation.run import Setting, run_all
from validation.verification.scenes import with_

# Experiments, and how many printed numbers each records; those that made-up runs miss.
MADE = {"gravities": 3, "torsion": 0, "superresolution": 5, "poke": 0, "tower": 15}
MISSED = {"superresolution": {"ldm.fig12.reduced_high", "ldm.fig12.baseline",
                              "ldm.fig12.low_points"}}
SOME = np.stack(np.meshgrid(*3 * (np.arange(2.0),), indexing="ij"), axis=-1).reshape(-1, 3)


@pytest.fixture
def short(monkeypatch):
    """A short run, and a map that is exact for affine motions."""
    affine = SimpleNamespace(decoder=Affine(3), rest=Affine(3).rest)
    monkeypatch.setattr(states, "trained", lambda name: affine)
    return with_(fallen(5.0), steps=3)


def test_a_pair_is_one_run_in_two_models(short):
    one = states.pair(short, "any", {0, 3})
    x = list(states.positions(short))
    np.testing.assert_array_equal(one.full, [x[0], x[3]])
    np.testing.assert_allclose(one.reduced[0], one.X, atol=1e-12)
    assert one.xhat.shape == (4, 12)
    assert 0.0 < one.errors.origin < 0.01
    assert np.linalg.norm(one.reduced[1] - x[3]) / np.linalg.norm(x[3]) < 0.01
    assert one.scale == "1368 particles, 3 steps, 50 samples"


def test_errors_are_of_all_points_whatever_is_shown(short):
    every, some = states.pair(short, "any"), states.pair(short, "any", {1}, np.array([4, 9]))
    assert every.full.shape == (4, 1368, 3)
    np.testing.assert_array_equal(some.full[0], every.full[1][[4, 9]])
    np.testing.assert_allclose(some.reduced[0], every.reduced[1][[4, 9]], atol=1e-12)
    assert some.errors == every.errors


def test_what_is_kept_is_read_again(tmp_path):
    run = SimpleNamespace(folder=tmp_path, experiment=SimpleNamespace(id="ldm.toy"))
    x = np.random.default_rng(0).normal(size=(50, 3))
    states.keep(run, x=x, count=[3, 1])
    found = states.read(tmp_path, "ldm.toy")
    assert found["x"].dtype == np.float32
    assert found["count"].tolist() == [3, 1]
    assert 0.0 < np.abs(found["x"] - x).max() <= 2.0 ** -states.BITS * np.abs(x).max() / 2.0
    with pytest.raises(FileNotFoundError, match=r"run ldm\.other again"):
        states.read(tmp_path, "ldm.other")


def test_rounding_takes_less_room_and_keeps_zeros(tmp_path):
    x = np.random.default_rng(0).normal(size=(5000, 3))
    np.savez_compressed(tmp_path / "plain.npz", x=x.astype(np.float32))
    np.savez_compressed(tmp_path / "rounded.npz", x=states.rounded(x))
    plain, rounded = ((tmp_path / f"{name}.npz").stat().st_size for name in ("plain", "rounded"))
    assert rounded < 0.75 * plain
    assert states.rounded(np.array([0.0, 1.0])).tolist() == [0.0, 1.0]


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
    assert states.returned(path) == pytest.approx(0.5)
    assert states.returned(np.vstack([path, path[:1]])) == 0.0
    assert states.returned(path[:, None] + np.ones((1, 5, 1))) == pytest.approx(0.5)


def stood_in(scene, net, shots=None, shown=None, way=states.WAY):
    """A `Pair` of a few points without any run."""
    k = scene.steps + 1 if shots is None else len(shots)
    x = np.arange(k)[:, None, None] * 0.01 + SOME
    xhat = np.random.default_rng(0).normal(size=(scene.steps + 1, 4))
    return states.Pair(SOME, x, x, xhat, Errors(0.1, 0.2, 0.3), "8 particles")


@pytest.mark.parametrize("name", MADE)
def test_figures_are_drawn_from_what_experiments_leave(name, tmp_path, monkeypatch):
    monkeypatch.setattr(states, "pair", stood_in)
    monkeypatch.setattr(states, "advected", lambda scene, X: np.stack((scene.steps + 1) * [SOME]))
    monkeypatch.setattr(states, "positions", lambda scene: [SOME])
    monkeypatch.setattr(_states, "PIXELS", 40)
    declared = getattr(states, name).experiment
    assert run_all([declared], Setting("standard", tmp_path, targets=targets.load())) == []
    results = Results(tmp_path)
    judged = {r.target: r.verdict for r in results.records(declared.id) if r.paper is not None}
    assert {r for r, verdict in judged.items() if verdict == "miss"} == MISSED.get(name, set())
    assert len(judged) == MADE[name]
    drawn = draw_all(results, names=[declared.id])
    assert (drawn.left, drawn.failed) == ([], [])
    assert len(drawn.done) == 1 + (name == "poke")


def test_samples_are_near_what_is_held(tmp_path):
    """LDM-sec3.3-hyper."""
    setting = Setting("quick", tmp_path, targets=targets.load())
    assert run_all([states.sampled.experiment], setting) == []
    found = states.read(tmp_path, "ldm.fig4")
    z = found["X"][found["samples"], 2]
    bottom, top = (z[held] for held in found["held"])
    assert len(z) == states.WAY.points
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
