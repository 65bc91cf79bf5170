"""Training of decoders: loss, gradients, encoder, checkpoints. Needs PyTorch."""

import numpy as np
import pytest
import rom_toys

torch = pytest.importorskip("torch")

from mpm_ref.rom.fields.architecture import lengths  # noqa: E402
from mpm_ref.rom.snapshots import Snapshots, displacement_error  # noqa: E402
from mpm_ref.rom.train import decoder, loss, schedule  # noqa: E402
from mpm_ref.rom.train.decoder import DecoderSession, DecoderTraining, train_decoder  # noqa: E402
from mpm_ref.rom.train.loss import (  # noqa: E402
    CODE,
    PRINTED,
    LossWeights,
    batch_of,
    tensors_of,
    terms,
)
from mpm_ref.rom.train.networks import FieldPerceptron, perceptron_of  # noqa: E402

LEVELS = np.arange(5)
ALL = LossWeights(1.0, 1.0)
PLACE = LossWeights(0.0, 0.0)
KINDS = {"encoder": {}, "free": {"latent": "free"}, "some points": {"points": 7}}


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def straight(map, start, rates, n=15, dt=rom_toys.DT):
    """`Snapshots` of a map along latent coordinates start + rates t, (runs, r) each, and these."""
    X, xhat = rom_toys.cloud(map.dim, n), start[:, None] + dt * rates[:, None] * LEVELS[:, None]
    found = [[map.derivatives(X, y) for y in run] for run in xhat]
    x, F = (np.array([[level[k] for level in run] for run in found]) for k in (0, 1))
    v = np.zeros_like(x)
    for i, run in enumerate(xhat):
        for k, y in enumerate(run[:-1]):    # a step from level k ends with the velocity of k + 1
            v[i, k + 1] = map.velocity(X, y, rates[i])
    return Snapshots(X, np.ones(n), np.ones(n), start, x, F, v, dt), xhat


def known(dim):
    """A decoder, its `Data` along a straight path, and the snapshots' latents by number."""
    map, (start, rates) = rom_toys.decoder(dim, 2), np.random.default_rng(0).normal(size=(2, 2, 2))
    snapshots, xhat = straight(map, 0.5 * start, 20.0 * rates)
    table = torch.from_numpy(xhat.reshape(-1, 2))
    return map, tensors_of(snapshots, map.units, torch.float64), lambda numbers: table[numbers]


def batch(dim):
    """A network of doubles, a `Batch` of the data that it makes itself, and its units."""
    map, data, latents = known(dim)
    points = torch.arange(0, 15, 2)
    return perceptron_of(map), batch_of(data, torch.arange(10), points, latents), data.units


def shifted(batch):
    return batch._replace(u=batch.u + 0.1, F=batch.F + 0.2, v=batch.v - 3.0)


def gradients(f, total):
    return torch.cat([g.flatten() for g in torch.autograd.grad(total, list(f.parameters()))])


# Loss.

def test_terms_vanish_on_the_networks_own_data(d):
    """LDM-eq24, with latent coordinates that are linear in time."""
    f, own, scales = batch(d)
    found = terms(f, own, scales, ALL)
    sizes = [a.square().flatten(1).sum(dim=1).mean() for a in (own.u, own.F, own.v)]
    assert all(term < 1e-24 * size for term, size in zip(found, sizes, strict=True))


def test_terms_are_means_of_squared_lengths(d):
    f, own, scales = batch(d)
    expected = [0.01 * d, 0.04 * d * d, 9.0 * d]
    assert [a.item() for a in terms(f, shifted(own), scales, ALL)] == pytest.approx(expected)
    total, found = loss.loss(f, shifted(own), scales, LossWeights(2.0, 0.5))
    assert [a.item() for a in found] == pytest.approx(expected)
    scale = float(np.sum(rom_toys.STD[:d] ** 2))
    assert total.item() == pytest.approx((0.01 * d + 0.08 * d * d + 4.5 * d) / scale)


def test_a_batch_pairs_each_snapshot_with_its_successor(d):
    _, data, latents = known(d)
    assert data.successor.tolist() == [1, 2, 3, 4, 4, 6, 7, 8, 9, 9]
    found = batch_of(data, torch.tensor([6, 4]), torch.tensor([3, 1]), latents)
    for row, (k, p) in enumerate([(6, 3), (6, 1), (4, 3), (4, 1)]):       # snapshot, point
        rate, v = (latents(k + 1) - latents(k)) / rom_toys.DT, data.v[k + 1, p]
        if k == 4:                                                      # the last of its run
            rate, v = torch.zeros(2), torch.zeros(d)
        expected = (data.X[p], data.u[k, p], data.F[k, p], v, latents(k), rate)
        assert all(torch.equal(a[row], b) for a, b in zip(found, expected, strict=True))


