"""Latent coordinates known beforehand, and snapshots that are shown more often than others."""

import numpy as np
import pytest
from rom_toys import cloud

from mpm_ref.rom.fields.pod import basis, directions
from mpm_ref.rom.snapshots import Snapshots

torch = pytest.importorskip("torch")
decoder = pytest.importorskip("mpm_ref.rom.train.decoder")
loss = pytest.importorskip("mpm_ref.rom.train.loss")
field = pytest.importorskip("mpm_ref.rom.train.field")

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
    return decoder.DecoderTraining(R, hidden=(8,), epochs=2, batch=4, points=5, **settings)


def test_modes_are_in_the_norm_of_the_loss_and_stay(data):
    plan = training(latent="modes")
    expected = basis(data.X, *data.flat(), R, plan.weights.F).xhat
    done = decoder.train_decoder(plan, data)
    assert done.xhat.reshape(-1, R) == pytest.approx(expected, rel=1e-6)
    assert done.xhat.reshape(-1, R) != pytest.approx(
        basis(data.X, *data.flat(), R).xhat, rel=1e-2)


def test_modes_weigh_snapshots_as_often_as_they_are_shown(data):
    plan = training(latent="modes", dense=4, every=3)
    shown = np.tile(np.where(np.arange(LEVELS) < 4, 1.0, 1.0 / 3.0), RUNS)
    expected = basis(data.X, *data.flat(), R, plan.weights.F, np.sqrt(shown)).xhat
    found = decoder.train_decoder(plan, data).xhat.reshape(-1, R)
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-6)
    assert found != pytest.approx(basis(data.X, *data.flat(), R, plan.weights.F).xhat, rel=1e-2)


def test_the_decoder_learns_with_given_latents(data):
    session = decoder.DecoderSession(training(latent="modes"), data)
    before = [p.detach().clone() for p in session.f.parameters()]
    session.epoch()
    assert all(not torch.equal(a, b) for a, b in zip(before, session.f.parameters(), strict=True))


def test_early_levels_are_always_shown_and_later_ones_in_their_turn(data, monkeypatch):
    session, shown = decoder.DecoderSession(training(dense=4, every=3), data), []
    monkeypatch.setattr(session, "show", lambda at, progress: shown.append(at) or [0.0] * 4)
    for _ in range(40):
        session.epoch()
    level = torch.cat(shown) % LEVELS
    count = torch.bincount(level, minlength=LEVELS)
    assert (count[:4] == 40 * RUNS).all()
    assert 0.2 < count[4:].double().mean() / (40 * RUNS) < 0.47


def test_an_epoch_shows_everything_where_nothing_is_thinned(data, monkeypatch):
    session, shown = decoder.DecoderSession(training(), data), []
    monkeypatch.setattr(session, "show", lambda at, progress: shown.append(at) or [0.0] * 4)
    session.epoch()
    assert sorted(torch.cat(shown).tolist()) == list(range(RUNS * LEVELS))


@pytest.mark.parametrize(("wrong", "said"), [({"latent": "codes"}, "latent = 'codes'"),
                                             ({"every": 0}, "every = 0"),
                                             ({"dense": -1}, "dense = -1")])
def test_settings_that_mean_nothing_are_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        training(**wrong)


def test_every_epoch_shows_a_snapshot_however_thin(data, monkeypatch):
    shown, show = [], decoder.DecoderSession.show
    monkeypatch.setattr(decoder.DecoderSession, "show", lambda self, at,
                        progress: shown.append(at.tolist())
                        or show(self, at, progress))
    found = decoder.train_decoder(decoder.DecoderTraining(R, (8,), epochs=40, every=10**9), data)
    assert [len(at) for at in shown] == 40 * [1]
    assert len({at[0] for at in shown}) > 5
    assert np.isfinite(found.history).all()


# Directions, and states beside the snapshots.

NONE = loss.LossWeights(0.0, 0.0)


def beside(**settings):
    return training(latent="directions", weights=NONE, **settings)


def test_directions_are_the_modes_in_one_unit(data):
    """The best sum of R fields for the displacements, all of them as long."""
    u = (data.x - data.X).reshape(RUNS * LEVELS, -1)
    U, xhat = directions(data.X, data.x.reshape(-1, N, 3), R)
    left, sigma, right = np.linalg.svd(u, full_matrices=False)
    assert np.einsum("pdr,sr->spd", U, xhat).reshape(u.shape) == pytest.approx(
        (left * sigma)[:, :R] @ right[:R], abs=1e-12)
    assert np.linalg.norm(U, axis=(0, 1)) == pytest.approx([sigma[0] / np.sqrt(len(u))] * R)
    assert np.mean(xhat**2, axis=0) == pytest.approx((sigma[:R] / sigma[0])**2)


