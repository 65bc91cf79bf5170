"""Latent coordinates known beforehand, and snapshots that are shown more often than others."""

import numpy as np
import pytest
from rom_toys import cloud

from mpm_ref.rom.modes import basis
from mpm_ref.rom.snapshots import Snapshots

torch = pytest.importorskip("torch")
fit = pytest.importorskip("mpm_ref.rom.learn.fit")

N, RUNS, LEVELS, R = 12, 3, 10, 2


@pytest.fixture
def data(rng):
    """Three runs of ten time levels, of twelve points."""
    X = cloud(3, N)
    shape = (RUNS, LEVELS, N, 3)
    x, v = X + 0.1 * rng.normal(size=shape), rng.normal(size=shape)
    F = np.eye(3) + 0.1 * rng.normal(size=(*shape, 3))
    m = np.ones(N)
    return Snapshots(X, m, m, np.arange(RUNS)[:, None], x, F, v, 0.01)


def training(**settings):
    return fit.Training(R, hidden=(8,), epochs=2, batch=4, points=5, **settings)


def test_modes_are_in_the_norm_of_the_loss_and_stay(data):
    plan = training(latent="modes")
    expected = basis(data.X, *data.flat(), R, plan.weights.F).xhat
    done = fit.train(plan, data)
    assert done.xhat.reshape(-1, R) == pytest.approx(expected, rel=1e-6)
    assert done.xhat.reshape(-1, R) != pytest.approx(
        basis(data.X, *data.flat(), R).xhat, rel=1e-2)


def test_modes_weigh_snapshots_as_often_as_they_are_shown(data):
    plan = training(latent="modes", dense=4, thin=3)
    shown = np.tile(np.where(np.arange(LEVELS) < 4, 1.0, 1.0 / 3.0), RUNS)
    expected = basis(data.X, *data.flat(), R, plan.weights.F, np.sqrt(shown)).xhat
    found = fit.train(plan, data).xhat.reshape(-1, R)
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-6)
    assert found != pytest.approx(basis(data.X, *data.flat(), R, plan.weights.F).xhat, rel=1e-2)


def test_the_decoder_learns_with_given_latents(data):
    session = fit.Session(training(latent="modes"), data)
    before = [p.detach().clone() for p in session.f.parameters()]
    session.epoch()
    assert all(not torch.equal(a, b) for a, b in zip(before, session.f.parameters(), strict=True))


def test_early_levels_are_always_shown_and_later_ones_in_their_turn(data, monkeypatch):
    session, shown = fit.Session(training(dense=4, thin=3), data), []
    monkeypatch.setattr(session, "show", lambda at, progress: shown.append(at) or [0.0] * 4)
    for _ in range(40):
        session.epoch()
    level = torch.cat(shown) % LEVELS
    count = torch.bincount(level, minlength=LEVELS)
    assert (count[:4] == 40 * RUNS).all()
    assert 0.2 < count[4:].double().mean() / (40 * RUNS) < 0.47


def test_an_epoch_shows_everything_where_nothing_is_thinned(data, monkeypatch):
    session, shown = fit.Session(training(), data), []
    monkeypatch.setattr(session, "show", lambda at, progress: shown.append(at) or [0.0] * 4)
    session.epoch()
    assert sorted(torch.cat(shown).tolist()) == list(range(RUNS * LEVELS))


@pytest.mark.parametrize(("wrong", "said"), [({"latent": "codes"}, "latent = 'codes'"),
                                             ({"thin": 0}, "thin = 0"),
                                             ({"dense": -1}, "dense = -1")])
def test_settings_that_mean_nothing_are_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        training(**wrong)


def test_every_epoch_shows_a_snapshot_however_thin(data, monkeypatch):
    shown, show = [], fit.Session.show
    monkeypatch.setattr(fit.Session, "show", lambda self, at, progress: shown.append(at.tolist())
                        or show(self, at, progress))
    found = fit.train(fit.Training(R, (8,), epochs=40, thin=10**9), data)
    assert [len(at) for at in shown] == 40 * [1]
    assert len({at[0] for at in shown}) > 5
    assert np.isfinite(found.history).all()