@pytest.mark.parametrize("name", ["F", "v"])
def test_gradients_flow_through_the_derivatives(d, name):
    f, own, scales = batch(d)
    without, with_it = (gradients(f, loss.loss(f, shifted(own), scales, weights)[0])
                        for weights in (PLACE, PLACE._replace(**{name: 1.0})))
    assert (with_it - without).norm() > 0.1 * without.norm()


@pytest.mark.parametrize("term", [1, 2])
def test_a_decoder_learns_from_one_term_alone(d, term):
    _, own, scales = batch(d)
    torch.manual_seed(0)
    f = FieldPerceptron(d, 2, (12, 12)).double()
    optimiser = torch.optim.Adam(f.parameters(), lr=1e-2)
    errors = []
    for _ in range(150):
        optimiser.zero_grad()
        errors.append(terms(f, own, scales, ALL)[term])
        errors[-1].backward()
        optimiser.step()
    assert errors[-1].item() < 0.05 * errors[0].item()


def test_terms_without_weight_cost_nothing(d, monkeypatch):
    f, own, scales = batch(d)
    position = terms(f, shifted(own), scales, ALL)[0] / scales.std.square().sum()
    monkeypatch.setattr(loss, "with_derivatives", lambda *_: pytest.fail("differentiated"))
    total, found = loss.loss(f, shifted(own), scales, PLACE)
    assert found[1:] == (0.0, 0.0)
    assert total.item() == pytest.approx(position.item(), rel=1e-14)
    assert torch.allclose(gradients(f, total), gradients(f, position), rtol=1e-12)


def test_the_readings_of_the_weights():
    """In the release: 1000 MSE(u) + 100 MSE(F) + 8 * 10 MSE(v), means over components, d = 3."""
    assert PRINTED == (100.0, 0.01)
    u, F, v = 1000.0 / 3.0, 100.0 / 9.0, 80.0 / 3.0
    assert pytest.approx((F / u, v / u)) == CODE


# Networks.

@pytest.mark.parametrize(("points", "last", "count"),
                         [(1368, 60, 6), (1757, 37, 7), (3_076_115, 66, 17)])
def test_lengths_of_the_encoder_are_those_of_the_paper(points, last, count):
    """LDM-tab1."""
    found = lengths(3 * points)
    assert (found[0], found[-1], len(found) - 1) == (3 * points, last, count)
    if points == 1368:
        assert found == [4104, 2050, 1023, 509, 252, 124, 60]


def test_a_decoder_has_the_papers_number_of_weights():
    """LDM-tab1, d = 3, r = 6."""
    assert sum(a.numel() for a in FieldPerceptron(3, 6).parameters()) == 3183


# Training.

def stretching(runs=3):
    """`Snapshots` of affine motions of various speeds."""
    map, xhat = rom_toys.affine(2)
    rates = np.multiply.outer(np.linspace(1.0, 3.0, runs), xhat - map.rest)
    return straight(map, np.tile(map.rest, (runs, 1)), rates, dt=0.1)[0]


def training(**kw):
    return DecoderTraining(**{"r": 2, "hidden": (8, 8), "epochs": 7, "batch": 5, **kw})


def bits(trained):
    arrays = (*trained.decoder.net, *trained.decoder.units, trained.xhat, trained.history)
    return [a.tobytes() for a in arrays]


@pytest.fixture(params=KINDS.values(), ids=KINDS.keys())
def kind(request):
    return request.param


def test_training_lowers_every_term(kind, monkeypatch):
    monkeypatch.setattr(schedule, "FASTEST", 1e-2)
    snapshots = stretching()
    found = train_decoder(training(epochs=100, seed=1, **kind), snapshots)
    assert found.history.shape == (100, 4)
    assert found.xhat.shape == (3, 5, 2)
    assert (found.history[-1] < [0.1, 0.1, 0.4, 0.1] * found.history[0]).all()
    for k in (3, 4):
        x = found.decoder.place(snapshots.X, found.xhat[2, k])
        assert displacement_error(x, snapshots.x[2, k], snapshots.X) < 0.4


def test_the_same_seed_gives_the_same_numbers(kind):
    first = bits(train_decoder(training(**kind), stretching()))
    torch.rand(3)
    assert bits(train_decoder(training(**kind), stretching())) == first
    assert bits(train_decoder(training(seed=1, **kind), stretching()))[1] != first[1]
    shown = [DecoderSession(training(seed=k, points=7), stretching()).draw_points() for k in (0, 1)]
    assert not torch.equal(*shown)