def test_directions_ask_for_positions_alone_and_stay(data):
    found = decoder.train_decoder(beside(jitter=0.3), data._replace(F=None, v=None)).xhat
    assert found.reshape(-1, R) == pytest.approx(
        directions(data.X, data.x.reshape(-1, N, 3), R)[1], rel=1e-5, abs=1e-6)


def shown(monkeypatch, data, far):
    """The batch of two snapshots, known displacements and coordinates of them."""
    batches = []
    monkeypatch.setattr(decoder, "loss", lambda f, batch, *_: batches.append(batch) or (0.0, ()))
    under_way = decoder.DecoderSession(beside(jitter=far), data)
    state = under_way.random.get_state()
    under_way.error(torch.tensor([7, 21]))
    under_way.random.set_state(state)
    points = under_way.draw_points().numpy()
    U, xhat = directions(data.X, data.x.reshape(-1, N, 3), R)
    u = (data.x - data.X).reshape(-1, N, 3)[[7, 21]][:, points]
    return batches[0], U[points], u, xhat[[7, 21]]


def test_snapshots_are_shown_displaced_along_directions(monkeypatch, data):
    batch, U, u, xhat = shown(monkeypatch, data, 0.5)
    away = batch.xhat.numpy().reshape(2, 5, R) - xhat[:, None]
    assert away.std(axis=1) == pytest.approx(0.0, abs=1e-6)         # all points of one state
    assert (np.abs(away[:, 0]) > 1e-3).all()
    assert abs(away[0, 0] - away[1, 0]).min() > 1e-3
    assert batch.u.numpy().reshape(u.shape) - u == pytest.approx(
        np.einsum("pdr,sr->spd", U, away[:, 0]), abs=1e-6)


def test_without_a_distance_snapshots_are_shown_as_they_are(monkeypatch, data):
    batch, _, u, xhat = shown(monkeypatch, data, 0.0)
    assert batch.u.numpy().reshape(u.shape) == pytest.approx(u, abs=1e-6)
    assert batch.xhat.numpy()[::5] == pytest.approx(xhat, abs=1e-6)


def test_the_distance_is_that_of_the_training(data):
    under_way = decoder.DecoderSession(beside(jitter=0.5), data)
    away = under_way.draw_jitter(20_000, R).numpy()
    assert away.std() == pytest.approx(0.5 / np.sqrt(3.0), rel=0.03)    # of uniform deviations
    assert np.abs(away.mean(axis=0)).max() < 0.01


def test_values_of_a_field_are_shown_beside_theirs_in_coordinates_alone(data):
    """Parameters stay as they are, and so do the values."""
    xhat = np.zeros((RUNS, LEVELS, R))
    seen = field.FieldData(data.X, xhat, data.mu.astype(float), data.x, data.dt)
    plan = field.FieldTraining((4,), True, 1, 4, jitter=0.5)
    under_way, found = field.FieldSession(plan, seen), []
    under_way.f.register_forward_pre_hook(lambda _, given: found.append(given[1]))
    under_way.error(torch.tensor([3, 28]))
    states = found[0].detach().numpy().reshape(2, N, R + 1)
    assert states.std(axis=1) == pytest.approx(0.0, abs=1e-6)
    assert (np.abs(states[:, 0, :R]) > 1e-3).all()
    assert states[:, 0, R] == pytest.approx([-np.sqrt(1.5), np.sqrt(1.5)], rel=1e-5)


@pytest.mark.parametrize("settings", [
    {"latent": "modes", "weights": NONE}, {"latent": "directions", "weights": loss.CODE}])
def test_nothing_but_displacements_is_known_beside_snapshots(data, settings):
    with pytest.raises(ValueError, match=r"jitter = 0.5, .*: expected latent = 'directions' and"):
        decoder.train_decoder(training(jitter=0.5, **settings), data)


def test_a_distance_below_zero_is_refused():
    with pytest.raises(ValueError, match=r"jitter = -0.1: expected 0 or more"):
        beside(jitter=-0.1)