def test_units_are_those_of_the_training_runs():
    """LDM-appB; what was not trained on has no part in anything."""
    snapshots = stretching(4)
    held = snapshots._replace(x=snapshots.x.copy())
    held.x[1] *= 3.0
    one, other = (train_decoder(training(), s.select([0, 2, 3])) for s in (snapshots, held))
    assert bits(one) == bits(other)
    u = (snapshots.x - snapshots.X)[[0, 2, 3]].reshape(-1, 2)
    expected = (snapshots.X.min(axis=0), np.ptp(snapshots.X, axis=0), u.mean(axis=0), u.std(axis=0))
    assert np.array(one.decoder.units) == pytest.approx(np.array(expected))


def test_the_exported_decoder_is_the_trained_one(kind):
    session, X = DecoderSession(training(**kind), stretching()), stretching().X
    session.epoch()
    found, scales = session.result(3), session.data.units
    xhat = session.latents(torch.tensor([6])).detach()
    assert found.xhat[1, 1] == pytest.approx(xhat[0].numpy(), rel=1e-5)
    y = session.f((session.data.X - scales.low) / scales.span, xhat.repeat(len(X), 1)).detach()
    place = X + (scales.mean + scales.std * y).numpy()
    assert found.decoder.place(X, found.xhat[1, 1]) == pytest.approx(place, abs=1e-6)


def test_the_rate_falls_from_the_fastest_to_the_slowest():
    found = [schedule.cosine(a) for a in np.linspace(0.0, 1.0, 9)]
    assert (found[0], found[-1]) == pytest.approx((1e-3, 1e-6))
    assert (np.diff(found) < 0.0).all()


def test_the_rate_is_that_of_the_share_of_all_steps(monkeypatch):
    progress = []
    monkeypatch.setitem(schedule.SCHEDULES, "cosine",
                        lambda share: progress.append(share) or 0.0)
    one, seven = (train_decoder(training(epochs=k), stretching()).decoder.net.W for k in (1, 7))
    assert progress[3:] == pytest.approx(np.arange(21) / 21)      # three batches in an epoch
    assert np.array_equal(one, seven)


@pytest.mark.parametrize(("settings", "said"), [
    ({"r": 0}, "r = 0: expected at least 1"), ({"epochs": 0}, "epochs = 0"),
    ({"batch": -1}, "batch = -1"), ({"points": -1}, "points = -1: expected 0"),
    ({"latent": "pca"}, "latent = 'pca': expected one of encoder"),
])
def test_settings_that_mean_nothing_are_refused(settings, said):
    with pytest.raises(ValueError, match=said):
        training(**settings)


# Checkpoints.

@pytest.mark.parametrize("save", [1, 3])
def test_a_training_that_was_cut_off_goes_on_bit_for_bit(tmp_path, monkeypatch, kind, save):
    monkeypatch.setattr(decoder, "SAVE", save)
    whole, epochs = train_decoder(training(**kind), stretching()), []

    def cut(history):
        epochs.append(len(history))
        if epochs == [1, 2, 3, 4, 5]:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_decoder(training(**kind), stretching(), tmp_path / "a.pt", cut)
    torch.rand(3)
    assert bits(train_decoder(training(**kind), stretching(), tmp_path / "a.pt",
                              cut)) == bits(whole)
    assert epochs[5:] == list(range(5 // save * save + 1, 8))
    assert [file.name for file in tmp_path.iterdir()] == ["a.pt"]


@pytest.fixture
def checkpoint(tmp_path, monkeypatch):
    monkeypatch.setattr(decoder, "SAVE", 1)
    train_decoder(training(epochs=1), stretching(), tmp_path / "a.pt")
    return tmp_path / "a.pt"


def refused(path, said, data, **settings):
    with pytest.raises(ValueError, match=said) as refusal:
        train_decoder(training(**{"epochs": 1, **settings}), data, path)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("settings", [{"seed": 1}, {"r": 3}, {"hidden": (8,)}, {"epochs": 2},
                                      {"latent": "free"}, {"weights": PRINTED}, {"points": 3}])
def test_a_checkpoint_of_another_training_is_refused(checkpoint, settings):
    refused(checkpoint, "is a checkpoint of the training", stretching(), **settings)


@pytest.mark.parametrize("name", ["X", "x", "F", "v", "dt"])
def test_a_checkpoint_of_other_data_is_refused(checkpoint, name):
    data = stretching()
    refused(checkpoint, "is a checkpoint of", data._replace(**{name: 1.01 * getattr(data, name)}))
    refused(checkpoint, "is a checkpoint of", stretching(4))


@pytest.mark.parametrize("damage", [lambda b: b[:len(b) // 2], lambda b: b[:20], lambda b: b"",
                                    lambda b: b"text" + b[4:], lambda b: b"not a checkpoint",
                                    lambda b: b[:-200] + b"?" + b[-199:]])
def test_a_damaged_checkpoint_is_refused(checkpoint, damage):
    checkpoint.write_bytes(damage(checkpoint.read_bytes()))
    refused(checkpoint, "is damaged or no checkpoint", stretching())
